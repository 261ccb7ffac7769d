"""Vehicles that are written with sympy's terms."""
import pathlib

import numpy
import pytest
import rhec
from shared import FIGURE8, ROOT, SHORT

sympy = pytest.importorskip("sympy")

NAMES = "x_pos y_pos beta delta u1 u2 kappa mu wheelbase gps_offset"
X, Y, BETA, DELTA, U1, U2, KAPPA, MU, WHEELBASE, OFFSET = sympy.symbols(NAMES)
LIMIT = 35 * numpy.pi / 180


def bicycle(**more):
    """models/bicycle_slip."""
    speed = sympy.Symbol("speed")
    keys = dict(
        source="Kraus et al. 2013",
        states={X: {"unit": "m", "typical": 10, "role": "position_x"}, Y: {"unit": "m", "typical": 10, "role": "position_y"},
                BETA: {"unit": "rad", "angle": True, "role": "heading"},
                DELTA: {"unit": "rad", "typical": 0.3, "bounds": [-LIMIT, LIMIT]}},
        inputs={U1: {"unit": "m/s", "typical": 5, "role": "speed"}, U2: {"unit": "rad/s", "typical": 0.3, "bounds": [-LIMIT, LIMIT]}},
        parameters={KAPPA: {"typical": 0.5, "bounds": [0, 1], "role": "speed_factor"}, MU: {"typical": 0.5, "bounds": [0, 1]}},
        outputs={"x_gps": {"unit": "m", "typical": 10}, "y_gps": {"unit": "m", "typical": 10},
                 "delta": {"unit": "rad", "typical": 0.3, "angle": True}},
        options={WHEELBASE: {"default": 1.4, "unit": "m", "above": 0}, OFFSET: {"default": 0.4, "unit": "m"}},
        definitions={speed: KAPPA * U1},
        rates={X: speed * sympy.cos(BETA), Y: speed * sympy.sin(BETA), BETA: speed / WHEELBASE * sympy.tan(MU * DELTA), DELTA: U2},
        measured={"x_gps": X - OFFSET * sympy.cos(BETA), "y_gps": Y - OFFSET * sympy.sin(BETA)})
    return rhec.Model("bicycle", **{**keys, **more})


def one_rate(term, **more):
    """A model whose only rate is a term of x and u."""
    return rhec.Model("one", states=["x"], inputs=["u"], outputs=["x"], rates=[term], **more)


x, u = sympy.symbols("x u")


def test_a_model_is_what_the_plugin_is():
    ours = rhec.run(FIGURE8, set={**SHORT, "model": bicycle()})
    theirs = rhec.run(FIGURE8, set=SHORT)
    assert ours.completed
    for name in ("kappa", "mu", "x_pos", "tracking"):
        numpy.testing.assert_allclose(ours.steps[name], theirs.steps[name], atol=1e-9)


def test_models_are_loaded_with_options():
    vehicle = bicycle().with_options(wheelbase=2.0, outputs=["x_gps", "delta"]).load()
    assert [each.name for each in vehicle.outputs] == ["x_gps", "delta"] and vehicle.roles["speed"] == "u1"
    rates = vehicle.rates([0, 0, 0, 0.1], [2.0, 0.0], [1.0, 1.0])
    assert rates[2] == pytest.approx(2.0 / 2.0 * numpy.tan(0.1))
    with pytest.raises(rhec.Error, match="wheelbase"):
        bicycle().with_options(wheelbase=-1.0).load()


def test_the_text_is_a_file_with_equations(tmp_path):
    file = tmp_path / "vehicle.yaml"
    file.write_text(bicycle().yaml())
    assert not rhec.check(str(file)).failed
    assert "beta' = speed * tan(delta * mu) / wheelbase" in file.read_text()  # definitions keep their names
    found = [[each for each in checked.details["findings"] if each["check"] != "time"]
             for checked in (rhec.check(bicycle()), rhec.check(str(file)))]
    assert found[0] == found[1] and len(found[0]) > 5


def test_the_formula_comes_back():
    rates, outputs = rhec.to_sympy(bicycle())
    real = {symbol: sympy.Symbol(symbol.name, real=True) for symbol in (X, BETA, KAPPA, U1, MU, DELTA)}
    expected = (KAPPA * U1 / 1.4 * sympy.tan(MU * DELTA)).subs(real)
    values = {symbol: 0.1 * (i + 1) for i, symbol in enumerate(real.values())}
    assert float((rates["beta"] - expected).subs(values)) == pytest.approx(0.0, abs=1e-15)
    assert float((outputs["x_gps"] - (X - 0.4 * sympy.cos(BETA)).subs(real)).subs(values)) == pytest.approx(0.0, abs=1e-15)


