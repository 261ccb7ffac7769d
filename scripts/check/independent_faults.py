"""What goes wrong with the sensors, inputs and messages of a vehicle: one fault of a ride."""
import math

import numpy

BEGAN = 2.3 * 604800.0      # [s] the vehicles' clocks at the start
START, LENGTH = 40.0, 100.0  # [s] of the fault and of the drive
SETTLES = (".moved", ".rotate")  # what leaves a receiver elsewhere, whose coordinates count in the end
MOVED = 5.0                 # [m] by which a receiver is off
TURN = 0.3                  # [rad] of a receiver's coordinates
TURNED = numpy.array([[math.cos(TURN), -math.sin(TURN)], [math.sin(TURN), math.cos(TURN)]])

# Kind -> how long it lasts [s]. What is done is in Spoiler.
FAULTS = {
    "position": {"zero": 4.0, "swap": 1.0, "freeze": 6.0, "lag": 8.0, "spike": 0.25, "burst": 3.0, "offset": 5.0, "moved": 60.0, "rotate": 60.0,
                 "dropout": 30.0, "ms_stamp": 2.0, "clock_back": 60.0, "doubled": 10.0, "not_finite": 5.0, "noise": 5.0, "ramp": 6.0, "negative": 3.0,
                 "stamp_jitter": 60.0, "one_axis_stuck": 8.0, "reordered": 10.0, "no_message": 30.0},
    "angle": {"off": 10.0, "off_for_good": 60.0, "turned": 60.0, "wander": 8.0, "stuck": 8.0, "not_finite": 5.0, "noise": 5.0},
    "rate": {"stuck": 8.0, "off": 10.0, "scaled": 60.0, "zero": 10.0, "noise": 5.0},
    "inputs": {"spin": 4.0, "spin_full": 8.0, "input_zero": 4.0, "input_scaled": 60.0, "input_stuck": 5.0, "input_silent": 5.0, "input_not_finite": 3.0,
               "input_huge": 0.3},
    "all": {"silence": 12.0, "late_all": 6.0, "position_and_angle": 5.0, "week_roll": 0.0, "none": 0.0},
}


def kinds_of(vehicle):
    """Names of all faults of a vehicle: kind, or sensor.kind."""
    found = [name for group in ("all", "inputs") for name in FAULTS[group]]
    return found + [f"{sensor.name}.{kind}" for sensor in vehicle.sensors for kind in FAULTS.get(sensor.kind, ())]


def duration(vehicle, fault):
    if "." not in fault:
        return FAULTS["all" if fault in FAULTS["all"] else "inputs"][fault]
    name, kind = fault.split(".")
    return FAULTS[next(sensor.kind for sensor in vehicle.sensors if sensor.name == name)][kind]


class Spoiler:
    """Makes the messages of one fault: what is sent, with which stamp, and when it arrives."""

    def __init__(self, fault, vehicle, seed):
        self.target, self.kind = fault.split(".") if "." in fault else ("", fault)
        self.noise = numpy.random.default_rng([seed, *fault.encode()])
        self.length, self.held, self.memory, self.count = duration(vehicle, fault), {}, [], 0
        self.jump = self.noise.uniform(0.0, 2.0 * math.pi)

    def on(self, time):
        return START <= time < START + self.length

    def direction(self, size):
        return size * numpy.array([math.cos(self.jump), math.sin(self.jump)])

    def elsewhere(self, place, psi):
        """Where the receiver that has moved says the vehicle is, and heads."""
        if self.kind == "rotate":
            return TURNED @ place, psi + TURN
        return place + self.direction(MOVED), psi

    def hold(self, name, value):
        return self.held.setdefault(name, value)

    def position(self, value, stamp, arrival, time):
        kind, since = self.kind, time - START
        self.memory.append(value)
        if kind == "zero":
            value = numpy.zeros(2)
        elif kind == "swap":
            value = value[::-1].copy()
        elif kind == "freeze":
            value = self.hold("position", value)
        elif kind == "one_axis_stuck":
            value = numpy.array([self.hold("position", value)[0], value[1]])
        elif kind == "lag":
            value = self.memory[max(0, len(self.memory) - 11)]
        elif kind == "spike":
            value = value + self.direction(60.0)
        elif kind in ("offset", "moved"):
            value = value + self.direction(MOVED)
        elif kind == "rotate":
            value = TURNED @ value
        elif kind == "ms_stamp":
            stamp = (BEGAN + stamp) * 1000.0 - BEGAN
        elif kind == "clock_back":
            stamp -= 3600.0
        elif kind == "not_finite":
            value = value * numpy.nan
        elif kind == "noise":
            value = value + 10.0 * self.noise.normal(size=2)
        elif kind == "ramp":
            value = value + self.direction(0.5 * since)
        elif kind == "negative":
            value = -value
        elif kind == "stamp_jitter":
            stamp += 0.02 * self.noise.normal()
        elif kind == "burst":
            self.count += 1
            arrival = START + self.length + 0.01 * self.count
        elif kind == "reordered":
            self.count += 1
            arrival += 0.35 if self.count % 3 == 0 else 0.0
        if kind == "dropout":
            return [(arrival, stamp, value * numpy.nan)]
        if kind == "no_message":
            return []
        return [(arrival, stamp, value)] + ([(arrival + 0.01, stamp, value)] if kind == "doubled" else [])

    def angle(self, value, time):
        kind, since = self.kind, time - START
        if kind in ("off", "off_for_good"):
            return value + 0.15
        if kind == "turned":
            return value + 2.0 * math.pi
        if kind == "wander":
            return value + 0.02 * since
        return self.common(value)

    def rate(self, value):
        if self.kind == "off":
            return value + 0.15
        if self.kind == "scaled":
            return 1.3 * value
        return numpy.zeros(1) if self.kind == "zero" else self.common(value)

    def common(self, value):
        if self.kind == "stuck":
            return self.hold("value", value)
        return value * numpy.nan if self.kind == "not_finite" else value + 0.3 * self.noise.normal(size=len(value))

    def messages(self, sensor, value, stamp, arrival, time):
        """Of a value: (arrival, stamp, value) of none, one or more messages."""
        if self.kind == "late_all" and self.on(time):
            return [(START + self.length + 0.001 * (time - START), stamp, value)]
        if not self.on(time) or self.kind == "silence":
            return [] if self.on(time) else [(arrival, stamp, value)]
        if self.kind == "position_and_angle":
            if sensor.kind == "position":
                return [(arrival, stamp, value + self.direction(MOVED))]
            return [(arrival, stamp, value + 0.2)] if sensor.kind == "angle" else [(arrival, stamp, value)]
        if self.target != sensor.name:
            return [(arrival, stamp, value)]
        if sensor.kind == "position":
            return self.position(value, stamp, arrival, time)
        return [(arrival, stamp, self.angle(value, time) if sensor.kind == "angle" else self.rate(value))]

    def input_messages(self, inputs, stamp, arrival, time):
        if self.kind == "late_all" and self.on(time):
            return [(START + self.length + 0.001 * (time - START), stamp, inputs)]
        if not self.on(time):
            return [(arrival, stamp, inputs)]
        if self.kind in ("silence", "input_silent"):
            return []
        changed = {"input_zero": lambda: 0.0 * inputs, "input_scaled": lambda: 1.25 * inputs, "input_stuck": lambda: self.hold("inputs", inputs),
                   "input_not_finite": lambda: inputs * numpy.nan, "input_huge": lambda: inputs + 1e6}.get(self.kind, lambda: inputs)()
        return [(arrival, stamp, changed)]
