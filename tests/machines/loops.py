#!/usr/bin/env python3
"""Closed loops on two kinds of processors have the same statistics.

    loops.py <machine_closed_loops> -- <emulator> ... <machine_closed_loops>
    loops.py --self-test

Each vehicle's own scenario is run with several seeds on both. A closed loop magnifies rounding, so that single runs may part
from each other; the means over the seeds of every mean absolute error differ by no more than two standard errors of
that difference, and as many runs reach the end. Exit code: 0 so it is, 1 it is not.
"""
import concurrent.futures
import math
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Scenarios, and what makes one short.
SCENARIOS = {
    "figure8": "path.laps=1",
    "bicycle_sideslip": "path.legs=2",
    "skid_steer": "path.laps=1",
    "tractor_trailer": "path.laps=1",
    "unicycle_traction": "path.legs=2",
}
SEEDS = 8
STANDARD_ERRORS = 2.0


def run(command, scenario):
    """Errors by name, a dict for each seed."""
    words = [*command, str(ROOT / "scenarios" / f"{scenario}.yaml"), SCENARIOS[scenario], str(SEEDS)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"loops: '{' '.join(words)}' ended with {done.returncode}: {done.stderr.strip()}")
    runs = [{} for _ in range(SEEDS)]
    for line in done.stdout.splitlines():
        seed, name, value = line.split()
        runs[int(seed) - 1][name] = float(value)
    return runs


def compare(scenario, one, other):
    """What differs between runs of two machines, in words; `one`, `other`: errors by name, a dict for each seed."""
    found = []
    for name in one[0]:
        a, b = [run[name] for run in one], [run[name] for run in other]
        difference = abs(statistics.mean(a) - statistics.mean(b))
        error = math.sqrt((statistics.variance(a) + statistics.variance(b)) / len(a))
        allowed = 0.0 if name == "completed" else STANDARD_ERRORS * error
        if not difference <= allowed:  # true of NaN
            found.append(f"{scenario}: {name}: {statistics.mean(a):.6g} here and {statistics.mean(b):.6g} there, "
                         f"over {len(a)} seeds; {allowed:.2g} is allowed")
    return found


def self_test():
    here = [{"completed": 1.0, "kappa": 0.1 + 0.01 * k} for k in range(8)]
    cases = [(here, 0), ([run | {"kappa": run["kappa"] + 1e-3} for run in here], 0),
             ([run | {"kappa": run["kappa"] + 0.1} for run in here], 1),
             ([run | {"kappa": math.nan} for run in here], 1), ([*here[1:], here[0] | {"completed": 0.0}], 1)]
    return [f"case {i}" for i, (there, count) in enumerate(cases) if len(compare("self test", here, there)) != count]


def main():
    if sys.argv[1:] == ["--self-test"]:
        failures = self_test()
        print("\n".join(failures) if failures else "loops: finds what differs")
        sys.exit(bool(failures))
    if "--" not in sys.argv[2:]:
        sys.exit(__doc__)
    at = sys.argv.index("--")
    commands = sys.argv[1:at], sys.argv[at + 1:]
    found = []
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        for scenario in SCENARIOS:
            here, there = pool.map(lambda command: run(command, scenario), commands)
            same = sum(a == b for a, b in zip(here, there))
            print(f"{scenario:<20} {len(here)} seeds; tracking {statistics.mean(r['tracking'] for r in here):.4f} m here, "
                  f"{statistics.mean(r['tracking'] for r in there):.4f} m there; {same} runs with the same digits", flush=True)
            found += compare(scenario, here, there)
    print("\n".join(found) if found else "closed loops of both machines have the same statistics")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
