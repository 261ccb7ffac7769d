"""Receding horizon estimation and control of field robots whose wheels slip.

Arrays are numpy's, units SI, angles in rad. docs/python.md has examples of everything.
"""
from ._errors import Error
from ._rhec import Command, Controller, Estimate, Estimator, Path, Report, Variable, Vehicle
from ._robot import Robot

__all__ = ["Command", "Controller", "Error", "Estimate", "Estimator", "Path", "Report", "Robot", "Variable", "Vehicle"]
