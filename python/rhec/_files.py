"""Files that are read and written whole, and what is said where they cannot be."""
from __future__ import annotations

import os
import pathlib
import secrets

from ._errors import Error
from ._types import File


def read_text(file: File) -> str:
    """The text of a file."""
    try:
        return pathlib.Path(file).read_text(encoding="utf-8")
    except OSError as problem:
        raise Error(f"{os.fspath(file)}: cannot be read: {problem.strerror}; expected a file of text") from None
    except UnicodeDecodeError as problem:
        raise Error(f"{os.fspath(file)}: found the byte {problem.object[problem.start]:#04x} at {problem.start}, expected a text in "
                    "UTF-8") from None


def write_text(file: File, text: str) -> None:
    """Writes a file, whole or not at all."""
    path = pathlib.Path(file)
    aside = path.parent / f".{path.name}-{secrets.token_hex(4)}"
    try:
        with open(aside, "x", encoding="utf-8") as out:
            out.write(text)
        os.replace(aside, path)
    except OSError as problem:
        raise Error(f"{os.fspath(file)}: cannot be written: {problem.strerror}; expected a file in a folder that is there and may be "
                    "written to") from None
    finally:
        aside.unlink(missing_ok=True)
