"""The one exception that rhec raises for what a user can correct."""
from __future__ import annotations

import re

# "file.yaml:12: key.path: what", "file.yaml:12:3: what", "file.jsonl:3: key: what"
_IN_A_FILE = re.compile(r"^(?P<file>[^:\n]+):(?P<line>\d+)(?::\d+)?: (?:(?P<key>[A-Za-z_][\w.\[\]]*): )?")
# "configuration: key.path: what", "set 'key.path': key.path: what"
_IN_PYTHON = re.compile(r"^(?:configuration|set '[^']*'): (?:(?P<key>[A-Za-z_][\w.\[\]]*): )?")


class Error(Exception):
    """Something that you can correct: the text says where, what was found, what was expected, and what to do.

    file: the file that it is about, or None
    line: the line of that file, counted from 1, or None
    key: the dotted key of a configuration, such as 'estimator.horizon', or None
    """

    def __init__(self, text: str = "") -> None:
        super().__init__(text)
        found = _IN_A_FILE.match(text)
        self.file: str | None = found["file"] if found else None
        self.line: int | None = int(found["line"]) if found else None
        found = found or _IN_PYTHON.match(text)
        self.key: str | None = found["key"] if found else None
