"""Vehicles that move by equations of their own, and what their sensors say: nothing of it is from rhec.

Wheels, steering and hitches lag, vehicles drift sideways, slip wanders in time and jumps, fixes are coloured, encoders have steps,
zeros drift, clocks began weeks ago, and each sensor has a rate and a latency. A vehicle says how somebody would configure rhec for
it: with what data sheets say, not with what is true. It goes by a course of its own, or does what `command` asks of its inputs.
"""
import dataclasses
import math

import numpy

TICK = 0.01  # [s] of the vehicle's motion


@dataclasses.dataclass(frozen=True)
class Sensor:
    """What a sensor says of a vehicle: values of `read`, wrong by these errors, every `every` ticks, `late` seconds later."""
    name: str
    kind: str                # position, angle or rate
    outputs: tuple           # of the model
    every: int               # [ticks]
    phase: int               # [ticks]
    late: float              # [s]
    jitter: float            # [s] of that
    white: float             # standard deviation of noise
    coloured: float = 0.0    # standard deviation of noise that has a memory
    memory: float = 0.8      # of the coloured noise from one value to the next
    quantum: float = 0.0     # step of the values
    zero: float = 0.0        # standard deviation of an offset from the start
    walk: float = 0.0        # by which it wanders, per square root of a second


class Errors:
    """Of one sensor on one drive."""

    def __init__(self, sensor, noise):
        self.sensor, self.noise = sensor, noise
        self.colour = numpy.zeros(len(sensor.outputs))
        self.zero = sensor.zero * noise.normal(size=len(sensor.outputs))

    def of(self, exact):
        sensor, size = self.sensor, len(self.sensor.outputs)
        drive = sensor.coloured * math.sqrt(1.0 - sensor.memory**2)
        self.colour = sensor.memory * self.colour + drive * self.noise.normal(size=size)
        self.zero = self.zero + sensor.walk * math.sqrt(sensor.every * TICK) * self.noise.normal(size=size)
        value = exact + self.zero + self.colour + sensor.white * self.noise.normal(size=size)
        return numpy.round(value / sensor.quantum) * sensor.quantum if sensor.quantum > 0.0 else value


class Slip:
    """Wanders about a level that jumps now and then."""

    def __init__(self, noise, least, most):
        self.noise, self.least, self.most = noise, least, most
        self.level = self.value = noise.uniform(least, most)
        self.next_jump = noise.exponential(15.0)

    def step(self):
        self.next_jump -= TICK
        if self.next_jump < 0.0:
            self.level, self.next_jump = self.noise.uniform(self.least, self.most), self.noise.exponential(15.0)
        self.value += TICK / 8.0 * (self.level - self.value) + 0.02 * math.sqrt(TICK) * (self.most - self.least) / 0.3 * self.noise.normal()
        self.value = min(max(self.value, self.least - 0.05), self.most + 0.02, 1.0)
        return self.value


class Sideways:
    """An angle of drift that no model knows."""

    def __init__(self, noise, size):
        self.noise, self.size, self.angle = noise, size, 0.0

    def step(self):
        self.angle += -TICK / 2.0 * self.angle + self.size * math.sqrt(TICK) * self.noise.normal()
        return self.angle


def antenna(x, y, psi, ahead, left=0.0):
    return numpy.array([x + ahead * math.cos(psi) - left * math.sin(psi), y + ahead * math.sin(psi) + left * math.cos(psi)])


