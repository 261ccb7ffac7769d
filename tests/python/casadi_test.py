"""CasADi: its terms become vehicles, and vehicles and problems become its functions."""
import time

import numpy
import pytest
import rhec
from shared import FIGURE8, ROOT, SHORT

casadi = pytest.importorskip("casadi")

QUIET = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes"}
x, u = casadi.SX.sym("x"), casadi.SX.sym("u")


def one_rate(term, **more):
    return rhec.Model("one", states=[x], inputs=[u], outputs=["x"], rates=[term], **more)


TERMS = {
    "sums": x + u - 2 * x, "products": x * u / (x + 3), "powers": x**2 + (x**2 + 1)**1.5 + (x**2 + 1)**u,
    "negative powers": x**-2, "roots": casadi.sqrt(x**2 + 1), "angles": casadi.atan2(x, u) + casadi.asin(u / 2) + casadi.acos(u / 2),
    "functions": casadi.exp(-x) + casadi.log(x**2 + 1) + casadi.tanh(u) + casadi.sin(x) * casadi.cos(u) + casadi.tan(u),
    "hyperbolic": casadi.sinh(x) - casadi.cosh(u), "signs": -(-x) - (-u), "parts": casadi.sin(x + u)**2 + casadi.sin(x + u),
    "log1p": casadi.log1p(x**2) + casadi.expm1(u), "hypot": casadi.hypot(x, u), "a number": casadi.SX(3.0),
    "by hand": rhec.smooth_abs(x, 0.1) + rhec.smooth_max(x, u, 0.1),
}
CORNERS = {
    "fabs": casadi.fabs(x), "fmax": casadi.fmax(x, u), "fmin": casadi.fmin(x, u), "sign": casadi.sign(x),
    "if_else": casadi.if_else(x > u, x**2, u), "and": casadi.if_else(casadi.logic_and(x > -1, x < 1), 1.0, 0.0),
    "or": casadi.if_else(casadi.logic_or(x < -1, x > 1), 1.0, 0.0),
}
POINTS = [(a, b) for a in (-1.7, -0.4, 0.3, 1.2) for b in (-0.9, 0.2, 0.8)]


