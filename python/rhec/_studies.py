"""Many runs: sweeps over the keys of a scenario, and the search for good numbers."""
from __future__ import annotations

import json
import math
import os
import pathlib
from collections.abc import Sequence
from typing import Any

from . import _configuration, _files, _rhec
from ._arguments import check_range, checked
from ._errors import Error, Names
from ._logs import drive_file, log_files
from ._progress import Bar
from ._table import Table
from ._types import Changes, Configuration, DriveLog, File, LogPart, PluginPath, Progress


@checked
class Sweep:
    """The runs of a grid.

    runs: Table with a row for each run, in the order of the grid: the grid's keys, status, steps, nees, mae.NAME,
        rmse.NAME, seconds
    made: how many were made by this call; the others were in the database before
    file: the database, docs/sweep.md
    """

    def __init__(self, made: dict[str, Any], file: File) -> None:
        self.name: str = made["name"]
        self.made: int = made["made"]
        self.file = pathlib.Path(file)
        self.runs = _runs_table(made["rows"])

    def to_pandas(self) -> Any:
        """The runs as a pandas.DataFrame."""
        return self.runs.to_pandas()

    def __repr__(self) -> str:
        return f"<sweep '{self.name}': {self.runs.rows} runs, {self.made} of them new, in {self.file}>"

    def _repr_html_(self) -> str:
        return self.runs._repr_html_()


def _flat(prefix, value, into):
    if isinstance(value, dict):
        for key, each in value.items():
            _flat(f"{prefix}.{key}" if prefix else key, each, into)
    else:
        into[prefix] = value


def _runs_table(rows):
    """What differs between configurations, and the measures of each run."""
    import numpy

    flat, measures = [], []
    for row in rows:
        configuration, of_run = {}, {}
        _flat("", json.loads(row["configuration"]), configuration)
        for group in ("mae", "rmse", "mae_after_start"):
            _flat(group, json.loads(row[group]) if row[group] else {}, of_run)
        _flat("solve_time_us", json.loads(row["solve_time_us"]) if row["solve_time_us"] else {}, of_run)
        flat.append(configuration)
        measures.append(of_run)
    keys = dict.fromkeys(key for each in flat for key in each)
    varied = [key for key in keys if len({json.dumps(each.get(key)) for each in flat}) > 1]
    table = Table(run=numpy.array([row["run"] for row in rows], dtype=int))
    for key in varied:
        table[key] = _column([each.get(key) for each in flat])
    for name in ("status", "reason", "steps", "solves", "fallbacks"):
        table[name] = _column([row[name] for row in rows])
    table["nees"] = numpy.array([_number(row["nees"]) for row in rows])
    for name in dict.fromkeys(name for each in measures for name in each):
        table[name] = numpy.array([_number(each.get(name)) for each in measures])
    table["seconds"] = _column([row["seconds"] for row in rows])
    return table


def _number(value):
    return math.nan if value is None else float(value)


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _column(values):
    """Numbers as numbers, NaN where there is none; flags and texts as such, what is neither as it is written, None where
    there is none."""
    import numpy

    known = [value for value in values if value is not None]
    if known and all(map(_is_number, known)):
        return numpy.array([math.nan if value is None else value for value in values])
    whole = len(known) == len(values)
    if known and all(isinstance(value, bool) for value in known):
        return numpy.array(values, dtype=bool if whole else object)
    texts = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
    return numpy.array(texts, dtype=None if whole and values else object)


@checked
def sweep(description: Configuration, file: File, *, threads: int = 0, plugin_path: PluginPath = (),
          progress: Progress = None) -> Sweep:
    """Runs a scenario over a grid of its keys, on several cores, into one SQLite file. Returns a Sweep.

    description: a YAML file (docs/sweep.md), or the same as a dict; then the scenario is beside the working directory
    file: the database. A run is written as soon as it is finished, and one that is there is not made again
    threads: runs at the same time; 0: as many as there are cores

    Ctrl-C finishes the runs under way, then raises KeyboardInterrupt: the same call goes on where it stopped.
    """
    check_range("sweep", threads=(threads, 0, math.inf))
    folders = _configuration.folders_of(plugin_path)
    if isinstance(description, dict):
        plain = _configuration.plain(description, folders)
        settings = _rhec.Settings.of(plain, os.path.join(os.getcwd(), "configuration"))
    else:
        settings = _rhec.Settings.read(os.fspath(description))
    program = f"rhec {_rhec.version} (Python)"
    with Bar(progress, "sweep") as bar:
        return Sweep(_rhec.sweep(folders, settings, os.fspath(file), program, threads, bar), file)