class Bicycle:
    """A car-like robot: a receiver with RTK whose fixes are late, and an encoder of the steering."""
    step, heading, inputs_every, inputs_late = 0.2, 2, 4, 0.002
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 20, 7, 0.12, 0.03, 0.020, 0.015),
               Sensor("steering", "angle", ("delta",), 5, 2, 0.004, 0.0, 0.012, quantum=0.004))
    wheelbase, behind, stop = 1.4, 0.4, 0.6

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, speed, 0.0
        self.x = self.y = self.psi = self.delta = self.v = 0.0
        self.kappa, self.mu, self.sideways = Slip(noise, 0.65, 0.98), Slip(noise, 0.75, 1.0), Sideways(noise, 0.01)
        self.pace, self.phase = noise.uniform(0.15, 0.5), noise.uniform(0.0, 6.0)
        self.spin, self.yaw_rate, self.inputs, self.command = 0.0, 0.0, numpy.zeros(2), None

    @classmethod
    def configuration(cls, estimator):
        return {"step": cls.step, "model": {"name": "bicycle_slip", "wheelbase": cls.wheelbase, "gps_offset": cls.behind},
                "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "delta": 0.017}, "inputs": {"u1": 0.1, "u2": 0.1}},
                "estimator": {"name": estimator, "initial": {"parameters": {"kappa": 0.9, "mu": 0.9}, "sigma": {"beta": 0.3}}}}

    def asked(self):
        """What its wheels and its steering are to do."""
        if self.command is None:
            wanted = 0.35 * math.sin(self.pace * self.time + self.phase)
            return self.speed * (1.0 + 0.1 * math.sin(0.3 * self.time)), min(max(3.0 * (wanted - self.delta), -0.6), 0.6)
        least, most = (-self.stop - self.delta) / TICK, (self.stop - self.delta) / TICK
        return self.command[0], min(max(self.command[1], -0.6, least), 0.6, most)

    def advance(self):
        kappa, mu, angle = self.kappa.step(), self.mu.step(), self.sideways.step()
        wheels, turning = self.asked()
        self.v += (kappa * (1.0 - self.spin) * wheels - self.v) * TICK / 0.1
        self.yaw_rate = self.v / self.wheelbase * math.tan(mu * self.delta)
        self.x += TICK * self.v * math.cos(self.psi + angle)
        self.y += TICK * self.v * math.sin(self.psi + angle)
        self.psi += TICK * self.yaw_rate
        self.delta += TICK * turning
        self.time += TICK
        self.inputs = numpy.array([wheels, turning])

    def truth(self):
        return numpy.array([self.x, self.y]), self.psi

    def read(self, sensor):
        return {"gps": lambda: antenna(self.x, self.y, self.psi, -self.behind), "steering": lambda: numpy.array([self.delta])}[sensor]()


class Rover(Bicycle):
    """A cheap receiver at 1 Hz with coloured errors, a compass whose zero drifts, and a gyro with a bias."""
    step, inputs_every, inputs_late = 0.1, 5, 0.06
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 100, 31, 0.20, 0.05, 0.15, 0.35, 0.9),
               Sensor("steering", "angle", ("delta",), 5, 2, 0.01, 0.0, 0.012, quantum=0.004),
               Sensor("compass", "angle", ("heading",), 10, 4, 0.02, 0.0, 0.02, 0.02, 0.95, zero=0.01),
               Sensor("gyro", "rate", ("yaw_rate",), 2, 0, 0.005, 0.0, 0.008, zero=0.02, walk=0.001))

    @classmethod
    def configuration(cls, estimator):
        return {"step": cls.step, "model": {"name": "bicycle_slip", "wheelbase": cls.wheelbase, "gps_offset": cls.behind,
                                            "outputs": ["x_gps", "y_gps", "delta", "heading", "yaw_rate"]},
                "noise": {"outputs": {"x_gps": 0.4, "y_gps": 0.4, "delta": 0.017, "heading": 0.035, "yaw_rate": 0.01},
                          "inputs": {"u1": 0.1, "u2": 0.1}, "biases": {"yaw_rate": {"sigma": 0.03, "drift": 0.001}}},
                "estimator": {"name": estimator, "horizon": "4 s", "initial": {"parameters": {"kappa": 0.9, "mu": 0.9}, "sigma": {"beta": 0.3}}}}

    def read(self, sensor):
        if sensor == "compass":
            return numpy.array([self.psi])
        return numpy.array([self.yaw_rate]) if sensor == "gyro" else super().read(sensor)


class TwoReceivers(Bicycle):
    """A receiver with RTK, and a cheap one that comes late."""
    sensors = Bicycle.sensors + (Sensor("poor", "position", ("x_poor", "y_poor"), 20, 13, 0.25, 0.05, 0.3, 0.3, 0.95),)

    @classmethod
    def configuration(cls, estimator):
        configuration = super().configuration(estimator)
        configuration["model"]["outputs"] = ["x_gps", "y_gps", "delta", {"x_poor": "x_gps"}, {"y_poor": "y_gps"}]
        configuration["noise"]["outputs"] |= {"x_poor": 0.5, "y_poor": 0.5}
        return configuration

    def read(self, sensor):
        return super().read("gps" if sensor == "poor" else sensor)


