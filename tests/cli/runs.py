#!/usr/bin/env python3
"""Good runs of the command line: every choice of a scenario ends at the end of the path, and results repeat themselves.

    runs.py <rhec>
"""
import csv
import json
import math
import pathlib
import re
import sys
import tempfile

import cli
from cli import FIGURE8, FINE, NOT_SOLVED, SHORT, ZIGZAG, Program, assignments

EXACT = {"steps", "completed", "mae", "rmse", "nees", "nees_expected", "within_two_sigma", "certainty", "solve_time_us", "statuses",
         "fallbacks", "integration"}
ERRORS = {"kappa", "mu", "position", "heading", "tracking"}
TIMES = {"median", "p99", "max"}
# The bicycle with slip, whose steering motor follows the wanted rate with a lag of 10 ms.
LAG = """
states:
  x_pos: {unit: m, typical: 10, role: position_x}
  y_pos: {unit: m, typical: 10, role: position_y}
  beta: {unit: rad, angle: true, role: heading}
  delta: {unit: rad, typical: 0.3}
  rate: {unit: rad/s, typical: 0.03}
inputs:
  u1: {unit: m/s, typical: 5, role: speed}
  u2: {unit: rad/s, typical: 0.3}
parameters:
  kappa: {typical: 0.5, bounds: [0, 1], role: speed_factor}
  mu: {typical: 0.5, bounds: [0, 1]}
outputs:
  x_gps: {unit: m, typical: 10}
  y_gps: {unit: m, typical: 10}
  delta: {unit: rad, typical: 0.3, angle: true}
equations: |
  x_pos' = kappa * u1 * cos(beta)
  y_pos' = kappa * u1 * sin(beta)
  beta'  = kappa * u1 / 1.4 * tan(mu * delta)
  delta' = rate
  rate'  = (u2 - rate) / 0.01
  x_gps  = x_pos - 0.4 * cos(beta)
  y_gps  = y_pos - 0.4 * sin(beta)
"""
# name: scenario, settings, words that the summary's statuses and error bounds are judged by
CHOICES = {
    "estimator rhe": (FIGURE8, ["estimator.name=rhe"]),
    "estimator ekf": (FIGURE8, ["estimator.name=ekf"]),
    "estimator truth": (FIGURE8, ["estimator.name=truth"]),
    "reference_speed literal": (FIGURE8, ["controller.reference_speed=literal"]),
    "reference_speed ground": (FIGURE8, ["controller.reference_speed=ground"]),
    "arrival smoothing": (FIGURE8, ["estimator.arrival.name=smoothing"]),
    "arrival constant": (FIGURE8, ["estimator.arrival.name=constant"]),
    "arrival off": (FIGURE8, ["estimator.arrival.name=off"]),
    "terrain constant": (FIGURE8, ["terrain={name: constant, values: {kappa: 0.8, mu: 0.9}}"]),
    "terrain patches": (FIGURE8, ["terrain={name: patches, patch_size: 5, lower: 0.6}"]),
    "terrain raster": (FIGURE8, ["terrain={name: raster, files: [kappa.csv, mu.csv], interpolation: nearest}"]),
    "terrain split": (FIGURE8, ["terrain={name: split, border: 5, below: {name: constant, values: {kappa: 0.8}}, "
                                "above: {name: gaussian, correlation_length: 4}}"]),
    "path zigzag": (ZIGZAG, []),
    "path file": (FIGURE8, ["path={name: file, file: path.csv}"]),
    "path file with speeds": (FIGURE8, ["path={name: file, file: speeds.csv}"]),
    "blocking full_horizon": (FIGURE8, ["blocking.kappa={name: full_horizon}"]),
    "blocking unblocked": (FIGURE8, ["blocking.kappa={name: unblocked, neighbour_sigma: 0.04}"]),
    "blocking unblocked, not linked": (FIGURE8, ["blocking.kappa={name: unblocked}"]),
    "blocking structured": (FIGURE8, ["blocking.kappa={name: structured, size: 3}"]),
    "blocking structured, as in the paper": (FIGURE8, ["blocking.kappa={name: structured, size: 2, overlap: 4}",
                                                       "estimator.block_sigma.kappa=.inf"]),
    "blocking structured, overlap": (FIGURE8, ["blocking.kappa={name: structured, size: 5, overlap: 4}"]),
    "blocking structured, ramp": (FIGURE8, ["blocking.kappa={name: structured, size: 5, overlap: 2, transition: ramp}"]),
    "blocking structured, both": (FIGURE8, ["blocking.mu={name: structured, size: 5, overlap: 4, neighbour_sigma: 0.04}"]),
    "blocking pattern": (FIGURE8, ["blocking.kappa={name: pattern, lengths: [2, 4], anchor: time}"]),
    "blocking pattern of the horizon": (FIGURE8, ["blocking.kappa={name: pattern, lengths: [8, 4, 3]}"]),
    "move blocking": (FIGURE8, ["controller.blocking={u1: {name: pattern, lengths: [1, 2, 4, 8]}, "
                                "u2: {name: structured, size: 3, anchor: horizon}}"]),
    "horizons of one": (FIGURE8, ["estimator.horizon=1", "controller.horizon=8", "blocking.kappa={name: unblocked, "
                                  "neighbour_sigma: 0.04}"]),
    "long horizons": (FIGURE8, ["estimator.horizon=40", "controller.horizon=30"]),
    "several iterations": (FIGURE8, ["estimator.solver.iterations=3", "controller.solver.iterations=3"]),
    "converge": (FIGURE8, ["estimator.solver.mode=converge", "controller.solver.mode=converge"]),
    "robust": (FIGURE8, ["estimator.robust={outputs: [x_gps, y_gps], delta: 3}"]),
    "substeps": (FIGURE8, ["estimator.substeps=3", "controller.substeps=2"]),
    "no bounds": (FIGURE8, ["bounds.kappa=[null, null]", "bounds.mu=[0, null]"]),
    "defaults alone": (None, []),
}
# These hold the vehicle less well on paths so narrow: that they get to the end of it is all that is asked.
LOOSE = {"path zigzag", "long horizons", "reference_speed literal", "arrival off", "horizons of one", "blocking full_horizon"}


