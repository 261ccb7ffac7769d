"""Sweeps: parallel, resumed, stopped; and the tuning of a controller."""
import os
import signal
import sqlite3
import threading

import numpy
import pytest
import rhec
from shared import FIGURE8, SHORT

GRID = {"name": "two by two", "scenario": str(FIGURE8), "set": {"path": {"name": "figure8", "laps": 1}},
        "grid": {"speed": [8, 10], "seed": [1, 2], "blocking.kappa": [{"name": "full_horizon"}]}}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return rhec.sweep(GRID, tmp_path_factory.mktemp("sweep") / "grid.sqlite", threads=2)


def test_runs_of_a_grid(swept):
    assert swept.made == 4 and swept.runs.rows == 4 and swept.name == "two by two"
    assert sorted(zip(swept.runs["speed"], swept.runs["seed"])) == [(8, 1), (8, 2), (10, 1), (10, 2)]
    assert "blocking.kappa.name" not in swept.runs  # what is the same for all is no column
    assert set(swept.runs["status"]) == {"completed"}
    alone = rhec.run(FIGURE8, set={**SHORT, "seed": 2, "blocking.kappa": {"name": "full_horizon"}, "path": {"name": "figure8", "laps": 1}})
    at = (swept.runs["speed"] == 10) & (swept.runs["seed"] == 2)
    assert swept.runs["mae.kappa"][at][0] == alone.summary["mae"]["kappa"]


def test_what_is_there_is_not_made_again(swept):
    again = rhec.sweep(GRID, swept.file)
    assert again.made == 0 and again.runs.rows == 4
    numpy.testing.assert_array_equal(again.runs["mae.kappa"], swept.runs["mae.kappa"])
    wider = rhec.sweep({**GRID, "grid": {**GRID["grid"], "seed": [1, 2, 3]}}, swept.file)
    assert wider.made == 2 and wider.runs.rows == 6


def test_a_sweep_goes_to_pandas(swept):
    pytest.importorskip("pandas")
    assert swept.to_pandas().groupby("speed")["mae.kappa"].mean().shape == (2,)


def test_columns_where_keys_are_missing(tmp_path):
    blocks = [{"name": "full_horizon"}, {"name": "structured", "size": 2}, {"name": "structured", "size": 3, "overlap": 4}]
    grid = {"scenario": str(FIGURE8), "set": {"path": {"name": "figure8", "laps": 1, "radius": 8}, "speed": 10},
            "grid": {"blocking.kappa": blocks, "estimator.horizon": [3, 12], "noise.adapt": [True, False],
                     "estimator.robust": [None, {"outputs": ["x_gps", "y_gps"]}]}}
    runs = rhec.sweep(grid, tmp_path / "blocks.sqlite", threads=2).runs
    assert runs.rows == 24
    size, overlap = runs["blocking.kappa.size"], runs["blocking.kappa.overlap"]
    assert size.dtype == overlap.dtype == float  # NaN where a blocking has no size
    assert numpy.isnan(size).sum() == 8 and (size == 2).sum() == (size == 3).sum() == (overlap == 4).sum() == 8
    assert runs["noise.adapt"].dtype == bool and runs["noise.adapt"].sum() == 12
    assert runs["estimator.horizon"].dtype == int
    assert list(runs["estimator.robust.outputs"]).count(None) == list(runs["estimator.robust.outputs"]).count('["x_gps", "y_gps"]') == 12
    # A run that is refused (an overlap that is longer than the horizon) has no measures.
    refused = runs["status"] == "refused"
    assert refused.sum() == 4
    for name in ("nees", "mae.kappa", "rmse.position"):
        assert runs[name].dtype == float and (numpy.isnan(runs[name]) == refused).all(), name


def test_ctrl_c_while_values_are_looked_at(tmp_path):
    """Of a grid with so many values that looking at them takes longer than anybody waits: no run was made yet."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    told = []

    def interrupt(share, text):
        if not told:
            os.kill(os.getpid(), signal.SIGINT)
        told.append(text)

    with pytest.raises(KeyboardInterrupt):
        rhec.sweep({"scenario": str(FIGURE8), "grid": {"seed": list(range(20000))}}, tmp_path / "many.sqlite", progress=interrupt)
    assert set(told) <= {"", "looking at values"} and not (tmp_path / "many.sqlite").exists()


def test_ctrl_c_keeps_what_was_made(tmp_path):
    many = {**GRID, "grid": {"speed": [10], "seed": {"from": 1, "to": 500, "step": 1}}}
    file = tmp_path / "many.sqlite"
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    timer = threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        rhec.sweep(many, file, threads=2)
    timer.join()
    with sqlite3.connect(file) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    few = {**many, "grid": {"speed": [10], "seed": [1, 2]}}
    assert rhec.sweep(few, file).made < 2  # at least one was there


def test_a_failing_progress_ends_a_sweep(tmp_path):
    def fail(share, text):
        raise ZeroDivisionError("by the caller")

    many = {**GRID, "grid": {"speed": [10], "seed": {"from": 1, "to": 500, "step": 1}}}
    with pytest.raises(ZeroDivisionError, match="by the caller"):
        rhec.sweep(many, tmp_path / "many.sqlite", threads=2, progress=fail)
    with pytest.raises(TypeError, match="takes 1 positional argument") as caught:
        rhec.sweep(many, tmp_path / "many.sqlite", threads=2, progress=lambda share: None)
    assert not isinstance(caught.value, rhec.Error)  # the mistake is the caller's own
    few = {**many, "grid": {"speed": [10], "seed": [1, 2]}}
    assert rhec.sweep(few, tmp_path / "many.sqlite").runs.rows == 2


def test_ctrl_c_stops_the_tuning_of_a_controller():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        rhec.tune_controller(FIGURE8, set=SHORT, seeds=3, evaluations=1000, threads=2)
    timer.join()


def test_mistakes_in_sweeps(tmp_path):
    with pytest.raises(rhec.Error) as caught:
        rhec.sweep({**GRID, "grid": {"sped": [1]}}, tmp_path / "x.sqlite")
    assert "sped" in str(caught.value)
    assert not (tmp_path / "x.sqlite").exists()
    broken = tmp_path / "broken.sqlite"
    broken.write_text("no database")
    with pytest.raises(rhec.Error, match="broken.sqlite"):
        rhec.sweep(GRID, broken)
    assert broken.read_text() == "no database"


def test_tuning_a_controller():
    tuning = rhec.tune_controller(FIGURE8, set=SHORT, seeds=1, judges=2, evaluations=5, threads=2, most_seconds=4.0)
    assert tuning.numbers.rows > 2 and "controller" in tuning.yaml
    with pytest.raises(rhec.Error, match="cases: 'slow'"):
        rhec.tune_controller(FIGURE8, cases={"slow": 3})
