"""Terms of a controller's problem that are written in Python, compiled, and beside those that come with rhec."""
import numpy
import pytest
import rhec
from shared import FIGURE8, SHORT

sympy = pytest.importorskip("sympy")

SPEED, RATE, MOST, LENGTH, ROLL = sympy.symbols("ground_speed heading_rate most arc_length roll_factor")
# Limits take more than one iteration.
SOLVER = {"controller.solver": {"name": "gn_rti", "iterations": 5, "residual": 0.01}}


def lateral():
    """terms/lateral_acceleration."""
    return rhec.Term("side", options={MOST: {"default": 3, "unit": "m/s^2", "above": 0, "meaning": "to either side"}},
                     limits={"acceleration": (-MOST, SPEED * RATE, MOST)})


@pytest.fixture(scope="module")
def side(tmp_path_factory):
    return lateral().build(tmp_path_factory.mktemp("side"))


def driven(*terms):
    return rhec.run(FIGURE8, set={**SHORT, **SOLVER, "controller.terms": list(terms)})


def test_a_limit_is_that_of_the_plugin(side):
    ours, theirs = driven(side.with_options(most=2.0)), driven({"name": "lateral_acceleration", "most": 2.0})
    free = driven()
    assert ours.completed and theirs.completed
    numpy.testing.assert_allclose(ours.steps["u1"], theirs.steps["u1"], atol=1e-6)
    limited, usual = (numpy.percentile(numpy.abs(run.steps["u1"] * run.steps["true_kappa"] *
                                                 numpy.gradient(run.steps["true_beta"], run.steps["time"])), 90) for run in (ours, free))
    assert limited < 0.8 * usual


def test_options_of_terms(side):
    table = rhec.options("side", plugin_path=side._plugin_path)
    assert list(table["name"])[0] == "most" and "to either side [m/s^2]" in list(table["meaning"])
    assert "hard" in list(table["name"])
    with pytest.raises(rhec.Error, match="greater than 0"):
        driven(side.with_options(most=-1.0))


def test_bounds_and_costs_of_a_node(tmp_path):
    """Slow on a part of the path, and dear steering: bounds with corners, costs with a loss, data of a node."""
    steering = sympy.Symbol("u2")
    term = rhec.Term("zone", inputs=[steering], options={"from_length": 10.0, "to_length": 40.0},
                     limits={"speed": (None, SPEED, sympy.Piecewise((3, (LENGTH > sympy.Symbol("from_length")) &
                                                                     (LENGTH < sympy.Symbol("to_length"))), (sympy.oo, True)))},
                     costs={"steering": {"term": steering, "weight": 2, "delta": 0.5}, "along": {"term": sympy.Symbol("path_speed") - SPEED,
                                                                                               "weight": 0.01}})
    built = term.build(tmp_path)
    slowed, free = driven(built), driven()
    along = numpy.concatenate([[0.0], numpy.hypot(numpy.diff(slowed.steps["reference_x"]), numpy.diff(slowed.steps["reference_y"])).cumsum()])
    speed = slowed.steps["u1"] * slowed.steps["kappa"]
    assert speed[(along > 34.0) & (along < 38.0)].max() < 3.2
    assert speed[along > 60.0].mean() > 8.0 and slowed.steps.rows > free.steps.rows
    assert "data[0] = place.speed;" in (tmp_path / "zone.cpp").read_text()