def circle(points, speed=None):
    """A path round a circle of 12 m."""
    rows = ["x,y,speed" if speed else "x,y"]
    for i in range(points):
        angle = 2.0 * math.pi * i / (points - 1)
        rows.append(f"{12 * math.sin(angle):.6f},{12 - 12 * math.cos(angle):.6f}" + (f",{speed(i)}" if speed else ""))
    return "\n".join(rows) + "\n"


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("runs")
        self.rhec, self.work, self.count_of_runs = rhec, work, 0
        (work / "path.csv").write_text(circle(200))
        (work / "speeds.csv").write_text(circle(200, lambda i: 4 + i % 3))
        for name, values in (("kappa", "0.7,0.9\n0.8,0.6\n"), ("mu", "0.9,0.8\n0.7,0.9\n")):
            (work / f"{name}.csv").write_text(f"origin_x,origin_y,cell_size\n-20,-20,20\n{values}")
        (work / "empty.yaml").write_text("{}\n")

    def run(self, name, settings, scenario=FIGURE8, words=()):
        """The folder of a run that must go well."""
        self.count_of_runs += 1
        out = self.work / f"out-{self.count_of_runs}"
        result = self.rhec("run", scenario, "--out", out, *assignments(*SHORT, *settings), *words, cwd=self.work)
        self.expect(result.returncode == FINE and not result.stderr, name, f"exit code {result.returncode}: {result.stderr}")
        return out if (out / "summary.json").is_file() else None

    def choices(self):
        for name, (scenario, settings) in CHOICES.items():
            out = self.run(name, settings, scenario or self.work / "empty.yaml")
            if out is None:
                continue
            files = sorted(path.name for path in out.iterdir())
            self.expect(files == ["horizons.jsonl", "run.svg", "steps.csv", "summary.json", "times.csv"], name, f"files: {files}")
            summary = json.loads((out / "summary.json").read_text())
            self.check_summary(name, summary)
            self.check_steps(name, out / "steps.csv", summary)

    def check_summary(self, name, summary):
        self.expect(EXACT <= summary.keys(), name, f"keys: {sorted(summary)}")
        self.expect(set(summary["mae"]) == ERRORS == set(summary["rmse"]), name, f"errors: {summary['mae']}")
        self.expect(set(summary["solve_time_us"]) == {"rhe", "rhc"}, name, f"times: {summary['solve_time_us']}")
        self.expect(all(set(times) == TIMES for times in summary["solve_time_us"].values()), name, "times")
        self.expect(set(summary["statuses"]) == {"rhe", "rhc"}, name, f"statuses: {summary['statuses']}")
        self.expect(summary["completed"] is True and summary["steps"] > 10, name, f"{summary['steps']}, {summary['ended']}")
        self.expect(summary["fallbacks"] == 0, name, f"{summary['fallbacks']} fallbacks: {summary['statuses']}")
        self.expect(sum(summary["statuses"]["rhc"].values()) == summary["steps"], name, f"statuses: {summary['statuses']}")
        truth, rhe = name == "estimator truth", summary["statuses"]["rhe"]
        self.expect(bool(rhe) == (name not in ("estimator truth", "estimator ekf")), name, f"statuses of rhe: {rhe}")
        self.expect((summary["nees"] is None) == truth, name, f"nees: {summary['nees']}")
        if name not in LOOSE:
            self.expect(summary["mae"]["tracking"] < 1.5 and summary["mae"]["kappa"] < 0.15, name, f"{summary['mae']}")
        if truth:
            self.expect(summary["mae"]["kappa"] == 0 and summary["mae"]["position"] == 0, name, f"{summary['mae']}")

    def check_steps(self, name, file, summary):
        with file.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        self.expect(len(rows) == summary["steps"], name, f"{len(rows)} rows for {summary['steps']} steps")
        texts = {"estimator_status", "controller_status", "faults", "health", "findings"}
        numbers = [value for row in rows for key, value in row.items() if key not in texts and value != ""]
        self.expect(all(math.isfinite(float(value)) for value in numbers), name, "a number in steps.csv is not finite")
        kappa = [abs(float(row["kappa"]) - float(row["true_kappa"])) for row in rows]
        self.expect(math.isclose(sum(kappa) / len(kappa), summary["mae"]["kappa"], rel_tol=1e-6, abs_tol=1e-9), name,
                    "mae.kappa is not that of steps.csv")

    def repeats(self):
        one, same = self.run("seed 1", ["seed=1"]), self.run("seed 1 again", ["seed=1"])
        other = self.run("seed 2", ["seed=2"])
        for file in ("steps.csv", "horizons.jsonl", "run.svg"):
            first = (one / file).read_bytes()
            self.expect(first == (same / file).read_bytes(), file, "two runs of one scenario and seed differ")
            self.expect(first != (other / file).read_bytes(), file, "runs of different seeds are the same")

    def overrides(self):
        scenario = self.work / "scenario.yaml"
        scenario.write_text("seed: 7\nblocking: {kappa: {name: structured, size: 5, overlap: 4}}\n")
        base = self.run("scenario", [], scenario)
        same = self.run("what is there already", ["seed=7"], scenario)
        other = self.run("another seed", ["seed=7", "seed=8"], scenario)
        last = self.run("the last one counts", ["seed=8", "seed=7"], scenario)
        size = self.run("a key of a section", ["blocking.kappa.size=3"], scenario)
        section = self.run("a whole section", ["blocking.kappa={name: full_horizon}"], scenario)
        steps = {name: (out / "steps.csv").read_bytes() for name, out in
                 [("base", base), ("same", same), ("other", other), ("last", last), ("size", size), ("section", section)]}
        self.expect(steps["base"] == steps["same"] == steps["last"], "--set", "a value that was there changed the run")
        self.expect(len({steps[name] for name in ("base", "other", "size", "section")}) == 4, "--set", "changed nothing")
        # A plugin without options is one word; another backend is that one word changed.
        word = self.run("a solver as a word", ["estimator.solver=gn_rti", "seed=7"], scenario)
        self.expect((word / "steps.csv").read_bytes() == steps["base"], "--set", "a word is not the plugin of that name")
        for solver in ("sparse_sqp", "ipopt", "nlopt"):
            self.run(solver, [f"estimator.solver={solver}", f"controller.solver={solver}"], scenario)

    def fast_lag(self):
        """A vehicle with a lag that is far shorter than an interval."""
        (self.work / "lag.yaml").write_text(LAG)
        vehicle = "model={equations: lag.yaml}"
        # The path is as tight as the steering allows, where rates that cost something track worse.
        weights = ["controller.weights.stage.u2=0.8", "controller.weights.rates.u2=0"]
        out = self.run("a fast lag", [vehicle, *weights])
        summary = json.loads((out / "summary.json").read_text())
        self.expect(summary["completed"] is True and summary["mae"]["tracking"] < 1.5, "a fast lag", f"{summary}")
        self.expect(summary["integration"]["checked"] > 0 and summary["integration"]["coarse"] == 0, "a fast lag",
                    f"{summary['integration']}")
        implicit = ["estimator.integrator=implicit", "controller.integrator=implicit"]
        (self.work / "stiff.yaml").write_text(LAG.replace("/ 0.01", "/ 0.001"))
        stiff = "model={equations: stiff.yaml}"
        for name, settings in {
                "a fast lag, implicit": [vehicle, *implicit], "a lag of 1 ms, implicit": [stiff, *implicit],
                "a lag of 1 ms, auto": [stiff, "estimator.integrator=auto", "controller.integrator=auto"],
                "a lag of 1 ms, ekf": [stiff, "estimator.name=ekf", *implicit],
                "a lag of 1 ms, bank": [stiff, "estimator.name=bank", *implicit],
                "a lag of 1 ms, blocks": [stiff, "blocking.kappa=full_horizon", "blocking.mu=full_horizon", *implicit],
                "a lag of 1 ms, rates": [stiff, "controller.weights.rates.u2=0.1", *implicit]}.items():
            summary = json.loads((self.run(name, [*weights, *settings]) / "summary.json").read_text())
            self.expect(summary["completed"] is True and summary["mae"]["tracking"] < 1.5, name, f"{summary}")
            self.expect(summary["integration"]["coarse"] == 0, name, f"{summary['integration']}")
        for section in ("estimator", "controller"):
            result = self.rhec("run", FIGURE8, "--out", self.work / "refused",
                               *assignments(*SHORT, vehicle, f"{section}.substeps=2"), cwd=self.work)
            self.expect(result.returncode != FINE, section, "a step that is unstable was taken")
            for words in ("substeps", "unstable", "0.01 s", "'rate'", "expected at least", "auto", "integrator: implicit"):
                self.expect(words in result.stderr, section, f"no '{words}' in: {result.stderr}")
            self.expect(not (self.work / "refused").exists(), section, "files of a run that was refused")
        self.count_of_runs += 1
        result = self.rhec("run", FIGURE8, "--out", self.work / "coarse",
                           *assignments(*SHORT, vehicle, "estimator.substeps=8"), cwd=self.work)
        self.expect(result.returncode == FINE and "the integration was too coarse" in result.stdout, "substeps 8",
                    result.stdout + result.stderr)

    def coarse_motion(self):
        """Steps that are too coarse for what a sensor of motion sees, a state of the estimator alone: it is named."""
        self.count_of_runs += 1
        result = self.rhec("run", cli.ROOT / "scenarios" / "tractor_trailer.yaml", "--out", self.work / "trailer",
                           *assignments("path.radius=8", "model.outputs=all", "model.trailer_length=0.5", "speed=6", "estimator.substeps=1",
                                        "controller.substeps=2"), cwd=self.work)
        self.expect(result.returncode == FINE and "too coarse, most in 'trailer_yaw_rate': give" in result.stdout, "coarse motion",
                    f"exit code {result.returncode}: {result.stdout}{result.stderr}")

    def rejected_sensor(self):
        """Of a sensor of which nothing is used there is no statistic."""
        self.count_of_runs += 1
        log = self.work / "all.csv"
        self.rhec("run", FIGURE8, "--out", self.work / "logged", "--log", log, *assignments(*SHORT), cwd=self.work)
        result = self.rhec("estimate", FIGURE8, log, "--out", self.work / "rejected",
                           *assignments("signals.outputs.delta={from: delta, offset: 100000}"), cwd=self.work)
        line = next((line for line in result.stdout.splitlines() if line.startswith("delta ") and " rad, " in line), "")
        self.expect(re.match(r"delta +0 +\d+ +- +1\.00 +- / - rad, -$", line), "a sensor that is rejected", result.stdout + result.stderr)

    def numbers_that_end(self):
        """A vehicle whose motion overflows behind x = 3 m: the run ends there, and all that is written is finite."""
        self.count_of_runs += 1
        text = (cli.ROOT / "examples" / "vehicles" / "bicycle.yaml").read_text()
        vehicle = self.work / "overflows.yaml"
        vehicle.write_text(text.replace("x_pos' = speed * cos(beta)", "x_pos' = speed * cos(beta) + exp(300 * (x_pos - 3))"))
        out = self.work / "overflows"
        result = self.rhec("run", FIGURE8, "--out", out, *assignments(*SHORT, f"model={{equations: {vehicle}}}", "estimator.name=truth"), cwd=self.work)
        self.expect(result.returncode == NOT_SOLVED and "moves faster than numbers can say" in result.stdout, "overflow", result.stdout + result.stderr)
        for name in ("steps.csv", "summary.json"):
            words = (out / name).read_text().replace(",", " ").split()
            self.expect(not {"nan", "-nan", "inf", "-inf"} & set(words), "overflow", f"{name} has numbers that are not finite")

    def limits(self):
        """A soft limit that costs too little to be kept."""
        self.count_of_runs += 1
        terms = "controller.terms=[{name: keep_out, lines: [{x: 0, y: -18, direction: 0}], soft: {linear: 0.01, quadratic: 0}}]"
        result = self.rhec("run", FIGURE8, "--out", self.work / "limits",
                           *assignments("path={name: zigzag, legs: 1, leg_length: 30}", "speed=3", terms), cwd=self.work)
        self.expect(result.returncode == FINE and "LIMIT VIOLATED" in result.stdout and "keep_out: line 1" in result.stdout,
                    "limits", result.stdout + result.stderr)
        limits = json.loads((self.work / "limits" / "summary.json").read_text())["limits"]
        self.expect(list(limits) == ["keep_out: line 1"] and limits["keep_out: line 1"]["violated"] > 20, "limits", f"{limits}")
        self.expect(abs(limits["keep_out: line 1"]["most"] - 2.5) < 0.5, "limits", f"{limits}")

    def others(self):
        result = self.rhec("plugins", "--json")
        self.expect(result.returncode == FINE, "plugins --json", result.stderr)
        names = {(plugin["kind"], plugin["name"]) for plugin in json.loads(result.stdout) if "kind" in plugin}
        for plugin in [("model", "bicycle_slip"), ("solver", "gn_rti"), ("blocking", "structured"), ("blocking", "pattern"),
                       ("blocking", "unblocked"), ("blocking", "full_horizon")]:
            self.expect(plugin in names, "plugins --json", f"{plugin} is missing in {names}")
        result = self.rhec("plugins", "structured")
        self.expect(result.returncode == FINE and "neighbour_sigma" in result.stdout, "plugins structured", result.stdout)
        result = self.rhec("options", "controller")
        self.expect(result.returncode == FINE and "`controller.horizon`" in result.stdout, "options", result.stdout)
        for words in (["--help"], ["--version"], ["run", "--help"], ["solve", "--help"], ["plugins", "--help"]):
            result = self.rhec(*words)
            self.expect(result.returncode == FINE and result.stdout and not result.stderr, " ".join(words), result.stderr)
        for line in self.rhec("run", "--help").stdout.splitlines():
            if line.strip().startswith("rhec run ") and "--out" in line:
                self.expect("{name:" in line or "blocking.kappa.name" not in line, "run --help", f"cannot work: {line}")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(work).resolve())
        for part in (test.choices, test.repeats, test.overrides, test.fast_lag, test.coarse_motion, test.rejected_sensor, test.numbers_that_end, test.limits, test.others):
            part()
        test.tell()


if __name__ == "__main__":
    main()
