"""Recorded drives: what is in them, and tables that become them."""
from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from . import _configuration, _rhec
from ._arguments import checked, found_in_words, is_array, is_table
from ._errors import ArgumentError, Error, Names, warn_of
from ._progress import Bar
from ._table import Table
from ._types import Configuration, File, LogPart, PluginPath, Progress

# Columns that all tables of a log may share: when a row was measured, and when it was known.
_CLOCKS = ("time", "received")


@checked
class Proposal(Names):
    """A section `signals` for a scenario, as a dict. It is guesswork: look at each line, at units and signs above all.

    yaml: the same as a text, with what else could be meant, and the meaning of each variable
    """

    def __init__(self, signals: dict[str, Any], yaml: str) -> None:
        super().__init__(signals)
        self.yaml = yaml

    def __reduce__(self) -> tuple[Any, ...]:
        return Proposal, (dict(self), self.yaml)


@checked
class Log:
    """A log: a table with a header (CSV), MCAP, or a bag of rosbag2 (a .db3 file or the folder). It is read when it is made,
    record by record, to say what is in it.

    file: its name
    msg_path: folders with definitions of messages that the bag does not bring
    """

    def __init__(self, file: File, *, msg_path: PluginPath = (), progress: Progress = None) -> None:
        self._file, self._msg_paths = os.fspath(file), _configuration.folders_of(msg_path)
        with Bar(progress, "log") as bar:
            self._log = _rhec.open_log(self._file, self._msg_paths, bar)
        self._tell(self._log.damage)

    @staticmethod
    def _tell(damage: str | None) -> None:
        if damage:
            warn_of([damage])

    def __reduce__(self) -> tuple[Any, ...]:
        return _log_of, (self._file, self._msg_paths)

    @property
    def file(self) -> str:
        """Its name."""
        return self._file

    @property
    def damage(self) -> str | None:
        """Where and why it cannot be read to its end, or None; what comes before is used."""
        return self._log.damage

    @property
    def topics(self) -> Table:
        """Table of topics, or of the one of a table, without a name: topic, type, records, when the first and last were
        measured [s], usual interval and longest gap between them [s], by how much they were received later at most [s], how
        many have a stamp before the one before them, and why its fields cannot be read."""
        return Table(self._log.topics())

    @property
    def fields(self) -> Table:
        """Table of all numbers in it: signal ("/odom:twist.twist.linear.x", or the name of a column), how many values are there
        and missing, the least and the largest."""
        return Table(self._log.fields())

    def read(self, *signals: str, clock: str = "", progress: Progress = None) -> Table:
        """The values of signals of one topic, or of columns, NaN where they are missing: a Table with a row for each record:
        time (measured, [s] of the log's clock), received [s], and the signals by their names.

        signals: as `fields` has them
        clock: what says when they were measured, if not the stamp of the header or the column `time`: "received", or a field
        """
        if not signals:
            raise ArgumentError("Log.read: expected the names of signals, as those of `fields`", "signals")
        parts = [each.partition(":") if each.startswith("/") else ("", "", each) for each in signals]
        topics = list(dict.fromkeys(topic for topic, _, _ in parts))
        if len(topics) > 1:
            raise ArgumentError(f"Log.read: signals: found those of {' and '.join(topics)}, whose records have times of their own; "
                                "expected signals of one topic: read each by a call of its own", "signals")
        fields = [field for _, _, field in parts]
        with Bar(progress, "log") as bar:
            columns, damage = self._log.read(topics[0], fields, clock, bar)
        self._tell(None if damage == self.damage else damage)
        made = Table(time=columns["time"], received=columns["received"])
        for name, field in zip(signals, fields):
            made[name] = columns[field]
        return made

    def propose(self, vehicle: Configuration, *, plugin_path: PluginPath = ()) -> Proposal:
        """The section `signals` by which a vehicle could read it: a dict to put into a scenario, and `yaml`, which also has
        what else could be meant.

        vehicle: the name of a model, or a scenario, as a file or a dict
        """
        is_name = isinstance(vehicle, str) and not os.path.exists(vehicle)
        settings, folders = _configuration.read({"model": {"name": vehicle}} if is_name else vehicle, None, plugin_path)
        text, signals = self._log.propose(folders, settings)
        return Proposal(signals["signals"], text)

    def __repr__(self) -> str:
        topics = self.topics
        return f"<log '{self._file}': {topics['records'].sum()} records of {topics.rows} topics>"

    def _repr_html_(self) -> str:
        return self.topics._repr_html_() + self.fields._repr_html_()


