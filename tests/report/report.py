#!/usr/bin/env python3
"""The page of one kind of report, made here and looked at in a browser by page.mjs: report.py <kind> <rhec> ...

Ends with 77 (skipped) where there is no browser.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

import material

MOST_BYTES = 5_000_000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=material.KINDS)
    parser.add_argument("rhec")
    parser.add_argument("--node", required=True)
    parser.add_argument("--modules", required=True)
    parser.add_argument("--browser", default="")
    arguments = parser.parse_args()
    if not pathlib.Path(arguments.browser).is_file():
        print("skipped: no chromium was found when the build was configured (Debian: apt-get install chromium)")
        sys.exit(77)
    rhec = pathlib.Path(arguments.rhec).resolve()
    with tempfile.TemporaryDirectory(prefix="rhec-report-") as name:
        folder = pathlib.Path(name)
        page = folder / "report.html"
        material.call(rhec, "report", material.make(arguments.kind, rhec, folder), "-o", page)
        if page.stat().st_size > MOST_BYTES:
            sys.exit(f"report.{arguments.kind}: the page has {page.stat().st_size} bytes, expected at most {MOST_BYTES}")
        here = pathlib.Path(__file__).resolve().parent
        sys.exit(subprocess.run([arguments.node, here / "page.mjs", page, arguments.modules, arguments.browser, folder]).returncode)


if __name__ == "__main__":
    main()
