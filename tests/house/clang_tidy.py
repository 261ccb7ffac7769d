#!/usr/bin/env python3
"""clang-tidy over the sources of the libraries, plugins and apps.

    clang_tidy.py <source root> <build directory> [--jobs N] [--thorough] [folder or file ...]

A file that passed is not looked at again until it, a header of ours that it includes, its flags, .clang-tidy or
clang-tidy itself changes; what passed is kept in <build directory>/clang-tidy. Checks that take long and find little are
left to --thorough, for the night.
"""
import argparse
import concurrent.futures
import hashlib
import json
import pathlib
import re
import subprocess
import time

import house

QUOTED = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
# Each of them matches every statement or call of every header: together they take as long as all others.
SLOW = ["bugprone-assert-side-effect", "bugprone-infinite-loop", "bugprone-multiple-statement-macro", "bugprone-sizeof-expression",
        "bugprone-suspicious-semicolon", "bugprone-suspicious-string-compare", "bugprone-undelegated-constructor",
        "bugprone-unused-raii", "bugprone-unused-return-value", "modernize-use-nullptr", "performance-move-const-arg"]
# Compiler warnings are the compiler's business; what it is told about them must not stop clang.
EXTRA = ["--extra-arg=-Wno-error", "--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-unused-command-line-argument"]
UNKNOWN_TO_CLANG = {"-fno-tree-loop-distribute-patterns"}
# A header that gcc has precompiled for a test is none for clang.
PRECOMPILED = re.compile(r" -Winvalid-pch| -fpch-preprocess| -include \S+cmake_pch\.hxx")


class Headers:
    """Which files of ours a file includes, itself and through others."""

    def __init__(self, root):
        self.include_directories = sorted([*root.glob("*/include"), *root.glob("*/*/include")])
        self.digests = {}

    def closure(self, file):
        seen, open_files = set(), [file.resolve()]
        while open_files:
            path = open_files.pop()
            if path in seen:
                continue
            seen.add(path)
            text = path.read_text(encoding="utf-8")
            self.digests.setdefault(path, hashlib.sha256(text.encode()).hexdigest())
            for name in QUOTED.findall(text):
                places = [path.parent, *self.include_directories]
                open_files += [(place / name).resolve() for place in places if (place / name).is_file()]
        return sorted(seen)

    def digest(self, file):
        return "".join(self.digests[path] for path in self.closure(file))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=pathlib.Path)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--thorough", action="store_true")
    parser.add_argument("only", nargs="*")
    arguments = parser.parse_args()
    root, build = arguments.root.resolve(), arguments.build.resolve()

    wanted = [(root / name).resolve() for name in (arguments.only or house.FOLDERS)]
    passed = build / "clang-tidy"
    passed.mkdir(exist_ok=True)
    commands = json.loads((build / "compile_commands.json").read_text())
    for entry in commands:
        command = PRECOMPILED.sub("", entry["command"])
        entry["command"] = " ".join(word for word in command.split(" ") if word not in UNKNOWN_TO_CLANG)
    aside = passed / "compile_commands.json.new"
    aside.write_text(json.dumps(commands))
    aside.replace(passed / "compile_commands.json")
    entries = {}
    for entry in commands:
        file = pathlib.Path(entry["directory"], entry["file"]).resolve()
        if any(file.is_relative_to(place) for place in wanted):
            entries.setdefault(file, entry["command"])

    version = subprocess.run(["clang-tidy", "--version"], check=True, capture_output=True, text=True).stdout
    options = EXTRA + ([] if arguments.thorough else [f"--checks={','.join(f'-{name}' for name in SLOW)}"])
    common = version + (root / ".clang-tidy").read_text() + " ".join(options)
    headers = Headers(root)
    header_filter = f"--header-filter=^{re.escape(str(root))}/({'|'.join(house.FOLDERS)})/"

    def look(file):
        key = hashlib.sha256((common + str(file) + entries[file] + headers.digest(file)).encode()).hexdigest()
        stamp = passed / key
        if stamp.exists():
            return file, "", 0.0
        start = time.monotonic()
        command = ["clang-tidy", "--quiet", "-p", str(passed), header_filter, *options, str(file)]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode == 0:
            stamp.touch()
            return file, "", time.monotonic() - start
        return file, result.stdout + (result.stderr if "error:" not in result.stdout else ""), time.monotonic() - start

    violations = []
    with concurrent.futures.ThreadPoolExecutor(max_workers=arguments.jobs) as pool:
        for file, text, seconds in pool.map(look, sorted(entries)):
            if seconds > 0:
                print(f"{file.relative_to(root)}: {seconds:.1f} s", flush=True)
            if text:
                violations.append(text.rstrip())
    house.tell("clang-tidy", list(dict.fromkeys(violations)), len(entries))


if __name__ == "__main__":
    main()
