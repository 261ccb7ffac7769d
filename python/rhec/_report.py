"""The page of `rhec report`: figures of a run, an estimation or a sweep, in a file or a notebook."""
from __future__ import annotations

import html
import os
import pathlib
import shutil
import subprocess
import tempfile
from typing import Any

from . import _files, _rhec
from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Error
from ._runs import _Result
from ._studies import Sweep
from ._types import File

_HEIGHT = 800  # of the frame in a notebook [px]


@checked
class Page:
    """A page that is a text of HTML, whole: it opens in a browser without a network, and in a notebook by itself."""

    def __init__(self, text: str) -> None:
        self.html = text

    def save(self, file: File) -> pathlib.Path:
        """Writes it."""
        path = pathlib.Path(file)
        _files.write_text(path, self.html)
        return path

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.html)}" style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'

    def __repr__(self) -> str:
        return f"<page of {len(self.html)} letters>"


def _program() -> str:
    """The command line that belongs to the library of this package, or the one that is found."""
    folder = pathlib.Path(_rhec.library_folder())
    for above in (folder.parent, folder.parent.parent):
        if (above / "bin" / "rhec").is_file():
            return str(above / "bin" / "rhec")
    found = shutil.which("rhec")
    if found is None:
        raise Error(f"report: the program rhec is neither beside {folder} nor in PATH; install rhec with its command line")
    return found


@checked
def report(results: Any) -> Page:
    """The page of a Run, SmoothedRun, Estimates or Sweep, or of a folder or database of the command line. It is drawn by the
    program rhec, which must be there."""
    with tempfile.TemporaryDirectory(prefix="rhec-report-") as folder:
        if isinstance(results, (str, os.PathLike)):
            source = os.fspath(results)
        elif isinstance(results, _Result):
            source = str(results.save(os.path.join(folder, "results")))
        elif isinstance(results, Sweep):
            source = os.fspath(results.file)
        else:
            raise ArgumentError(f"report: results: found {found_in_words(results)}, expected a Run, a SmoothedRun, Estimates, a Sweep, or "
                                "the name of a folder or a database", "results")
        page = os.path.join(folder, "page.html")
        told = subprocess.run([_program(), "report", source, "-o", page], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              check=False)
        if told.returncode != 0:
            raise Error(told.stdout.strip().removeprefix("rhec: error: "))
        return Page(pathlib.Path(page).read_text(encoding="utf-8"))
