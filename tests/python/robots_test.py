"""Robots, estimators and controllers, sample by sample."""
import copy
import math
import os
import pickle
import subprocess

import numpy
import pytest
import rhec
from shared import ROBOT, Driven, line


def test_the_same_drive_as_in_cpp():
    printed = subprocess.run([os.environ["RHEC_EXAMPLE_ROBOT"], str(ROBOT)], check=True, capture_output=True, text=True).stdout
    driven, lines = Driven(), []
    while not driven.controller.finished and driven.time < 60.0:
        estimate, _ = driven.step()
        lines.append(f"{estimate.time:4.1f} s  x {estimate.state[0]:6.2f} m  y {estimate.state[1]:5.2f} m  kappa "
                     f"{estimate['kappa']:.3f}")
    assert driven.controller.finished
    assert len(lines) > 40
    assert lines == printed.splitlines()


def test_a_dict_is_the_same_as_a_file():
    configuration = {
        "step": 0.2, "model": {"name": "bicycle_slip", "wheelbase": 1.4, "gps_offset": numpy.float64(0.4)},
        "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "delta": 0.017}, "inputs": {"u1": 0.1, "u2": 0.1}},
        "blocking": {"kappa": {"name": "structured", "size": 2, "overlap": 4}, "mu": {"name": "full_horizon"}},
        "estimator": {"horizon": numpy.int64(15), "initial": {"parameters": {"kappa": 0.9, "mu": 0.9}, "sigma": {"beta": 0.3}}},
        "controller": {"horizon": 15},
    }
    of_file, of_dict = Driven(), Driven(rhec.Robot(configuration))
    for _ in range(10):
        first, second = of_file.step()[0], of_dict.step()[0]
        numpy.testing.assert_array_equal(first.state, second.state)
        numpy.testing.assert_array_equal(first.covariance, second.covariance)


def test_changes_are_put_over_the_configuration():
    assert rhec.Robot(ROBOT, set={"step": 0.1}).step == 0.1
    assert rhec.Robot(ROBOT, set={"model": {"name": "unicycle_traction"}, "noise": None, "blocking": None,
                                  "estimator.initial": None}).vehicle.name == "unicycle_traction"


@pytest.mark.parametrize("change, key, word", [
    ({"estimator.horizont": 3}, "estimator.horizont", "did you mean 'horizon'"),
    ({"estimator.horizon": "many"}, "estimator.horizon", "expected an integer"),
    ({"model": {"name": "bycicle_slip"}}, None, "bicycle_slip"),
    ({"estimator": {"horizon": object()}}, "estimator.horizon", "found an object of the class 'object'"),
    ({"noise": {"outputs": {"x_gps": float("nan")}}}, "noise.outputs.x_gps", "NaN"),
])
def test_mistakes_name_the_key(change, key, word):
    with pytest.raises(rhec.Error, match=word) as caught:
        rhec.Robot(ROBOT, set=change)
    if key:
        assert key.endswith(caught.value.key)
    assert caught.value.line is None


