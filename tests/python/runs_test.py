"""Runs of scenarios: the same as those of the command line, stopped, shown, and saved."""
import concurrent.futures
import csv
import io
import json
import multiprocessing
import os
import pickle
import signal
import subprocess
import threading
import time
import warnings

import numpy
import pytest
import rhec
from shared import CLI, FIGURE8, SHORT


@pytest.fixture(scope="module")
def run():
    return rhec.run(FIGURE8, set=SHORT, problems_every=40)


@pytest.fixture(scope="module")
def of_the_command_line(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    changes = [part for key, value in SHORT.items() for part in ("--set", f"{key}={value}")]
    subprocess.run([CLI, "run", str(FIGURE8), *changes, "--out", str(folder)], check=True, capture_output=True)
    return folder


def test_steps_are_those_of_the_command_line(run, of_the_command_line):
    rows = list(csv.DictReader(io.StringIO((of_the_command_line / "steps.csv").read_text())))
    assert run.steps.rows == len(rows) > 100
    assert list(rows[0]) == [name for name in run.steps if name not in ("rhe_us", "rhc_us")]
    for name in rows[0]:
        column = run.steps[name]
        texts = [row[name] for row in rows]
        if column.dtype == bool:
            assert [str(int(value)) for value in column] == texts
        elif column.dtype.kind == "U":
            assert list(column) == texts
        else:
            numpy.testing.assert_allclose(column, [float(text or "nan") for text in texts], rtol=1e-9, atol=1e-300)


def test_saved_files_are_those_of_the_command_line(run, of_the_command_line, tmp_path):
    saved = run.save(tmp_path / "run")
    for name in ("steps.csv", "horizons.jsonl", "run.svg"):
        assert (saved / name).read_bytes() == (of_the_command_line / name).read_bytes(), name
    assert sorted(file.name for file in saved.iterdir()) == sorted(file.name for file in of_the_command_line.iterdir())
    summary = json.loads((of_the_command_line / "summary.json").read_text())
    assert run.summary["mae"] == summary["mae"]
    assert run.completed and run.ended == summary["ended"]


@pytest.mark.skipif(os.environ.get("RHEC_REPORT") == "0", reason="rhec was built without the page of reports")
def test_the_page_of_a_run(run, tmp_path):
    page = rhec.report(run)
    assert page.html.startswith("<!") and page.save(tmp_path / "page.html").stat().st_size > 100_000
    assert page._repr_html_().startswith("<iframe srcdoc=")
    again = rhec.report(run.save(tmp_path / "folder"))
    assert len(again.html) == pytest.approx(len(page.html), rel=1e-2)
    with pytest.raises(rhec.Error, match="nothing here"):
        rhec.report(tmp_path / "nothing here")


def test_how_a_run_is_shown(run):
    html = run._repr_html_()
    assert "<svg" in html and "figure8" in html
    assert run.steps._repr_html_().count("<tr>") == 11  # a head and ten rows
    assert f"{run.steps.rows} rows" in run.steps._repr_html_()
    assert repr(run).startswith("<run 'figure8'")


def test_tables_go_to_pandas(run):
    pandas = pytest.importorskip("pandas")
    frame = run.steps.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and frame.shape == (run.steps.rows, len(run.steps))
    numpy.testing.assert_array_equal(frame["kappa"].to_numpy(), run.steps["kappa"])


def test_progress_is_told():
    told = []
    rhec.run(FIGURE8, set=SHORT, progress=lambda share, text: told.append(share))
    assert told == sorted(told) and told[-1] == 1.0


def test_a_failing_progress_ends_the_run():
    def fail(share, text):
        raise ZeroDivisionError("by the caller")

    start = time.monotonic()
    with pytest.raises(ZeroDivisionError, match="by the caller"):
        rhec.run(FIGURE8, set={"path.laps": 100}, progress=fail)
    assert time.monotonic() - start < 20.0


def test_a_bar_on_a_terminal(capfd):
    rhec.run(FIGURE8, set=SHORT, progress=True)
    shown = capfd.readouterr().err
    assert "run [" in shown and "%" in shown and shown.endswith("\r\033[K")
    rhec.run(FIGURE8, set=SHORT)  # where nobody looks, nothing is shown
    assert capfd.readouterr().err == ""


def interrupt_after(seconds):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    thread = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    thread.start()
    return thread


def test_ctrl_c_stops_a_run(tmp_path):
    changes = {"path.laps": 300, "estimator.memory": {"name": "place", "file": str(tmp_path / "map.sqlite")}}
    timer = interrupt_after(0.7)
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        rhec.run(FIGURE8, set=changes)
    timer.join()
    assert time.monotonic() - start < 20.0
    assert not list(tmp_path.iterdir())
    assert rhec.run(FIGURE8, set=SHORT).completed  # and all works as before


def test_runs_in_several_threads():
    runs = []
    threads = [threading.Thread(target=lambda seed: runs.append((seed, rhec.run(FIGURE8, set={**SHORT, "seed": seed}))), args=(seed,))
               for seed in (1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(seed for seed, _ in runs) == [1, 2, 3]
    assert len({run.summary["mae"]["kappa"] for _, run in runs}) == 3


def test_a_run_that_fails_is_data(run):
    lost = rhec.run(FIGURE8, set={**SHORT, "controller.reference_speed": "literal",
                                  "terrain": {"name": "constant", "values": {"kappa": 0.05, "mu": 1.0}}})
    assert not lost.completed and "end of the path was reached" not in lost.ended and lost.steps.rows > 10


def test_mistakes_in_scenarios():
    with pytest.raises(rhec.Error, match="did you mean") as caught:
        rhec.run(FIGURE8, set={"sped": 3})
    assert caught.value.key == "sped"


def test_results_go_to_other_processes(run, tmp_path):
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as processes:
        there = processes.submit(rhec.run, FIGURE8, set=SHORT, problems_every=40).result(timeout=120)
    assert (there.completed, there.ended, repr(there), there.summary["mae"]) == (run.completed, run.ended, repr(run), run.summary["mae"])
    numpy.testing.assert_array_equal(there.steps["kappa"], run.steps["kappa"])
    assert [problem.line() for problem in there.problems] == [problem.line() for problem in run.problems]
    assert there.svg == run.svg and there._repr_html_() == run._repr_html_()
    for name in ("steps.csv", "horizons.jsonl", "run.svg"):
        assert (there.save(tmp_path / "there") / name).read_bytes() == (run.save(tmp_path / "here") / name).read_bytes()
    assert sorted(os.listdir(tmp_path / "there")) == sorted(os.listdir(tmp_path / "here"))
    smoothed = rhec.smooth(FIGURE8, set=SHORT)
    again = pickle.loads(pickle.dumps(smoothed))
    assert again.report.status == smoothed.report.status and again.svg == smoothed.svg


def test_notes_are_warnings(tmp_path):
    changes = {**SHORT, "model.outputs": ["x_gps", "y_gps"]}
    with pytest.warns(rhec.Note, match="passed over, since model.outputs leaves this sensor out") as told:
        rhec.run(FIGURE8, set=changes)
    note = told[0]
    assert len(told) == 1 and note.filename == __file__  # the line that called the package
    assert (note.message.key, note.message.file) == ("noise.outputs.delta", str(FIGURE8)) and note.message.line > 1
    with pytest.warns(rhec.Note, match="noise.outputs.delta"):
        rhec.smooth(FIGURE8, set=changes)
    with warnings.catch_warnings():
        warnings.simplefilter("error", rhec.Note)  # an error ends the run at once
        start = time.monotonic()
        with pytest.raises(rhec.Note):
            rhec.run(FIGURE8, set={**changes, "path.laps": 100})
        assert time.monotonic() - start < 20.0
        rhec.run(FIGURE8, set=SHORT)  # nothing is told where nothing is wrong


def test_a_drive_is_smoothed(run):
    smoothed = rhec.smooth(FIGURE8, set=SHORT)
    assert smoothed.report.status == "solved" and smoothed.steps.rows == run.steps.rows
    error = {name: numpy.abs(table["kappa"] - table["true_kappa"]).mean()
             for name, table in (("hindsight", smoothed.steps), ("causal", smoothed.causal))}
    assert error["hindsight"] < 0.8 * error["causal"]
    numpy.testing.assert_array_equal(smoothed.causal["kappa"], run.steps["kappa"])
    assert "<svg" in smoothed._repr_html_()
    with pytest.raises(rhec.Error, match="gps alone, expected dead reckoning"):
        rhec.smooth(FIGURE8, gps="GPS.txt")
    with pytest.raises(rhec.Error, match="those of a recorded drive"):
        rhec.smooth(FIGURE8, hold_out=5)