@checked
class Tuning:
    """What was found.

    numbers: Table of name, unit, before, after, and of a log the standard error
    judged: Table of figures on what nothing was tuned on, before and after, with the 95 % interval of their change
    yaml: the scenario with what was found, as a text; `save` writes it
    remarks: what cannot be told, in words
    """

    def __init__(self, made: dict[str, Any]) -> None:
        self.numbers, self.judged = Table(made["numbers"]), Table(made["judged"])
        self.yaml, self.svg, self.remarks = made["yaml"], made["svg"], made["remarks"]
        self.summary = json.loads(made["summary"], object_hook=Names)

    def save(self, file: File) -> None:
        """Writes the scenario."""
        _files.write_text(file, self.yaml)

    def __repr__(self) -> str:
        return f"<tuning of {', '.join(self.numbers['name'])}>"

    def _repr_html_(self) -> str:
        return self.numbers._repr_html_() + self.judged._repr_html_() + self.svg


@checked
def tune(scenario: Configuration, log: DriveLog, gps: LogPart | None = None, *, hold_out: int = 5, tune: Sequence[str] = (),
         keep: Sequence[str] = (), variants: Sequence[str] = (), threads: int = 0, smoother: bool = True,
         most_seconds: float = math.inf, set: Changes = None, plugin_path: PluginPath = (),
         progress: Progress = None) -> Tuning:
    """Finds the noise of sensors, priors, biases, lever arms and delays that make a recorded drive most likely. Returns
    a Tuning.

    log, gps: as `estimate` has them
    hold_out: one of so many measurements of the position is not tuned on, and judges the result
    tune, keep: keys of the scenario to tune beside, or not to tune (docs/tune.md)
    smoother: whether the smoother judges, too, which takes longest
    most_seconds: of the search; then the best so far is taken

    Ctrl-C gives it up with KeyboardInterrupt; to keep the best so far use `most_seconds`.
    """
    check_range("tune", hold_out=(hold_out, 2, math.inf), threads=(threads, 0, math.inf), most_seconds=(most_seconds, 0, math.inf))
    settings, folders = _configuration.read(scenario, set, plugin_path)
    wishes = {"hold_out": hold_out, "tune": list(tune), "keep": list(keep), "variants": list(variants), "threads": threads,
              "smoother": smoother, "most_seconds": most_seconds}
    if gps is not None:
        with log_files(log, gps) as names, Bar(progress, "tune") as bar:
            return Tuning(_rhec.tune_log(folders, settings, names[0], names[1], wishes, bar))
    with drive_file(log) as (file, name, msg_paths), Bar(progress, "tune") as bar:
        asked = _rhec.DriveLog(file, name, msg_paths, list(variants), hold_out, -1)
        return Tuning(_rhec.tune_drive(folders, settings, asked, wishes, bar))


@checked
def tune_controller(scenario: Configuration, *, cases: dict[str, Changes] | None = None, seeds: int = 3, first_seed: int = 1,
                    judges: int = 6, effort: float = 1.0, evaluations: int = 40, threads: int = 0,
                    most_seconds: float = math.inf, set: Changes = None, plugin_path: PluginPath = (),
                    progress: Progress = None) -> Tuning:
    """Finds weights and horizon by which the vehicle of a scenario tracks its path best, in simulation. Returns a Tuning.

    cases: worlds to drive in, {"slow": {"speed": 2}, ...}; the scenario as it is without any
    seeds, first_seed: drives to tune on in each case; judges: further ones that judge the result
    effort: at most so many times the inputs' changes of the scenario
    """
    check_range("tune_controller", seeds=(seeds, 1, math.inf), judges=(judges, 0, math.inf), effort=(effort, 0, math.inf),
                evaluations=(evaluations, 1, math.inf), threads=(threads, 0, math.inf), most_seconds=(most_seconds, 0, math.inf))
    settings, folders = _configuration.read(scenario, set, plugin_path)
    worlds = []
    for name, changes in (cases or {"as it is": {}}).items():
        if not isinstance(changes, dict):
            raise Error(f"cases: '{name}': expected a dict of keys and values")
        worlds.append((name, _configuration.read(scenario, {**(set or {}), **changes}, plugin_path)[0]))
    wishes = {"seeds": seeds, "first_seed": first_seed, "judges": judges, "effort": effort, "evaluations": evaluations,
              "threads": threads, "most_seconds": most_seconds}
    with Bar(progress, "tune") as bar:
        return Tuning(_rhec.tune_controller(folders, settings, worlds, wishes, bar))
