#!/usr/bin/env python3
"""clang-tidy over the sources of the libraries, plugins and apps.

    clang_tidy.py <source root> <build directory> [--jobs N] [--recent N] [--thorough] [folder or file ...]

A file that passed is not looked at again until it, a header of ours that it includes, its flags, .clang-tidy or
clang-tidy itself changes; what passed is kept in <build directory>/clang-tidy. --recent N, for a test that begins with
nothing: what the last N commits have changed, or is not committed, and one in sixteen of the other folders, others after
each commit; everything where git does not say what has changed. --thorough, for the night: with checks that take long and
find little, and each file by itself, so that none has a header from the one before it.
"""
import argparse
import collections
import concurrent.futures
import hashlib
import json
import pathlib
import re
import subprocess
import tempfile
import time

import house

QUOTED = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
# Each of them matches every statement or call of every header: together they take as long as all others.
SLOW = ["bugprone-assert-side-effect", "bugprone-forward-declaration-namespace", "bugprone-infinite-loop",
        "bugprone-misplaced-widening-cast", "bugprone-multiple-statement-macro", "bugprone-not-null-terminated-result",
        "bugprone-signed-char-misuse", "bugprone-sizeof-expression", "bugprone-suspicious-semicolon",
        "bugprone-suspicious-string-compare", "bugprone-undelegated-constructor", "bugprone-unused-raii",
        "bugprone-unused-return-value", "modernize-use-nullptr", "performance-move-const-arg",
        "performance-type-promotion-in-math-fn"]
# Compiler warnings are the compiler's business; what it is told about them must not stop clang.
EXTRA = ["--extra-arg=-Wno-error", "--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-unused-command-line-argument"]
UNKNOWN_TO_CLANG = {"-fno-tree-loop-distribute-patterns"}
# A header that gcc has precompiled for a test is none for clang.
PRECOMPILED = re.compile(r" -Winvalid-pch| -fpch-preprocess| -include \S+cmake_pch\.hxx")


# Templates that nothing uses are read at night.
QUICK = ["--extra-arg=-fdelayed-template-parsing"]
# Of a folder so many sources are looked at together. Where others of it have passed, so few are looked at one by one.
MOST, FEW = 20, 2
# With --recent one in so many of the folders that have not changed is looked at.
OTHERS = 16


def singles(entry):
    """A command that compiles several sources as one, as that of each of them; any other as it is."""
    unit = pathlib.Path(entry["directory"], entry["file"])
    if unit.parent.name != "Unity":
        return [entry]
    return [entry | {"file": source, "command": entry["command"].replace(entry["file"], source)}
            for source in QUOTED.findall(unit.read_text(encoding="utf-8"))]


def git(root, *arguments):
    """What git says of the sources, as lines; None where it says nothing of them."""
    try:
        result = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        return None
    return result.stdout.splitlines() if result.returncode == 0 else None


def changed_files(root, commits):
    """What the last commits have changed, with what is not committed. None: everything, as the last one has changed the
    rules, or nobody knows, as where there is no git, or so few commits are known that these may be all that a clone has."""
    known = git(root, "rev-list", "-n", str(commits + 1), "HEAD")
    if known is None or len(known) <= commits:
        return None
    committed = git(root, "diff", "--name-only", known[-1])
    newest = git(root, "diff", "--name-only", known[1])
    added = git(root, "ls-files", "--others", "--exclude-standard")
    if committed is None or newest is None or added is None or ".clang-tidy" in newest:
        return None
    return {(root / name).resolve() for name in committed + added}


def has_turn(root, folder, turn):
    """Whether it is a folder's turn, which one in OTHERS has."""
    name = str(folder.relative_to(root))
    return int(hashlib.sha256(f"{turn} {name}".encode()).hexdigest(), 16) % OTHERS == 0


