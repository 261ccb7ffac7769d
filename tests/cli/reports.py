"""What the tests of `rhec report` share: runs to be shown, the document of a page, and answers to what is no report."""
import csv
import json
import math
import pathlib
import re
import shutil
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, SHORT, Program, assignments

DOCUMENT = re.compile(r'<script type="application/json" id="document">(.*?)</script>', re.DOTALL)
MOST_BYTES = 5_000_000
TERMS = ("kappa", "mu", "position", "heading", "tracking")


def strict(text):
    """JSON that has no NaN."""
    def refuse(word):
        raise ValueError(f"{word} is no JSON")
    return json.loads(text, parse_constant=refuse)


def rows_of(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def close(a, b, relative=2e-6, absolute=1e-9):
    return math.isclose(a, b, rel_tol=relative, abs_tol=absolute)


class Reports(cli.Findings):
    """What a test of reports is derived from; `parts` are called one after the other."""

    parts = ()

    def __init__(self, name, rhec, work):
        super().__init__(name)
        self.rhec, self.work = rhec, work

    def make_run(self, name, *settings, short=True):
        result = self.rhec("run", FIGURE8, "--out", self.work / name, *assignments(*(SHORT if short else ()), *settings))
        self.expect(result.returncode == FINE, name, result.stderr)
        return self.work / name

    def page_of(self, source, name="page"):
        """The document of a page that must be made, and the page."""
        page = self.work / f"{name}.html"
        result = self.rhec("report", source, "-o", page, timeout=240)
        self.expect(result.returncode == FINE and not result.stderr, f"report {source}", result.stderr)
        text = page.read_text(encoding="utf-8") if page.is_file() else ""
        found = DOCUMENT.findall(text)
        self.expect(len(found) == 1, f"report {source}", f"{len(found)} documents in the page")
        document = strict(found[0])
        self.expect(document["form"] == "rhec report" and document["version"] == 1, f"report {source}", "form or version")
        self.expect(len(text.encode()) < MOST_BYTES, f"report {source}", f"the page has {len(text.encode())} bytes")
        for word in ("http-equiv", "src=\"http", "href=\"http", "@import", "url(http"):
            self.expect(word not in text.replace(found[0], ""), f"report {source}", f"the page fetches: {word}")
        return document, text

    def notes(self, document, about):
        return " ".join(note["text"] for note in document["notes"] if note["about"] == about)

    def copy_of(self, folder, name):
        copy = self.work / name
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        return copy

    def refused(self, source, *words, out=None, code=ERROR):
        page = out or self.work / "kept.html"
        if out is None:
            page.write_text("as it was")
        result = self.rhec("report", source, "-o", page)
        self.expect(result.returncode == code and not result.stdout, f"report {source}", f"exit code {result.returncode}: {result.stdout}")
        line = result.stderr
        self.expect(line.startswith("rhec: error: ") and line.count("\n") == 1, f"report {source}", f"said {line!r}")
        for word in words:
            self.expect(str(word) in line, f"report {source}", f"'{word}' is not in {line!r}")
        if out is None:
            self.expect(page.read_text() == "as it was", f"report {source}", "the page was written to")


def main(test):
    """`test`: a class derived from Reports."""
    name = pathlib.Path(sys.argv[0]).stem
    with tempfile.TemporaryDirectory(prefix=f"rhec-{name}-") as work:
        under_test = test(name, Program(sys.argv[1]), pathlib.Path(work))
        for part in test.parts:
            getattr(under_test, part)()
        under_test.tell()
