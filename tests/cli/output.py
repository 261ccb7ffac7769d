#!/usr/bin/env python3
"""Where results go where nobody says so, results as JSON, and notes on configurations that look wrong: output.py <rhec>"""
import json
import pathlib
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, NOT_SOLVED, SHORT, Program, assignments

SWEEP = """\
name: small
scenario: {scenario}
set: {{path.laps: 1, path.radius: 12, speed: 10}}
grid:
  - estimator.name: [ekf, truth]
    seed: {{from: 1, to: 2}}
"""


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("output")
        self.rhec, self.work = rhec, work
        (work / "small.yaml").write_text(SWEEP.format(scenario=FIGURE8))

    def call(self, *words, fine=(FINE,)):
        result = self.rhec(*words, cwd=self.work, timeout=200)
        self.expect(result.returncode in fine, " ".join(map(str, words)), f"{result.returncode}: {result.stderr}")
        return result

    def document(self, *words, fine=(FINE,)):
        result = self.call(*words, "--json", fine=fine)
        try:
            return json.loads(result.stdout)
        except ValueError as problem:
            self.expect(False, " ".join(map(str, words)), f"no JSON: {problem}: {result.stdout[:200]}")
            return {}

    def places(self):
        short = assignments(*SHORT)
        self.call("run", FIGURE8, *short, "--dump", "problems", "--dump-every", "20", "--log", "drive.csv")
        self.expect(sorted(path.name for path in (self.work / "out").iterdir()) == ["figure8"], "run", "out/figure8 and nothing else")
        self.expect(sorted(path.name for path in (self.work / "problems").iterdir()) == ["rhc.jsonl", "rhe.jsonl"], "--dump")
        self.call("report", "out/figure8")
        self.call("sweep", "small.yaml")
        self.call("report", "out/small.sqlite")
        self.call("compare", FIGURE8, *short, "--solvers", "gn_rti:mode=converge", "--every", "20", "--no-closed-loop")
        self.call("smooth", FIGURE8, *short)
        self.call("estimate", FIGURE8, "drive.csv", *assignments("estimator.name=ekf"))
        expected = {"figure8/summary.json", "figure8/report.html", "small.sqlite", "small.html", "figure8_compare/compare.json",
                    "figure8_smooth/summary.json", "figure8_estimate/summary.json"}
        there = {path.relative_to(self.work / "out").as_posix() for path in (self.work / "out").rglob("*") if path.is_file()}
        self.expect(expected <= there, "out/", f"missing: {sorted(expected - there)}")
        self.expect({path.name for path in self.work.iterdir()} == {"out", "small.yaml", "problems", "drive.csv"}, "the working folder",
                    f"{sorted(path.name for path in self.work.iterdir())}")

    def json_of_all(self):
        short = assignments(*SHORT)
        run = self.document("run", FIGURE8, *short, "--out", "a")
        self.expect({**run, "out": None} == {**json.loads((self.work / "a" / "summary.json").read_text()), "out": None}, "run --json", str(run)[:200])
        self.expect(pathlib.Path(run.get("out", "")) == self.work / "a", "run --json", f"out: {run.get('out')}")
        estimate = self.document("estimate", FIGURE8, "drive.csv", *assignments("estimator.name=ekf"))
        self.expect(pathlib.Path(estimate.get("out", "")).name == "figure8_estimate" and len(estimate) > 3, "estimate --json")
        self.expect("out" in self.document("smooth", FIGURE8, *short), "smooth --json")
        self.expect("out" in self.document("smooth", FIGURE8, "drive.csv", *assignments("estimator.name=ekf")), "smooth LOG --json")
        compare = self.document("compare", FIGURE8, *short, "--solvers", "gn_rti:mode=converge", "--every", "20", "--no-closed-loop")
        self.expect("out" in compare and {**compare, "out": None} == {**json.loads((self.work / "out" / "figure8_compare" / "compare.json").read_text()), "out": None},
                    "compare --json", str(compare)[:200])
        sweep = self.document("sweep", "small.yaml")
        self.expect(sweep.get("there_before") == 4 and sweep.get("made") == 0, "sweep --json", str(sweep)[:200])
        rows = sweep.get("settings", [])
        self.expect([row["keys"].get("estimator.name") for row in rows] == ["truth", "ekf"], "sweep --json", f"the truth is nearest: {rows}")
        self.expect(all(row["runs"] == row["completed"] == 2 and row["mae"]["kappa"] >= 0 for row in rows), "sweep --json", str(rows))
        self.expect(self.document("report", "out/small.sqlite", "--svg", "figures").get("report") == "out/small.html", "report --json")
        log = self.document("log", "drive.csv", "--vehicle", FIGURE8)
        self.expect(log["topics"][0]["records"] > 20 and "signals:" in log["signals"], "log --json", str(log)[:200])
        self.call("run", FIGURE8, *short, "--set", "estimator.memory={name: place, file: field.sqlite}", "--out", "b")
        maps = self.document("map", "field.sqlite", "--ascii", "rasters")
        self.expect([each["name"] for each in maps["maps"][0]["parameters"]] == ["kappa", "mu"] and "ASCII rasters" in maps["written"], "map --json")
        tuned = self.document("tune", FIGURE8, "drive.csv", "--most-seconds", "2", "--out", "tuned", fine=(FINE, NOT_SOLVED))
        self.expect("out" in tuned and len(tuned) > 3, "tune --json", str(tuned)[:200])

    def every_command_has_it(self):
        """But for those that print no results: a script for a shell, and solutions, which are JSON anyway."""
        listed = self.rhec("--help").stdout.split("Subcommands:")[1].split("\n\n")[0]
        for command in {line.split()[0] for line in listed.splitlines() if line.strip()} - {"completion", "solve"}:
            self.expect("--json" in self.rhec(command, "--help").stdout, f"{command} --json")
        vehicle = self.document("model", cli.ROOT / "examples" / "vehicles" / "bicycle.yaml")
        self.expect([state["name"] for state in vehicle["states"]] == ["x_pos", "y_pos", "beta", "delta"] and vehicle["options"], "model --json", str(vehicle))

    def sweeps_are_told(self):
        told = self.call("sweep", "small.yaml").stdout
        rows = [line.split() for line in told.splitlines()]
        head = next((row for row in rows if row[:2] == ["estimator.name", "RUNS"]), [])
        self.expect("kappa" in head and "tracking" in head, "sweep", f"no table of errors: {told}")
        self.expect(any(row[:2] == ["truth", "2"] for row in rows) and any(row[:2] == ["ekf", "2"] for row in rows), "sweep", told)

    def notes(self):
        def note(*settings):
            result = self.call("run", FIGURE8, *assignments("path.laps=1", *settings), "--out", "c", fine=(FINE, NOT_SOLVED, ERROR))
            return result.stderr

        # Which numbers are noted is tested in tests/sim/loop/scenario_test.cpp; drives with such numbers take minutes.
        long_step = note("step=1.5", "speed=1", "path.radius=5", "estimator.name=truth")
        self.expect("rhec: note: step: 1.5 s" in long_step, "step=1.5", long_step)
        leftover = note("model.outputs=[x_gps, y_gps]", "path.radius=12")
        self.expect("figure8.yaml:" in leftover and "noise.outputs.delta: passed over" in leftover, "model.outputs", leftover)
        wrong = self.rhec("run", FIGURE8, *assignments("model.outputs=[x_gps, y_gps]", "noise.outputs.dleta=1"), cwd=self.work)
        self.expect(wrong.returncode == ERROR and "did you mean 'delta'?" in wrong.stderr, "a name that no sensor has", wrong.stderr)


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-output-") as folder:
        test = Test(Program(sys.argv[1]), pathlib.Path(folder).resolve())
        test.places()
        test.json_of_all()
        test.every_command_has_it()
        test.sweeps_are_told()
        test.notes()
        test.tell()


if __name__ == "__main__":
    main()
