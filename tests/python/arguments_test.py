"""Arguments of a wrong class: every function says which one, what it found and what it expects."""
import ast
import inspect

import numpy
import pytest
import rhec
from rhec import _rhec
from shared import FIGURE8, SHORT, Driven, line
from stubs_test import STUB, functions


class Nothing:
    """What no function takes."""


@pytest.fixture(scope="module")
def things():
    """An object of each class, by the names of stubs and of the package."""
    driven = Driven()
    estimate, command = driven.step()
    run = rhec.run(FIGURE8, set=SHORT, problems_every=60)
    problem = run.problems[0]
    model = rhec.Model("one", states=["x"], inputs=["u"], outputs=["x"], rates=["u"])
    term = rhec.Term("slow", options={"most": 3.0}, limits={"speed": (None, "ground_speed", "most")})
    solution = problem.solve("sparse_sqp")
    return {"Settings": _rhec.Settings.of({"a": 1}, "test"), "Vehicle": driven.robot.vehicle, "Variable": driven.robot.vehicle.states[0],
            "Report": command.report, "Path": line(), "_rhec.Robot": driven.robot._robot, "Robot": driven.robot, "Estimate": estimate,
            "Estimator": driven.estimator, "Command": command, "Controller": driven.controller, "Drive": run._made, "Run": run,
            "ProblemBase": problem._made, "Problem": problem, "Solution": solution, "Model": model, "Term": term,
            "Page": rhec.Page("<!doctype html>"), "Check": model.check(), "Table": run.steps}


def public_methods(kind):
    return [name for name, value in vars(kind).items() if not name.startswith("_") and not isinstance(value, property) and
            callable(getattr(kind, name))]


def calls(things):
    """Every public callable of the module and of the package, by name, with what comes before its arguments."""
    body = ast.parse(STUB.read_text()).body
    for name in functions(body):
        yield f"_rhec.{name}", getattr(_rhec, name)
    for kind in (each for each in body if isinstance(each, ast.ClassDef)):
        yield f"_rhec.{kind.name}", getattr(_rhec, kind.name)
        of = things.get(f"_rhec.{kind.name}", things.get(kind.name))
        for name, member in functions(kind.body).items():
            # Anything may be looked for by `in`.
            if name not in ("__init__", "__contains__") and not any(getattr(mark, "id", "") == "property" for mark in member.decorator_list):
                yield f"_rhec.{kind.name}.{name}", getattr(of if isinstance(of, getattr(_rhec, kind.name)) else getattr(_rhec, kind.name), name)
    for name in rhec.__all__:
        value = getattr(rhec, name)
        if not callable(value):
            continue
        if not (inspect.isclass(value) and issubclass(value, (Exception, Warning))):  # these take what they are about
            yield name, value
        if inspect.isclass(value) and value.__module__.startswith("rhec") and value.__module__ != "rhec._rhec" and name in things:
            for member in public_methods(value):
                if name != "Table" or member in vars(value):
                    yield f"{name}.{member}", getattr(things[name], member)


def test_every_function_says_what_it_does_not_take(things):
    walked, bare = [], []
    for name, call in calls(things):
        walked.append(name)
        try:
            call(Nothing())
        except rhec.ArgumentError as told:
            if not any(words in str(told) for words in ("Nothing", "argument", "is missing", "No constructor")):
                bare.append(f"{name}: {told}")
        except Exception as told:  # noqa: B902  (all of them are told)
            bare.append(f"{name}: {type(told).__name__}: {told}")
        else:
            bare.append(f"{name}: took it")
    assert len(walked) > 110 and not bare, "\n".join(bare)
    for wanted in ("report", "read_problems", "sweep", "_rhec.Estimator.push_measurement", "Model.build", "Problem.solve", "_rhec.problems"):
        assert wanted in walked


ZEROS, ONES = numpy.zeros(4), [1.0, 1.0]