POINTS = [(x, u) for x in (-1.7, -0.4, 0.3, 1.2) for u in (-0.9, 0.2, 0.8)]
TERMS = [
    x + u, x - u, -x - u, -(x + u), x * u, -x * u, x / u, -x / (u * (x + 3)), (x + u) / (x - u - 7), x**2, -x**2, (-x)**2, x**-2,
    (x + u)**3, sympy.sqrt(x**2 + 1), 1 / sympy.sqrt(x**2 + 1), (x**2 + 1)**sympy.Rational(3, 2), (x**2 + 1)**u, 2**x, sympy.exp(-x),
    sympy.log(x**2 + 1), sympy.sin(x) * sympy.cos(u), sympy.tan(x / 3), sympy.asin(u / 2), sympy.acos(u / 2), sympy.atan(x),
    sympy.atan2(x, u), sympy.tanh(x), sympy.sinh(x), sympy.cosh(u), sympy.sec(x / 2), sympy.cot(u), sympy.Rational(2, 3) * x,
    -sympy.Rational(2, 3) * x, 1.5 * x - 1e-7 * u, sympy.pi * x, sympy.E**x, sympy.Integer(3) + 0 * x, x * (u - 1) * (x - 2), x - (u - 1),
    x - (1 - u) * 2, (x - 1) / 2 / u, x**(-sympy.Rational(1, 1)) + 5, sympy.sqrt(2) * x, -(-x), x * -u, 3 - 2 * x, (x + 1)**2 / (u - 3)**2,
    rhec.smooth_abs(x, 0.1), rhec.smooth_max(x, u, 0.1), rhec.smooth_min(x, u, 0.1),
]


@pytest.mark.parametrize("term", TERMS, ids=str)
def test_terms_keep_their_values(term):
    vehicle = one_rate(term).load()
    exact = sympy.lambdify((x, u), term, "math")
    for point in POINTS:
        assert vehicle.rates([point[0]], [point[1]], [])[0] == pytest.approx(exact(*point), rel=1e-12, abs=1e-12)


SMOOTHED = [sympy.Abs(x), sympy.Max(x, u), sympy.Min(x, u, 0), sympy.sign(x), sympy.Heaviside(x),
            sympy.Piecewise((x, x > u), (2 * u, True)), sympy.Piecewise((0, x < -1), (x, x <= 1), (u, True)),
            sympy.Piecewise((1, (x > -1) & (x < 1)), (0, True))]


@pytest.mark.parametrize("term", SMOOTHED, ids=str)
def test_corners_are_refused_or_smoothed(term):
    with pytest.raises(rhec.Error, match="no derivative everywhere; write rhec.smooth_abs") as caught:
        one_rate(term)
    assert "smooth=WIDTH" in str(caught.value)
    vehicle = one_rate(term, smooth=1e-3).load()
    exact = sympy.lambdify((x, u), term)
    for point in POINTS:  # none lies within a width of a corner
        assert vehicle.rates([point[0]], [point[1]], [])[0] == pytest.approx(float(exact(*point)), abs=1e-2)


@pytest.mark.parametrize("term, word", [
    (sympy.gamma(x), "do not have the function 'gamma'"), (sympy.I * x, "real, finite"), (sympy.oo + 0 * x, "finite"),
    (sympy.Piecewise((x, x > 0)), "all other cases"), (sympy.Symbol("y dot"), "letters, digits"), (sympy.Symbol("speed"), "'speed'"),
    (sympy.Piecewise((x, sympy.Ne(x, 0)), (0, True)), "no smooth form"),
])
def test_what_equations_do_not_have(term, word):
    with pytest.raises(rhec.Error, match=word):
        one_rate(term, smooth=0.1).load()


@pytest.mark.parametrize("given", [None, lambda: 0, object(), [1.0]])
def test_what_is_no_term(given):
    with pytest.raises(rhec.Error, match=f"an object of the class '{type(given).__name__}' as an equation, expected a term of sympy"):
        one_rate(given)


