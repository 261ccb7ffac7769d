#!/usr/bin/env python3
"""rhec compare: its table, its files, its exit codes, and that a second run gives the same but for times.

    compare.py <rhec> <folder of toy_solver>
"""
import json
import pathlib
import re
import sys
import tempfile
import xml.etree.ElementTree

import cli
from cli import ERROR, FIGURE8, FINE, NOT_SOLVED, SHORT, USAGE, ZIGZAG, Program, assignments

SPREADS = {"iterations", "kkt_residual", "defect", "violation", "gap", "distance", "time_us"}
RTI, CONVERGED = "rti=gn_rti:mode=rti", "converged=gn_rti:mode=converge,tolerance=1e-9"


def without_times(node):
    if isinstance(node, dict):
        return {key: without_times(value) for key, value in node.items() if key != "time_us"}
    return [without_times(item) for item in node] if isinstance(node, list) else node


class Test(cli.Findings):
    def __init__(self, rhec, toys, work):
        super().__init__("compare")
        self.rhec, self.toys, self.work, self.runs = rhec, toys, work, 0

    def compare(self, name, *words, code=FINE, scenario=FIGURE8):
        """What was printed, and compare.json."""
        self.runs += 1
        out = self.work / f"out-{self.runs}"
        result = self.rhec("compare", scenario, *words, "--out", out, "--plugin-path", self.toys, *assignments(*SHORT))
        self.expect(result.returncode == code, name, f"exit code {result.returncode}: {result.stderr or result.stdout}")
        self.expect(not result.stderr, name, f"standard error: {result.stderr}")
        files = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
        if not self.expect(files == ["compare.json", "compare.svg"], name, f"files: {files}"):
            return result.stdout, None
        picture = xml.etree.ElementTree.parse(out / "compare.svg")
        self.expect(picture.getroot().tag.endswith("svg"), name, "compare.svg is no SVG")
        return result.stdout, json.loads((out / "compare.json").read_text())

    def good(self):
        for scenario in (FIGURE8, ZIGZAG):
            text, found = self.compare(scenario.name, "--solvers", f"{RTI},{CONVERGED}", "--seeds", 2, scenario=scenario)
            self.expect([solver["label"] for solver in found["solvers"]] == ["rti", "converged"], "labels", text)
            self.expect(found["solvers"][1]["options"] == {"mode": "converge", "tolerance": 1e-9}, "options",
                        f"{found['solvers']}")
            self.expect(len(found["seeds"]) == 2 and found["all_usable"] is True, "seeds", f"{found['seeds']}")
            for kind in ("rhe", "rhc"):
                same = found["same_problems"][kind]
                rti, converged = same["solvers"]
                for solver in same["solvers"]:
                    self.expect(SPREADS <= solver.keys(), kind, f"keys: {sorted(solver)}")
                    self.expect(sum(solver["statuses"].values()) == same["problems"] == solver["solved"], kind, f"{solver}")
                self.expect(converged["kkt_residual"]["max"] <= 1e-9 < rti["kkt_residual"]["median"], kind, "KKT residual")
                self.expect(abs(converged["gap"]["max"]) <= 1e-9 < rti["gap"]["median"], kind, "gap")
                self.expect(converged["distance"]["max"] < rti["distance"]["median"], kind, "distance")
            for loop in found["closed_loop"]:
                self.expect(len(loop["runs"]) == 2 and all(run["completed"] for run in loop["runs"]), "runs", f"{loop}")
                mean = sum(run["mae"]["kappa"] for run in loop["runs"]) / 2
                self.expect(abs(mean - loop["errors"]["kappa"]["mean"]) < 1e-12, "mean", f"{loop['errors']}")
            first, second = found["closed_loop"]
            pairs = zip(first["runs"], second["runs"])
            difference = sum(b["mae"]["tracking"] - a["mae"]["tracking"] for a, b in pairs) / 2
            self.expect(abs(difference - second["errors"]["tracking"]["difference"]) < 1e-12, "difference",
                        f"{second['errors']}")
            self.check_text(text)

    def check_text(self, text):
        for words in ("ESTIMATION (RHE)", "CONTROL (RHC)", "CLOSED LOOP", "DISTANCE", "TIME [us]", "difference to the first"):
            self.expect(words in text, "table", f"'{words}' is missing:\n{text}")
        rows = [line for line in text.splitlines() if line.startswith(("rti ", "converged "))]
        self.expect(len(rows) == 6, "table", f"{len(rows)} rows:\n{text}")
        longest = max(len(line) for line in text.splitlines() if not re.search("numbers and a picture", line))
        self.expect(longest <= 150, "table", f"{longest} columns")
        self.expect(not any(line != line.rstrip() for line in text.splitlines()), "table", "blanks at the end of a line")

    def repeats(self):
        words = ("--solvers", f"{RTI},{CONVERGED},toy=toy_solver", "--accuracy", "1e-6", "--every", 3)
        # The toy gets lost in the closed loop.
        first = self.compare("first", *words, code=NOT_SOLVED)[1]
        second = self.compare("second", *words, code=NOT_SOLVED)[1]
        self.expect(without_times(first) == without_times(second), "repeats", "two runs differ in more than times")
        self.expect(list(first) == list(second), "repeats", "keys in another order")
        for kind in ("rhe", "rhc"):
            rti, converged, toy = first["same_problems"][kind]["solvers"]
            for solver in (rti, converged):
                self.expect(solver["accuracy_reached"] and solver["kkt_residual"]["p99"] <= 1e-6, kind, f"{solver}")
            self.expect(not toy["accuracy_reached"] and "tolerance" in toy["tuning"], kind, f"{toy['tuning']}")
            self.expect(toy["gap"]["median"] > 1e-6, kind, f"the toy is not seen as worse: {toy['gap']}")

    def bad_solvers(self):
        text, found = self.compare("refusal", "--solvers", "gn_rti,toy_solver:kind=refuse_rhe", code=NOT_SOLVED)
        self.expect("a toy cannot look back" in text, "refusal", text)
        self.expect(found["closed_loop"][0]["runs"] and not found["closed_loop"][1]["runs"], "refusal", "closed loop")
        text, found = self.compare("lost", "--solvers", "gn_rti,toy_solver:kind=lost", "--no-closed-loop", code=NOT_SOLVED)
        self.expect("infeasible" in text and found["closed_loop"] == [], "lost", text)

    def drives(self):
        own = self.compare("--drive", "--solvers", "a=gn_rti,b=gn_rti:mode=converge", "--drive", "a", "--no-closed-loop")[1]
        self.expect(own["reference"]["label"] == "a" and own["reference"]["options"] == {}, "--drive", f"{own['reference']}")
        other = self.compare("--drive", "--solvers", "gn_rti", "--drive", "gn_rti:mode=converge", "--no-closed-loop")[1]
        self.expect(other["reference"]["options"] == {"mode": "converge"}, "--drive", f"{other['reference']}")

    def mistakes(self):
        for words, code, expected in (
                (["--solvers", "gn_rtj"], ERROR, "--solvers gn_rtj: there is no solver plugin 'gn_rtj'; did you mean 'gn_rti'?"),
                (["--solvers", "gn_rti:mod=rti"], ERROR, "--solvers gn_rti:mod=rti: mod: .*did you mean 'mode'"),
                (["--solvers", "gn_rti:mode=rti,tolerance=-1"], ERROR, "--solvers gn_rti:tolerance=-1: .*greater than 0"),
                (["--solvers", "gn_rti:mode=rti,other=gn_rti,a=b"], ERROR, "--solvers b: there is no solver plugin 'b'"),
                (["--solvers", "gn_rti,gn_rti"], ERROR, "a second solver of the label"),
                (["--solvers", "gn_rti,,"], ERROR, "a solver without a name"),
                (["--solvers", "=gn_rti"], ERROR, "an empty label"),
                (["--solvers", "gn_rti", "--drive", "gn_rti,ipopt"], ERROR, "--drive gn_rti,ipopt: expected one solver"),
                (["--solvers", "gn_rti", "--drive", "nobody"], ERROR, "--drive nobody: there is no solver plugin"),
                (["--solvers", "gn_rti", "--set", "foo=3"], ERROR, "has no option 'foo'"),
                (["--solvers", "gn_rti", "--set", "seed=2147483647", "--seeds", 2], ERROR, "seed 2147483648 is too large"),
                (["--solvers", "gn_rti", "--seeds", 0], USAGE, "--seeds"),
                (["--solvers", "gn_rti", "--every", 0], USAGE, "--every"),
                (["--solvers", "gn_rti", "--accuracy", 0], USAGE, "--accuracy"),
                ([], USAGE, "--solvers is required")):
            out = self.work / "not made"
            result = self.rhec("compare", FIGURE8, *words, "--out", out)
            name = " ".join(map(str, words))
            self.expect(result.returncode == code, name, f"exit code {result.returncode}: {result.stderr}")
            self.expect(re.search(expected, result.stderr), name, result.stderr)
            self.expect(not result.stdout and not out.exists(), name, f"wrote something: {result.stdout}")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), pathlib.Path(work).resolve())
        for part in (test.good, test.repeats, test.bad_solvers, test.drives, test.mistakes):
            part()
        test.tell()


if __name__ == "__main__":
    main()
