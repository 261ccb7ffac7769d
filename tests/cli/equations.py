#!/usr/bin/env python3
"""A vehicle as equations, as a user meets it: the same drive as with the plugin whose equations they are, every solver and
command, and mistakes.

    equations.py <rhec>
"""
import csv
import json
import pathlib
import shutil
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, SHORT, Program, assignments

VEHICLES = cli.ROOT / "examples" / "vehicles"
BICYCLE = VEHICLES / "bicycle.yaml"
# Converged, so that rounding is all that can differ.
CONVERGED = ["estimator.solver={name: gn_rti, mode: converge, tolerance: 1e-10}",
             "controller.solver={name: gn_rti, mode: converge, tolerance: 1e-10}"]
SOLVERS = ["gn_rti", "sparse_sqp", "ipopt", "nlopt"]


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("equations")
        self.rhec, self.work = rhec, work

    def drive(self, name, *settings):
        out = self.work / name
        result = self.rhec("run", FIGURE8, *assignments(*SHORT, *settings), "--out", out)
        if not self.expect(result.returncode == FINE, name, result.stderr):
            return []
        with open(out / "steps.csv", newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def same_drive(self):
        """The same trajectory with plugin and equations, at usual and at other lengths."""
        for lengths in ("", ", wheelbase: 2.1, gps_offset: -0.2"):
            compiled = self.drive("plugin", f"model={{name: bicycle_slip{lengths}}}", *CONVERGED)
            interpreted = self.drive("file", f"model={{equations: {BICYCLE}{lengths}}}", *CONVERGED)
            self.expect(compiled and len(compiled) == len(interpreted), "steps", f"{len(compiled)}, {len(interpreted)}")
            worst = 0.0
            for one, other in zip(compiled, interpreted):
                for name in ("true_x_pos", "true_y_pos", "x_pos", "y_pos", "beta", "delta", "kappa", "mu", "u1", "u2"):
                    worst = max(worst, abs(float(one[name]) - float(other[name])))
            self.expect(worst < 1e-8, "the same drive", f"differs by {worst}")

    def every_solver(self):
        """All solvers take the vehicle, for estimation and control."""
        problems = self.work / "problems"
        result = self.rhec("run", FIGURE8, *assignments(*SHORT, "blocking.kappa={name: full_horizon}", f"model={{equations: {BICYCLE}}}"),
                           "--out", self.work / "dumped", "--dump", problems,
                           "--dump-every", "20")
        self.expect(result.returncode == FINE, "dump", result.stderr)
        for file in sorted(problems.glob("*.jsonl")):
            self.expect(json.loads(file.read_text().splitlines()[0])["model"]["name"].endswith("bicycle.yaml"), "recorded model", file.name)
            for solver in SOLVERS:
                options = ["mode=converge"] if solver == "gn_rti" else []
                result = self.rhec("solve", file, "--solver", solver, *assignments(*options), "--out", self.work / "solved.jsonl")
                self.expect(result.returncode == FINE, f"{solver} on {file.name}", result.stderr + result.stdout)

    def commands(self):
        """plugins, check: of the file itself; a file that a scenario names is beside the scenario."""
        result = self.rhec("plugins", BICYCLE)
        self.expect(result.returncode == FINE and "wheelbase" in result.stdout and "by the interpreter" in result.stdout,
                    "plugins", result.stdout + result.stderr)
        result = self.rhec("plugins", BICYCLE, "--json")
        if self.expect(result.returncode == FINE, "plugins --json", result.stderr):
            about = json.loads(result.stdout)[0]
            self.expect([option["name"] for option in about["options"]] == ["wheelbase", "gps_offset", "outputs"], "options",
                        str(about["options"]))
        for vehicle in sorted(VEHICLES.glob("*.yaml")):
            result = self.rhec("check", vehicle)
            self.expect(result.returncode == FINE and "0 failed, 0 warnings" in result.stdout, f"check {vehicle.name}",
                        result.stdout + result.stderr)
        result = self.rhec("check", BICYCLE, *assignments("wheelbase=0"))
        self.expect(result.returncode == ERROR and "wheelbase: found '0', expected a number, greater than 0" in result.stderr,
                    "check with a wrong option", result.stderr)

        folder = self.work / "scenario"
        folder.mkdir()
        shutil.copy(BICYCLE, folder / "mine.yaml")
        text = FIGURE8.read_text(encoding="utf-8").replace("  name: bicycle_slip\n", "  equations: mine.yaml\n")
        (folder / "figure8.yaml").write_text(text, encoding="utf-8")
        result = self.rhec("run", folder / "figure8.yaml", *assignments(*SHORT), "--out", self.work / "beside")
        self.expect(result.returncode == FINE, "a file beside the scenario", result.stderr)

    def inline(self):
        """Equations in the scenario itself: the same drive as with the file; problems that are saved have them, too."""
        scenario = self.work / "inline.yaml"

        def write(vehicle):
            vehicle = vehicle[vehicle.index("name: bicycle"):]
            section = "".join(f"    {line}\n" if line else "\n" for line in vehicle.splitlines())
            text = FIGURE8.read_text(encoding="utf-8")
            scenario.write_text(text.replace("  name: bicycle_slip\n", f"  equations:\n{section}"), encoding="utf-8")
            return scenario.read_text(encoding="utf-8")

        good = BICYCLE.read_text(encoding="utf-8")
        write(good)
        drives = []
        for name, words in (("inline", [scenario]), ("by_file", [FIGURE8, *assignments(f"model={{equations: {BICYCLE}}}")])):
            problems = self.work / f"problems_{name}"
            result = self.rhec("run", *words, *assignments(*SHORT, "blocking.kappa={name: full_horizon}"), "--out", self.work / name,
                               "--dump", problems, "--dump-every", "20")
            if not self.expect(result.returncode == FINE, f"a drive {name}", result.stderr):
                return
            drives.append((self.work / name / "steps.csv").read_text(encoding="utf-8").splitlines())
            for file in sorted(problems.glob("*.jsonl")):
                result = self.rhec("solve", file, "--solver", "gn_rti", *assignments("mode=converge"), "--out", self.work / "s.jsonl")
                self.expect(result.returncode == FINE, f"{file} again", result.stderr)
        # All but the times of computing.
        columns = [k for k, name in enumerate(drives[0][0].split(",")) if "time" not in name and "_us" not in name and "_ms" not in name]
        same = all([one.split(",")[k] for k in columns] == [other.split(",")[k] for k in columns] for one, other in zip(*drives))
        self.expect(len(drives[0]) == len(drives[1]) and same, "the same drive inline")
        result = self.rhec("check", scenario, *assignments("model.wheelbase=2.5"), "--trace")
        self.expect(result.returncode == FINE and "2.5" in result.stdout, "check --trace of inline equations", result.stderr)
        text = write(good.replace("mu * delta", "mu * detla", 1))
        line = text[:text.index("detla")].count("\n") + 1
        column = text.splitlines()[line - 1].index("detla") + 1
        result = self.rhec("run", scenario, "--out", self.work / "none")
        self.expect(result.returncode == ERROR and f"{scenario}:{line}:{column}: 'detla' is not known" in result.stderr,
                    "a mistake inline", result.stderr)
        result = self.rhec("run", FIGURE8, *assignments("model={equations: {states: {x: {}}}}"), "--out", self.work / "none")
        self.expect(result.returncode == ERROR and "it has no outputs; expected the key 'outputs'" in result.stderr, "inline by --set",
                    result.stderr)

    def mistakes(self):
        wrong = self.work / "wrong.yaml"
        good = BICYCLE.read_text(encoding="utf-8")
        line = good[:good.index("beta'  =")].count("\n") + 1
        for part, other, expected in (
            ("tan(mu * delta)", "tan(mu * deltta)", f"{wrong}:{line}:41: 'deltta' is not known; did you mean 'delta'?"),
            ("kappa * u1", "kappa u1", "a product is written with '*'"),
            ("beta'  =", "# beta'  =", "the state 'beta' has no equation"),
            ("speed / wheelbase", "speed / 0", "this divides by 0"),
            ("equations: |", "equation: |", "did you mean 'equations'?"),
        ):
            wrong.write_text(good.replace(part, other, 1), encoding="utf-8")
            for command in (["plugins", wrong], ["run", FIGURE8, *assignments(f"model={{equations: {wrong}}}"), "--out",
                                                  self.work / "none"]):
                result = self.rhec(*command)
                self.expect(result.returncode == ERROR and expected in result.stderr, f"{command[0]}: {other}", result.stderr)
        self.expect(not (self.work / "none").exists(), "nothing is written")
        for settings, expected in (
            ("model={equations: nowhere.yaml}", "expected a file with a vehicle's equations; there is no nowhere.yaml"),
            ("model={equations: bicycle_slip}", "expected a file with a vehicle's equations, whose name ends in .yaml"),
            (f"model={{equations: {BICYCLE}, name: bicycle_slip}}", "expected one of the keys"),
            (f"model={{equations: {BICYCLE}, wheelbse: 2}}", "did you mean 'wheelbase'?"),
            (f"model={{equations: {BICYCLE}, outputs: [x_gpss]}}", "expected an output of the model"),
        ):
            result = self.rhec("run", FIGURE8, *assignments(settings), "--out", self.work / "none")
            self.expect(result.returncode == ERROR and expected in result.stderr, settings, result.stderr)


def main():
    with tempfile.TemporaryDirectory() as folder:
        test = Test(Program(sys.argv[1]), pathlib.Path(folder))
        test.same_drive()
        test.every_solver()
        test.commands()
        test.inline()
        test.mistakes()
        test.tell()


if __name__ == "__main__":
    main()
