#!/usr/bin/env python3
"""Holds what machine_numbers wrote on two kinds of processors against each other.

    compare.py <numbers> <numbers>
    compare.py --self-test

Evaluations of models agree to 1e-12, one step of the solver to 1e-9, each relative to the largest number of its line or to 1.
Exit code: 0 they agree, 1 they do not.
"""
import math
import pathlib
import sys

TOLERANCES = {"evaluation": 1e-12, "step": 1e-9}


def read(text, name):
    """Lists of numbers by (kind, vehicle, what)."""
    rows = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if len(words) < 4 or words[0] not in TOLERANCES:
            sys.exit(f"{name}:{number}: expected a kind ({', '.join(TOLERANCES)}), a vehicle, a name and numbers; found '{line[:60]}'")
        rows[tuple(words[:3])] = [float.fromhex(word) for word in words[3:]]
    return rows


def difference(one, other):
    """The largest difference of two lines, relative to their largest number or to 1; infinite where a number is none."""
    if not all(map(math.isfinite, one + other)):
        return math.inf
    return max(abs(a - b) for a, b in zip(one, other)) / max(1.0, *map(abs, one))


def compare(one, other):
    """What differs, in words, and the largest difference of each kind and vehicle."""
    found = [f"{' '.join(key)}: only one of the two machines has it" for key in sorted(one.keys() ^ other.keys())]
    if not one.keys() & other.keys():
        found.append("nothing was compared")
    largest = {}
    for key in sorted(one.keys() & other.keys()):
        if len(one[key]) != len(other[key]):
            found.append(f"{' '.join(key)}: {len(one[key])} and {len(other[key])} numbers")
            continue
        off = difference(one[key], other[key])
        largest[key[:2]] = max(largest.get(key[:2], 0.0), off)
        if off > TOLERANCES[key[0]]:
            found.append(f"{' '.join(key)}: the numbers differ by {off:.1e}, {TOLERANCES[key[0]]:.0e} is allowed")
    return found, largest


def self_test():
    good = {("step", "v", "rhe"): [1.0, 2.0], ("evaluation", "v", "F"): [1e6, 0.0]}

    def changed(key, values):
        return good | {key: values}

    cases = [
        (good, 0),
        (changed(("step", "v", "rhe"), [1.0, 2.0 + 1e-9]), 0),
        (changed(("step", "v", "rhe"), [1.0, 2.0 + 1e-8]), 1),
        (changed(("evaluation", "v", "F"), [1e6, 0.9e-6]), 0),  # of the line's largest number
        (changed(("evaluation", "v", "F"), [1e6, 1.1e-6]), 1),
        (changed(("evaluation", "v", "F"), [1e6, math.nan]), 1),
        (changed(("evaluation", "v", "F"), [1e6]), 1),
        (changed(("evaluation", "v", "h"), [0.0]), 1),
        ({}, 3),
    ]
    return [f"case {i}" for i, (other, count) in enumerate(cases) if len(compare(good, other)[0]) != count]


def main():
    if sys.argv[1:] == ["--self-test"]:
        failures = self_test()
        print("\n".join(failures) if failures else "compare: finds what differs")
        sys.exit(bool(failures))
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    one, other = (read(pathlib.Path(name).read_text(encoding="utf-8"), name) for name in sys.argv[1:])
    found, largest = compare(one, other)
    for (kind, vehicle), off in sorted(largest.items()):
        print(f"{kind:<12} {vehicle:<20} largest difference {off:.1e}")
    print("\n".join(found) if found else "both machines have the same numbers")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
