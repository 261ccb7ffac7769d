"""What the tests of the Python package share."""
import os
import pathlib

import numpy
import rhec

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FIGURE8 = ROOT / "scenarios" / "figure8.yaml"
# A run of a second at most.
SHORT = {"speed": 10, "path.laps": 1}
ROBOT = ROOT / "examples" / "robot" / "robot.yaml"
CLI = os.environ.get("RHEC_CLI", "")


def line():
    """The path of examples/robot."""
    return rhec.Path([(0.5 * i, numpy.sin(0.25 * i), 2.0) for i in range(41)])


class Driven:
    """The robot of examples/robot, with the model itself on slipping ground in the vehicle's place."""

    def __init__(self, robot=None):
        self.robot = robot or rhec.Robot(ROBOT)
        self.estimator, self.controller = self.robot.make_estimator(), self.robot.make_controller(line())
        self.state, self.time, self.slip = numpy.zeros(4), 0.0, [0.7, 0.9]

    def step(self, estimate=None, command=None):
        """One sample; its estimate and command, which may be reused."""
        vehicle = self.robot.vehicle
        self.estimator.push_measurement(self.time, vehicle.observe(self.state))
        estimate = self.estimator.estimate(self.time, out=estimate)
        command = self.controller.control(estimate, out=command)
        self.state = vehicle.integrate(self.state, command.inputs, self.slip, self.robot.step)
        self.estimator.push_input(self.time, command.inputs)
        self.estimator.prepare()
        self.controller.prepare()
        self.time += self.robot.step
        return estimate, command