@pytest.mark.parametrize("keys, word", [
    (dict(), "neither limits nor costs"),
    (dict(limits={"g": (0, SPEED)}), r"expected \(lower, term, upper\)"),
    (dict(limits={"g": (SPEED, RATE, 1)}), "a bound or a weight depends on 'ground_speed'"),
    (dict(limits={"g": (0, sympy.Symbol("u2"), 1)}), "'u2' is not known; .*inputs="),
    (dict(limits={"g": (0, sympy.Abs(SPEED), 1)}), "no derivative"),
    (dict(limits={"g": (0, SPEED - sympy.Symbol("room_left"), 1)}), "expected them in bounds alone"),
    (dict(costs={"c": {"weight": 1}}), "'term' is missing"),
    (dict(costs={"c": SPEED}, options={"double": 1}), "'double' is taken"),
    (dict(costs={"c": SPEED}, options={"a": {"default": 1, "units": "m"}}), "'units' is not known"),
    (dict(costs={"c": SPEED}, options={"a": "many"}), "options: a: default: found 'many', expected a number"),
    (dict(costs={"c": SPEED}, options={"a": float("nan")}), "options: a: default: found nan, expected a number"),
    (dict(costs={"c": SPEED}, options={"a": {"default": 1, "above": "0"}}), "options: a: above: found '0', expected a number"),
    (dict(costs={"c": SPEED}, options={"a": {"default": 1, "above": 0, "at_least": 0}}), "expected one of them"),
    (dict(costs={"c": SPEED}, options={"a": {"default": -1, "above": 0}}), "greater than 0"),
    (dict(costs={"c": SPEED}, options={"a": {"default": 1, "meaning": 3}}), "options: a: meaning: found 3, expected a text"),
    (dict(costs={"c": SPEED}, options={"hard": 1}), "options: hard: is a key of every term"),
    (dict(costs={"c": SPEED}, options={"sin": 1}), "'sin' is taken"),
    (dict(costs={"c": SPEED}, options={"lower": 1}), "'lower' is taken"),
    (dict(costs={"c": SPEED}, options={"a__b": 1}), "'a__b' is taken"),
    (dict(costs={"c": SPEED}, options={"co_await": 1}), "'co_await' is taken"),
    (dict(costs={"c": SPEED}, options={"NAN": 1}), "'NAN' is taken"),
    (dict(costs={"c": SPEED}, states=["time"]), "'time' is taken"),
    (dict(costs={"c": SPEED}, states=["a"], inputs=["a"]), "'a' is there twice"),
    (dict(costs={"c": SPEED}, states=["a", "a"]), "states: 'a' is there twice"),
    (dict(costs={"c": SPEED}, states="ab"), "states: found 'ab', expected a dict"),
    (dict(costs={"c": SPEED}, states=["a b"]), "'a b'.*expected letters"),
    (dict(costs={"c": SPEED}, limits={"c": (0, SPEED, 1)}), "costs: c: there is a limit of that name"),
    (dict(costs={"c": {"term": SPEED, "wait": 1}}), "costs: c: 'wait' is not known"),
    (dict(costs={"c": {"term": SPEED, "weight": LENGTH}}), "costs: c: weight: a bound or a weight depends on 'arc_length'; expected options"),
    (dict(costs={"c": {"term": SPEED, "weight": -1}}), "costs.c.weight: the weight is -1, expected a finite number, at least 0"),
    (dict(costs={"c": {"term": SPEED, "delta": 0}}), "costs.c.delta: delta is 0, expected a number greater than 0"),
    (dict(costs={"c": "ground_speed^^2"}), r"costs: c: the text 'ground_speed\^\^2': found '\^', expected a number, a name"),
    (dict(costs={"c": "ground_speed**2"}), "found '\\*\\*', expected .*; write a power as x\\^2"),
    (dict(costs={"c": "2 ground_speed"}), "found 'ground_speed', expected an operator .*; a product is written with"),
    (dict(costs={"c": "(ground_speed"}), "found the end, expected an operator or"),
    (dict(costs={"c": "abs(ground_speed)"}), "there is no function 'abs'; .*no derivative everywhere; write rhec.smooth_abs"),
    (dict(costs={"c": "sine(ground_speed)"}), "there is no function 'sine'; expected one of sqrt"),
    (dict(costs={"c": "atan2(ground_speed)"}), "atan2 has 2 arguments, found 1"),
    (dict(costs={"c": "ground_spede"}), "costs: c: 'ground_spede' is not known"),
    (dict(costs={"c": "part7 + ground_speed"}), "costs: c: 'part7' is not known"),
    (dict(costs={"c": "(" * 200 + "ground_speed" + ")" * 200}), "nested deeper than 100 levels"),
    (dict(costs={"c": SPEED / 0}), "expected real, finite numbers"),
    (dict(costs={"c": "ground_speed / 0"}), "costs.c: this divides by 0|divides by 0"),
    (dict(costs={"c": object()}), "costs: c: found an object of the class 'object' as an equation"),
    (dict(costs={"c": sympy.gamma(SPEED)}), "costs: c: gamma.*do not have the function 'gamma'"),
    (dict(costs={"c": sympy.Min(SPEED, RATE)}), "costs: c: .*no derivative everywhere"),
    (dict(costs={"c": sympy.Piecewise((SPEED, SPEED > 1), (0, True))}), "costs: c: .*no derivative everywhere; .*smooth=WIDTH"),
    (dict(costs={"c": sympy.Symbol("y dot")}), "costs: c: the name 'y dot': expected letters"),
    (dict(limits={"g": (None, SPEED, None)}), "limits: g: it has no bound"),
    (dict(limits={"g": (0, SPEED, sympy.Symbol("mots"))}), "limits: g: upper: a bound or a weight depends on 'mots'"),
    (dict(limits={"g": (0, SPEED, sympy.Piecewise((1, LENGTH > 1)))}), "limits: g: upper: .*all other cases"),
    (dict(limits={"g": (0, SPEED, float("nan"))}), "limits: g: upper: .*not finite|real, finite"),
    (dict(limits={"g\n": (0, SPEED, 1)}), "expected a text that can be printed"),
    (dict(costs={"c": SPEED}, smooth=-1.0), "smooth: found -1.0, expected a width greater than 0"),
])
def test_mistakes_in_terms(keys, word):
    with pytest.raises(rhec.Error, match=word):
        rhec.Term("wrong", **keys)
    with pytest.raises(rhec.Error, match="small letters"):
        rhec.Term("Wrong Name", costs={"c": SPEED})


