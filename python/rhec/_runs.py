"""Drives that are simulated or recorded, and what was estimated of them."""
from __future__ import annotations

import html
import json
import math
import os
import pathlib
import tempfile
from collections.abc import Sequence
from typing import Any, overload

from . import _configuration, _rhec
from ._arguments import check_range, checked
from ._errors import Error, Names
from ._logs import drive_file, log_files
from ._problems import Problem, problems_of
from ._progress import Bar
from ._table import Table
from ._types import Changes, Configuration, DriveLog, File, LogPart, PluginPath, Progress


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

    variants: by the variant's name a Table of time [s], estimates (NAME) and standard deviations (sigma_NAME). Of dead reckoning
        and fixes it has a row for each node and fix, with fixes and their residuals [m]; of other logs one for each step,
        with health and its findings
    reports: of a smoother, by variant, in order
    """

    def __init__(self, made: _rhec.Replays | _rhec.DriveReplays) -> None:
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
class DriveEstimates(Estimates):
    """What a log with the vehicle's own sensors was estimated to be.

    innovations: by the variant's name a Table with a row for each measurement: time [s], sensor, accepted, nis, and by output
        what was measured minus what was expected (NAME), and the standard deviation expected of that (sigma_NAME)
    predictions: by the variant's name a Table with a row for each measurement that was withheld: time [s], distance, and by
        output what was measured minus what was predicted (residual_NAME)
    """

    def __init__(self, made: _rhec.DriveReplays) -> None:
        super().__init__(made)
        self.innovations = {name: Table(made.innovations(index)) for index, name in enumerate(made.names)}
        self.predictions = {name: Table(made.predictions(index)) for index, name in enumerate(made.names)}

    def save_track(self, file: File) -> pathlib.Path:
        """Writes the estimates of the first variant for other tools, by the ending of the file's name: .mcap (messages of ROS 2,
        for Foxglove and PlotJuggler), .csv (PlotJuggler), .tum (evo)."""
        if isinstance(self._made, _Kept):
            raise Error("save_track: these results came from another process; write the track there")
        self._made.save_track(os.fspath(file))
        return pathlib.Path(file)


@checked
def run(scenario: Configuration, *, set: Changes = None, plugin_path: PluginPath = (), problems_every: int = 0,
        log: File | None = None, progress: Progress = None) -> Run:
    """Runs a scenario: a robot on simulated ground learns its slip and holds its path. Returns a Run.

    scenario: a YAML file, or the same as a dict
    set: keys to change, such as {"speed": 4, "estimator.name": "ekf"}
    problems_every: keep the problems of every N-th step, for `Run.problems`; 0: none
    log: keep what the sensors measured, in a file that `estimate` takes, .csv or .mcap
    progress: None for a bar on a terminal or in a notebook; True, False, or a function of (share, text)

    Ctrl-C ends it with KeyboardInterrupt, and nothing is written.
    """
    check_range("run", problems_every=(problems_every, 0, math.inf))
    settings, folders = _configuration.read(scenario, set, plugin_path)
    with Bar(progress, "run") as bar:
        return Run(_rhec.run(folders, settings, problems_every, os.fspath(log) if log else "", bar), folders)


# Without `hold_out`: one in so many measurements of a log is withheld, and of dead reckoning and fixes none.
_USUAL_HOLD_OUT = 5


def _tables(function, scenario, log, variants, hold_out, phase, changes, plugin_path, progress, title):
    settings, folders = _configuration.read(scenario, changes, plugin_path)
    with log_files(*log) as names, Bar(progress, title) as bar:
        files = _rhec.LogFiles(*names, list(variants), hold_out or 0, -1 if phase is None else phase)
        return Estimates(function(folders, settings, files, bar))


def _drive(function, scenario, log, variants, hold_out, phase, changes, plugin_path, progress, title):
    settings, folders = _configuration.read(scenario, changes, plugin_path)
    with drive_file(log) as (file, name, msg_paths), Bar(progress, title) as bar:
        every = _USUAL_HOLD_OUT if hold_out is None else hold_out
        asked = _rhec.DriveLog(file, name, msg_paths, list(variants), every, -1 if phase is None else phase)
        return DriveEstimates(function(folders, settings, asked, bar))


@overload
def estimate(scenario: Configuration, log: DriveLog, gps: None = None, *, variants: Sequence[str] = ..., hold_out: int | None = ...,
             phase: int | None = ..., set: Changes = ..., plugin_path: PluginPath = ..., progress: Progress = ...) -> DriveEstimates: ...
@overload
def estimate(scenario: Configuration, log: LogPart, gps: LogPart, *, variants: Sequence[str] = ..., hold_out: int | None = ...,
             phase: int | None = ..., set: Changes = ..., plugin_path: PluginPath = ..., progress: Progress = ...) -> Estimates: ...
@checked
def estimate(scenario: Configuration, log: DriveLog, gps: LogPart | None = None, *, variants: Sequence[str] = (),
             hold_out: int | None = None, phase: int | None = None, set: Changes = None, plugin_path: PluginPath = (),
             progress: Progress = None) -> Estimates:
    """Estimates state and slip from a recorded drive, and predicts what it withholds. Returns DriveEstimates; of dead reckoning
    and fixes Estimates.

    log: what the vehicle's sensors said: the name of a file (CSV, MCAP, a bag of rosbag2) or a Log; or a table: a dict of columns,
        a Table, a pandas.DataFrame, with a column time [s]; or a list of tables, each with a time of its own. The scenario's
        section `signals` says which are the model's outputs and inputs. NaN is missing
    gps: time [s], x [m], y [m]: a file, or an array (n, 3); `log` is dead reckoning then: time [s], wheel speed [m/s],
        steering angle [rad], likewise
    variants: names of the scenario's variants to run; all without any
    hold_out: withhold one of so many measurements of the position, from `phase` on; 0: none. None: 5 of a log, and none of
        fixes
    """
    if gps is not None:
        return _tables(_rhec.estimate_log, scenario, (log, gps), variants, hold_out, phase, set, plugin_path, progress, "estimate")
    return _drive(_rhec.estimate_drive, scenario, log, variants, hold_out, phase, set, plugin_path, progress, "estimate")


@overload
def smooth(scenario: Configuration, log: None = None, gps: None = None, *, variants: Sequence[str] = ..., hold_out: int | None = ...,
           phase: int | None = ..., set: Changes = ..., plugin_path: PluginPath = ..., progress: Progress = ...) -> SmoothedRun: ...
@overload
def smooth(scenario: Configuration, log: DriveLog, gps: None = None, *, variants: Sequence[str] = ..., hold_out: int | None = ...,
           phase: int | None = ..., set: Changes = ..., plugin_path: PluginPath = ..., progress: Progress = ...) -> DriveEstimates: ...
@overload
def smooth(scenario: Configuration, log: LogPart, gps: LogPart, *, variants: Sequence[str] = ..., hold_out: int | None = ...,
           phase: int | None = ..., set: Changes = ..., plugin_path: PluginPath = ..., progress: Progress = ...) -> Estimates: ...
@checked
def smooth(scenario: Configuration, log: DriveLog | None = None, gps: LogPart | None = None, *, variants: Sequence[str] = (),
           hold_out: int | None = None, phase: int | None = None, set: Changes = None, plugin_path: PluginPath = (),
           progress: Progress = None) -> Estimates | SmoothedRun:
    """Estimates a whole drive at once: every moment from what was measured before and after it.

    With a recorded drive, as `estimate` has it, it returns DriveEstimates or Estimates, causal ones beside; without one it
    simulates the scenario's drive first and returns a SmoothedRun.
    """
    if gps is not None and log is None:
        raise Error("smooth: found gps alone, expected dead reckoning, too, as log")
    if gps is not None:
        return _tables(_rhec.smooth_log, scenario, (log, gps), variants, hold_out, phase, set, plugin_path, progress, "smooth")
    if log is not None:
        return _drive(_rhec.smooth_drive_log, scenario, log, variants, hold_out, phase, set, plugin_path, progress, "smooth")
    if variants or hold_out or phase is not None:
        raise Error("smooth: variants, hold_out and phase are those of a recorded drive; give a log, too")
    settings, folders = _configuration.read(scenario, set, plugin_path)
    with Bar(progress, "smooth") as bar:
        return SmoothedRun(_rhec.smooth_drive(folders, settings, bar))
