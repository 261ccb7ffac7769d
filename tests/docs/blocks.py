#!/usr/bin/env python3
"""What the documentation shows is what is there: readme.py <rhec>

A block of a page below a line `<!-- file: ... -->` is that file, word for word. Commands of the README, of docs/ and of
the pages of models that begin with `rhec run`, `rhec check`, `rhec compare`, `rhec options` or `rhec plugins` work (with shorter paths);
those below a line `<!-- run: <test> -->` are that test's to run. Links lead to files.
"""
import pathlib
import re
import shlex
import sys
import tempfile

import cli
from cli import FINE, Program, assignments

COMMANDS = (["run"], ["check"], ["compare"], ["options"], ["plugins"])
SHOWN = re.compile(r"<!-- file: (\S+) -->\n```\w*\n(.*?)```\n", re.DOTALL)
BLOCK = re.compile(r"(<!-- run: \S+ -->\n)?```(\w*)\n(.*?)```\n", re.DOTALL)
LINK = re.compile(r"\]\((?!https?:)([^)#\s]+)\)")


def commands(text):
    for run_elsewhere, language, block in BLOCK.findall(text):
        if language in ("sh", "bash") and not run_elsewhere:
            for line in block.replace("\\\n", " ").splitlines():
                yield line.split("  #")[0].strip()


def main():
    rhec, findings = Program(sys.argv[1]), cli.Findings("readme")
    readme = (cli.ROOT / "README.md").read_text()
    shown = SHOWN.findall(readme)
    findings.expect(len(shown) >= 4, "README.md", f"shows {len(shown)} files")
    pages = [cli.ROOT / "README.md", cli.ROOT / "CHANGELOG.md", *sorted((cli.ROOT / "docs").rglob("*.md")),
             *sorted((cli.ROOT / "models").rglob("*.md"))]
    with tempfile.TemporaryDirectory(prefix="rhec-readme-") as work:
        for page in pages:
            text = page.read_text()
            for name, shown in SHOWN.findall(text):
                findings.expect((cli.ROOT / name).read_text() == shown, str(page.relative_to(cli.ROOT)),
                                f"what it shows of {name} is not what is there")
            for link in LINK.findall(text):
                findings.expect((page.parent / link).exists(), str(page.relative_to(cli.ROOT)), f"leads to {link}, which is not there")
            for command in commands(text):
                words = shlex.split(command, comments=True)
                if words[:1] != ["rhec"] or words[1:2] not in COMMANDS:
                    continue
                if words[1] in ("run", "compare"):
                    words[3:3] = assignments("path.laps=1", "path.legs=2")
                    words = [str(pathlib.Path(work) / "out") if before == "--out" else word
                             for before, word in zip([""] + words, words)]
                    words = [str(pathlib.Path(work) / word) if before in ("--log", "--mcap", "--csv", "--tum") else word
                             for before, word in zip([""] + words, words)]
                    if "--out" not in words:
                        words += ["--out", str(pathlib.Path(work) / "out")]
                # A drawing goes there too: the tree that is tested stays as it is.
                words = [str(pathlib.Path(work) / word) if word.endswith(".svg") else word for word in words]
                result = rhec(*words[1:], cwd=cli.ROOT)
                findings.expect(result.returncode == FINE, f"{page.relative_to(cli.ROOT)}: {command}", f"{result.returncode}: {result.stderr}")
    findings.tell()


if __name__ == "__main__":
    main()