class SkidSteer:
    """Wheels of two sides, a receiver with RTK at 10 Hz, and a compass."""
    step, heading, inputs_every, inputs_late = 0.1, 2, 5, 0.01
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 10, 3, 0.06, 0.01, 0.015, 0.012),
               Sensor("compass", "angle", ("heading",), 5, 1, 0.01, 0.0, 0.01, 0.008, 0.9))
    radius, track, ahead, left = 0.14, 0.6, 0.2, 0.1

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, 0.35 * speed, 0.0
        self.x = self.y = self.psi = self.v = self.turn = 0.0
        self.slips, self.ahead_of_centre = (Slip(noise, 0.02, 0.35), Slip(noise, 0.02, 0.35)), Slip(noise, -0.12, 0.12)
        self.pace, self.phase = noise.uniform(0.15, 0.5), noise.uniform(0.0, 6.0)
        self.spin, self.inputs, self.command = 0.0, numpy.zeros(2), None

    @classmethod
    def configuration(cls, estimator):
        return {"step": cls.step, "model": {"name": "skid_steer", "wheel_radius": cls.radius, "track_width": cls.track, "antenna_x": cls.ahead,
                                            "antenna_y": cls.left},
                "noise": {"outputs": {"x_gps": 0.02, "y_gps": 0.02, "heading": 0.02}, "inputs": {"omega_left": 0.3, "omega_right": 0.3}},
                "estimator": {"name": estimator, "horizon": "2 s", "initial": {"sigma": {"psi": 0.3}}}}

    def asked(self):
        """What the wheels of both sides are to do."""
        if self.command is not None:
            return self.radius * numpy.array(self.command)
        wanted = 0.5 * math.sin(self.pace * self.time + self.phase)
        return numpy.array([self.speed - wanted * self.track / 2.0, self.speed + wanted * self.track / 2.0]) * (1.0 + 0.1 * math.sin(0.3 * self.time))

    def advance(self):
        sides = self.asked()
        left, right = ((1.0 - slip.step()) * (1.0 - self.spin) * side for slip, side in zip(self.slips, sides))
        self.v += (0.5 * (left + right) - self.v) * TICK / 0.08
        self.turn += ((right - left) / self.track - self.turn) * TICK / 0.08
        sideways = -self.ahead_of_centre.step() * self.turn
        self.x += TICK * (self.v * math.cos(self.psi) - sideways * math.sin(self.psi))
        self.y += TICK * (self.v * math.sin(self.psi) + sideways * math.cos(self.psi))
        self.psi += TICK * self.turn
        self.time += TICK
        self.inputs = sides / self.radius

    def truth(self):
        return numpy.array([self.x, self.y]), self.psi

    def read(self, sensor):
        return antenna(self.x, self.y, self.psi, self.ahead, self.left) if sensor == "gps" else numpy.array([self.psi])


class Tracks:
    """A tracked vehicle with a receiver and a gyro, and without a compass."""
    step, heading, inputs_every, inputs_late = 0.1, 2, 5, 0.01
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 20, 3, 0.15, 0.02, 0.02, 0.02),
               Sensor("gyro", "rate", ("yaw_rate",), 2, 0, 0.003, 0.0, 0.006, zero=0.01, walk=0.0005))
    ahead = 0.3

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, 0.6 * speed, 0.0
        self.x = self.y = self.psi = self.v = self.turn = 0.0
        self.straight, self.round, self.sideways = Slip(noise, 0.6, 0.98), Slip(noise, 0.6, 0.98), Sideways(noise, 0.01)
        self.pace, self.phase = noise.uniform(0.15, 0.5), noise.uniform(0.0, 6.0)
        self.spin, self.inputs, self.command = 0.0, numpy.zeros(2), None

    @classmethod
    def configuration(cls, estimator):
        return {"step": cls.step, "model": {"name": "unicycle_traction", "antenna_x": cls.ahead, "outputs": ["x_gps", "y_gps", "yaw_rate"]},
                "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "yaw_rate": 0.01}, "inputs": {"v": 0.1, "omega": 0.05},
                          "biases": {"yaw_rate": {"sigma": 0.02, "drift": 0.001}}},
                "estimator": {"name": estimator, "horizon": "3 s", "initial": {"parameters": {"mu": 0.8, "kappa": 0.8}, "sigma": {"psi": 0.3}}}}

    def asked(self):
        """What its tracks are to do: speed and yaw rate."""
        if self.command is not None:
            return self.command
        return self.speed * (1.0 + 0.1 * math.sin(0.3 * self.time)), 0.5 * math.sin(self.pace * self.time + self.phase)

    def advance(self):
        speed, wanted = self.asked()
        self.v += (self.straight.step() * (1.0 - self.spin) * speed - self.v) * TICK / 0.1
        self.turn += (self.round.step() * wanted - self.turn) * TICK / 0.1
        angle = self.sideways.step()
        self.x += TICK * self.v * math.cos(self.psi + angle)
        self.y += TICK * self.v * math.sin(self.psi + angle)
        self.psi += TICK * self.turn
        self.time += TICK
        self.inputs = numpy.array([speed, wanted])

    def truth(self):
        return numpy.array([self.x, self.y]), self.psi

    def read(self, sensor):
        return antenna(self.x, self.y, self.psi, self.ahead) if sensor == "gps" else numpy.array([self.turn])


