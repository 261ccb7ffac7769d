#!/usr/bin/env python3
"""What no file of ours says, and how long and how guarded public headers are.

    words.py <source root>
    words.py --self-test
"""
import pathlib
import re
import sys
import tempfile

import house

LONGEST_HEADER = 200
LIBRARIES = ("core", "plugins", "solvers", "models", "blocking", "priors", "terms", "logs", "sim")
# In libraries: nothing is printed, nobody leaves the process. Looked for in code alone, comments and texts blanked.
LIBRARY_WORDS = [
    (re.compile(r"\bstd::(cout|cerr|clog)\b"), "a library prints nothing"),
    (re.compile(r"\b(v|f|vf)?printf\s*\(|\bf?puts\s*\("), "a library prints nothing"),
    (re.compile(r'\bfmt::(print|println)\s*\(\s*("|stdout|stderr)'), "a library prints nothing"),
    (re.compile(r"\b(_|quick_)?exit\s*\(|\bstd::(abort|terminate)\s*\("), "a library does not end the process"),
]
# In all files of ours, comments included. Written in pieces so that this file passes itself.
WORDS = [
    (re.compile(r"\b(TO" + r"DO|FIX" + r"ME)\b"), "unfinished; do it, or say in docs/ what is missing"),
    (re.compile(r"(?<![\w.~}])/(ho" + r"me|wo" + r"rk|ro" + r"ot|Use" + r"rs)/"), "a path of one machine"),
]
# Comments, characters and texts; a text is kept as an empty one.
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'', re.DOTALL)


def code_only(text):
    def blank(match):
        kept = '""' if match.group(0)[0] in 'R"' else ""
        return kept + "\n" * match.group(0).count("\n")

    return NOT_CODE.sub(blank, text)


def find(words, path, text):
    return [
        f"{path}:{number}: '{match.group(0)}': {why}"
        for number, line in enumerate(text.splitlines(), 1)
        for pattern, why in words
        for match in pattern.finditer(line)
    ]


def header_violations(path, text):
    violations = []
    lines = text.splitlines()
    if not lines or lines[0] != "#pragma once":
        violations.append(f"{path}:1: a public header starts with '#pragma once'")
    if len(lines) > LONGEST_HEADER:
        violations.append(f"{path}:{len(lines)}: {len(lines)} lines; a public header has {LONGEST_HEADER} at most, one concept each")
    return violations


def check(root):
    violations = []
    for path in house.cpp_files(root, LIBRARIES):
        text = path.read_text(encoding="utf-8")
        violations += find(LIBRARY_WORDS, path, code_only(text))
        if "include" in path.relative_to(root).parts:
            violations += header_violations(path, text)
    others = [path for path in root.iterdir() if path.is_file() and path.suffix in house.TEXT and path.name != ".git"]
    texts = house.files(root, house.ALL_FOLDERS, house.TEXT) + sorted(others)
    for path in texts:
        violations += find(WORDS, path, path.read_text(encoding="utf-8", errors="replace"))
    return violations, len(texts)


def self_test():
    wrong = {
        "core/src/a.cpp": "void f() { std::cout << 1; }",
        "sim/loop/b.cpp": 'void f() { printf("x"); }',
        "solvers/s/c.cpp": "void f() { std::exit(1); }",
        "models/m/d.cpp": 'void f() { fmt::print("x"); }',
        "core/include/rhec/core/e.hpp": "// no guard",
        "core/include/rhec/core/f.hpp": "#pragma once\n" + "\n" * LONGEST_HEADER,
        "apps/g.cpp": "// TO" + "DO later",
        "docs/h.md": "see /ho" + "me/me/x",
    }
    right = {
        "core/src/i.cpp": '// std::cout, exit(1)\nauto t = "printf(x)"; int n = snprintf(t); obj.on_exit(1);',
        "core/include/rhec/core/j.hpp": "#pragma once\n",
        "apps/k.cpp": "void f() { std::cout << 1; std::exit(1); }",
        "docs/l.md": "see docs/ho" + "me/x and ${HERE}/wo" + "rk/",
    }
    failures = []
    with tempfile.TemporaryDirectory() as directory:
        root = pathlib.Path(directory)
        for name, text in {**wrong, **right}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        told = {violation.split(":")[0] for violation in check(root)[0]}
        failures += [f"not noticed: {name}" for name in wrong if str(root / name) not in told]
        failures += [f"wrongly blamed: {name}" for name in right if str(root / name) in told]
    house.tell("words self-test", failures, len(wrong) + len(right))


def main():
    if "--self-test" in sys.argv[1:]:
        self_test()
    house.tell("words", *check(pathlib.Path(sys.argv[1]).resolve()))


if __name__ == "__main__":
    main()
