#!/usr/bin/env python3
"""All our C++ files are as clang-format would have them: format.py <source root> [--fix]"""
import pathlib
import re
import subprocess
import sys

import house


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    files = [str(path) for path in house.cpp_files(root)]
    if "--fix" in sys.argv[2:]:
        sys.exit(subprocess.run(["clang-format", "-i", "--style=file", *files]).returncode)
    result = subprocess.run(["clang-format", "--dry-run", "-Werror", "--style=file", *files], capture_output=True, text=True)
    lines = re.findall(r"^(\S+?):(\d+):\d+: error:", result.stderr, re.MULTILINE)
    violations = [f"{file}:{line}: not as clang-format would have it" for file, line in dict.fromkeys(lines)]
    if result.returncode and not violations:
        violations = [result.stderr]
    if violations:
        version = subprocess.run(["clang-format", "--version"], capture_output=True, text=True).stdout.strip()
        print(f"python3 tests/house/format.py . --fix    puts it right (this is {version}; the house uses 14)")
    house.tell("format", violations, len(files))


if __name__ == "__main__":
    main()