class Tractor:
    """A tractor with a trailer; the receivers of both, a steering encoder and one of the hitch."""
    step, heading, inputs_every, inputs_late = 0.2, 2, 5, 0.01
    sensors = (Sensor("gps", "position", ("x_trailer_gps", "y_trailer_gps"), 20, 7, 0.10, 0.02, 0.02, 0.015),
               Sensor("front", "position", ("x_tractor_gps", "y_tractor_gps"), 20, 7, 0.10, 0.02, 0.02, 0.015),
               Sensor("steering", "angle", ("delta",), 5, 2, 0.01, 0.0, 0.012, quantum=0.004),
               Sensor("hitch", "angle", ("articulation",), 5, 2, 0.01, 0.0, 0.012, quantum=0.004))
    wheelbase, trailer, behind, ahead = 1.4, 1.3, 1.1, 0.5

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, 0.6 * speed, 0.0
        self.x, self.y = self.trailer + self.behind, 0.0  # the tractor's rear axle
        self.psi = self.psi_trailer = self.delta = self.v = 0.0
        self.mu, self.kappa, self.eta, self.sideways = Slip(noise, 0.75, 0.98), Slip(noise, 0.7, 1.0), Slip(noise, 0.7, 1.0), Sideways(noise, 0.005)
        self.pace, self.phase = noise.uniform(0.1, 0.3), noise.uniform(0.0, 6.0)
        self.spin, self.inputs = 0.0, numpy.zeros(2)

    @classmethod
    def configuration(cls, estimator):
        outputs = [output for sensor in cls.sensors for output in sensor.outputs]
        return {"step": cls.step, "model": {"name": "tractor_trailer", "wheelbase": cls.wheelbase, "trailer_length": cls.trailer, "hitch": cls.behind,
                                            "tractor_antenna_x": cls.ahead, "outputs": outputs},
                "noise": {"outputs": {output: 0.03 if "gps" in output else 0.017 for output in outputs}, "inputs": {"v": 0.1, "delta_rate": 0.1}},
                "estimator": {"name": estimator, "initial": {"parameters": {"mu": 0.85, "kappa": 0.85, "eta": 0.85},
                                                             "sigma": {"psi_trailer": 0.3, "psi_tractor": 0.3}}}}

    def advance(self):
        wheels = self.speed * (1.0 + 0.1 * math.sin(0.3 * self.time))
        turning = min(max(3.0 * (0.3 * math.sin(self.pace * self.time + self.phase) - self.delta), -0.6), 0.6)
        self.v += (self.mu.step() * (1.0 - self.spin) * wheels - self.v) * TICK / 0.1
        turn, angle = self.v / self.wheelbase * math.tan(self.kappa.step() * self.delta), self.sideways.step()
        # The velocity of the hitch, of which the trailer's wheels leave a share across.
        hitch = self.eta.step() * (self.psi - self.psi_trailer)
        turn_trailer = (self.v * math.sin(hitch) - self.behind * turn * math.cos(hitch)) / self.trailer
        self.x += TICK * self.v * math.cos(self.psi + angle)
        self.y += TICK * self.v * math.sin(self.psi + angle)
        self.psi += TICK * turn
        self.psi_trailer += TICK * turn_trailer
        self.delta += TICK * turning
        self.time += TICK
        self.inputs = numpy.array([wheels, turning])

    def axle(self):
        hitch = antenna(self.x, self.y, self.psi, -self.behind)
        return antenna(*hitch, self.psi_trailer, -self.trailer)

    def truth(self):
        return self.axle(), self.psi_trailer

    def read(self, sensor):
        return {"gps": self.axle, "front": lambda: antenna(self.x, self.y, self.psi, self.ahead), "steering": lambda: numpy.array([self.delta]),
                "hitch": lambda: numpy.array([self.psi - self.psi_trailer])}[sensor]()


