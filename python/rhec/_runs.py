"""Drives that are simulated or recorded, and what was estimated of them."""
from __future__ import annotations

import contextlib
import html
import json
import math
import os
import pathlib
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from . import _configuration, _rhec
from ._arguments import check_range, checked
from ._errors import Error, Names
from ._problems import Problem, problems_of
from ._progress import Bar
from ._table import Table
from ._types import Changes, Configuration, File, LogPart, PluginPath, Progress


@checked
class _Result:
    """What all results have: a summary, a picture, and files for `rhec report`."""

    def __init__(self, made: Any) -> None:
        self._made = made
        self.summary: dict[str, Any] = json.loads(made.summary_json, object_hook=Names)

    @property
    def svg(self) -> str:
        """The picture of the drive, as a text of SVG."""
        return self._made.svg()

    def save(self, folder: File) -> pathlib.Path:
        """Writes the files that the command line writes, whole or not at all; `rhec report` makes a page of them."""
        self._made.save(os.fspath(folder))
        return pathlib.Path(folder)

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self)[1:-1])}</p>{self.svg}"

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": _Kept(self._made)}


class _Kept:
    """What goes to another process of what was made in C++: the files that it writes, and what else is asked of it."""

    def __init__(self, made: Any) -> None:
        self.__dict__.update({name: getattr(made, name) for name in ("name", "completed", "ended") if hasattr(made, name)})
        with tempfile.TemporaryDirectory(prefix="rhec-") as folder:
            made.save(os.path.join(folder, "results"))
            self._files = {file.name: file.read_bytes() for file in pathlib.Path(folder, "results").iterdir()}

    def svg(self) -> str:
        return self._files["run.svg"].decode()

    def save(self, folder: str) -> None:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".rhec-", dir=folder) as aside:
            for name, content in self._files.items():
                pathlib.Path(aside, name).write_bytes(content)
            for name in self._files:
                os.replace(os.path.join(aside, name), os.path.join(folder, name))


@checked
class Run(_Result):
    """A simulated drive.

    steps: Table with a row for each sample: time [s], truth (true_NAME), estimates (NAME), standard deviations
        (sigma_NAME), inputs, reference, tracking [m], statuses, times of solves [us]
    summary: dict with the keys of summary.json (docs/results.md)
    problems: every N-th problem, if they were asked for
    """

    def __init__(self, made: _rhec.Drive, plugin_path: list[str]) -> None:
        super().__init__(made)
        self.steps = Table(made.steps())
        self.problems = problems_of("\n".join(made.problems), "run", plugin_path) if made.problems else []

    @property
    def completed(self) -> bool:
        """Whether the end of the path was reached."""
        return self._made.completed

    @property
    def ended(self) -> str:
        """Why the run ended, in words."""
        return self._made.ended

    def __repr__(self) -> str:
        return f"<run '{self._made.name}': {self.steps.rows} steps, {self.ended}>"


@checked
class SmoothedRun(_Result):
    """A simulated drive, estimated as a whole.

    steps: Table as of a Run, with the estimates of hindsight; causal: with those that drove
    report: of the solver
    """

    def __init__(self, made: _rhec.Drive) -> None:
        super().__init__(made)
        self.steps, self.causal = Table(made.steps()), Table(made.causal_steps())
        self.report = made.report

    def __repr__(self) -> str:
        return f"<smoothed run '{self._made.name}': {self.steps.rows} steps, {self.report.status}>"


@checked
class Estimates(_Result):
    """What a recorded drive was estimated to be.

    variants: by the variant's name a Table with a row for each node and fix: time [s], estimates (NAME), standard
        deviations (sigma_NAME), fixes and their residuals [m]
    reports: of a smoother, by variant, in order
    """

    def __init__(self, made: _rhec.Replays) -> None:
        super().__init__(made)
        self.variants = {name: Table(made.estimates(index)) for index, name in enumerate(made.names)}
        self.reports = made.reports

    @property
    def estimates(self) -> Table:
        """The Table of the first variant."""
        return next(iter(self.variants.values()))

    def __repr__(self) -> str:
        return f"<estimates of {', '.join(self.variants)}: {self.estimates.rows} rows>"


