#!/usr/bin/env python3
"""`rhec smooth` on a short drive made here: a circle with an outage of the receiver, and a jump of it.

    smooth.py <rhec>
"""
import csv
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

SCENARIO = """\
name: circle
step: 0.2
model: {name: bicycle_slip, wheelbase: 2.0, gps_offset: 0}
log: {wheel_offset: 0}
noise:
  outputs: {x_gps: 0.05, y_gps: 0.05, delta: 0.02}
  inputs: {u1: 0.1, u2: 0.05}
bounds: {kappa: [0.3, 1.3], mu: [0.3, 1.3], u2: [null, null]}
estimator:
  horizon: 10
  heading_starts: 12
  process_noise: {kappa: 0.02, mu: 0.02}
  initial:
    parameters: {kappa: 1, mu: 1}
    sigma: {x_pos: 100, y_pos: 100, beta: 3.14, delta: 0.1, kappa: 0.3, mu: 0.3}
smoother:
  blocking:
    kappa: {name: structured, size: 10, neighbour_sigma: 0.02}
    mu: {name: full_horizon}
  robust: {outputs: [x_gps, y_gps], delta: 3}
variants:
  rhe: {}
  ekf: {estimator: {name: ekf}}
"""


def drive(folder):
    """30 s round a circle, with fixes missing from 12 s to 18 s."""
    noise = random.Random(3)
    rows, fixes, x, y, heading, dt = [], [], 0.0, 0.0, 0.7, 0.025
    for i in range(1200):
        time, rate = dt * i, 0.8 * 3.0 / 2.0 * math.tan(0.1)
        rows.append(f"{time:.3f},{3.0 + 0.05 * noise.gauss(0, 1):.6f},{0.1 + 0.01 * noise.gauss(0, 1):.6f}")
        if i % 8 == 0 and not 12 < time < 18:
            jump = 5.0 if i == 800 else 0.0
            fixes.append(f"{time:.3f},{x + 0.05 * noise.gauss(0, 1) + jump:.6f},{y + 0.05 * noise.gauss(0, 1):.6f}")
        x += dt * 0.8 * 3.0 * math.cos(heading + 0.5 * dt * rate)
        y += dt * 0.8 * 3.0 * math.sin(heading + 0.5 * dt * rate)
        heading += dt * rate
    for name, lines in (("drs.txt", rows), ("gps.txt", fixes)):
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "circle.yaml").write_text(SCENARIO)


