#!/usr/bin/env python3
"""What kernels for wide instruction sets leave to the linker: nothing that another unit could take for its own.

    kernel_symbols.py --nm <nm> --readelf <readelf> <instruction set>=<object> ...
    kernel_symbols.py --self-test

Of a weak or unique symbol the linker keeps one copy for the whole library. If that is a copy with AVX-512 in it, a
machine without stops, wherever the call came from. So each such symbol names the pack of its own instruction set. And no
code of these units runs before the machine has been asked: they have no static constructors.
"""
import re
import subprocess
import sys

# One word of data, alike in all units: where the run-time library of C++ is.
ALIKE = {"DW.ref.__gxx_personality_v0"}


def violations_in(name, instruction_set, symbols, sections):
    """`symbols`: lines of `nm --demangle`; `sections`: text of `readelf --sections`."""
    found = []
    for line in symbols:
        match = re.match(r"^[0-9a-f]*\s+([WwVvu]) (.*)$", line)
        if match:
            if match[2] not in ALIKE and f"xsimd_{instruction_set}::" not in match[2]:
                found.append(f"{name}: '{match[2]}' ({match[1]}) could be taken for that of another unit")
    if re.search(r"\.(init_array|ctors)\b", sections):
        found.append(f"{name}: has static constructors, which run before the machine is asked")
    if not symbols:
        found.append(f"{name}: has no symbol at all; is this the object of a kernel?")
    return found


def self_test():
    good = ["0000000000000000 W void f<xsimd_avx2::batch<double> >()", "                 U memcpy", "0000 T plain()"]
    cases = [
        (good, "", 0),
        (good + ["0000000000000000 W void f<double>()"], "", 1),
        (good + ["0000000000000000 u f()::table"], "", 1),
        (good + ["0000000000000000 W void f<xsimd_avx512::batch<double> >()"], "", 1),
        (good, "  [ 5] .init_array", 1),
        ([], "", 1),
    ]
    return [f"case {i}" for i, (symbols, sections, n) in enumerate(cases)
            if len(violations_in("planted", "avx2", symbols, sections)) != n]


def main():
    if sys.argv[1:] == ["--self-test"]:
        found = self_test()
    else:
        assert sys.argv[1] == "--nm" and sys.argv[3] == "--readelf", __doc__
        nm, readelf, objects = sys.argv[2], sys.argv[4], sys.argv[5:]
        found = [] if objects else ["no object to look at"]
        for argument in objects:
            instruction_set, path = argument.split("=", 1)
            def run(*command):
                return subprocess.run([*command, path], check=True, capture_output=True, text=True).stdout
            found += violations_in(path, instruction_set, run(nm, "--demangle").splitlines(),
                                   run(readelf, "--sections", "--wide"))
    print("\n".join(found) if found else "kernel symbols: none is shared")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
