#!/usr/bin/env python3
"""The commands of docs/my_log.md work, one after the other, in one folder: my_log.py <rhec>"""
import pathlib
import re
import shlex
import sys
import tempfile

import cli
from cli import FINE, Findings, Program

BLOCK = re.compile(r"<!-- run: tests/cli/my_log.py -->\n```sh\n(.*?)```\n", re.DOTALL)


def main():
    rhec, findings = Program(sys.argv[1]), Findings("my_log")
    text = (cli.ROOT / "docs" / "my_log.md").read_text()
    with tempfile.TemporaryDirectory(prefix="rhec-my-log-") as folder:
        work = pathlib.Path(folder)
        (work / "scenarios").symlink_to(cli.ROOT / "scenarios")
        for block in BLOCK.findall(text):
            for command in block.replace("\\\n", " ").splitlines():
                result = rhec(*shlex.split(command, comments=True)[1:], cwd=work, timeout=200)
                findings.expect(result.returncode == FINE, command, f"{result.returncode}: {result.stderr}")
        for file in ("estimate.mcap", "estimate.csv", "track.tum", "out/hindsight/run.svg"):
            findings.expect((work / file).is_file(), f"{file} was written")
    findings.expect(findings.count > 12, "docs/my_log.md", f"{findings.count} commands")
    findings.tell()


if __name__ == "__main__":
    main()
