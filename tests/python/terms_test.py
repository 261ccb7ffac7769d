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
    (dict(costs={"c": SPEED}, options={"a": "many"}), "expected a number"),
])
def test_mistakes_in_terms(keys, word):
    with pytest.raises(rhec.Error, match=word):
        rhec.Term("wrong", **keys)
    with pytest.raises(rhec.Error, match="small letters"):
        rhec.Term("Wrong Name", costs={"c": SPEED})


TERMS = [SPEED**2, SPEED**-2, sympy.sqrt(SPEED**2 + 1), (SPEED**2 + 1)**sympy.Rational(3, 2), sympy.Rational(1, 2) * SPEED, sympy.pi * SPEED,
         sympy.atan2(SPEED, RATE + 2), rhec.smooth_max(SPEED, RATE, 0.1), sympy.exp(-SPEED) + sympy.log(SPEED**2 + 1)]


def test_all_functions_compile(tmp_path):
    term = rhec.Term("functions", costs={f"c{i}": {"term": term, "weight": 1e-9} for i, term in enumerate(TERMS)})
    assert driven(term.build(tmp_path)).completed
