"""Recorded drives: estimated, smoothed, tuned; and what is in logs."""
import json
import os
import pickle
import signal
import subprocess
import tempfile
import threading

import numpy
import pytest
import rhec
from shared import CLI, ROOT

PARK = ROOT / "scenarios" / "victoria_park.yaml"
RNG = numpy.random.default_rng(1)


def drive(seconds=60.0):
    """What a car's sensors say of a drive on a plane: dead reckoning every 0.1 s and fixes every second."""
    vehicle = rhec.Robot({"model": {"name": "bicycle_slip", "wheelbase": 2.83, "gps_offset": 0.0}}).vehicle
    state, rows, fixes = numpy.zeros(4), [], []
    for k in range(int(seconds * 10)):
        time, rate = 0.1 * k, 0.2 * numpy.cos(0.3 * 0.1 * k)
        if k % 10 == 0:
            fixes.append([time, *(state[:2] + RNG.normal(0.0, 0.05, 2))])
        rows.append([time, 3.0 + RNG.normal(0.0, 0.02), state[3] + RNG.normal(0.0, 0.01)])
        state = vehicle.integrate(state, [3.0, rate], [0.9, 0.95], 0.1)
    return numpy.array(rows), numpy.array(fixes)


@pytest.fixture(scope="module")
def log():
    return drive()


CHANGES = {"model": {"name": "bicycle_slip", "wheelbase": 2.83, "gps_offset": 0.0}, "log": None, "variants": None}


@pytest.fixture(scope="module")
def estimates(log):
    return rhec.estimate(PARK, *log, hold_out=5, set=CHANGES)


def test_estimates_of_arrays(estimates, log):
    table = estimates.estimates
    assert (table["kind"] == "fix").sum() == len(log[1]) and table["held_out"].sum() == len(log[1]) // 5
    late = table["time"] > 30.0
    assert numpy.abs(table["kappa"][late] - 0.9).mean() < 0.05
    assert numpy.nanmedian(table["residual"][table["held_out"]]) < 0.3
    assert estimates.summary["hold_out"]["every"] == 5
    assert "<svg" in estimates._repr_html_()


def test_files_give_the_same(estimates, log, tmp_path):
    files = [tmp_path / "rows.txt", tmp_path / "fixes.txt"]
    for file, rows in zip(files, log):
        numpy.savetxt(file, rows, fmt="%.17g", delimiter=",")
    again = rhec.estimate(PARK, *files, hold_out=5, set=CHANGES)
    numpy.testing.assert_array_equal(again.estimates["kappa"], estimates.estimates["kappa"])
    saved = again.save(tmp_path / "out")
    assert sorted(file.name for file in saved.iterdir()) == ["estimates.csv", "horizons.jsonl", "run.svg", "summary.json",
                                                             "times.csv"]


def test_smoothing_a_log(log):
    smoothed = rhec.smooth(PARK, *log, set=CHANGES)
    assert [report.status for report in smoothed.reports] == ["solved"]
    assert len(smoothed.variants) == 2 and any(name.endswith(" causal") for name in smoothed.variants)


def test_notes_are_warnings(log):
    with pytest.warns(rhec.Note, match="step: 1.5 s"):
        rhec.estimate(PARK, *log, set={**CHANGES, "step": 1.5})


def test_mistakes_in_logs(log, tmp_path):
    with pytest.raises(rhec.Error, match=r"gps: expected a file or an array \(n, 3\)"):
        rhec.estimate(PARK, log[0], numpy.zeros((3, 2)), set=CHANGES)
    broken = tmp_path / "broken.txt"
    broken.write_text("0,1,2\n1,two,3\n")
    with pytest.raises(rhec.Error) as caught:
        rhec.estimate(PARK, broken, log[1], set=CHANGES)
    assert caught.value.file == str(broken) and caught.value.line == 2
    with pytest.raises(rhec.Error, match="hold_out"):
        rhec.estimate(PARK, *log, hold_out=3, phase=3, set=CHANGES)