@pytest.mark.parametrize("call, word", [
    (lambda d: rhec.report(3), "report: results: found 3, expected a Run, a SmoothedRun"),
    (lambda d: rhec.read_problems(3), "read_problems: file: found 3, expected the name of a file"),
    (lambda d: rhec.Robot("a\0b.yaml"), "Robot: configuration: found 'a"),
    (lambda d: rhec.run(FIGURE8, problems_every=-1), "problems_every: found -1, expected a number, at least 0"),
    (lambda d: rhec.run(FIGURE8, problems_every=2**40), "problems_every: found 1099511627776, expected an integer of 32 bits"),
    (lambda d: rhec.run(FIGURE8, speed=3), r"run: there is no argument 'speed'; keys of a configuration go into set=\{'speed': ...\}; it is run\("),
    (lambda d: rhec.run(FIGURE8, sett={}), r"run: there is no argument 'sett'; did you mean 'set'\? it is run\(scenario, \*, set=None"),
    (lambda d: rhec.run(), "run: scenario is missing; expected the name of a YAML file or a dict: run"),
    (lambda d: rhec.run(FIGURE8, {}), "run: found 2 arguments without a name, expected at most 1"),
    (lambda d: rhec.run(FIGURE8, scenario=FIGURE8), "run: scenario is there twice"),
    (lambda d: d.robot.make_controller(), r"Robot.make_controller: path is missing; .*: Robot.make_controller\(path, ahead=None\)"),
    (lambda d: _rhec.Settings.of({}, 3), "Settings.of: origin: found 3"),
    (lambda d: rhec.sweep({}, "x.sqlite", threads=-3), "sweep: threads: found -3, expected a number, at least 0"),
    (lambda d: rhec.tune({}, [(0, 0, 0)], [(0, 0, 0)], hold_out=0), "tune: hold_out: found 0, expected a number, at least 2"),
    (lambda d: rhec.tune({}, [(0, 0, 0)], [[0, 0], [1]]), "tune: gps: found rows of 1 and 2 entries, expected the name of a file, or an array"),
    (lambda d: rhec.tune_controller(FIGURE8, seeds=-1), "seeds: found -1, expected a number, at least 1"),
    (lambda d: rhec.tune_controller(FIGURE8, effort=numpy.nan), "effort: found nan, expected a number, at least 0"),
    (lambda d: rhec.estimate({}, [(0, 0, 0)], [(0, 0, 0)], variants="ab"), "variants: found 'ab', expected a list of texts"),
    (lambda d: d.estimator.estimate(), "Estimator.estimate: time is missing; expected seconds, one number"),
    (lambda d: d.estimator.estimate(0.0, deadline="soon"), r"Estimator.estimate: deadline: found 'soon' \(str\), expected seconds from now"),
    (lambda d: d.estimator.estimate(0.0, dedline=1), "Estimator.estimate: there is no argument 'dedline'; did you mean 'deadline'"),
    (lambda d: d.estimator.push_measurement(0.0, "three"), r"push_measurement: outputs: found 'three' \(str\), expected a number for each output"),
    (lambda d: rhec.Estimator.estimate(3, 0.0), r"Estimator.estimate: found 3 \(int\) before the arguments, expected an object of the class 'Estimator'"),
    (lambda d: d.controller.control(d.robot), "control: estimate: found an object of the class 'Robot', expected an Estimate"),
    (lambda d: rhec.Controller(d.robot, line()), "Controller: robot: found an object of the class 'Robot'"),
    (lambda d: d.robot.vehicle.integrate(ZEROS, ONES, ONES, 0.1, 10**12), r"substeps: found 1000000000000 \(int\), expected a whole number"),
    (lambda d: d.robot.vehicle.observe([10**400] * 4), "Vehicle.observe: states: found .*expected a number for each state"),
    (lambda d: rhec.Model("a", states=["x"], inputs=["u"], rates=["u"]).build(instruction_sets=["sse9"]), "found 'sse9', expected some of generic"),
    (lambda d: rhec.smooth_abs("x", 0.1), "smooth_abs: found 'x', 0.1, expected numbers, or terms"),
])
def test_what_was_wrong_is_said(call, word):
    with pytest.raises(rhec.ArgumentError, match=word) as caught:
        call(Driven())
    assert isinstance(caught.value, rhec.Error) and isinstance(caught.value, TypeError)


def test_the_argument_is_named():
    with pytest.raises(rhec.ArgumentError) as caught:
        Driven().estimator.push_input(0.0, outputs=[1, 2])
    assert caught.value.argument is None
    with pytest.raises(rhec.ArgumentError) as caught:
        Driven().estimator.push_input(0.0, {})
    assert caught.value.argument == "inputs"


