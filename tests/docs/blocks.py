#!/usr/bin/env python3
"""Every block of every page of the documentation is what it says: blocks.py <rhec>

Commands run, page by page, in a folder of the page's own that has the scenarios and the examples; what one block makes, the next one finds. They
are shortened (fewer laps, fewer evaluations), and have nothing else changed. Of the other blocks

    <!-- file: NAME -->     the block is that file, word for word
    <!-- run: TEST -->      that test runs it
    <!-- fails: TEXT -->    the command is refused, with this text
    <!-- not run: WHY -->   for what cannot run in a test

YAML is a configuration that rhec reads, JSON is JSON, SQL is asked of the database that the page has made. Python is run by
tests/python/documents_test.py. Links lead to files, and to headings that are there.
"""
import json
import os
import pathlib
import re
import shlex
import sqlite3
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
import cli  # noqa: E402
from cli import ERROR, FINE, NOT_SOLVED, USAGE, Program, assignments  # noqa: E402

BLOCK = re.compile(r"(?:<!-- (file|run|fails|not run): (.*?) -->\n)?^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]+))?\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
MADE = ("reference/", "notebooks/")  # pages that scripts/docs makes
# What is no code: grammars, mathematics, texts that a program prints.
PROSE = {"", "text", "ebnf"}
VEHICLE = re.compile(r"(source|options|states|inputs|parameters|outputs|equations|straight_motion):")
PYTHON = ("README.md", "docs/python.md")  # tests/python/documents_test.py
SHORTER = {"run": assignments("path.laps=1", "path.legs=2", "path.rows=2"), "compare": assignments("path.laps=1", "path.legs=2"),
           "smooth": assignments("path.laps=1", "path.legs=2"), "tune": ["--most-seconds", "2", "--evaluations", "5", "--seeds", "1", "--judges", "2"]}


def pages():
    return [cli.ROOT / "README.md", cli.ROOT / "CHANGELOG.md", *sorted((cli.ROOT / "docs").rglob("*.md")), *sorted((cli.ROOT / "models").rglob("*.md"))]


def slug(heading):
    """The anchor of a heading, as GitHub and MyST make it."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


class Page:
    def __init__(self, file, rhec, findings, folder):
        self.file, self.rhec, self.findings, self.work = file, rhec, findings, folder
        self.name = file.relative_to(cli.ROOT).as_posix()
        self.text = file.read_text(encoding="utf-8")
        folder.mkdir()
        for shared in ("scenarios", "examples", "plugins"):
            (folder / shared).symlink_to(cli.ROOT / shared)

    def expect(self, truth, line, text):
        self.findings.expect(truth, f"{self.name}:{line}", text)

    def blocks(self):
        for block in BLOCK.finditer(self.text):
            mark, about, language, content = block.groups()
            line = self.text[:block.start(4)].count("\n") + 1
            self.block(mark, about, language, content, line)

    def block(self, mark, about, language, content, line):
        if mark == "file":
            self.expect((cli.ROOT / about).read_text() == content, line, f"is not what is in {about}")
        elif mark == "run":
            self.expect((cli.ROOT / about.split("::")[0]).is_file(), line, f"{about} is not there to run it")
        elif mark == "not run":
            self.expect(len(about) > 10, line, "says not why it does not run")
        elif language in ("sh", "bash"):
            self.commands(content, line, about if mark == "fails" else None)
        elif language == "python":
            self.expect(self.name in PYTHON, line, "is Python on a page that tests/python/documents_test.py does not run")
        elif language == "yaml":
            self.configuration(content, line)
        elif language == "json":
            try:
                for document in content.splitlines() if content.count("\n{") else [content]:
                    json.loads(document)
                    self.expect(True, line, "")
            except ValueError as problem:
                self.expect(False, line, f"is no JSON: {problem}")
        elif language == "sql":
            self.query(content, line)
        else:
            self.expect(language in PROSE, line, f"a block of '{language}' that nothing runs; give it a mark")

    def commands(self, content, line, refusal):
        for command in content.replace("\\\n", " ").splitlines():
            words = shlex.split(command, comments=True)
            if not words:
                continue
            if words[0] != "rhec":
                self.expect(False, line, f"'{command}' is no command of rhec; give the block a mark")
                continue
            words = words[1:]
            words[2:2] = SHORTER.get(words[0], [])
            result = self.rhec(*words, cwd=self.work, timeout=300)
            if refusal:
                self.expect(result.returncode in (ERROR, USAGE) and refusal in result.stderr, line, f"{command}: {result.returncode}: {result.stderr}")
            else:
                # A search that is cut short says so by its exit code.
                fine = (FINE, NOT_SOLVED) if words[0] == "tune" else (FINE,)
                self.expect(result.returncode in fine, line, f"{command}: {result.returncode}: {result.stderr}")

    def configuration(self, content, line):
        """A part of a scenario or of a vehicle."""
        file = self.work / f"block-{line}.yaml"
        file.write_text(content)
        if VEHICLE.match(content):  # a part of a vehicle: it is YAML at least, which is said before a key is missing
            result = self.rhec("model", file, cwd=self.work)
            self.expect("not valid YAML" not in result.stderr, line, result.stderr)
            return
        result = self.rhec("check", file, cwd=self.work, timeout=120)
        self.expect(result.returncode in (FINE, NOT_SOLVED) or self.is_named_only(result.stderr), line, result.stderr)

    @staticmethod
    def is_named_only(problem):
        """A part may name a file, or a variable of a vehicle, that is not there: what is wrong is no key and no syntax."""
        return "there is no" in problem and "did you mean" not in problem

    def query(self, content, line):
        databases = sorted(self.work.rglob("*.sqlite"))
        if not databases:
            (self.work / "made").mkdir()
            result = self.rhec("sweep", "scenarios/sweep_blocks.yaml", "--out", "made/blocks.sqlite", cwd=self.work, timeout=300)
            self.expect(result.returncode == FINE, line, result.stderr)
            databases = sorted(self.work.rglob("*.sqlite"))
        with sqlite3.connect(databases[0]) as connection:
            try:
                connection.execute(content).fetchall()
                self.expect(True, line, "")
            except sqlite3.Error as problem:
                self.expect(False, line, f"SQLite: {problem}")

    def links(self):
        prose = FENCE.sub(lambda block: "\n" * block.group(0).count("\n"), self.text)
        for link in LINK.finditer(prose):
            target, anchor = link.groups()
            line = prose[:link.start()].count("\n") + 1
            file = (self.file.parent / target) if target else self.file
            if self.file.parent == cli.ROOT / "docs" and target.startswith(MADE):
                continue
            self.expect(file.exists(), line, f"leads to {target}, which is not there")
            if anchor and file.suffix == ".md" and file.is_file():
                headings = {slug(heading) for heading in HEADING.findall(FENCE.sub("", file.read_text(encoding="utf-8")))}
                self.expect(anchor in headings, line, f"leads to #{anchor} of {file.name}, which has no such heading")


def same_first_table(findings):
    """What the first screen says of an EKF is what the page of concepts says."""
    def rows(page):
        return [line for line in (cli.ROOT / page).read_text(encoding="utf-8").splitlines() if line.startswith(("| EKF |", "| rhec, `rhe` |"))]
    findings.expect(len(rows("README.md")) == 2 and rows("README.md") == rows("docs/concepts.md"), "README.md",
                    "its table against an EKF is not that of docs/concepts.md")


def main():
    rhec, findings = Program(sys.argv[1]), cli.Findings("blocks")
    wanted = sys.argv[2:]
    with tempfile.TemporaryDirectory(prefix="rhec-blocks-") as work:
        for number, file in enumerate(pages()):
            page = Page(file, rhec, findings, pathlib.Path(work) / f"{number}")
            if wanted and page.name not in wanted:
                continue
            page.links()
            page.blocks()
    if not wanted:
        same_first_table(findings)
    findings.tell()


if __name__ == "__main__":
    main()
