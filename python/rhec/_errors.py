"""The exceptions that rhec raises for what a user can correct, and the warning for what one should know."""
from __future__ import annotations

import difflib
import importlib
import os
import re
import sys
import warnings
from collections.abc import Sequence
from typing import Any

# "file.yaml:12: key.path: what", "file.yaml:12:3: what", "file.jsonl:3: key: what"
_IN_A_FILE = re.compile(r"^(?P<file>[^:\n]+):(?P<line>\d+)(?::\d+)?: (?:(?P<key>[A-Za-z_][\w.\[\]]*): )?")
# "configuration: key.path: what", "set 'key.path': key.path: what"
_IN_PYTHON = re.compile(r"^(?:configuration|set '[^']*'|the (?:model|term) '[^']*'): (?:(?P<key>[A-Za-z_][\w.\[\]]*): )?")
# "configuration: key.path: file.yaml:12:3: what", of a file that a configuration names
_IN_A_NAMED_FILE = re.compile(r"(?P<file>[^:\n]+):(?P<line>\d+)(?::\d+)?: ")


# "step: what", of a configuration as a whole
_OF_A_KEY = re.compile(r"^(?P<key>[a-z_][\w.\[\]]*): ")


class _Placed:
    """A text that begins with where it is about."""

    def __init__(self, text: str = "") -> None:
        text = str(text)
        super().__init__(text)  # type: ignore[call-arg]
        in_python = _IN_PYTHON.match(text)
        in_a_file = _IN_A_NAMED_FILE.match(text, in_python.end()) if in_python else _IN_A_FILE.match(text)
        self.file: str | None = in_a_file["file"] if in_a_file else None
        self.line: int | None = int(in_a_file["line"]) if in_a_file else None
        found = in_python or in_a_file
        self.key: str | None = found["key"] if found else None


class Error(_Placed, Exception):
    """Something that you can correct: the text says where, what was found, what was expected, and what to do.

    file: the file that it is about, or None
    line: the line of that file, counted from 1, or None
    key: the dotted key of a configuration, such as 'estimator.horizon', or None
    """


class ArgumentError(Error, TypeError):
    """An argument that a function does not take: by its class, its name, its range, or because there are too many. The text names
    it, and says what was found and what was expected. It is a TypeError, too.

    argument: its name, or None
    """

    def __init__(self, text: str = "", argument: str | None = None) -> None:
        super().__init__(text)
        self.argument = argument


class UnknownName(Error, KeyError):
    """A name that a result does not have: the text says which is close, or which there are. It is a KeyError, too, as dicts
    raise.

    name: what was asked for
    """

    def __init__(self, text: str = "", name: Any = None) -> None:
        super().__init__(text)
        self.name = name

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""  # a KeyError puts it into quotes


def nearest(name: Any, known: Sequence[str]) -> str:
    """The one of those that are known that was most likely meant, or nothing."""
    near = difflib.get_close_matches(name, known, 1, 0.6) if isinstance(name, str) else []
    return near[0] if near else ""


def unknown_name(name: Any, known: Sequence[str]) -> UnknownName:
    """The error for a name that is none of those that are known."""
    near = nearest(name, known)
    return UnknownName(f"there is no {name!r}; " + (f"did you mean '{near}'?" if near else f"expected one of {', '.join(known)}" if known
                                                    else "nothing is there"), name)


class Names(dict[str, Any]):
    """A dict of results that tells what it has where a name is unknown."""

    def __missing__(self, name: Any) -> Any:
        raise unknown_name(name, [*self])


class Note(_Placed, UserWarning):
    """What you should know of a configuration though it can be used: keys that count for nothing, numbers that look like a
    wrong unit. It is warned of, so that warnings.simplefilter("ignore", rhec.Note) silences it, and "error" raises it.

    file, line, key: as of an Error
    """

    def __init__(self, text: str = "") -> None:
        super().__init__(text)
        found = _OF_A_KEY.match(str(text))
        if found and self.key is None:
            self.key = found["key"]


class MissingModule(Error, ModuleNotFoundError):
    """A module that something takes and that is not there; a ModuleNotFoundError, too."""


def module_of(name: str, title: str) -> Any:
    """A module that is not needed for everything else."""
    try:
        return importlib.import_module(name)
    except ImportError as missing:
        told = MissingModule(f"{title}: takes {name}, which cannot be imported: {missing}; install it (pip install {name.split('.')[0]})")
        told.name = name
        raise told from None


def warn_of(notes: Sequence[str]) -> None:
    """Warns of each of them where this package was called."""
    folder = os.path.dirname(__file__) + os.sep
    frame, level = sys._getframe(0), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(folder):
        frame, level = frame.f_back, level + 1
    for text in notes:
        warnings.warn(Note(text), stacklevel=level)
