#!/usr/bin/env python3
"""docs/configuration.md is what `rhec options` prints: configuration.py <rhec> [--update]"""
import difflib
import sys

import cli


def main():
    result = cli.Program(sys.argv[1])("options")
    file = cli.ROOT / "docs" / "configuration.md"
    if result.returncode:
        sys.exit(f"configuration: rhec options: {result.stderr}")
    if "--update" in sys.argv[2:]:
        file.write_text(result.stdout)
    there = file.read_text() if file.is_file() else ""
    if there == result.stdout:
        return
    sys.stdout.writelines(difflib.unified_diff(there.splitlines(True), result.stdout.splitlines(True), str(file.name), "rhec options"))
    sys.exit("configuration: docs/configuration.md is out of date; rhec options > docs/configuration.md puts it right")


if __name__ == "__main__":
    main()
