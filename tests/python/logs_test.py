"""Recorded drives: estimated, smoothed, tuned."""
import os
import signal
import tempfile
import threading

import numpy
import pytest
import rhec
from shared import ROOT

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