def test_what_is_not_evaluated():
    with pytest.raises(rhec.Error, match=r"not evaluated; write term.doit\(\)"):
        one_rate(sympy.Derivative(sympy.sin(x), x))
    assert one_rate(sympy.Derivative(sympy.sin(x), x).doit()).load().rates([0.0], [0.0], [])[0] == 1.0


def test_the_name_of_a_plugin(tmp_path):
    model = rhec.Model("my own / vehicle", states=[x], inputs=[u], outputs=["x"], rates=[u])
    assert model.load().name == "my own / vehicle"
    with pytest.raises(rhec.Error, match="build: the model's name is 'my own / vehicle'; a plugin takes letters"):
        model.build(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_sum_that_is_long_and_one_that_is_deep():
    long = sum(sympy.sin(k * x + u) for k in range(1, 200))
    deep = x
    for _ in range(60):
        deep = sympy.sin(deep) + u
    for term in (long, deep):
        vehicle = one_rate(term).load()
        exact = sympy.lambdify((x, u), term, "math")
        assert vehicle.rates([0.3], [0.2], [])[0] == pytest.approx(exact(0.3, 0.2), rel=1e-9)


def test_dynamic_symbols_and_derivatives():
    from sympy.physics.mechanics import dynamicsymbols

    q, v = dynamicsymbols("q v")
    model = rhec.Model("spring", states=[q, v], inputs=["force"], outputs=["acceleration", "q"],
                       rates={q: v, v: sympy.Symbol("force") - 4 * q}, measured={"acceleration": v.diff()})
    vehicle = model.load()
    numpy.testing.assert_allclose(vehicle.rates([1.0, 2.0], [0.5], []), [2.0, -3.5])


def test_matrices_and_texts():
    force = sympy.Symbol("force")
    state = sympy.Matrix(sympy.symbols("a b c"))
    matrix = sympy.Matrix([[0, 1, 0], [0, 0, 1], [-1, -2, -3]])
    vehicle = rhec.Model("chain", states=list(state), inputs=[force], outputs=["a"], rates=matrix * state).load()
    numpy.testing.assert_allclose(vehicle.rates([1, 2, 3], [0], []), [2, 3, -14])
    assert one_rate("u - x^2").load().rates([2.0], [1.0], [])[0] == -3.0


def test_twelve_states_of_a_paper():
    """A quadrotor: position, Euler angles, velocities, rates of turn; Newton and Euler with a rotation matrix."""
    p = sympy.symbols("px py pz")
    phi, theta, psi = sympy.symbols("phi theta psi")
    velocity = sympy.Matrix(sympy.symbols("vx vy vz"))
    omega = sympy.Matrix(sympy.symbols("wx wy wz"))
    thrust, *torques = sympy.symbols("thrust tx ty tz")
    inertia = sympy.diag(0.02, 0.02, 0.04)
    turn = sympy.rot_axis3(-psi) * sympy.rot_axis2(-theta) * sympy.rot_axis1(-phi)
    rates_of_angles = sympy.Matrix([[1, sympy.sin(phi) * sympy.tan(theta), sympy.cos(phi) * sympy.tan(theta)],
                                    [0, sympy.cos(phi), -sympy.sin(phi)],
                                    [0, sympy.sin(phi) / sympy.cos(theta), sympy.cos(phi) / sympy.cos(theta)]]) * omega
    acceleration = turn * sympy.Matrix([0, 0, thrust / sympy.Float(1.2)]) - sympy.Matrix([0, 0, 9.81])
    turning = inertia.inv() * (sympy.Matrix(torques) - omega.cross(inertia * omega))
    model = rhec.Model("quadrotor", states=[*p, phi, theta, psi, *velocity, *omega], inputs=[thrust, *torques],
                       outputs=["px", "py", "pz"], rates=[*velocity, *rates_of_angles, *acceleration, *turning])
    vehicle = model.load()
    hover = vehicle.rates(numpy.zeros(12), [1.2 * 9.81, 0, 0, 0], [])
    numpy.testing.assert_allclose(hover, numpy.zeros(12), atol=1e-12)
    tilted = vehicle.rates([0, 0, 0, 0.1, 0.2, 0.3, 1, 2, 3, 0.4, 0.5, 0.6], [12.0, 0.01, 0.02, 0.03], [])
    symbols = [*p, phi, theta, psi, *velocity, *omega, thrust, *torques]
    values = dict(zip(symbols, [0, 0, 0, 0.1, 0.2, 0.3, 1, 2, 3, 0.4, 0.5, 0.6, 12.0, 0.01, 0.02, 0.03]))
    expected = [float(term.subs(values)) for term in (*velocity, *rates_of_angles, *acceleration, *turning)]
    numpy.testing.assert_allclose(tilted, expected, rtol=1e-12)


@pytest.mark.parametrize("keys, word", [
    (dict(states=["x", "x"], inputs=["u"], rates=["u", "u"]), "'x' is there twice"),
    (dict(states=["x"], inputs=["u"], rates=["u", "u"]), "found 2 terms, expected 1: x"),
    (dict(states=["x"], inputs=["u"], rates={"z": "u"}), "'z' is none of the states"),
    (dict(states=[3], inputs=["u"], rates=["u"]), "found 3 as the name"),
    (dict(states="xy", inputs=["u"], rates=["u"]), "states: found 'xy', expected a dict"),
    (dict(states=["x"], inputs=["u"], rates=3), "rates: found 3, expected a dict"),
    (dict(states=["x"], inputs=["u"], rates=[sympy.Symbol("z") + u]), "rates: x: 'z' is not known; expected one of u, x"),
    (dict(states=["x"], inputs=["u"], rates=[sympy.Abs(u)]), "the model 'wrong': rates: x: .*no derivative everywhere"),
    (dict(states=["x"], inputs=["u"], rates=["u"], smooth=0.0), "smooth: found 0.0, expected a width"),
])
def test_mistakes_in_models(keys, word):
    with pytest.raises(rhec.Error, match=word):
        rhec.Model("wrong", **keys)


@pytest.mark.parametrize("keys, word", [
    (dict(rates=["u +"]), r"the model 'wrong': equations.equations: .*found the end of the line, expected a number.* \(in the equation of x'\)"),
    (dict(rates=["z"]), r"the model 'wrong': .*'z' is not known; did you mean 'u'\? \(in the equation of x'\)"),
    (dict(rates=["abs(u)"]), "there is no function 'abs'; it has no derivative at 0; use smooth_abs"),
    (dict(rates=["u"], measured={"y": "x y"}, outputs=["y"]), r"found 'y', expected an operator .* \(in the equation of y\)"),
    (dict(rates=["d"], definitions={"d": "e"}), r"'e' is not known; .* \(in the equation of d\)"),
    (dict(rates=["u"], straight_motion={"u": "speed"}), r"the model 'wrong': equations.straight_motion: .*'speed' is not known; did you mean 'ground_speed'"),
])
def test_mistakes_in_texts_of_models(keys, word):
    model = rhec.Model("wrong", **{"states": ["x"], "inputs": ["u"], "outputs": ["x"], **keys})
    with pytest.raises(rhec.Error, match=word):
        model.load()


@pytest.mark.parametrize("term, found", [
    ("2 * (u - 3 * v", "line 2, column 10: this '(' is not closed: found the end, expected an operator or ')' (in the equation of v')\n"
                       "    v' = 2 * (u - 3 * v\n             ^"),
    ("2 * u - * v", "line 2, column 14: found '*', expected a number, a name or '(' (in the equation of v')\n    v' = 2 * u - * v\n                 ^"),
    ("2 u", "line 2, column 8: found 'u', expected an operator or the end of the line; a product is written with '*' (in the equation of v')"),
    ("2 * q", "line 2, column 10: 'q' is not known; did you mean 'u'? (in the equation of v')\n    v' = 2 * q\n             ^"),
    ("u ** 2", "write a power as x^2"),
    ("", "line 2, column 6: found the end of the line, expected a number, a name or '('"),
])
def test_mistakes_in_texts_name_equation_line_and_column(term, found, tmp_path):
    model = rhec.Model("wrong", states=["x", "v"], inputs=["u"], outputs=["x"], rates={"x": "v", "v": term})
    for use in (model.load, model.check, lambda: model.build(tmp_path / "built"), lambda: rhec.Robot({"model": model})):
        with pytest.raises(rhec.Error) as caught:
            use()
        assert found in str(caught.value) and caught.value.key.endswith("equations.equations")
    file = tmp_path / "wrong.yaml"
    file.write_text(model.yaml())
    line = 1 + [each.strip() for each in file.read_text().splitlines()].index(f"v' = {term}".strip())
    with pytest.raises(rhec.Error) as caught:
        rhec.Robot({"model": {"equations": str(file)}})
    assert f" {file}:{line}:" in str(caught.value)
    assert (caught.value.file, caught.value.line, caught.value.key) == (str(file), line, "model")


def test_a_key_that_is_not_known():
    with pytest.raises(rhec.Error, match="units") as caught:
        rhec.Model("one", states={"x": {"units": "m"}}, inputs=["u"], outputs=["x"], rates=["u"]).load()
    assert caught.value.key and "states.x" in caught.value.key


def test_a_model_becomes_a_plugin(tmp_path, monkeypatch):
    checked = []
    check = rhec._rhec.check
    monkeypatch.setattr(rhec._rhec, "check", lambda *arguments: checked.append(arguments) or check(*arguments))
    built = bicycle().build(tmp_path / "built", instruction_sets=["generic"])
    assert len(checked) == 1  # of what is compiled, before it is
    assert not built.check.failed
    assert built.check is built.check and len(checked) == 2
    header = next(pathlib.Path(built.folder).glob("*.hpp")).read_text()
    assert "speed" in header and "Kraus et al. 2013" in (header + "".join(f.read_text() for f in pathlib.Path(built.folder).glob("*.cpp")))
    assert built.vehicle.instruction_sets[-1] == "generic"  # compiled, not interpreted
    ours, theirs = rhec.run(FIGURE8, set={**SHORT, "model": built}), rhec.run(FIGURE8, set=SHORT)
    numpy.testing.assert_array_equal(ours.steps["kappa"], theirs.steps["kappa"])
    longer = built.with_options(wheelbase=2.0).vehicle
    assert longer.rates([0, 0, 0, 0.1], [2.0, 0.0], [1.0, 1.0])[2] == pytest.approx(numpy.tan(0.1))
    times = {file: file.stat().st_mtime_ns for file in (tmp_path / "built").iterdir() if file.suffix in (".hpp", ".cpp")}
    bicycle().build(tmp_path / "built", instruction_sets=["generic"])  # nothing has changed, nothing is written anew
    assert times == {file: file.stat().st_mtime_ns for file in times}


def test_a_build_that_fails_says_why(tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", "/no/such/compiler")
    with pytest.raises(rhec.Error, match="build.log") as caught:
        bicycle().build(tmp_path / "built")
    assert "/no/such/compiler" in str(caught.value)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(rhec.Error, match="cmake is not there"):
        bicycle().build(tmp_path / "other")


def test_a_model_that_a_check_rejects(tmp_path):
    turning = bicycle(rates={X: KAPPA * U1 * sympy.cos(BETA) * X, Y: KAPPA * U1 * sympy.sin(BETA), BETA: U1, DELTA: U2})
    assert turning.check().failed  # the dynamics depend on the position
    with pytest.raises(rhec.Error, match="symmetry"):
        turning.build(tmp_path / "turning", instruction_sets=["generic"])
    assert not (tmp_path / "turning" / "build").exists()  # nothing was compiled


def test_examples_are_the_same():
    """examples/vehicles/bicycle.yaml is this model."""
    ours = bicycle().load()
    theirs = rhec.Robot({"model": {"equations": str(ROOT / "examples" / "vehicles" / "bicycle.yaml")}}).vehicle
    point = ([1, 2, 0.3, 0.1], [2.0, 0.1], [0.8, 0.9])
    numpy.testing.assert_allclose(ours.rates(*point), theirs.rates(*point), rtol=1e-14)


def test_a_formula_that_comes_back_is_a_model_again():
    """Outputs, too, that measure the state of their name: `delta = delta` is no equation."""
    ours = bicycle().load()
    rates, outputs = rhec.to_sympy(ours)
    again = rhec.Model("again", states={each.name: {"unit": each.unit} for each in ours.states}, inputs=[each.name for each in ours.inputs],
                       parameters=[each.name for each in ours.parameters], outputs={each.name: {"unit": each.unit} for each in ours.outputs},
                       rates=rates, measured=outputs).load()
    point = ([1, 2, 0.3, 0.1], [2.0, 0.1], [0.8, 0.9])
    numpy.testing.assert_allclose(again.rates(*point), ours.rates(*point), rtol=1e-13)
    numpy.testing.assert_allclose(again.observe(point[0]), ours.observe(point[0]), rtol=1e-13)
