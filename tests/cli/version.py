#!/usr/bin/env python3
"""What `rhec --version` says of the program is what it was built with: version.py <rhec> <CMake cache>"""
import json
import pathlib
import re
import sys

import cli

LINES = ("compiler", "preset", "flags", "instruction sets", "libraries", "parts", "backends")


def cached(cache, name):
    found = re.search(rf"^{name}:\w+=(.*)$", cache, re.MULTILINE)
    if not found:
        sys.exit(f"version: the CMake cache has no {name}")
    return found[1]


def main():
    rhec = cli.Program(sys.argv[1])
    cache = pathlib.Path(sys.argv[2]).read_text(encoding="utf-8")
    findings = cli.Findings("version")
    told = rhec("--version")
    findings.expect(told.returncode == cli.FINE, "exit code", told.stderr)
    first, *others = told.stdout.splitlines()
    findings.expect(first == f"rhec {cached(cache, 'CMAKE_PROJECT_VERSION')}", "the first line is name and version alone", first)
    said = {name: line[len(name):].strip() for name, line in zip(LINES, others) if line.startswith(name)}
    if not findings.expect(tuple(said) == LINES, "one line of each", told.stdout):
        findings.tell()
    build_type = cached(cache, "CMAKE_BUILD_TYPE").upper()
    findings.expect(cached(cache, f"CMAKE_CXX_FLAGS_{build_type}") in said["flags"], "flags of the build type", said["flags"])
    findings.expect(re.fullmatch(r"\w+ \d+\.\S+, for \w+ \w+", said["compiler"]) is not None, "compiler", said["compiler"])
    sets = cached(cache, "RHEC_MODEL_INSTRUCTION_SETS").replace(";", ", ")
    findings.expect(f"models: {sets};" in said["instruction sets"], "instruction sets", said["instruction sets"])
    findings.expect(re.search(r"Eigen \d+\.\d+.*fmt \d+\.\d+", said["libraries"]) is not None, "libraries", said["libraries"])
    # As `rhec plugins` tells them.
    plugins = json.loads(rhec("plugins", "--json").stdout)
    for plugin in plugins if isinstance(plugins, list) else plugins["plugins"]:
        if plugin.get("backend"):
            expected = f"{plugin['name']}: {plugin['backend']} {plugin.get('backend_version', '')}".strip()
            findings.expect(expected in said["backends"], "backends", f"'{expected}' is not in '{said['backends']}'")
    findings.tell()


if __name__ == "__main__":
    main()