TERMS = [SPEED**2, (SPEED**2 + 1)**-2, sympy.sqrt(SPEED**2 + 1), (SPEED**2 + 1)**sympy.Rational(3, 2), sympy.Rational(1, 2) * SPEED, sympy.pi * SPEED,
         sympy.atan2(SPEED, RATE + 2), rhec.smooth_max(SPEED, RATE, 0.1), sympy.exp(-SPEED) + sympy.log(SPEED**2 + 1)]


def test_all_functions_compile(tmp_path):
    """Compiled they are what they are without a compiler: sympy's terms, and texts."""
    texts = ["-ground_speed^2 / (2 + heading_rate^2)", "(ground_speed^2 + 1)^0.5 * pi", "hypot(ground_speed, 1)^-1 - -2e-1", "smooth_min(3, ground_speed, .1) + atan2(1, ground_speed) + atan2(scale, 2)"]
    term = rhec.Term("functions", costs={f"c{i}": {"term": term, "weight": 1e-6} for i, term in enumerate([*TERMS, *texts])}, options={"scale": 2.0},
                     limits={'with "quotes"': (sympy.Min(-5, -LENGTH), RATE, "where(arc_length - 20, abs(-6), max(5, 4)) + infinity"),
                             "smoothed": (None, sympy.Max(SPEED, 0) * sympy.Abs(RATE), 100)}, smooth=1e-2)
    compiled, loaded = driven(term.build(tmp_path)), driven(term)
    assert compiled.completed and "abs(" not in term.source.replace("fabs(", "").replace("smooth_abs(", "")
    for name in ("u1", "u2", "x_pos", "kappa"):
        numpy.testing.assert_allclose(loaded.steps[name], compiled.steps[name], rtol=1e-9, atol=1e-12)