def checks_option(without):
    return f"--checks={','.join(f'-{name}' for name in without)}"


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
    parser.add_argument("--recent", type=int, metavar="N")
    parser.add_argument("--thorough", action="store_true")
    parser.add_argument("only", nargs="*")
    arguments = parser.parse_args()
    root, build = arguments.root.resolve(), arguments.build.resolve()

    wanted = [(root / name).resolve() for name in (arguments.only or house.FOLDERS)]
    passed = build / "clang-tidy"
    passed.mkdir(exist_ok=True)
    # clang does not take xsimd's functions of two results under another name: what uses it for wide instruction sets is
    # looked at in its generic form, or not at all where it has none (a benchmark for the very machine). All other files are looked at in each of their forms.
    commands = [entry for entry in json.loads((build / "compile_commands.json").read_text())
                if "-DRHEC_PACK_NAMESPACE=" not in entry["command"] and "-march=native" not in entry["command"]]
    commands = [single for entry in commands for single in singles(entry)]
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
    common = version + (root / ".clang-tidy").read_text() + " ".join(EXTRA + ([] if arguments.thorough else SLOW + QUICK))
    headers = Headers(root)
    changed = changed_files(root, arguments.recent) if arguments.recent else None
    if changed is not None:
        turn = git(root, "rev-parse", "HEAD")[0]
        # A header is looked at with the first file that includes it.
        first = {}
        for file in sorted(entries):
            for name in headers.closure(file):
                first.setdefault(name, file)
        recent = {first[file] for file in changed if file in first}
        entries = {file: command for file, command in entries.items()
                   if file in recent or file in changed or has_turn(root, file.parent, turn)}
    header_filter = f"--header-filter=^{re.escape(str(root))}/({'|'.join(house.FOLDERS)})/"

    def stamp_of(file):
        return passed / hashlib.sha256((common + str(file) + entries[file] + headers.digest(file)).encode()).hexdigest()

    def tidy(folder, file, *more):
        """What clang-tidy says of a file, with the commands in `folder`; empty if nothing."""
        command = ["clang-tidy", "--quiet", "-p", str(folder), f"--config-file={root / '.clang-tidy'}", header_filter,
                   *([] if arguments.thorough else [checks_option([*SLOW, *more]), *QUICK]), *EXTRA, str(file)]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode == 0:
            return ""
        return result.stdout + (result.stderr if "error:" not in result.stdout else "") or f"{file}: clang-tidy ended with {result.returncode}"

    def look(files):
        """What is wrong with files that are compiled alike. Several are looked at as one, for headers take most of the time;
        where that does not pass, because of a finding or of names that two of them have, each half is looked at by itself.
        """
        start = time.monotonic()
        if len(files) == 1:
            text = tidy(passed, files[0])
        else:
            with tempfile.TemporaryDirectory(dir=passed) as folder:
                unit = pathlib.Path(folder, "together.cpp")
                unit.write_text("".join(f'#include "{file}"\n' for file in files))
                command = entries[files[0]].replace(str(files[0]), str(unit))
                pathlib.Path(folder, "compile_commands.json").write_text(
                    json.dumps([{"directory": str(build), "file": str(unit), "command": command}]))
                text = tidy(folder, unit, "bugprone-suspicious-include")
            if text:
                half = len(files) // 2
                return look(files[:half]) + look(files[half:])
        for file in () if text else files:
            stamp_of(file).touch()
        print(f"{', '.join(str(file.relative_to(root)) for file in files)}: {time.monotonic() - start:.1f} s", flush=True)
        return [text.rstrip()] if text else []

    alike = collections.defaultdict(list)
    for file in sorted(entries):
        alike[file.parent, re.sub(r" -o \S+| -D\w+_EXPORTS", "", entries[file].replace(str(file), ""))].append(file)
    groups = []
    for files in alike.values():
        left = [file for file in files if not stamp_of(file).exists()]
        size = 1 if arguments.thorough or len(files) > len(left) <= FEW else MOST
        groups += [left[i:i + size] for i in range(0, len(left), size)]

    violations = []
    with concurrent.futures.ThreadPoolExecutor(max_workers=arguments.jobs) as pool:
        for found in pool.map(look, sorted(groups, key=len, reverse=True)):
            violations += found
    house.tell("clang-tidy", list(dict.fromkeys(violations)), len(entries))


if __name__ == "__main__":
    main()