@pytest.mark.parametrize("name", TERMS)
def test_terms_keep_their_values(name):
    vehicle, exact = one_rate(TERMS[name]).load(), casadi.Function("f", [x, u], [TERMS[name]])
    for point in POINTS:
        assert vehicle.rates([point[0]], [point[1]], [])[0] == pytest.approx(float(exact(*point)), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", CORNERS)
def test_corners_are_refused_or_smoothed(name):
    with pytest.raises(rhec.Error, match="no derivative everywhere"):
        one_rate(CORNERS[name])
    vehicle, exact = one_rate(CORNERS[name], smooth=1e-3).load(), casadi.Function("f", [x, u], [CORNERS[name]])
    for point in POINTS:
        assert vehicle.rates([point[0]], [point[1]], [])[0] == pytest.approx(float(exact(*point)), abs=1e-2)


def test_what_equations_do_not_have():
    with pytest.raises(rhec.Error, match="CasADi's operation 'erf'"):
        one_rate(casadi.erf(x))
    with pytest.raises(rhec.Error, match=r"the shape \(2, 1\)"):
        one_rate(casadi.vertcat(x, u))


def test_parts_that_are_used_twice_are_computed_once():
    deep = x
    for _ in range(60):
        deep = casadi.sin(deep) * deep  # as a tree it would have 2^60 parts
    vehicle, exact = one_rate(deep).load(), casadi.Function("f", [x], [deep])
    assert vehicle.rates([0.7], [0.0], [])[0] == pytest.approx(float(exact(0.7)), rel=1e-12)


def test_vectors_of_casadi():
    state = casadi.SX.sym("s", 2)
    matrix = casadi.SX([[0.0, 1.0], [-2.0, -3.0]])
    names = ["s_0", "s_1"]
    model = rhec.Model("pair", states=names, inputs=["u"], outputs=["s_0"], rates=matrix @ state + casadi.vertcat(0, u))
    numpy.testing.assert_allclose(model.load().rates([1.0, 2.0], [0.5], []), [2.0, -7.5])


def test_states_may_be_a_vector():
    x, u = casadi.SX.sym("x", 3), casadi.SX.sym("u", 2)
    rates = casadi.vertcat(u[0] * casadi.cos(x[2]), u[0] * casadi.sin(x[2]), u[1])
    model = rhec.Model("point", states=x, inputs=u, outputs=["x_0", "x_1"], rates=rates)
    assert [each.name for each in model.load().states] == ["x_0", "x_1", "x_2"]
    numpy.testing.assert_allclose(model.load().rates([0, 0, 0.3], [2, 0.5], []), [2 * numpy.cos(0.3), 2 * numpy.sin(0.3), 0.5])
    with pytest.raises(rhec.Error, match="found CasADi's MX.*write the equations with SX"):
        rhec.Model("point", states=["a"], inputs=["b"], rates=[casadi.MX.sym("a")])


def test_a_vehicle_becomes_functions():
    for name in ("bicycle_slip", "skid_steer", "tractor_trailer"):
        vehicle = rhec.Robot({"model": name}).vehicle
        made = rhec.to_casadi(vehicle)
        rng = numpy.random.default_rng(3)
        for _ in range(5):
            at = [rng.uniform(0.1, 0.5, len(variables)) for variables in (vehicle.states, vehicle.inputs, vehicle.parameters)]
            numpy.testing.assert_allclose(numpy.array(made.rates(*at)).ravel(), vehicle.rates(*at), rtol=1e-12)
            numpy.testing.assert_allclose(numpy.array(made.outputs(*at)).ravel(), vehicle.observe(at[0]), rtol=1e-12)


CASES = {
    "priors": {}, "blocks": {"blocking": {"kappa": {"name": "structured", "size": 2, "overlap": 4}, "mu": {"name": "full_horizon"}}},
    "linked blocks": {"blocking": {"kappa": {"name": "structured", "size": 3, "neighbour_sigma": 0.05}, "mu": {"name": "full_horizon"}}},
    "noise of states": {"noise.states": {"x_pos": 0.05}}, "robust": {"estimator.robust": {"outputs": ["x_gps", "y_gps"], "delta": 3}},
    "blocked inputs": {"controller.blocking": {"u2": {"name": "structured", "size": 2}}},
    "no rates of inputs": {"controller.weights.rates": None},
    "rates of both inputs": {"controller.weights.rates": {"u1": 0.1, "u2": 0.02}, "controller.rate_bounds": {"u2": [-0.4, 0.4]}},
    "substeps": {"estimator.substeps": 3, "controller.substeps": 2},
    "a heading": {"model": {"name": "bicycle_slip", "wheelbase": 1.4, "gps_offset": 0.4, "outputs": ["x_gps", "y_gps", "heading"]},
                  "noise": {"outputs": {"x_gps": 0.03, "y_gps": 0.03, "heading": 0.02}}},
}


@pytest.mark.parametrize("name", CASES)
def test_problems_are_the_same(name):
    problems = rhec.run(FIGURE8, set={**SHORT, **CASES[name]}, problems_every=45).problems
    compared = 0
    for problem in problems:
        try:
            made = rhec.to_casadi(problem)
        except rhec.Error as refusal:
            assert "window without intervals" in str(refusal)
            continue
        point = made.unpack(made.start)
        there = problem.evaluate(point["states"], point["inputs"], point["parameters"])
        assert made.objective(made.start) == pytest.approx(there["objective"], rel=1e-11)
        compared += 1
    assert compared >= 5


@pytest.mark.parametrize("kind, changes", [("rhe", {}), ("rhc", {}), ("rhc", CASES["rates of both inputs"])],
                         ids=["rhe", "rhc", "rhc with limits of rates"])
def test_solutions_are_the_same(kind, changes):
    problem = [each for each in rhec.run(FIGURE8, set={**SHORT, **changes}, problems_every=40).problems if each.kind == kind][1]
    theirs, ours = rhec.to_casadi(problem).solve("ipopt", **QUIET), problem.solve("sparse_sqp")
    assert theirs["stats"]["success"] and ours.status == "solved"
    assert theirs["objective"] == pytest.approx(ours.objective, rel=1e-6)
    numpy.testing.assert_allclose(theirs["states"], ours.states, atol=1e-4)
    numpy.testing.assert_allclose(theirs["inputs"], ours.inputs, atol=1e-3)


def test_what_is_not_handed_over():
    problems = rhec.run(ROOT / "scenarios" / "obstacles.yaml", problems_every=100000).problems
    with pytest.raises(rhec.Error, match="no problem with terms"):
        rhec.to_casadi(next(each for each in problems if each.kind == "rhc"))


def test_a_slow_peer_is_told_apart():
    """The comparison of docs/python.md: the same problem, timed alike."""
    problem = [each for each in rhec.run(FIGURE8, set=SHORT, problems_every=40).problems if each.kind == "rhc"][1]
    made = rhec.to_casadi(problem)
    start = time.perf_counter()
    made.solve("ipopt", **QUIET)
    theirs = time.perf_counter() - start
    assert 0.0 < problem.solve("gn_rti", mode="converge").seconds < theirs


def test_terms_of_casadi(tmp_path):
    """A limit and a cost, with bounds that have corners, without a compiler and with one; as sympy has them."""
    speed, rate, most, along = (casadi.SX.sym(name) for name in ("ground_speed", "heading_rate", "most", "arc_length"))
    with pytest.raises(rhec.Error, match="limits: g: .*no derivative everywhere"):
        rhec.Term("wrong", limits={"g": (0, casadi.fabs(speed), 1)})
    with pytest.raises(rhec.Error, match="costs: c: 'spede' is not known"):
        rhec.Term("wrong", costs={"c": casadi.SX.sym("spede")})
    term = rhec.Term("both", options={most: 2.0}, costs={"smooth": {"term": casadi.fmax(rate, 0), "weight": 1e-3}},
                     limits={"side": (-most, speed * rate, casadi.fmin(most, 5)),
                             "zone": (None, speed, casadi.if_else(casadi.logic_and(along > 20, along < 40), 3, casadi.inf))}, smooth=0.01)
    changes = {**SHORT, "controller.solver": {"name": "gn_rti", "iterations": 5, "residual": 0.01}}
    loaded, built = (rhec.run(FIGURE8, set={**changes, "controller.terms": [each]}) for each in (term.load(), term.build(tmp_path)))
    assert loaded.completed
    numpy.testing.assert_allclose(loaded.steps["u1"], built.steps["u1"], rtol=1e-9)
    texts = rhec.Term("texts", options={"most": 2.0}, costs={"smooth": {"term": "smooth_max(heading_rate, 0, 0.01)", "weight": 1e-3}},
                      limits={"side": ("-most", "ground_speed * heading_rate", "min(most, 5)"),
                              "zone": (None, "ground_speed", "where(arc_length - 20, where(40 - arc_length, 3, infinity), infinity)")})
    same = rhec.run(FIGURE8, set={**changes, "controller.terms": [texts]})
    numpy.testing.assert_allclose(loaded.steps["u1"], same.steps["u1"], rtol=1e-9)
    free = rhec.run(FIGURE8, set=changes)
    assert loaded.steps.rows > free.steps.rows
