"""Estimators of a vehicle with compass and gyro, and what is wrong about all of its sensors: numbers stay finite, and it finds back."""
import numpy
import pytest
import rhec

STEP, OUTPUTS = 0.2, {"x_gps": 0.03, "y_gps": 0.03, "delta": 0.01745, "heading": 0.02, "yaw_rate": 0.01}
WEEK = 604800.0  # [s]


def robot(estimator):
    return rhec.Robot({"step": STEP, "model": {"name": "bicycle_slip", "outputs": list(OUTPUTS)},
                       "noise": {"outputs": OUTPUTS, "inputs": {"u1": 0.1, "u2": 0.1}},
                       "estimator": {"name": estimator, "initial": {"sigma": {"x_pos": 0.05, "y_pos": 0.05, "beta": 0.03, "delta": 0.02}}}})


def drive(made, fault, seed):
    """By sample: since when the fault has been there, by how far the position is wrong, whether it is within three standard deviations
    or health says that it may not be, and whether all numbers are finite; and how long the fault lasts."""
    noise, estimator, vehicle = numpy.random.default_rng(seed), made.make_estimator(), made.vehicle
    state, slip, inputs, speed = numpy.zeros(4), numpy.array([0.75, 0.85]), numpy.zeros(2), 2.0 + 2.0 * (seed % 4)
    begin, length, direction = 60, int(noise.integers(5, 60)), noise.uniform(0.0, 2.0 * numpy.pi)
    far, turned, samples = noise.uniform(0.5, 20.0) * numpy.array([numpy.cos(direction), numpy.sin(direction)]), noise.uniform(0.1, 0.6), []
    for k in range(begin + length + 100):
        time, since = WEEK + STEP * k, k - begin
        share = (since / length if fault == "ramp" else 1.0) if 0 <= since < length and fault != "inputs" else 0.0
        outputs = vehicle.observe(state, inputs, slip) + numpy.array(list(OUTPUTS.values())) * noise.normal(size=5)
        outputs[:2] += share * far
        outputs[3] += share * turned * (fault == "together")
        estimator.push_measurement(time, outputs)
        now = estimator.estimate(time)
        error, sigmas = now.state[:2] - state[:2], numpy.asarray(now.sigmas)
        samples.append((since, numpy.hypot(*error), (abs(error) <= 3.3 * sigmas[:2]).all() or str(now.health) != "ok",
                        numpy.isfinite(now.state).all() and numpy.isfinite(sigmas).all()))
        inputs = numpy.array([speed, numpy.clip((0.3 * numpy.sin(2.0 * numpy.pi * k / 70.0) - state[3]) / 0.4, -0.5, 0.5)])
        for _ in range(4):
            slip = numpy.clip(slip + 0.03 * noise.normal(size=2) * numpy.sqrt(0.025 * speed), 0.4, 1.0)
            state = numpy.asarray(vehicle.integrate(state, inputs, slip, 0.25 * STEP))
        measured = inputs + 0.1 * noise.normal(size=2)
        estimator.push_input(time, 3.0 * measured + 1.0 if fault == "inputs" and 0 <= since < length else measured)
    return samples, length


@pytest.mark.parametrize("fault", ["inputs", "ramp", "together"])
@pytest.mark.parametrize("estimator", ["bank", "rhe"])
def test_whatever_is_wrong_all_is_finite_and_found_again(estimator, fault):
    made, honest = robot(estimator), []
    for seed in range(100, 112):
        samples, length = drive(made, fault, seed)
        assert all(finite for *_, finite in samples), seed
        assert all(error < 0.5 for since, error, *_ in samples if since >= length + 30), seed
        honest += [inside for since, _, inside, _ in samples if since >= 0]
    assert numpy.mean(honest) > 0.93
