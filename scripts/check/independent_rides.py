"""One ride of an independent vehicle: its sensors, what goes wrong with them, and an estimator that is told of it; and which rides
there are to be.
"""
import pathlib
import sys
import warnings

import numpy
from independent_faults import BEGAN, START, Spoiler, kinds_of
from independent_vehicles import TICK, VEHICLES, Errors

WEEK = 604800.0  # [s]


class Ride:
    """A vehicle with a fault, from its start. `robot` is that of rhec, `estimator` one of its estimators."""

    def __init__(self, build, name, fault, estimator, seed, speed):
        sys.path.insert(0, str(build / "python"))
        warnings.simplefilter("ignore")
        import rhec
        self.kind, self.fault = VEHICLES[name], fault
        self.vehicle = self.kind(numpy.random.default_rng([seed, 77]), speed)
        self.errors = {sensor.name: Errors(sensor, numpy.random.default_rng([seed, 78, i])) for i, sensor in enumerate(self.kind.sensors)}
        self.late, self.spoiler = numpy.random.default_rng([seed, 79]), Spoiler(fault, self.kind, seed)
        self.rhec, self.robot = rhec, rhec.Robot(self.kind.configuration(estimator))
        self.estimator = self.robot.make_estimator()
        self.outputs = [output for sensor in self.kind.sensors for output in sensor.outputs]
        self.began = WEEK - START if fault == "week_roll" else BEGAN
        self.waiting = []

    def settles(self, time, kinds):
        """Whether the receiver has been elsewhere, by one of the kinds of faults, for so long that its coordinates count as well."""
        return self.fault.endswith(kinds) and time > START + 30.0 * self.kind.step

    def estimates(self, length):
        """Time and estimate at each step of so many seconds."""
        every = round(self.kind.step / TICK)
        for tick in range(int(length / TICK)):
            time = tick * TICK + TICK
            self.advance(tick, time)
            if tick % every == every - 1:
                self.deliver(time)
                yield time, self.estimator.estimate(self.began + time)

    def advance(self, tick, time):
        kind, spoiler, vehicle = self.kind, self.spoiler, self.vehicle
        vehicle.spin = {"spin": 0.6, "spin_full": 0.97}.get(self.fault, 0.0) if spoiler.on(time) else 0.0
        vehicle.advance()
        if tick % kind.inputs_every == 0:
            self.waiting += [(*message, None) for message in spoiler.input_messages(vehicle.inputs, time, time + kind.inputs_late, time)]
        for sensor in kind.sensors:
            if tick % sensor.every == sensor.phase:
                arrival = time + sensor.late + abs(sensor.jitter * self.late.normal())
                value = self.errors[sensor.name].of(vehicle.read(sensor.name))
                self.waiting += [(*message, sensor) for message in spoiler.messages(sensor, value, time, arrival, time)]

    def deliver(self, time):
        """What has arrived until then."""
        ready = sorted((message for message in self.waiting if message[0] <= time), key=lambda message: message[0])
        self.waiting = [message for message in self.waiting if message[0] > time]
        for _, stamp, value, sensor in ready:
            if sensor is None:
                self.estimator.push_input(self.began + stamp, value)
            else:
                row = numpy.full(len(self.outputs), numpy.nan)
                row[[self.outputs.index(output) for output in sensor.outputs]] = value
                self.estimator.push_measurement(self.began + stamp, row)


def add_arguments(parser, vehicles, estimators):
    """Which rides, of which build."""
    parser.add_argument("build", type=pathlib.Path, help="folder of a build with the Python module")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 1), metavar=("FIRST", "COUNT"))
    parser.add_argument("--vehicles", nargs="+", choices=sorted(vehicles), default=list(vehicles))
    parser.add_argument("--faults", nargs="+", help="those whose names contain one of these")
    parser.add_argument("--estimators", nargs="+", choices=estimators, default=estimators)
    parser.add_argument("--every", type=int, default=1, metavar="N", help="one of N faults")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="write the tables of docs/faults.md")
    parser.add_argument("--check", action="store_true")


def tasks_of(parser, arguments, vehicles, estimators):
    """(build, vehicle, faults, estimator, seed) of all rides that are asked for."""
    if not (arguments.build / "python" / "rhec").is_dir():
        parser.error(f"{arguments.build}: there is no Python module in it (scripts/build release makes build/release)")
    if arguments.seeds[0] < 0 or arguments.seeds[1] < 1 or arguments.every < 1:
        parser.error("--seeds: expected a first seed from 0 on and at least one; --every: at least 1")
    known = {fault for name in arguments.vehicles for fault in kinds_of(VEHICLES[name])}
    for part in arguments.faults or ():
        if not any(part in fault for fault in known):
            parser.error(f"--faults {part}: no fault of these vehicles is called so; there are {', '.join(sorted(known))}")
    is_part = len(arguments.vehicles) < len(vehicles) or arguments.faults or len(arguments.estimators) < len(estimators) or arguments.every > 1
    if arguments.write and is_part:
        parser.error("--write: the tables are those of all vehicles, faults and estimators")
    tasks, count = [], 0
    for seed in range(arguments.seeds[0], sum(arguments.seeds)):
        for name in arguments.vehicles:
            for estimator in arguments.estimators:
                faults = []
                for fault in kinds_of(VEHICLES[name]):
                    count += 1
                    is_wanted = not arguments.faults or any(part in fault for part in arguments.faults)
                    if fault == "none" or (is_wanted and count % arguments.every == 0):
                        faults.append(fault)
                tasks.append((arguments.build.resolve(), name, faults, estimator, seed))
    return tasks