class Slope(Bicycle):
    """A farm vehicle across a slope, which pushes its axles aside; a receiver with two antennas, an encoder, a radar and a gyro."""
    step, heading, inputs_every, inputs_late = 0.1, 2, 5, 0.01
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 10, 7, 0.08, 0.02, 0.012, 0.010, 0.9),
               Sensor("antennas", "angle", ("heading",), 10, 7, 0.08, 0.02, 0.006, 0.004, 0.9, zero=0.004),
               Sensor("steering", "angle", ("delta",), 5, 2, 0.004, 0.0, 0.012, quantum=0.004),
               Sensor("radar", "rate", ("ground_speed",), 10, 3, 0.05, 0.01, 0.05, 0.03),
               Sensor("gyro", "rate", ("yaw_rate",), 1, 0, 0.003, 0.0, 0.006, zero=0.01, walk=0.0005))
    wheelbase, ahead, left = 2.0, 0.5, -0.3
    downhill, aside = 0.7, (0.035, 0.050)  # [rad]; side-slip of front and rear by lateral acceleration [rad s^2/m]

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, speed, 0.0
        self.x = self.y = self.psi = self.delta = self.v = self.yaw_rate = 0.0
        self.slip, self.tilt, self.ground = Slip(noise, 0.0, 0.08), Slip(noise, 0.02, 0.15), Slip(noise, 0.5, 0.95)
        self.front = self.rear = self.spin = 0.0
        self.pace, self.phase = noise.uniform(0.1, 0.4), noise.uniform(0.0, 6.0)
        self.inputs = numpy.zeros(2)

    @classmethod
    def configuration(cls, estimator):
        return {"step": cls.step, "model": {"name": "bicycle_sideslip", "wheelbase": cls.wheelbase, "antenna_x": cls.ahead, "antenna_y": cls.left,
                                            "outputs": ["x_gps", "y_gps", "heading", "delta", "ground_speed", "yaw_rate"]},
                "noise": {"outputs": {"x_gps": 0.02, "y_gps": 0.02, "heading": 0.01, "delta": 0.017, "ground_speed": 0.1, "yaw_rate": 0.01},
                          "inputs": {"v": 0.1, "delta_rate": 0.1}, "biases": {"yaw_rate": {"sigma": 0.02, "drift": 0.001}}},
                "estimator": {"name": estimator, "horizon": "2 s", "initial": {"parameters": {"beta_front": 0, "beta_rear": 0}, "sigma": {"psi": 0.1}}}}

    def advance(self):
        wheels = self.speed * (1.0 + 0.1 * math.sin(0.3 * self.time))
        most = min(0.3, self.wheelbase * 1.0 / max(self.v, 0.1)**2)  # whoever drives there takes bends slowly
        turning = min(max(3.0 * (most * math.sin(self.pace * self.time + self.phase) - self.delta), -0.6), 0.6)
        self.v += ((1.0 - self.slip.step()) * (1.0 - self.spin) * wheels - self.v) * TICK / 0.1
        # Gravity pushes downhill, a bend outwards; tyres give way on soft ground, and after they have rolled for some way.
        push = (9.81 * math.sin(self.tilt.step()) * math.sin(self.downhill - self.psi) - self.v * self.yaw_rate) / self.ground.step()
        self.front += (self.aside[0] * push - self.front) * TICK * max(self.v, 0.1) / 0.5
        self.rear += (self.aside[1] * push - self.rear) * TICK * max(self.v, 0.1) / 0.5
        self.yaw_rate = self.v / self.wheelbase * (math.tan(self.delta + self.front) * math.cos(self.rear) - math.sin(self.rear))
        self.x += TICK * self.v * math.cos(self.psi + self.rear)
        self.y += TICK * self.v * math.sin(self.psi + self.rear)
        self.psi += TICK * self.yaw_rate
        self.delta += TICK * turning
        self.time += TICK
        self.inputs = numpy.array([wheels, turning])

    def read(self, sensor):
        return {"gps": lambda: antenna(self.x, self.y, self.psi, self.ahead, self.left), "antennas": lambda: numpy.array([self.psi]),
                "steering": lambda: numpy.array([self.delta]), "radar": lambda: numpy.array([self.v]), "gyro": lambda: numpy.array([self.yaw_rate])}[sensor]()


