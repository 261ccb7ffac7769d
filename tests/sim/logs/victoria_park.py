#!/usr/bin/env python3
"""Runs `rhec estimate` or `rhec smooth` on the Victoria Park log, and holds its figures against what is claimed of them.

    victoria_park.py estimate|smooth <rhec> <scenario> <folder of DRS.txt and GPS.txt>

Exit code: 0 all is well, 1 not, 77 the log is not there (tests count that as skipped): it is not ours to redistribute.
"""
import csv
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

SKIPPED = 77
# Median and root mean square (errors above 5 m counting as 5 m) that a simple filter reached on the same fixes.
SIMPLE_FILTER = (0.216, 0.769)
FIXES, WITHHELD, CAP = 4466, 893, 5.0


def figures(errors):
    return statistics.median(errors), math.sqrt(sum(min(e, CAP) ** 2 for e in errors) / len(errors))


def check_estimates(rhec, scenario, files, expect):
    with tempfile.TemporaryDirectory() as out:
        command = [rhec, "estimate", scenario, "--hold-out", "5", "--out", out]
        for option, path in files.items():
            command += [option, str(path)]
        done = subprocess.run(command, capture_output=True, text=True)
        print(done.stdout)
        expect(done.returncode == 0, f"estimate ends with {done.returncode}: {done.stderr}")
        if done.returncode != 0:
            return
        summary = json.loads((pathlib.Path(out) / "summary.json").read_text())
        expect((pathlib.Path(out) / "run.svg").stat().st_size > 10000, "run.svg is empty")
        with open(pathlib.Path(out) / "estimates.csv", newline="") as file:
            rows = list(csv.DictReader(file))
    with open(files["--gps"]) as file:
        fixes = [tuple(map(float, line.split(","))) for line in file]
    expect(summary["fixes"]["rows"] == FIXES == len(fixes), "number of fixes")
    variants = summary["variants"]
    expect(set(variants) >= {"rhe", "rhe_robust", "ekf"}, "variants rhe, rhe_robust and ekf")
    expect(summary["held_out"] == variants[summary["variant"]]["held_out"], "held_out is the first variant's")
    for name, result in variants.items():
        held = result["held_out"]
        expect(held["count"] == WITHHELD, f"{name}: {held['count']} withheld fixes, expected {WITHHELD}")
        expect(result["fallbacks"] == 0, f"{name}: {result['fallbacks']} solves fell back")
        # The figures again, from the rows and the log itself. The antenna is at the axle only where its offset is 0, so
        # the rows' own residuals are what is compared with.
        mine = [row for row in rows if row["variant"] == name]
        withheld = [row for row in mine if row["held_out"] == "1"]
        wanted = fixes[4::5]
        expect(len(withheld) == len(wanted) and all(
            math.isclose(float(row["fix_x"]), fix[1], abs_tol=1e-6) and math.isclose(float(row["fix_y"]), fix[2], abs_tol=1e-6)
            for row, fix in zip(withheld, wanted)), f"{name}: the withheld fixes are not every fifth one")
        median, rmse = figures([float(row["residual"]) for row in withheld])
        expect(math.isclose(median, held["median_m"], rel_tol=1e-6) and math.isclose(rmse, held["rmse_capped_m"], rel_tol=1e-6),
               f"{name}: summary.json says {held}, the rows {median}, {rmse}")
        times = [float(row["time"]) for row in mine if row["held_out"] == "0"]
        gap = max(b - a for a, b in zip(times, times[1:]))
        expect(gap < 0.2 + 1e-6, f"{name}: nodes are up to {gap} s apart")
    best = summary["held_out"]
    for other, (median, rmse) in {"the simple filter": SIMPLE_FILTER,
                                  "ekf": (variants["ekf"]["held_out"]["median_m"],
                                          variants["ekf"]["held_out"]["rmse_capped_m"])}.items():
        expect(best["median_m"] < median, f"median {best['median_m']:.4f} m is not below that of {other}, {median:.4f} m")
        expect(best["rmse_capped_m"] < rmse, f"rmse {best['rmse_capped_m']:.4f} m is not below that of {other}, {rmse:.4f} m")


def check_smoothed(rhec, scenario, files, expect):
    with tempfile.TemporaryDirectory() as out:
        command = [rhec, "smooth", scenario, "--variant", "rhe_robust", "--hold-out", "5", "--out", out, "--set", "smoother.deadline=.inf"]
        for option, path in files.items():
            command += [option, str(path)]
        done = subprocess.run(command, capture_output=True, text=True)
        print(done.stdout)
        expect(done.returncode == 0 and ": solved after" in done.stdout, f"smooth ends with {done.returncode}: {done.stderr}")
        if done.returncode == 0:
            smoothed = json.loads((pathlib.Path(out) / "summary.json").read_text())["variants"]
            own, causal = (smoothed[name]["held_out"] for name in ("rhe_robust", "rhe_robust causal"))
            expect(own["count"] == WITHHELD, f"smoothed: {own['count']} withheld fixes")
            for figure in ("median_m", "rmse_capped_m"):
                expect(own[figure] < causal[figure], f"{figure}: smoothed {own[figure]}, causal {causal[figure]}")
            with open(pathlib.Path(out) / "estimates.csv", newline="") as file:
                nodes = [row for row in csv.DictReader(file) if row["variant"] == "rhe_robust" and row["held_out"] == "0"]
            sigmas = [float(row[key] or "nan") for row in nodes for key in row if key.startswith("sigma_")]
            expect(len(sigmas) == 6 * len(nodes) and all(0.0 < sigma < 50.0 for sigma in sigmas), "smoothed sigmas")


def main():
    job, rhec, scenario, folder = sys.argv[1], sys.argv[2], sys.argv[3], pathlib.Path(sys.argv[4])
    files = {"--dead-reckoning": folder / "DRS.txt", "--gps": folder / "GPS.txt"}
    absent = [str(path) for path in files.values() if not path.is_file()]
    if absent:
        print(f"skipped: {', '.join(absent)} not there; set RHEC_VICTORIA_PARK to the folder of the log")
        return SKIPPED
    complaints = []

    def expect(holds, what):
        if not holds:
            complaints.append(what)

    {"estimate": check_estimates, "smooth": check_smoothed}[job](rhec, scenario, files, expect)
    for complaint in complaints:
        print("FAILED:", complaint)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
