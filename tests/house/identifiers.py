#!/usr/bin/env python3
"""No name of ours is one that C++ reserves for the compiler and its library: a__b, _Upper.

    identifiers.py <source root> | --self-test

What others define, and may be used, begins as in KNOWN. Comments and strings are not looked at.
"""
import pathlib
import re
import sys
import tempfile

import house

RESERVED = re.compile(r"\b(?:_[A-Z]\w*|\w*__\w*)\b")
KNOWN = re.compile(r"""__builtin_\w+|__(?:attribute|asm|has_include|restrict|VA_ARGS|x86_64|aarch64|clang\w*|GNUC|cplusplus|SANITIZE_\w+|
    SSE\w+|AVX\w+|FMA|ORDER_\w+|BYTE_ORDER|FILE|LINE|rdtscp|libc_\w+|m(?:128|256|512)[di]?)(?:__)?|_GLIBCXX_\w+|_LIBCPP_\w+|_mm\w*""", re.VERBOSE)
# Raw strings, strings, characters, comments: whichever begins first.
NO_CODE = re.compile(r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'|//[^\n]*|/\*.*?\*/', re.DOTALL)


def reserved_in(text):
    """(line, name) of every reserved name in the code of a file."""
    code = NO_CODE.sub(lambda match: "\n" * match.group().count("\n") or " ", text)
    for number, line in enumerate(code.split("\n"), 1):
        for name in RESERVED.findall(line):
            if not KNOWN.fullmatch(name):
                yield number, name


def violations_in(root):
    found = []
    files = house.cpp_files(root)
    for file in files:
        for line, name in reserved_in(file.read_text(encoding="utf-8")):
            found.append(f"{file}:{line}: '{name}' is reserved for the compiler and its library; choose a name without "
                         "two underscores in a row, or one in front of a capital")
    return found, len(files)


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder, "core", "x.hpp")
        file.parent.mkdir()
        file.write_text('int a_b; // a__b\nauto s = "_Text"; int x__y;\n/* __c\n*/ struct _Upper {};\n'
                        'auto r = R"(__raw\n)"; int __z; char c = \'"\'; int q__;\n__attribute__((unused)) int k = __builtin_clz(1);\n')
        found = [(line, name) for line, name in reserved_in(file.read_text())]
        expected = [(2, "x__y"), (4, "_Upper"), (6, "__z"), (6, "q__")]
        assert found == expected, found
        assert len(violations_in(pathlib.Path(folder))[0]) == len(expected)
    print("identifiers: the self-test passed")


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        self_test()
    else:
        house.tell("identifiers", *violations_in(pathlib.Path(sys.argv[1]).resolve()))
