"""Plugins, options, models, and what is said of mistakes."""
import json
import subprocess

import numpy
import pytest
import rhec
from shared import CLI, ROOT


def test_the_same_plugins_as_the_command_line():
    told = json.loads(subprocess.run([CLI, "plugins", "--json"], check=True, capture_output=True, text=True).stdout)
    expected = {(each["kind"], each["name"], each["version"]) for each in told if "refusal" not in each}
    table = rhec.plugins()
    assert set(zip(table["kind"], table["name"], table["version"])) == expected
    assert len(expected) > 15 and table.rows == len(expected)


def test_options_of_plugins_and_sections():
    told = json.loads(subprocess.run([CLI, "plugins", "gn_rti", "--json"], check=True, capture_output=True, text=True).stdout)
    table = rhec.options("gn_rti")
    assert list(table["name"]) == [each["name"] for each in told[0]["options"]]
    assert "horizon" in list(rhec.options("estimator")["name"])
    assert "speed" in list(rhec.options()["name"])
    assert list(rhec.options("estimator.horizon")["name"]) == ["estimator.horizon"]
    assert {"estimator.horizon", "controller.horizon"} <= {*rhec.options("horizon")["name"]}
    for wrong, right in (("gnrti", "gn_rti"), ("estimater", "estimator"), ("estimator.horizn", "estimator.horizon"), ("corridr", "corridor")):
        with pytest.raises(rhec.Error, match=f"there is no section, key or plugin '{wrong}'; did you mean '{right}'"):
            rhec.options(wrong)
    with pytest.raises(rhec.Error, match="there is no .* plugin 'xyzzy'"):
        rhec.options("xyzzy")
    assert "wheelbase" in list(rhec.options(str(ROOT / "examples" / "vehicles" / "bicycle.yaml"))["name"])
    with pytest.raises(rhec.Error, match="gn_rti"):
        rhec.options("gn_rtti", kind="solver")
    with pytest.raises(rhec.Error, match="expected one of model"):
        rhec.options("gn_rti", kind="engine")


def test_refused_plugins_say_why(tmp_path):
    (tmp_path / "broken.so").write_bytes(b"no library")
    table = rhec.plugins(plugin_path=tmp_path, refused=True)
    refusals = [text for path, text in zip(table["path"], table["refusal"]) if path.endswith("broken.so")]
    assert len(refusals) == 1 and "not an ELF file" in refusals[0]
    assert rhec.plugins(plugin_path=tmp_path).rows == rhec.plugins().rows


def test_vehicles_are_evaluated():
    vehicle = rhec.Robot({"model": {"name": "bicycle_slip", "wheelbase": 2.0}}).vehicle
    state, inputs, slip = numpy.array([1.0, 2.0, 0.3, 0.1]), numpy.array([3.0, 0.2]), numpy.array([0.8, 0.9])
    speed = 0.8 * 3.0
    expected = [speed * numpy.cos(0.3), speed * numpy.sin(0.3), speed / 2.0 * numpy.tan(0.9 * 0.1), 0.2]
    numpy.testing.assert_allclose(vehicle.rates(state, inputs, slip), expected, rtol=1e-14)
    rows = vehicle.rates(numpy.tile(state, (5, 1)), inputs, slip)
    assert rows.shape == (5, 4)
    numpy.testing.assert_allclose(rows, numpy.tile(expected, (5, 1)), rtol=1e-14)
    after, jacobian = vehicle.integrate(state, inputs, slip, 0.1, substeps=4, with_jacobian=True)
    z, step = numpy.concatenate([state, inputs, slip]), 1e-6
    for column in range(8):
        shifted = z.copy()
        shifted[column] += step
        moved = vehicle.integrate(shifted[:4], shifted[4:6], shifted[6:], 0.1, substeps=4)
        numpy.testing.assert_allclose((moved - after) / step, jacobian[:, column], atol=1e-5)
    with pytest.raises(rhec.Error, match="found 2 rows, expected 5"):
        vehicle.rates(numpy.tile(state, (5, 1)), numpy.tile(inputs, (2, 1)), slip)
    for wrong in ({"duration": 0.0}, {"duration": 0.1, "substeps": 0}):
        with pytest.raises(rhec.Error, match="expected"):
            vehicle.integrate(state, inputs, slip, **wrong)


def test_variables_say_what_they_are():
    vehicle = rhec.Robot({"model": "bicycle_slip", "bounds": {"delta": [-0.5, 0.4]}}).vehicle
    delta = vehicle.states[3]
    assert (delta.name, delta.unit, delta.lower, delta.upper, delta.is_angle) == ("delta", "rad", -0.5, 0.4, False)
    assert vehicle.parameters[0].nominal == 1.0 and "slip" in vehicle.parameters[0].meaning
    assert vehicle.roles["speed_factor"] == "kappa" and vehicle.instruction_sets[-1] != ""


def test_checks_of_models():
    checked = rhec.check("bicycle_slip")
    assert not checked.failed and "derivatives" in list(checked.findings["check"])
    assert rhec.check(str(ROOT / "examples" / "vehicles" / "bicycle.yaml")).details["model"] == "bicycle"
    with pytest.raises(rhec.Error, match="did you mean|there is no model"):
        rhec.check("bicycle")