class Shuttle(Bicycle):
    """A yard tug that drives to and fro, and stands in between; its receiver says something then, too."""
    # Speeds as parts of the usual one, and how long they are asked for [s].
    course = ((1.0, 14.0), (0.0, 5.0), (-0.6, 9.0), (0.0, 1.0), (0.5, 6.0), (0.0, 8.0))

    def __init__(self, noise, speed):
        super().__init__(noise, speed)
        self.wheels, self.began = 0.0, noise.uniform(0.0, 20.0)

    def wanted(self):
        left = (self.began + self.time) % sum(length for _, length in self.course)
        for part, length in self.course:
            if left < length:
                return part * self.speed
            left -= length
        return 0.0

    def asked(self):
        self.wheels += min(max(self.wanted() - self.wheels, -1.5 * TICK), 1.5 * TICK)
        wanted = 0.35 * math.sin(self.pace * self.time + self.phase)
        return self.wheels, min(max(3.0 * (wanted - self.delta), -0.6), 0.6) if self.wheels != 0.0 else 0.0


class Misbuilt(Rover):
    """A rover with a receiver at 5 Hz whose measures are wrong, whose compass is mounted crooked, and whose speed is old."""
    step, inputs_every, inputs_late = 0.1, 5, 0.06
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 20, 11, 0.20, 0.05, 0.03, 0.02, 0.9),
               Sensor("steering", "angle", ("delta",), 5, 2, 0.01, 0.0, 0.012, quantum=0.004, zero=0.02),
               Sensor("compass", "angle", ("heading",), 10, 4, 0.02, 0.0, 0.02, 0.02, 0.95, zero=0.05),
               Sensor("gyro", "rate", ("yaw_rate",), 2, 0, 0.005, 0.0, 0.008, zero=0.02, walk=0.001))
    built, mounted, age = 1.55, 0.6, 15  # wheelbase and antenna as they are [m]; the speed's [ticks]

    def __init__(self, noise, speed):
        super().__init__(noise, speed)
        self.speeds = []

    @classmethod
    def configuration(cls, estimator):
        configuration = super().configuration(estimator)
        configuration["noise"]["outputs"] |= {"x_gps": 0.05, "y_gps": 0.05}
        return configuration

    def advance(self):
        stated, self.wheelbase = self.wheelbase, self.built
        super().advance()
        self.wheelbase = stated
        self.speeds.append(self.inputs[0])
        self.inputs = numpy.array([self.speeds[max(0, len(self.speeds) - 1 - self.age)], self.inputs[1]])

    def read(self, sensor):
        return antenna(self.x, self.y, self.psi, -self.mounted) if sensor == "gps" else super().read(sensor)