def test_mistakes_in_files_name_file_line_and_key(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text("step: 0.2\nestimator:\n  horizon: -3\n")
    with pytest.raises(rhec.Error) as caught:
        rhec.Robot(file)
    assert (caught.value.file, caught.value.line, caught.value.key) == (str(file), 3, "estimator.horizon")
    with pytest.raises(rhec.Error, match="gone.yaml"):
        rhec.Robot(tmp_path / "gone.yaml")
    with pytest.raises(rhec.Error, match="class 'int'"):
        rhec.Robot(3)
    with pytest.raises(rhec.ArgumentError, match="Robot: configuration: found an object of the class 'int', expected the name of a YAML file or a dict"):
        rhec.Robot(3)
    with pytest.raises(rhec.Error, match="the key 1, expected a text"):
        rhec.Robot({"model": {1: 2}})


def test_estimates_stay_as_they_are():
    driven = Driven()
    estimates = [driven.step()[0] for _ in range(5)]
    assert [round(each.time, 3) for each in estimates] == [0.0, 0.2, 0.4, 0.6, 0.8]
    x = [each["x_pos"] for each in estimates]
    assert x == sorted(x) and x[0] < x[-1]
    last = estimates[-1]
    assert last.state.shape == (4,) and last.parameters.shape == (2,) and last.covariance.shape == (6, 6)
    numpy.testing.assert_array_equal(last.covariance, last.covariance.T)
    numpy.testing.assert_allclose(last.sigmas, numpy.sqrt(numpy.diag(last.covariance)))
    assert last.health == "ok" and last.findings == ""
    assert 1.0 <= last.covariance_factor < 2.0
    assert [each["sensor"] for each in last.innovations] == ["x_gps and y_gps", "delta"]
    assert last.report.usable and not last.fallback
    assert [*last] == last.keys() == ["x_pos", "y_pos", "beta", "delta", "kappa", "mu"] and dict(last)["kappa"] == last["kappa"]
    assert "kappa" in last and "gamma" not in last and 3 not in last
    for name, told in (("kapa", "there is no 'kapa'; did you mean 'kappa'?"), ("gamma", "there is no 'gamma'; expected one of x_pos, y_pos, beta")):
        for of in (rhec.Error, KeyError):
            with pytest.raises(of) as caught:
                last[name]
            assert type(caught.value) is rhec.UnknownName and str(caught.value).startswith(told) and caught.value.name == name


def test_results_that_are_reused():
    driven, other = Driven(), Driven()
    estimate, command = driven.step()
    state, inputs = estimate.state, command.inputs
    for _ in range(3):
        again, order = driven.step(estimate, command)
        assert again is estimate and order is command
    other.step()
    for _ in range(3):
        expected, ordered = other.step()
    numpy.testing.assert_array_equal(state, expected.state)  # the array of the first call, which has become the last one's
    numpy.testing.assert_array_equal(inputs, ordered.inputs)
    wide = rhec.Robot({"model": {"name": "tractor_trailer"}}).make_estimator()
    with pytest.raises(rhec.Error, match="an estimate of another vehicle"):
        wide.estimate(0.0, out=estimate)


def test_limits_that_are_not_kept_are_told():
    terms = [{"name": "obstacles", "most": 1, "vehicle_radius": 0.2}]
    driven = Driven(rhec.Robot({"model": "bicycle_slip", "controller": {"terms": terms}}))
    driven.step()
    assert driven.controller.violations() == {"obstacles: obstacle 1": 0.0}
    assert driven.controller.set_obstacles([[*driven.state[:2], 1.0, 1.0, 0.0, 0.0, 0.0]], driven.time) == 1
    driven.step()
    assert 0.1 < driven.controller.violations()["obstacles: obstacle 1"] < 1.5


def test_what_a_controller_plans_and_says():
    driven = Driven()
    for _ in range(3):
        _, command = driven.step()
    plan = driven.controller.plan()
    assert plan["times"].shape == (16,) and plan["states"].shape == (16, 4) and plan["inputs"].shape == (15, 2)
    assert plan["times"][1] == pytest.approx(0.2)
    assert command.reference.shape == (4,) and command.pace == 1.0 and not command.fallback
    assert command.report.status in ("solved", "step_taken")
    assert driven.controller.fallbacks == 0
    assert driven.controller.set_obstacles(numpy.zeros((0, 7)), 0.0) == 0
    assert driven.controller.violations() == {}
    driven.controller.applied([1.0, 0.0])
    driven.controller.locate()
    driven.controller.locate(30.0)
    with pytest.raises(rhec.Error, match="arc_length"):
        driven.controller.locate(numpy.nan)
    driven.controller.reset()
    driven.controller.finish()


def test_a_deadline_is_data():
    driven = Driven(rhec.Robot(ROBOT, set={"controller.solver": {"name": "gn_rti", "mode": "converge"}}))
    driven.estimator.push_measurement(0.0, driven.robot.vehicle.observe(driven.state))
    estimate = driven.estimator.estimate(0.0)
    command = driven.controller.control(estimate, deadline=0.0)
    assert command.report.status == "deadline" and command.report.usable and "allow more time" in command.report.advice
    with pytest.raises(rhec.Error, match="at least 0"):
        driven.controller.control(estimate, deadline=-1.0)


@pytest.mark.parametrize("changes", [{}, {"blocking": None}, {"blocking": None, "estimator": {"name": "bank"}}], ids=["blocks", "priors", "bank"])
def test_a_rehearsal_changes_no_bit(changes):
    robot = rhec.Robot(ROBOT, set=changes)
    plain, rehearsed = Driven(robot), Driven(robot)
    assert rehearsed.estimator.rehearse() is None  # there is nothing to go through yet
    for k in range(30):
        for _ in range(k % 3):
            rehearsed.estimator.rehearse()
        (now, command), (again, same) = plain.step(), rehearsed.step()
        for name in ("state", "parameters", "covariance"):
            numpy.testing.assert_array_equal(getattr(now, name), getattr(again, name))
        numpy.testing.assert_array_equal(command.inputs, same.inputs)
    assert plain.estimator.counts == rehearsed.estimator.counts


def test_estimators_are_reset():
    driven = Driven()
    with pytest.raises(rhec.Error, match="both the mean and the covariance"):
        driven.estimator.reset(mean=numpy.zeros(6))
    estimate, _ = driven.step()
    n = driven.estimator.estimate(0.0).covariance.shape[0]
    with pytest.raises(rhec.Error, match=r"expected the mean of \[state; parameters\]"):
        driven.estimator.reset(numpy.zeros(3), numpy.eye(3))
    driven.estimator.reset()
    assert not driven.estimator.has_started and driven.estimator.counts["nodes"] == 0
    assert n == 6 and estimate.time == 0.0


def test_shapes_are_checked():
    driven = Driven()
    for wrong in ([1.0, 2.0], 3.0, numpy.zeros((1, 3)), []):
        with pytest.raises(rhec.Error, match="outputs: found (an array of .*|one number), expected 3 numbers.*x_gps .*, y_gps .*, delta"):
            driven.estimator.push_measurement(0.0, wrong)
    with pytest.raises(TypeError):
        driven.estimator.push_measurement(0.0, "three")
    # Anything that numpy makes doubles of, in whatever order it lies.
    for right in ([1, 2, 3], (1.0, 2.0, 3.0), numpy.arange(3), numpy.zeros(6)[::2], numpy.zeros(3, dtype=">f8")):
        driven.estimator.push_measurement(0.0, right)
    with pytest.raises(rhec.Error, match="n x 3"):
        rhec.Path(numpy.zeros((3, 2)))
    with pytest.raises(rhec.Error, match="n x 7"):
        driven.controller.set_obstacles([[1.0, 2.0]], 0.0)


def test_another_vehicle():
    robot = rhec.Robot({"model": "skid_steer", "estimator": {"name": "ekf"}})
    assert [each.name for each in robot.vehicle.parameters] == ["lambda_left", "lambda_right", "icr_offset"]
    driven = robot.make_estimator(initial_state=[1.0, 2.0, 0.5])
    driven.push_measurement(0.0, [1.0, 2.0, 0.5])
    numpy.testing.assert_allclose(driven.estimate(0.0).state[:3], [1.0, 2.0, 0.5], atol=1e-6)
    bicycle = Driven()
    with pytest.raises(rhec.Error, match="expected an estimate of the same robot"):
        bicycle.controller.control(driven.estimate(0.0))


def test_paths():
    path = line()
    length = sum(numpy.hypot(0.5, numpy.sin(0.25 * (i + 1)) - numpy.sin(0.25 * i)) for i in range(40))
    assert len(path) == 41 and path.length == pytest.approx(length)
    x, y, heading, speed, _ = path.at(0.0)
    assert (x, y, speed) == (0.0, 0.0, 2.0) and heading > 0.0
    slowed = rhec.Path([(0.0, 0.0, 2.0), (10.0, 0.0, 2.0), (20.0, 0.0, 0.0)], acceleration=0.1)
    assert slowed.at(10.0)[3] == pytest.approx(numpy.sqrt(2 * 0.1 * 10.0))
    with pytest.raises(rhec.Error, match="waypoint 1"):
        rhec.Path([(numpy.nan, 0.0, 1.0), (1.0, 0.0, 1.0)])


def test_what_is_no_row_of_numbers_is_refused():
    driven = Driven()
    for wrong in ("abc", b"abc", numpy.zeros(3, complex), numpy.array(["2020"] * 3, "datetime64[D]"), [[1, 2], [3]], [1, "a", 2], {}):
        with pytest.raises(TypeError):
            driven.estimator.push_measurement(0.0, wrong)
    # What a mask hides is not there.
    hidden, told = (rhec.Robot(ROBOT).make_estimator() for _ in range(2))
    for time in (0.0, 0.2, 0.4):
        hidden.push_measurement(time, numpy.ma.masked_array([time, 3, 0], mask=[False, True, False]))
        told.push_measurement(time, [time, None, 0])
    numpy.testing.assert_array_equal(hidden.estimate(0.4).state, told.estimate(0.4).state)
    matrix = numpy.asfortranarray(numpy.arange(9.0).reshape(3, 3))
    driven.estimator.push_measurement(0.0, matrix[1])  # neither contiguous nor owned


CALLS = {
    "Estimator.push_measurement: time: found 'a' (str), expected seconds, one number": lambda on: on.estimator.push_measurement("a", [1]),
    "Estimator.push_measurement: outputs is missing; expected a number for each output, (n_y)": lambda on: on.estimator.push_measurement(1),
    "Estimator.push_measurement: outputs: found 'abc' (str), expected a number for each": lambda on: on.estimator.push_measurement(1, "abc"),
    "outputs: found an array of complex128, (3,), expected": lambda on: on.estimator.push_measurement(1, numpy.array([1, 2, 3j])),
    "outputs: found rows of 1 and 2 entries, expected": lambda on: on.estimator.push_measurement(1, [[1, 2], [3]]),
    "Estimator.push_input: inputs: found None, expected a number for each input, (n_u), in": lambda on: on.estimator.push_input(1, None),
    "Estimator.estimate: there is no argument 'deadlin'; did you mean 'deadline'? it is Estimator.estimate(time, deadline=None, *, out=None)":
        lambda on: on.estimator.estimate(1, deadlin=2),
    "Estimator.estimate: found 3 arguments without a name, expected at most 2": lambda on: on.estimator.estimate(1, 2, 3),
    "Estimator.estimate: time is there twice": lambda on: on.estimator.estimate(1, time=2),
    "Controller.control: estimate: found None, expected an Estimate": lambda on: on.controller.control(None),
    "Controller.control: deadline: found 'x' (str), expected seconds from now": lambda on: on.controller.control(on.step()[0], "x"),
    "Controller.control: found 3 (int) before the arguments": lambda on: rhec.Controller.control(3),
    "Controller: path: found 5 (int), expected a Path": lambda on: on.robot.make_controller(5),
    "Controller: robot: found an object of the class 'Robot', expected what is inside a Robot; call its make_estimator":
        lambda on: rhec.Controller(on.robot, line()),
    "Estimator: initial_state: found 'a' (str), expected a number for each state, (n_x)": lambda on: on.robot.make_estimator("a"),
    "Vehicle.integrate: substeps: found 1.5 (float), expected a whole number":
        lambda on: on.robot.vehicle.integrate([0] * 4, [0] * 2, [1, 1], 0.2, 1.5),
    "Vehicle.integrate: substeps: found 1099511627776 (int), expected a whole number":
        lambda on: on.robot.vehicle.integrate([0] * 4, [0] * 2, [1, 1], 0.2, 2**40),
    "Path: waypoints: found 'x' (str), expected rows of x [m], y [m], speed [m/s], (n, 3)": lambda on: rhec.Path("x"),
    "Path: acceleration: found 'a' (str), expected a number [m/s^2]": lambda on: rhec.Path([(0, 0, 1), (1, 0, 1)], acceleration="a"),
    "Path.at: arc_length is missing; expected a number [m]: Path.at(arc_length)": lambda on: line().at(),
    "set: found 5, expected a dict of keys": lambda on: rhec.Robot(ROBOT, set=5),
    "configuration: found an object of the class 'int'": lambda on: rhec.Robot(5),
    "plugin_path: found 3, expected a folder or a list of folders": lambda on: rhec.plugins(plugin_path=3),
    "progress: found 3, expected True, False, None": lambda on: rhec.run(ROBOT.parents[2] / "scenarios" / "figure8.yaml", progress=3),
}


@pytest.mark.parametrize("words", CALLS)
def test_arguments_that_are_refused_are_named_in_words(words):
    with pytest.raises(TypeError) as caught:
        CALLS[words](Driven())
    assert words in str(caught.value) and "incompatible" not in str(caught.value)
    assert isinstance(caught.value, rhec.ArgumentError) and isinstance(caught.value, rhec.Error)


def test_shapes_that_are_refused_are_named_with_units():
    driven = Driven()
    for call, words in (
            (lambda: driven.estimator.push_measurement(0.0, [1, 2]),
             "outputs: found an array of 2, expected 3 numbers in one dimension: x_gps [m], y_gps [m], delta [rad]"),
            (lambda: driven.robot.vehicle.observe([[1, 2]]),
             "states: found an array of 1 x 2, expected 4 numbers in one dimension, or rows of so many (n x 4): x_pos [m]"),
            (lambda: rhec.Path([1, 2]), "waypoints: found an array of 2, expected rows of x [m], y [m], speed [m/s] (n x 3)"),
            (lambda: driven.controller.set_obstacles([[1, 2]], 0.0), "obstacles: found an array of 1 x 2, expected rows of"),
            (lambda: driven.estimator.reset(1, 2), "reset: found a mean that is one number and a covariance that is one number")):
        with pytest.raises(rhec.Error) as caught:
            call()
        assert str(caught.value).startswith(words)


def test_outputs_of_motion_are_observed_with_what_moves():
    """A gyro's rate is that at which the heading turns; without input and slip it is no 0."""
    vehicle = rhec.Robot({"model": {"name": "bicycle_slip", "outputs": ["x_gps", "heading", "yaw_rate"]}}).vehicle
    state, inputs, slip = numpy.array([1.0, 2.0, 0.3, 0.2]), [3.0, 0.1], [0.7, 0.9]
    turning = vehicle.observe(state, inputs, slip)
    assert turning[2] == pytest.approx(vehicle.rates(state, inputs, slip)[2], rel=1e-12) and turning[2] > 0.1
    rows = vehicle.observe(numpy.array([state, 2.0 * state]), inputs, [slip, slip])
    numpy.testing.assert_array_equal(rows[0], turning)
    assert rows.shape == (2, 3)
    with pytest.raises(rhec.Error, match="inputs and parameters: yaw_rate measures motion"):
        vehicle.observe(state)
    with pytest.raises(rhec.Error, match="inputs: found an array of 3, expected 2"):
        vehicle.observe(state, [1, 2, 3], slip)


def test_no_rows_are_no_rows():
    """There is nothing to read of them."""
    vehicle = rhec.Robot(ROBOT).vehicle
    none, inputs = numpy.zeros((0, 4)), numpy.zeros((0, 2))
    assert vehicle.integrate(none, inputs, [1, 1], 0.2).shape == (0, 4)
    assert vehicle.rates(none, [0, 0], [1, 1]).shape == (0, 4)
    assert vehicle.integrate(none, inputs, [1, 1], 0.2, with_jacobian=True)[1].shape == (0, 4, 8)
    assert vehicle.observe(none).shape == (0, 3)
    with pytest.raises(rhec.Error, match="inputs: found 3 rows, expected 0"):
        vehicle.rates(none, numpy.zeros((3, 2)), [1, 1])


def test_a_configuration_that_contains_itself():
    configuration = {"step": 0.2}
    configuration["model"] = configuration
    with pytest.raises(rhec.Error, match="contains itself"):
        rhec.Robot(configuration)


def test_states_of_motion_are_told():
    robot = rhec.Robot(ROBOT, set={"model.outputs": ["x_gps", "y_gps", "delta", "yaw_rate"], "noise.outputs.yaw_rate": 0.01})
    estimator = robot.make_estimator()
    estimator.push_measurement(0.0, [0, 0, 0, 0])
    assert len(estimator.estimate(0.0).state) == len(robot.vehicle.states) + 1
    with pytest.raises(rhec.Error, match="5 states as an Estimate has them, and 2 parameters"):
        estimator.reset(numpy.zeros(6), numpy.eye(6))
    estimator.reset(numpy.zeros(7), numpy.eye(7))


def test_what_a_callback_raises_stays_as_it_is():
    def mistaken(share, text):
        raise TypeError("f(): incompatible function arguments. The following argument types are supported:\n    1. (x: int) -> int")
    with pytest.raises(TypeError) as caught:
        rhec.run(ROBOT.parents[2] / "scenarios" / "figure8.yaml", set={"path.laps": 1}, progress=mistaken)
    assert "incompatible function arguments" in str(caught.value)


def test_what_no_estimator_can_begin_with():
    robot = rhec.Robot(ROBOT)
    with pytest.raises(rhec.Error, match="initial_state: found an infinite number"):
        robot.make_estimator([0, numpy.inf, 0, 0])
    driven = Driven(robot)
    driven.step()
    for covariance in (-numpy.eye(6), numpy.arange(36.0).reshape(6, 6), numpy.full((6, 6), numpy.nan)):
        with pytest.raises(rhec.Error, match="not symmetric, or not positive definite"):
            driven.estimator.reset(numpy.zeros(6), covariance)
    estimate = driven.estimator.estimate(0.2)
    command = driven.controller.control(estimate)
    with pytest.raises(TypeError, match="out: expected an Estimate"):
        driven.estimator.estimate(0.4, out=command)
    with pytest.raises(TypeError, match="out: expected a Command"):
        driven.controller.control(estimate, out=estimate)
    for wrong in ({"acceleration": -1}, {"lateral_acceleration": 0}, {"acceleration": numpy.nan}):
        with pytest.raises(rhec.Error, match=f"{next(iter(wrong))}: expected more than 0"):
            rhec.Path([(0, 0, 1), (1, 0, 1)], **wrong)


def test_of_a_heading_that_nobody_tells_nothing_is_known():
    any_angle = math.pi / math.sqrt(3.0)
    initial = {"state": {"psi": 0.3}, "sigma": {"psi": 0.2}}
    for start, configured, sigma in ((None, {}, any_angle), ([1.0, 2.0, numpy.nan], {}, any_angle), ([1.0, 2.0, 0.5], {}, 0.1),
                                     (None, {"initial": initial}, 0.2), ([1.0, 2.0, numpy.nan], {"initial": {"state": {"psi": 0.3}}}, 0.1)):
        robot = rhec.Robot({"model": "skid_steer", "estimator": {"name": "ekf"} | configured})
        estimator = robot.make_estimator(initial_state=start)
        estimator.push_measurement(0.0, [1.0, 2.0, numpy.nan])
        now = estimator.estimate(0.0)
        assert now.covariance[2, 2]**0.5 == pytest.approx(sigma, rel=0.05), (start, configured)
        assert str(now.health) == ("lost" if sigma == any_angle else "ok")
        estimator.push_measurement(0.1, [1.0, 2.0, 0.5])
        assert abs(estimator.estimate(0.1).state[2] - 0.5) < 0.3


def test_robots_are_pickled_and_others_say_what_to_do(tmp_path, monkeypatch):
    robot = rhec.Robot(ROBOT, set={"estimator.horizon": 7})
    driven = Driven(robot)
    estimate, command = driven.step()
    monkeypatch.chdir(tmp_path)  # another process may have another folder
    for again in (pickle.loads(pickle.dumps(robot)), copy.copy(robot), copy.deepcopy(robot)):
        numpy.testing.assert_array_equal(Driven(again).step()[0].state, estimate.state)
    vehicle = rhec.Robot({"model": rhec.Robot(ROBOT).vehicle.name})
    assert pickle.loads(pickle.dumps(vehicle)).vehicle.name == "bicycle_slip"
    for thing in (driven.estimator, driven.controller, estimate, command, line(), robot.vehicle):
        for attempt in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(TypeError, match="cannot pickle or copy an object of the class .*; (make|keep)"):
                attempt(thing)
    assert pickle.loads(pickle.dumps(command.report)).kkt == command.report.kkt


def test_how_things_are_shown():
    robot = rhec.Robot(ROBOT)
    assert repr(robot.vehicle) == "<vehicle 'bicycle_slip': 4 states, 2 inputs, 2 parameters, 3 outputs>"
    assert repr(rhec.Path([(0, 0, 1), (3, 4, 1)])) == "<path: 2 waypoints, 5.0 m>"


def test_notes_are_warnings():
    with pytest.warns(rhec.Note, match="step: 1.5 s from node to node is long") as told:
        rhec.Robot(ROBOT, set={"step": 1.5})
    assert told[0].filename == __file__ and told[0].message.key == "step" and told[0].message.file is None


def test_a_map_is_kept(tmp_path):
    file = tmp_path / "map.sqlite"
    robot = rhec.Robot(ROBOT, set={"blocking": None, "estimator.memory": {"name": "place", "file": str(file)}})
    driven = Driven(robot)
    for _ in range(40):
        driven.step()
    assert not file.exists()
    driven.estimator.end_drive()
    driven.estimator.save_map()
    assert file.stat().st_size > 0
    again = Driven(robot)
    assert again.step()[0].health == "ok"  # the second drive begins with what the first one has found
    file.write_text("no map")
    with pytest.raises(rhec.Error, match="map.sqlite"):
        robot.make_estimator()