def _log_of(file: str, msg_paths: Sequence[str]) -> Log:
    return Log(file, msg_path=msg_paths)


# Tables of a program that become files.


def _column(table: Any, name: Any) -> Any:
    """A column as numbers that a log can have."""
    import numpy

    if not isinstance(name, str) or any(letter in name for letter in ',;\t\n\r"') or name != name.strip() or not name:
        raise Error(f"log: found the column {name!r}, expected a name without commas, semicolons, tabs, quotes and line breaks")
    values = table[name]
    made = numpy.asarray(values.filled(numpy.nan) if numpy.ma.isMaskedArray(values) else values)
    if made.dtype.kind == "M":  # a date: the log counts nanoseconds since 1970
        return made.astype("datetime64[ns]").astype(numpy.int64)
    if made.ndim != 1 or not is_array(made):
        raise Error(f"log: column '{name}': found {found_in_words(made)}, expected numbers, one for each row")
    return made if made.dtype.kind in "iu" else made.astype(float)


def _rows_of(table: Any) -> dict[str, Any]:
    columns = {name: _column(table, name) for name in table.keys()}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        shown = ", ".join(f"{name}: {len(values)}" for name, values in columns.items())
        raise Error(f"log: found columns of unlike lengths ({shown}), expected a value for each row; sensors with rates of their own are a "
                    "list of tables, each with its own column time")
    return columns


def _merged(tables: Sequence[Any]) -> dict[str, Any]:
    """One table of several with rows of their own, in the order in which they were known; NaN is missing."""
    import numpy

    parts = [_rows_of(table) for table in tables]
    for index, part in enumerate(parts):
        if "time" not in part:
            raise Error(f"log: table {index} has no column time; expected one in each of several tables: it has {', '.join(part) or 'nothing'}")
    names = list(dict.fromkeys(name for part in parts for name in part))
    twice = [name for name in names if name not in _CLOCKS and sum(name in part for part in parts) > 1]
    if twice:
        raise Error(f"log: found the column '{twice[0]}' in several tables, expected names of their own")
    counts = [len(part["time"]) for part in parts]
    columns: dict[str, Any] = {}
    for name in names:
        there = [part.get(name, part["time"] if name == "received" else numpy.full(count, numpy.nan)) for part, count in zip(parts, counts)]
        columns[name] = numpy.concatenate(there)
    order = numpy.argsort(columns.get("received", columns["time"]), kind="stable")
    return {name: values[order] for name, values in columns.items()}


def _write_csv(columns: dict[str, Any], file: str) -> None:
    with open(file, "w", encoding="utf-8") as out:
        out.write(",".join(columns) + "\n")
        out.writelines(",".join(map(repr, row)) + "\n" for row in zip(*(values.tolist() for values in columns.values())))


@contextlib.contextmanager
def drive_file(given: Any) -> Iterator[tuple[str, str, list[str]]]:
    """The file of a log, its name where it is no file of the user's, and folders with definitions, for as long as the context
    lasts."""
    if isinstance(given, Log):
        yield given.file, "", given._msg_paths
    elif isinstance(given, (str, os.PathLike)):
        yield os.fspath(given), "", []
    else:
        if not is_table(given) and is_array(given):
            raise Error("log: found an array, which is dead reckoning, without gps; expected both, or a table with a name for each column")
        columns = _rows_of(given) if is_table(given) else _merged(given)
        with tempfile.TemporaryDirectory(prefix="rhec-") as folder:
            file = os.path.join(folder, "log.csv")
            _write_csv(columns, file)
            try:
                yield file, "log", []
            except Error as error:
                if file not in str(error):
                    raise
                raise type(error)(str(error).replace(file, "log")) from None


# Dead reckoning and fixes.


@contextlib.contextmanager
def _part_file(given: LogPart, name: str, columns: str) -> Iterator[str]:
    """The file of one part; an array becomes one."""
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
    with _part_file(dead_reckoning, "dead_reckoning", "time [s], wheel speed [m/s] and steering angle [rad]") as rows:
        with _part_file(gps, "gps", "time [s], x [m] and y [m]") as fixes:
            yield rows, fixes
