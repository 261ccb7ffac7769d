"""Receding horizon estimation and control of field robots whose wheels slip.

Arrays are numpy's, units SI, angles in rad. docs/python.md has examples of everything.
"""
from ._casadi import CasadiModel, CasadiProblem, to_casadi
from ._check import Check, check
from ._errors import ArgumentError, Error, Note, UnknownName
from ._graphs import to_sympy
from ._logs import Log, Proposal
from ._model import BuiltModel, Model
from ._notation import smooth_abs, smooth_max, smooth_min
from ._plugins import options, plugins
from ._problems import Problem, read_problems, write_problems
from ._report import Page, report
from ._rhec import Command, Controller, Estimate, Estimator, Path, Report, Solution, Variable, Vehicle
from ._rhec import version as __version__
from ._robot import Robot
from ._runs import DriveEstimates, Estimates, Run, SmoothedRun, estimate, run, smooth
from ._studies import Sweep, Tuning, sweep, tune, tune_controller
from ._table import Table
from ._term import BuiltTerm, Term

__all__ = ["ArgumentError", "BuiltModel", "BuiltTerm", "CasadiModel", "CasadiProblem", "Check", "Command", "Controller", "DriveEstimates", "Error",
           "Estimate", "Estimates", "Estimator", "Log", "Model", "Note", "Page", "Path", "Problem", "Proposal", "Report", "Robot", "Run",
           "SmoothedRun", "Solution", "Sweep", "Table", "Term", "Tuning", "UnknownName", "Variable", "Vehicle", "__version__", "check", "estimate",
           "options", "plugins", "read_problems", "report", "run", "smooth", "smooth_abs", "smooth_max", "smooth_min", "sweep", "to_casadi",
           "to_sympy", "tune", "tune_controller", "write_problems"]
