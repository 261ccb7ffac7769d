#!/usr/bin/env python3
"""What a formula must not do with its numbers does not compile, and the compiler's message says what to do instead.

    refused_formulas.py <compiler> <include directory> ...
"""
import subprocess
import sys

PROGRAM = """
#include <cmath>
#include "rhec/core/formula/expression.hpp"
template <class Scalar>
Scalar formula(const Scalar& x, const Scalar& y) {{
  {body}
}}
template rhec::Expression formula(const rhec::Expression&, const rhec::Expression&);
"""
COMPARES = "a formula does not compare its numbers"
CONVERTS = "do not branch on them or convert them"
# body -> what the message has to say; None where it compiles
CASES = {
    "using std::sin; return 2 * sin(x) / (y - 1);": None,
    "return rhec::smooth_max(x, y, 0.1) + rhec::smooth_abs(x, 0.1);": None,
    "using std::pow, std::hypot; return pow(x, 2) + hypot(x, y);": None,
    'return rhec::named(x, "speed");': None,
    "return x < y ? x : y;": COMPARES,
    "if (x >= 0.0) return x; return y;": COMPARES,
    "if (1 == x) return y; return x;": COMPARES,
    "if (x) return y; return x;": CONVERTS,
    "double value = x; return value * y;": CONVERTS,
    "return std::sin(x);": CONVERTS,
    "return x * std::sqrt(y);": CONVERTS,
}


def main():
    compiler, includes = sys.argv[1], [f"-I{folder}" for folder in sys.argv[2:]]
    failures = []
    for body, expected in CASES.items():
        result = subprocess.run([compiler, "-std=c++20", "-fsyntax-only", *includes, "-x", "c++", "-"],
                                input=PROGRAM.format(body=body), capture_output=True, text=True)
        if expected is None and result.returncode != 0:
            failures.append(f"does not compile: {body}\n{result.stderr}")
        if expected is not None and result.returncode == 0:
            failures.append(f"compiles: {body}")
        if expected is not None and expected not in result.stderr:
            failures.append(f"is refused without '{expected}': {body}\n{result.stderr}")
    print("\n".join(failures) or f"{len(CASES)} formulas as expected")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