def test_what_stops_long_work_leaves_nothing(log, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        rhec.tune(PARK, *log, set=CHANGES, threads=1)
    timer.join()

    def fail(share, text):
        raise ZeroDivisionError("by the caller")

    for function in (rhec.estimate, rhec.tune):
        with pytest.raises(ZeroDivisionError, match="by the caller"):
            function(PARK, *log, set=CHANGES, progress=fail)
    assert not list(tmp_path.iterdir())


def test_tuning_on_a_log(log):
    tuning = rhec.tune(PARK, *log, set=CHANGES, threads=1, most_seconds=2.0, smoother=False, keep=["log", "estimator"])
    names = list(tuning.numbers["name"])
    assert any(name.startswith("noise.outputs") for name in names)
    assert tuning.judged.rows > 0 and "model:" in tuning.yaml
    assert "<table>" in tuning._repr_html_()


# Logs with the vehicle's own sensors.

ROBOT = ROOT / "scenarios" / "skid_steer.yaml"
SHORT = {"path.laps": 1, "seed": 3}
OUTPUTS = ["x_gps", "y_gps", "heading"]


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The file of a simulated drive, and the run."""
    file = tmp_path_factory.mktemp("driven") / "drive.csv"
    return file, rhec.run(ROBOT, set=SHORT, log=file)


@pytest.fixture(scope="module")
def replayed(driven):
    return rhec.estimate(ROBOT, driven[0], set=SHORT)


def test_a_log_gives_the_estimates_of_the_run(driven, replayed):
    run, table = driven[1], replayed.estimates
    numpy.testing.assert_allclose(table["lambda_left"], run.steps["lambda_left"][:table.rows], rtol=1e-9, atol=1e-12)
    assert set(table["health"]) <= {"ok", "degraded", "lost"}
    assert isinstance(replayed, rhec.DriveEstimates) and "<svg" in replayed.svg


def test_innovations_and_predictions_of_a_log(replayed):
    name = next(iter(replayed.variants))
    innovations, predictions = replayed.innovations[name], replayed.predictions[name]
    told = replayed.summary["variants"][name]["innovations"]
    for sensor, figures in told.items():
        of_sensor = innovations["sensor"] == sensor
        assert (of_sensor & innovations["accepted"]).sum() == figures["used"]
        assert innovations["nis"][of_sensor & innovations["accepted"]].mean() == pytest.approx(figures["nis"])
    withheld = replayed.summary["variants"][name]["held_out"]
    assert predictions.rows == withheld["count"] > 10
    assert numpy.median(predictions["distance"]) == pytest.approx(withheld["median"])


def test_tables_are_logs_too(driven, replayed):
    log = rhec.Log(driven[0])
    names = [name for name in log.fields["signal"] if name != "received"]
    table = log.read(*names)
    kappa = replayed.estimates["lambda_left"]
    for given in (table, dict(table), [dict(table)]):
        again = rhec.estimate(ROBOT, given, set=SHORT)
        numpy.testing.assert_array_equal(again.estimates["lambda_left"], kappa)
        assert again.summary["log"] == "log"
    # Each sensor with rows of its own, in no order.
    measured = ~numpy.isnan(table["x_gps"])
    inputs = ~numpy.isnan(table["omega_left"])
    parts = [{name: table[name][rows] for name in ["time", "received", *columns]}
             for rows, columns in ((inputs, ["omega_left", "omega_right"]), (measured, OUTPUTS))]
    apart = rhec.estimate(ROBOT, parts, set=SHORT, hold_out=0)
    numpy.testing.assert_allclose(apart.estimates["lambda_left"], kappa, rtol=1e-9)
    assert not next(iter(apart.predictions.values())).rows


def test_a_data_frame_is_a_log(driven, replayed):
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(driven[0])
    again = rhec.estimate(ROBOT, frame, set=SHORT)
    numpy.testing.assert_array_equal(again.estimates["lambda_left"], replayed.estimates["lambda_left"])


def test_the_command_line_says_the_same(driven, replayed, tmp_path):
    changes = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
    subprocess.run([CLI, "estimate", ROBOT, driven[0], *changes, "--out", tmp_path / "cli"], check=True, stdout=subprocess.DEVNULL)
    saved = replayed.save(tmp_path / "python")
    for file in ("estimates.csv", "innovations.csv", "predictions.csv", "run.svg"):
        assert (saved / file).read_text() == (tmp_path / "cli" / file).read_text()
    ours, theirs = (json.loads((folder / "summary.json").read_text()) for folder in (saved, tmp_path / "cli"))
    assert ours["log"] == theirs["log"] and ours["signals"] == theirs["signals"]


def test_tracks_for_other_tools(replayed, tmp_path):
    for ending in ("csv", "tum", "mcap"):
        assert replayed.save_track(tmp_path / f"track.{ending}").stat().st_size > 1000
    assert len((tmp_path / "track.tum").read_text().splitlines()) == replayed.estimates.rows
    with pytest.raises(rhec.ArgumentError, match=r"track.bag: expected a name that ends in .mcap, .csv or .tum"):
        replayed.save_track(tmp_path / "track.bag")
    there = pickle.loads(pickle.dumps(replayed))
    numpy.testing.assert_array_equal(there.estimates["time"], replayed.estimates["time"])
    assert there.svg == replayed.svg
    with pytest.raises(rhec.Error, match="another process"):
        there.save_track(tmp_path / "track.csv")


def test_hindsight_of_a_log(driven, replayed):
    smoothed = rhec.smooth(ROBOT, driven[0], set=SHORT)
    assert [report.status for report in smoothed.reports] == ["solved"]
    causal = list(smoothed.variants.values())[1]
    numpy.testing.assert_array_equal(causal["time"], smoothed.estimates["time"])
    truth = driven[1].steps["true_lambda_left"][:causal.rows]
    errors = [numpy.abs(table["lambda_left"] - truth).mean() for table in (smoothed.estimates, causal)]
    assert errors[0] < errors[1]


def test_tuning_on_a_log_of_sensors(driven):
    changes = {**SHORT, "noise.outputs.x_gps": 0.2, "noise.outputs.y_gps": 0.2}
    tuning = rhec.tune(ROBOT, driven[0], set=changes, threads=1, smoother=False, keep=["model", "signals", "estimator"], most_seconds=20.0)
    noise = dict(zip(tuning.numbers["name"], tuning.numbers["after"]))
    gps = [value for name, value in noise.items() if "x_gps" in name and "noise" in name]
    assert gps and all(value < 0.1 for value in gps)
    assert "<svg" in tuning.svg


def of_grades(seed):
    """A drive whose receiver is good to 0.03 m, and in every third five seconds to 0.8 m, as its status and its deviation say; by
    how much the position is wrong on average if all its fixes count as good, as middling, if the good ones alone count, as two
    sensors, and each as it says."""
    run, noise = rhec.run(ROOT / "scenarios" / "figure8.yaml", set={"speed": 4, "seed": seed, "path.laps": 1}), numpy.random.default_rng(seed)
    steps, rows = run.steps, run.steps.rows
    is_good = (numpy.arange(rows) // 25) % 3 != 1
    sigma = numpy.where(is_good, 0.03, 0.8)
    log = {"time": steps["time"], "status": numpy.where(is_good, 2, 1), "sd": sigma, "u1": steps["u1"], "u2": steps["u2"],
           "east": steps["true_x_pos"] - 0.4 * numpy.cos(steps["true_beta"]) + sigma * noise.normal(size=rows),
           "north": steps["true_y_pos"] - 0.4 * numpy.sin(steps["true_beta"]) + sigma * noise.normal(size=rows),
           "delta": steps["true_delta"] + 0.01 * noise.normal(size=rows)}

    def error(sigmas, fixes, **more):
        set = {"signals.outputs": {"delta": "delta", **fixes}, **{f"noise.outputs.{name}": value for name, value in sigmas.items()}, **more}
        table = rhec.estimate(ROOT / "scenarios" / "figure8.yaml", log, set=set, hold_out=0).estimates
        return numpy.hypot(*(table[name] - steps[f"true_{name}"][:table.rows] for name in ("x_pos", "y_pos")))[20:].mean()

    names = {"x_gps": "east", "y_gps": "north"}
    good = {name: {"from": column, "when": {"of": "status", "at_least": 2}} for name, column in names.items()}
    poor = {name: {"from": column, "when": {"of": "status", "at_most": 1}} for name, column in (("x_poor", "east"), ("y_poor", "north"))}
    outputs = ["x_gps", "y_gps", "delta", {"x_poor": "x_gps"}, {"y_poor": "y_gps"}]
    return {"good": error({"x_gps": 0.03, "y_gps": 0.03}, names), "middling": error({"x_gps": 0.3, "y_gps": 0.3}, names),
            "stated": error({"x_gps": 0.03, "y_gps": 0.03}, {name: {"from": column, "sigma": "sd"} for name, column in names.items()}),
            "good alone": error({"x_gps": 0.03, "y_gps": 0.03}, good),
            "two": error({"x_gps": 0.03, "y_gps": 0.03, "x_poor": 0.8, "y_poor": 0.8}, {**good, **poor}, **{"model.outputs": outputs})}


def test_a_receiver_with_two_grades_is_two_sensors():
    errors = of_grades(5)
    for way in ("two", "stated"):
        assert errors[way] < 0.8 * min(errors["good"], errors["middling"], errors["good alone"])


def of_claims(seed):
    """A drive whose receiver states how accurate each fix is, in the median 0.1 m, changing smoothly by factors of ten; by how much
    the position is wrong on average with one noise for all fixes, and with what it states, right or wrong by one factor for all."""
    run, noise = rhec.run(ROOT / "scenarios" / "figure8.yaml", set={"speed": 4, "seed": seed, "path.laps": 1}), numpy.random.default_rng(seed)
    steps, rows = run.steps, run.steps.rows
    sigma = 0.1 * numpy.exp(1.2 * numpy.convolve(noise.normal(size=rows + 40), numpy.ones(41) / numpy.sqrt(41.0), "valid")[:rows])
    log = {"time": steps["time"], "sd": sigma, "u1": steps["u1"], "u2": steps["u2"],
           "east": steps["true_x_pos"] - 0.4 * numpy.cos(steps["true_beta"]) + sigma * noise.normal(size=rows),
           "north": steps["true_y_pos"] - 0.4 * numpy.sin(steps["true_beta"]) + sigma * noise.normal(size=rows),
           "delta": steps["true_delta"] + 0.01 * noise.normal(size=rows)}

    def error(one_for_all=0.1, **stated):
        fixes = {name: {"from": column, **stated} for name, column in (("x_gps", "east"), ("y_gps", "north"))}
        set = {"signals.outputs": {"delta": "delta", **fixes}, "noise.outputs.x_gps": one_for_all, "noise.outputs.y_gps": one_for_all}
        table = rhec.estimate(ROOT / "scenarios" / "figure8.yaml", log, set=set, hold_out=0).estimates
        return numpy.hypot(*(table[name] - steps[f"true_{name}"][:table.rows] for name in ("x_pos", "y_pos")))[20:].mean()

    return {"0.1 m": error(), "0.3 m": error(0.3), "right": error(sigma="sd"),
            "too small": error(sigma="sd", sigma_scale=1.0 / 3.0), "too large": error(sigma="sd", sigma_scale=3.0)}


def test_fixes_count_by_the_accuracy_that_they_state():
    errors = of_claims(8)
    for way in ("right", "too small", "too large"):
        assert errors[way] < 0.85 * min(errors["0.1 m"], errors["0.3 m"]), way


def test_what_is_in_a_log(driven, tmp_path):
    file = tmp_path / "drive.mcap"
    rhec.run(ROBOT, set=SHORT, log=file)
    log = rhec.Log(file)
    assert list(log.topics["topic"]) == ["/rhec/measured", "/rhec/inputs"] and log.damage is None
    as_table = rhec.Log(driven[0]).read("x_gps")["x_gps"]
    assert log.topics["records"][0] == numpy.isfinite(as_table).sum()
    x = log.read("/rhec/measured:position[x_gps]", "/rhec/measured:position[heading]")
    assert list(x) == ["time", "received", "/rhec/measured:position[x_gps]", "/rhec/measured:position[heading]"]
    assert (numpy.diff(x["time"]) > 0.0).all() and (x["received"] >= x["time"]).all()
    again = pickle.loads(pickle.dumps(log))
    assert repr(again) == repr(log) and "2 topics" in repr(log) and "<table>" in log._repr_html_()
    signals = log.propose("skid_steer")
    assert set(signals["outputs"]) >= set(OUTPUTS) and set(signals["inputs"]) == {"omega_left", "omega_right"}
    assert signals.yaml.startswith("signals:") and pickle.loads(pickle.dumps(signals)) == signals
    assert log.propose(ROBOT) == signals
    assert rhec.estimate(ROBOT, log, set={**SHORT, "signals": signals}).estimates.rows > 10


def test_a_damaged_log_is_told(driven, tmp_path):
    file, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    rhec.run(ROBOT, set=SHORT, log=file)
    cut.write_bytes(file.read_bytes()[:-file.stat().st_size // 3])
    with pytest.warns(rhec.Note, match="cut.mcap"):
        log = rhec.Log(cut)
    assert "cut.mcap" in log.damage
    with pytest.warns(rhec.Note, match="cut.mcap"):
        rhec.estimate(ROBOT, log, set=SHORT)


@pytest.mark.parametrize("given, message", [
    ({"time": [0.0, 1.0], "x_gps": [1.0]}, r"columns of unlike lengths \(time: 2, x_gps: 1\)"),
    ({"time": [0.0, 1.0], "a,b": [1.0, 2.0]}, "found the column 'a,b'"),
    ({"time": [0.0, 1.0], "x_gps": ["a", "b"]}, "column 'x_gps': found an array of <U1"),
    ([{"time": [0.0]}, {"x_gps": [1.0]}], "table 1 has no column time"),
    ([{"time": [0.0], "x": [1.0]}, {"time": [1.0], "x": [1.0]}], "the column 'x' in several tables"),
    (numpy.zeros((4, 3)), "dead reckoning, without gps"),
    ({"time": [0.0, 1.0], "x_gps": [1.0, 2.0]}, "^log has no column .y_gps.; did you mean"),
    ("no_such_file.csv", "no_such_file.csv"),
])
def test_mistakes_in_tables(given, message):
    with pytest.raises(rhec.Error, match=message):
        rhec.estimate(ROBOT, given, set=SHORT)


def test_mistakes_with_logs(driven):
    log = rhec.Log(driven[0])
    with pytest.raises(rhec.ArgumentError, match="expected the name of a file, a Log, a table"):
        rhec.estimate(ROBOT, 3.5j, set=SHORT)
    with pytest.raises(rhec.Error, match="did you mean 'x_gps'"):
        log.read("x_gpz")
    with pytest.raises(rhec.ArgumentError, match="expected the names of signals"):
        log.read()
    with pytest.raises(rhec.ArgumentError, match="signals of one topic"):
        log.read("/a:x", "/b:y")
    with pytest.raises(rhec.Error, match="ends in .csv or .mcap"):
        rhec.run(ROBOT, set=SHORT, log="drive.bag")
    with pytest.raises(rhec.Error, match="gps alone"):
        rhec.smooth(ROBOT, gps=numpy.zeros((3, 3)))