def main():
    rhec = str(pathlib.Path(sys.argv[1]).resolve())
    complaints = []

    def expect(holds, what):
        if not holds:
            complaints.append(what)

    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        drive(folder)

        def smooth(*more):
            command = [rhec, "smooth", "circle.yaml", "--dead-reckoning", "drs.txt", "--gps", "gps.txt", "--out", "out", *more]
            return subprocess.run(command, cwd=folder, capture_output=True, text=True)

        done = smooth("--hold-out", "5")
        expect(done.returncode == 0, f"exit code {done.returncode}: {done.stdout}{done.stderr}")
        expect(done.stdout.count(": solved after") == 2, f"not both variants are solved: {done.stdout}")
        variants = json.loads((folder / "out" / "summary.json").read_text())["variants"]
        expect((folder / "out" / "run.svg").stat().st_size > 10000, "run.svg is empty")
        with open(folder / "out" / "estimates.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        for variant in ("rhe", "ekf"):
            own, causal = (variants[n]["held_out"] for n in (variant, variant + " causal"))
            expect(own["rmse_capped_m"] < causal["rmse_capped_m"],
                   f"{variant}: smoothed RMSE {own['rmse_capped_m']} m, causal {causal['rmse_capped_m']} m")
            mine = [row for row in rows if row["variant"] == variant and row["held_out"] == "0"]
            sigmas = [key for key in mine[0] if "sigma" in key]
            expect(sigmas and all(float(row[key]) > 0.0 for row in mine for key in sigmas), f"{variant}: sigmas {sigmas}")

        done = smooth("--variant", "rhe", "--set", "smoother.solver.max_iterations=1")
        expect(done.returncode == 3 and "iteration_limit" in done.stdout, f"one iteration: {done.returncode} {done.stdout}")
        done = smooth("--variant", "rhe", "--set", "smoother.deadline=1e-6")
        expect(done.returncode == 3 and ": deadline after" in done.stdout, f"no time: {done.returncode} {done.stdout}")
        done = smooth("--variant", "rhe", "--set", "smoother.deadline=.inf",
                      "--set", "smoother.solver={name: gn_rti, mode: converge}")
        expect(done.returncode == 0 and "no covariances" not in done.stdout, f"gn_rti: {done.returncode} {done.stdout}")
        done = smooth("--variant", "rhe", "--set", "smoother.deadline=.inf", "--set", "smoother.solver=ipopt")
        expect(done.returncode == 0 and "no covariances" in done.stdout, f"ipopt: {done.returncode} {done.stdout}")
        for blocking in ("{name: unblocked, neighbour_sigma: 0.02}", "{name: full_horizon}",
                         "{name: structured, size: 5, transition: ramp, neighbour_sigma: 0.02}"):
            done = smooth("--variant", "rhe", "--set", f"smoother.blocking.kappa={blocking}")
            expect(done.returncode == 0, f"{blocking}: {done.returncode} {done.stdout}{done.stderr}")
        for key, words in (("smoother.deadlin=1", "deadline"), ("smoother.robust={outputs: [x]}", "x_gps"),
                           ("smoother.blocking.kapa={name: unblocked}", "kappa"), ("smoother.deadline=0", "deadline")):
            done = smooth("--variant", "rhe", "--set", key)
            expect(done.returncode == 1 and words in done.stderr, f"{key}: {done.returncode} {done.stderr}")
        done = smooth("--hold-out", "5", "--hold-out-phase", "5")
        expect(done.returncode == 1 and "expected a number below it" in done.stderr, f"phase: {done.returncode} {done.stderr}")

        # With priors: where neither the smoother nor the estimator has blocks, or where they are asked for.
        done = smooth("--variant", "rhe", "--set", "smoother.blocking=null", "--set", "smoother.laws=2")
        expect(done.returncode == 0 and ": solved after" in done.stdout, f"priors: {done.returncode} {done.stdout}{done.stderr}")
        done = smooth("--variant", "rhe", "--set", "smoother.priors={kappa: {name: walk, sigma: 0.01}}")
        expect(done.returncode == 1 and "either blocks or priors" in done.stderr, f"both: {done.returncode} {done.stderr}")
        done = smooth("--variant", "rhe", "--set", "smoother.blocking=null", "--set", "smoother.priors={kappa: 3}")
        expect(done.returncode == 1 and "circle.yaml" not in done.stdout, f"no prior: {done.returncode} {done.stderr}")

        # A simulated drive needs no files.
        figure8 = pathlib.Path(__file__).resolve().parents[2] / "scenarios" / "figure8.yaml"

        def smooth_drive(*more, scenario=str(figure8)):
            command = [rhec, "smooth", scenario, "--out", "drive", "--set", "path.laps=1", "--set", "path.radius=8", "--set",
                       "smoother.laws=2", *more]
            return subprocess.run(command, cwd=folder, capture_output=True, text=True)

        done = smooth_drive()
        expect(done.returncode == 0 and "WITH HINDSIGHT" in done.stdout, f"drive: {done.returncode} {done.stdout}{done.stderr}")
        summary = json.loads((folder / "drive" / "summary.json").read_text())
        expect(summary["mae"]["kappa"] < summary["causal"]["mae"]["kappa"], f"no better with hindsight: {summary}")
        expect(summary["smoother"]["laws"] and all(law["by_parameter"] for law in summary["smoother"]["laws"]), "no laws")
        with open(folder / "drive" / "steps.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        expect(len(rows) == summary["steps"] and all(float(row["sigma_kappa"]) > 0.0 for row in rows), "steps.csv")
        report = subprocess.run([rhec, "report", "drive", "-o", "drive.html"], cwd=folder, capture_output=True, text=True)
        expect(report.returncode == 0 or "without the page" in report.stderr, f"report: {report.stderr}")
        for more, code, words in ((["--hold-out", "5"], 1, "recorded drive"), (["--variant", "x"], 1, "recorded drive"),
                                  (["--gps", "gps.txt"], 2, "--dead-reckoning"),
                                  (["--set", "smoother.solver={name: sparse_sqp, max_iterations: 1}"], 3, "iteration_limit"),
                                  (["--set", "pth.laps=2"], 1, "path")):
            done = smooth_drive(*more)
            expect(done.returncode == code and words in done.stdout + done.stderr,
                   f"{more}: {done.returncode} {done.stdout}{done.stderr}")
        done = smooth_drive(scenario="circle.yaml")
        expect(done.returncode == 1 and "--dead-reckoning" in done.stderr, f"a log's scenario: {done.returncode} {done.stderr}")
    for complaint in complaints:
        print("FAILED:", complaint)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