class Mecanum:
    """A platform with rollers that goes any way, as somebody writes it down; a receiver, a compass and a gyro."""
    step, heading, inputs_every, inputs_late = 0.1, 2, 2, 0.01
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 20, 7, 0.09, 0.02, 0.02, 0.015),
               Sensor("compass", "angle", ("heading",), 10, 4, 0.02, 0.0, 0.02, 0.02, 0.95, zero=0.01),
               Sensor("gyro", "rate", ("yaw_rate",), 2, 0, 0.005, 0.0, 0.006, zero=0.01, walk=0.0005))
    ahead, left = 0.25, 0.15

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, 0.3 * speed, 0.0
        self.x = self.y = self.psi = self.forward = self.aside = self.turn = 0.0
        self.slips = Slip(noise, 0.8, 0.99), Slip(noise, 0.55, 0.9), Slip(noise, 0.75, 0.98)
        self.pace, self.phase = noise.uniform(0.1, 0.4), noise.uniform(0.0, 6.0)
        self.spin, self.inputs = 0.0, numpy.zeros(3)

    @classmethod
    def configuration(cls, estimator):
        slip = {"typical": 0.3, "bounds": [0, 1.1], "nominal": 0.9}
        equations = {
            "options": {"ahead": {"default": 0.0, "unit": "m"}, "left": {"default": 0.0, "unit": "m"}},
            "states": {"x": {"unit": "m", "typical": 5, "role": "position_x"}, "y": {"unit": "m", "typical": 5, "role": "position_y"},
                       "psi": {"unit": "rad", "angle": True, "role": "heading"}},
            "inputs": {"forward": {"unit": "m/s", "typical": 1}, "aside": {"unit": "m/s", "typical": 1}, "turn": {"unit": "rad/s", "typical": 1}},
            "parameters": {"along": slip, "across": slip, "round": slip},
            "outputs": {"x_gps": {"unit": "m", "typical": 5}, "y_gps": {"unit": "m", "typical": 5}, "heading": {"unit": "rad", "angle": True},
                        "yaw_rate": {"unit": "rad/s", "typical": 1}},
            "equations": "\n".join([
                "x' = along * forward * cos(psi) - across * aside * sin(psi)", "y' = along * forward * sin(psi) + across * aside * cos(psi)",
                "psi' = round * turn", "x_gps = x + ahead * cos(psi) - left * sin(psi)", "y_gps = y + ahead * sin(psi) + left * cos(psi)",
                "heading = psi", "yaw_rate = round * turn"])}
        return {"step": cls.step, "model": {"equations": equations, "ahead": cls.ahead, "left": cls.left},
                "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "heading": 0.04, "yaw_rate": 0.01},
                          "inputs": {"forward": 0.05, "aside": 0.05, "turn": 0.05},
                          "biases": {"yaw_rate": {"sigma": 0.02, "drift": 0.001}, "heading": {"sigma": 0.02, "drift": 0.002}}},
                "estimator": {"name": estimator, "horizon": "3 s", "initial": {"sigma": {"psi": 0.3}}}}

    def advance(self):
        wanted = numpy.array([self.speed * math.cos(self.pace * self.time), self.speed * math.sin(1.7 * self.pace * self.time + self.phase),
                              0.4 * math.sin(0.6 * self.pace * self.time)])
        along, across, turned = ((1.0 - self.spin) * slip.step() * part for slip, part in zip(self.slips, wanted))
        self.forward += (along - self.forward) * TICK / 0.08
        self.aside += (across - self.aside) * TICK / 0.08
        self.turn += (turned - self.turn) * TICK / 0.08
        self.x += TICK * (self.forward * math.cos(self.psi) - self.aside * math.sin(self.psi))
        self.y += TICK * (self.forward * math.sin(self.psi) + self.aside * math.cos(self.psi))
        self.psi += TICK * self.turn
        self.time += TICK
        self.inputs = wanted

    def truth(self):
        return numpy.array([self.x, self.y]), self.psi

    def read(self, sensor):
        return {"gps": lambda: antenna(self.x, self.y, self.psi, self.ahead, self.left), "compass": lambda: numpy.array([self.psi]),
                "gyro": lambda: numpy.array([self.turn])}[sensor]()


