#!/usr/bin/env python3
"""What a call from Python costs beyond what it calls.

    PYTHONPATH=build/release/python benchmarks/python_calls.py [--rounds N] [--most MICROSECONDS]

Drives the robot of examples/robot along its path, and takes the time of each `estimate` and `control` in Python less that of
the same call inside, with results made anew and reused (`out`). Also of `push_measurement`, as a whole. Prints medians and
90th percentiles; exits with 1 if a median of `estimate` or `control` is above `--most`.
"""
import argparse
import pathlib
import sys
import time

import numpy

import rhec

ROOT = pathlib.Path(__file__).resolve().parent.parent
SLIP = numpy.array([0.7, 0.9])


def drive(robot, reuse, samples):
    """Adds the costs [us] of a drive's calls to `samples`."""
    vehicle = robot.vehicle
    path = rhec.Path([(0.5 * i, numpy.sin(0.25 * i), 2.0) for i in range(41)])
    estimator, controller = robot.make_estimator(), robot.make_controller(path)
    state, now, command, moment = numpy.zeros(4), None, None, 0.0
    clock = time.perf_counter_ns
    while not controller.finished and moment < 60.0:
        outputs = vehicle.observe(state)
        begin = clock()
        estimator.push_measurement(moment, outputs)
        pushed = clock()
        now = estimator.estimate(moment, out=now if reuse else None)
        estimated = clock()
        command = controller.control(now, out=command if reuse else None)
        done = clock()
        samples["push_measurement"].append((pushed - begin) / 1e3)
        samples["estimate"].append((estimated - pushed) / 1e3 - now.microseconds)
        samples["control"].append((done - estimated) / 1e3 - command.microseconds)
        state = vehicle.integrate(state, command.inputs, SLIP, robot.step)
        estimator.push_input(moment, command.inputs)
        estimator.prepare()
        controller.prepare()
        moment += robot.step


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=50)
    parser.add_argument("--most", type=float, default=float("inf"))
    arguments = parser.parse_args()
    robot = rhec.Robot(ROOT / "examples" / "robot" / "robot.yaml")
    worst = 0.0
    print(f"{'CALL [us]':<28} {'MEDIAN':>8} {'P90':>8}")
    for reuse in (False, True):
        samples = {"push_measurement": [], "estimate": [], "control": []}
        for _ in range(arguments.rounds):
            drive(robot, reuse, samples)
        for call, costs in samples.items():
            if call == "push_measurement" and reuse:
                continue
            name = call if call == "push_measurement" else f"{call}, {'reused' if reuse else 'new'} result"
            median, p90 = numpy.median(costs), numpy.percentile(costs, 90)
            print(f"{name:<28} {median:8.2f} {p90:8.2f}")
            if call != "push_measurement":
                worst = max(worst, median)
    return 1 if worst > arguments.most else 0


if __name__ == "__main__":
    sys.exit(main())