def test_a_term_without_a_compiler(side, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    term = lateral().with_options(most=2.0)
    ours, theirs = driven(term), driven(side.with_options(most=2.0))
    for name in ("u1", "u2", "x_pos"):
        numpy.testing.assert_array_equal(ours.steps[name], theirs.steps[name])
    assert not (driven().steps["u1"][:50] == ours.steps["u1"][:50]).all()
    with pytest.raises(rhec.Error, match="most: .*greater than 0"):
        driven(lateral().with_options(most=-1.0))
    with pytest.raises(rhec.Error, match="moost"):
        lateral().with_options(moost=1.0).load()
    with pytest.raises(rhec.Error, match="cmake is not there"):
        lateral().build()


def test_a_term_for_a_vehicle():
    term = rhec.Term("still", inputs=["u7"], costs={"c": sympy.Symbol("u7") * SPEED})
    assert term.load() is term
    with pytest.raises(rhec.Error, match="u7"):
        term.load(rhec.Robot({"model": "bicycle_slip"}).vehicle)
    with pytest.raises(rhec.Error, match="u7"):
        driven(term)


def test_problems_keep_terms_of_equations(tmp_path):
    run = rhec.run(FIGURE8, set={**SHORT, **SOLVER, "controller.terms": [lateral().with_options(most=2.0)]}, problems_every=60)
    file = tmp_path / "problems.jsonl"
    rhec.write_problems(file, run.problems)
    for problem, again in zip(run.problems, rhec.read_problems(file)):
        assert again.line() == problem.line()
        if problem.kind == "rhc":
            numpy.testing.assert_array_equal(again.solve("sparse_sqp").inputs, problem.solve("sparse_sqp").inputs)
            assert problem.to_dict()["terms"]


def test_names_that_cmake_keeps(tmp_path):
    with pytest.raises(rhec.Error, match="'test', which CMake keeps for itself"):
        rhec.Term("test", costs={"c": SPEED}).build(tmp_path)
    assert not list(tmp_path.iterdir())


def test_bounds_with_corners_are_the_same_compiled_and_loaded():
    """As C++ and as equations: one by one, by a limit that nothing keeps within."""
    bounds = [sympy.Abs(LENGTH - 20), sympy.Max(LENGTH, 3, 1), sympy.Min(-1, LENGTH), sympy.Piecewise((1, LENGTH >= 3), (2, LENGTH <= 1), (3, True)),
              sympy.Piecewise((1, (LENGTH > 3) & (LENGTH < 5) | (LENGTH > 10)), (sympy.oo, True)), sympy.Piecewise((1, sympy.Eq(LENGTH, 3)), (0, True))]
    term = rhec.Term("bounds", limits={f"g{i}": (None, SPEED, bound) for i, bound in enumerate(bounds)})
    assert "(arc_length >= 3.0 ? 1.0 : (arc_length <= 1.0 ? 2.0 : 3.0))" in term.source
    assert term._section()["equations"]["limits"]["g3"]["upper"] == "where(3 - arc_length, where(arc_length - 1, 3, 2), 1)"


def test_a_term_is_checked(side):
    check = lateral().check()
    assert not check.failed and list(check.findings["check"]) == ["description", "vehicle", "rows", "derivatives", "numbers", "time"]
    vehicles = [each["vehicle"] for each in check.details["vehicles"]]
    assert "bicycle_slip" in vehicles and len(vehicles) > 1
    built = side.check
    assert built is side.check and [each["vehicle"] for each in built.details["vehicles"]] == vehicles
    vehicle = rhec.Robot({"model": "bicycle_slip"}).vehicle
    for one in (lateral().check(vehicle), rhec.check(lateral(), vehicle=vehicle), rhec.check("lateral_acceleration", vehicle=vehicle, most=3.0)):
        assert [each["vehicle"] for each in one.details["vehicles"]] == ["bicycle_slip"] and not one.failed
    assert "table of" in repr(check.findings) and "0 failed" in repr(check)


def test_checks_of_terms_that_are_wrong(tmp_path):
    root = rhec.Term("root", costs={"c": sympy.sqrt(RATE)}, meaning="bends to the left")
    with pytest.raises(rhec.Error, match="the term 'root': its check failed: numbers .*not finite.*square root"):
        root.build(tmp_path)
    assert not [each for each in tmp_path.iterdir() if each.name != "CMakeCache.txt"]
    assert "lower is 1, above upper, which is 0" in rhec.Term("crossed", limits={"g": (1, SPEED, 0)}).check().failures()
    mine = rhec.Term("mine", inputs=["u7"], costs={"c": "u7"})
    assert not mine.check().failed and "no vehicle" in " ".join(mine.check().findings["found"])
    with pytest.raises(rhec.Error, match="its check failed: vehicle bicycle_slip has no input 'u7'"):
        mine.build(tmp_path, vehicle=rhec.Robot({"model": "bicycle_slip"}).vehicle)
    with pytest.raises(rhec.ArgumentError, match="vehicle: found 3, expected a Vehicle"):
        root.check(3)
    with pytest.raises(rhec.Error, match="did you mean the term 'corridor'"):
        rhec.check("corridr")
    with pytest.raises(rhec.Error, match="lef: .*did you mean 'left'"):
        rhec.check("corridor", lef=3)
    with pytest.raises(rhec.Error, match="it is for a term"):
        rhec.check("bicycle_slip", vehicle=rhec.Robot({"model": "bicycle_slip"}).vehicle)
    with pytest.raises(rhec.ArgumentError, match="with_options"):
        rhec.check(root, most=3)