class Kart:
    """A car that is told how hard to drive, not how fast, as somebody writes it down; its slopes, its drag and its brakes are not in
    that. A receiver, an encoder of the wheels, and one of the steering.
    """
    step, heading, inputs_every, inputs_late = 0.1, 2, 2, 0.005
    sensors = (Sensor("gps", "position", ("x_gps", "y_gps"), 20, 5, 0.1, 0.02, 0.02, 0.015),
               Sensor("wheels", "rate", ("wheel_speed",), 4, 1, 0.01, 0.0, 0.04, quantum=0.01),
               Sensor("steering", "angle", ("steering",), 5, 2, 0.004, 0.0, 0.01, quantum=0.003, zero=0.004))
    wheelbase, ahead = 1.1, 0.3

    def __init__(self, noise, speed):
        self.noise, self.speed, self.time = noise, speed, 0.0
        self.x = self.y = self.psi = self.v = self.delta = self.yaw_rate = 0.0
        self.traction, self.grip = Slip(noise, 0.6, 0.95), Slip(noise, 0.75, 1.0)
        self.hills, self.pace, self.phase = noise.uniform(0.02, 0.06, 2), noise.uniform(0.1, 0.3), noise.uniform(0.0, 6.0)
        self.spin, self.inputs, self.command = 0.0, numpy.zeros(2), None

    @classmethod
    def configuration(cls, estimator):
        factor = {"typical": 0.3, "bounds": [0.2, 1.2], "nominal": 0.9}
        equations = {
            "options": {"wheelbase": {"unit": "m"}, "ahead": {"default": 0.0, "unit": "m"}},
            "states": {"x": {"unit": "m", "typical": 10, "role": "position_x"}, "y": {"unit": "m", "typical": 10, "role": "position_y"},
                       "psi": {"unit": "rad", "angle": True, "role": "heading"}, "v": {"unit": "m/s", "typical": 2}},
            "inputs": {"drive": {"unit": "m/s^2", "typical": 1, "bounds": [-3, 3]}, "delta": {"unit": "rad", "typical": 0.3, "bounds": [-0.6, 0.6]}},
            "parameters": {"traction": factor, "grip": factor},
            "outputs": {"x_gps": {"unit": "m", "typical": 10}, "y_gps": {"unit": "m", "typical": 10}, "wheel_speed": {"unit": "m/s", "typical": 2},
                        "steering": {"unit": "rad", "typical": 0.3}},
            "equations": "\n".join([
                "x' = v * cos(psi)", "y' = v * sin(psi)", "psi' = grip * v * tan(delta) / wheelbase", "v' = traction * drive - 0.4 * v",
                "x_gps = x + ahead * cos(psi)", "y_gps = y + ahead * sin(psi)", "wheel_speed = v", "steering = delta"]),
            "straight_motion": "\n".join(["v = ground_speed", "drive = 0.4 * ground_speed / traction", "delta = 0"])}
        return {"step": cls.step, "model": {"equations": equations, "wheelbase": cls.wheelbase, "ahead": cls.ahead},
                "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "wheel_speed": 0.05, "steering": 0.015},
                          "inputs": {"drive": 0.3, "delta": 0.03}, "states": {"v": 0.2}},
                "estimator": {"name": estimator, "horizon": "3 s", "initial": {"sigma": {"psi": 3.2}}}}

    def advance(self):
        wanted = self.speed * (1.0 + 0.3 * math.sin(0.2 * self.time))
        drive = min(max(1.5 * (wanted - self.v) + 0.5 * wanted, -3.0), 3.0)
        turning = 0.35 * math.sin(self.pace * self.time + self.phase)
        if self.command is not None:
            drive, turning = min(max(self.command[0], -3.0), 3.0), min(max(self.command[1], -0.6), 0.6)
        slope = 9.81 * (self.hills[0] * math.sin(0.05 * self.x) + self.hills[1] * math.sin(0.03 * self.y))
        grip = self.grip.step()
        self.v += TICK * ((1.0 - self.spin) * self.traction.step() * drive - 0.4 * self.v - slope)
        self.delta += (turning - self.delta) * TICK / 0.15
        self.yaw_rate = grip * self.v * math.tan(self.delta) / self.wheelbase
        self.x += TICK * self.v * math.cos(self.psi)
        self.y += TICK * self.v * math.sin(self.psi)
        self.psi += TICK * self.yaw_rate
        self.time += TICK
        self.inputs = numpy.array([drive, turning])

    def truth(self):
        return numpy.array([self.x, self.y]), self.psi

    def read(self, sensor):
        return {"gps": lambda: antenna(self.x, self.y, self.psi, self.ahead), "wheels": lambda: numpy.array([self.v]),
                "steering": lambda: numpy.array([self.delta])}[sensor]()


VEHICLES = {"bicycle": Bicycle, "rover": Rover, "two_receivers": TwoReceivers, "skid_steer": SkidSteer, "tracks": Tracks, "tractor": Tractor, "slope": Slope,
            "shuttle": Shuttle, "misbuilt": Misbuilt, "mecanum": Mecanum, "kart": Kart}