@pytest.mark.parametrize("call, word", [
    (lambda d: d.controller.applied([numpy.nan, 1]), "inputs: found a number that is not finite"),
    (lambda d: d.controller.set_obstacles(numpy.full((1, 7), numpy.nan), 0.0), "obstacles, time: found a number that is not finite"),
    (lambda d: d.controller.set_obstacles([[1, 0, 1, 1, 0, 0, 0], [5, 0, 1, -1, 0, 0, 0]], 0.0), "obstacles: row 1 has the semi-axes 1 and -1 m; expected at least 0"),
    (lambda d: d.controller.set_obstacles(numpy.zeros((1, 7)), numpy.inf), "obstacles, time: found a number that is not finite"),
    (lambda d: d.robot.vehicle.integrate(ZEROS, ONES, ONES, numpy.inf), "duration: expected a finite number"),
    (lambda d: line().at(numpy.nan), "arc_length: expected a finite number"),
    (lambda d: rhec.Robot({"model": "\ud800"}), r"model: found the text '\\ud800', which is not Unicode"),
    (lambda d: rhec.Robot({"\ud800": 1}), "which is not Unicode"),
    (lambda d: rhec.read_problems("/tmp"), "/tmp: cannot be read: Is a directory"),
    (lambda d: rhec.read_problems("not there"), "not there: cannot be read: No such file"),
    (lambda d: rhec.write_problems("not/there", []), "not/there: cannot be written: No such file"),
    (lambda d: rhec.Page("x").save("not/there"), "not/there: cannot be written"),
    (lambda d: rhec.Problem.from_dict({"a": object()}), "problem: found an object of the class 'object'; expected numbers"),
    (lambda d: rhec.smooth(FIGURE8, phase=3), "variants, hold_out and phase are those of a recorded drive"),
    (lambda d: rhec.Model("a", states={"x": {"unit": object()}}, inputs=["u"], outputs=["x"], rates=["u"]).yaml(), "states: x: found an object"),
])
def test_what_cannot_be_is_said(call, word):
    with pytest.raises(rhec.Error, match=word):
        call(Driven())


def test_a_configuration_without_end():
    endless = {}
    endless["a"] = endless
    with pytest.raises(rhec.Error, match="contains itself"):
        rhec.Robot(endless)


def test_arrays_of_every_kind():
    vehicle, whole = Driven().robot.vehicle, numpy.arange(8.0)
    expected = vehicle.rates(whole[::2].copy(), [1.0, 2.0], ONES)
    for states in (whole[::2], whole[::2].astype(numpy.float32), [0, 2, 4, 6], tuple(whole[::2]), whole[::-2][::-1] - 1,
                   numpy.asfortranarray(whole.reshape(4, 2))[:, 0], whole[::2].astype(">f8")):
        numpy.testing.assert_array_equal(vehicle.rates(states, numpy.array([1, 2], numpy.int8), ONES), expected)
    # No rows are no rows, whatever the others are; what was there before is not read.
    assert vehicle.rates(numpy.zeros((0, 4)), [1, 2], ONES).shape == (0, 4)
    assert vehicle.rates(ZEROS, numpy.zeros((0, 2)), ONES).shape == (0, 4)
    assert vehicle.observe(numpy.zeros((0, 4))).shape == (0, 3)
    ends, jacobians = vehicle.integrate(numpy.zeros((0, 4)), [1, 2], ONES, 0.1, with_jacobian=True)
    assert ends.shape == (0, 4) and jacobians.shape == (0, 4, 8)
    with pytest.raises(rhec.Error, match="inputs: found 3 rows, expected 0"):
        vehicle.rates(numpy.zeros((0, 4)), numpy.zeros((3, 2)), ONES)
    assert numpy.isnan(vehicle.rates(numpy.full(4, numpy.nan), [1, 2], ONES)[:3]).all()
    assert Driven().controller.set_obstacles([], 0.0) == 0


def test_what_cannot_be_measured_does_no_harm():
    driven, told = Driven(), Driven()
    for each in (driven, told):
        for _ in range(3):
            each.step()
    for time in (numpy.nan, numpy.inf, -numpy.inf):
        driven.estimator.push_measurement(time, [0.0, 0.0, 0.0])
        driven.estimator.push_input(time, [0.0, 0.0])
    assert driven.estimator.counts["dropped"] == 3
    numpy.testing.assert_array_equal(driven.step()[0].state, told.step()[0].state)
    with pytest.raises(rhec.Error, match="cannot be imported"):
        rhec._errors.module_of("no_such_module", "test")