@checked
def run(scenario: Configuration, *, set: Changes = None, plugin_path: PluginPath = (), problems_every: int = 0,
        progress: Progress = None) -> Run:
    """Runs a scenario: a robot on simulated ground learns its slip and holds its path. Returns a Run.

    scenario: a YAML file, or the same as a dict
    set: keys to change, such as {"speed": 4, "estimator.name": "ekf"}
    problems_every: keep the problems of every N-th step, for `Run.problems`; 0: none
    progress: None for a bar on a terminal or in a notebook; True, False, or a function of (share, text)

    Ctrl-C ends it with KeyboardInterrupt, and nothing is written.
    """
    check_range("run", problems_every=(problems_every, 0, math.inf))
    settings, folders = _configuration.read(scenario, set, plugin_path)
    with Bar(progress, "run") as bar:
        return Run(_rhec.run(folders, settings, problems_every, bar), folders)


@contextlib.contextmanager
def _log_file(given: LogPart, name: str, columns: str) -> Iterator[str]:
    """The file of a log; an array becomes one."""
    if isinstance(given, (str, os.PathLike)):
        yield os.fspath(given)
        return
    import numpy

    rows = numpy.asarray(given, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise Error(f"{name}: expected a file or an array (n, 3) of {columns}")
    with tempfile.TemporaryDirectory(prefix="rhec-") as folder:
        file = os.path.join(folder, f"{name}.csv")
        numpy.savetxt(file, rows, fmt="%.17g", delimiter=",")
        yield file


@contextlib.contextmanager
def log_files(dead_reckoning: LogPart, gps: LogPart) -> Iterator[tuple[str, str]]:
    """The names of both files of a log, for as long as the context lasts."""
    with _log_file(dead_reckoning, "dead_reckoning", "time [s], wheel speed [m/s] and steering angle [rad]") as rows:
        with _log_file(gps, "gps", "time [s], x [m] and y [m]") as fixes:
            yield rows, fixes


def _log(function, scenario, log, variants, hold_out, phase, changes, plugin_path, progress, title):
    settings, folders = _configuration.read(scenario, changes, plugin_path)
    with log_files(*log) as names, Bar(progress, title) as bar:
        files = _rhec.LogFiles(*names, list(variants), hold_out, -1 if phase is None else phase)
        return Estimates(function(folders, settings, files, bar))


@checked
def estimate(scenario: Configuration, dead_reckoning: LogPart, gps: LogPart, *, variants: Sequence[str] = (), hold_out: int = 0,
             phase: int | None = None, set: Changes = None, plugin_path: PluginPath = (),
             progress: Progress = None) -> Estimates:
    """Estimates state and slip from a recorded drive, and predicts what it withholds. Returns Estimates.

    dead_reckoning: time [s], wheel speed [m/s], steering angle [rad]: a file, or an array (n, 3), NaN where missing
    gps: time [s], x [m], y [m]: likewise
    variants: names of the scenario's variants to run; all without any
    hold_out: withhold one of so many fixes, from `phase` on; 0: none
    """
    return _log(_rhec.estimate_log, scenario, (dead_reckoning, gps), variants, hold_out, phase, set, plugin_path, progress,
                "estimate")


@checked
def smooth(scenario: Configuration, dead_reckoning: LogPart | None = None, gps: LogPart | None = None, *,
           variants: Sequence[str] = (), hold_out: int = 0, phase: int | None = None, set: Changes = None,
           plugin_path: PluginPath = (), progress: Progress = None) -> Estimates | SmoothedRun:
    """Estimates a whole drive at once: every moment from what was measured before and after it.

    With the two parts of a recorded drive, as `estimate` has them, it returns Estimates, causal ones beside; without
    them it simulates the scenario's drive first and returns a SmoothedRun.
    """
    if (dead_reckoning is None) != (gps is None):
        raise Error("smooth: expected both dead_reckoning and gps, or neither")
    if gps is not None:
        return _log(_rhec.smooth_log, scenario, (dead_reckoning, gps), variants, hold_out, phase, set, plugin_path, progress,
                    "smooth")
    if variants or hold_out or phase is not None:
        raise Error("smooth: variants, hold_out and phase are those of a recorded drive; give dead_reckoning and gps, too")
    settings, folders = _configuration.read(scenario, set, plugin_path)
    with Bar(progress, "smooth") as bar:
        return SmoothedRun(_rhec.smooth_drive(folders, settings, bar))
