#!/usr/bin/env python3
"""Problems that a run or an estimation saves, and their replay.

    dump.py <rhec>
"""
import csv
import json
import math
import pathlib
import re
import shlex
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, NOT_SOLVED, SHORT, USAGE, Program, assignments

# It cannot stop before the wall that it drives against: solves of the controller fail.
WALL = ["blocking.kappa={name: structured, size: 2, overlap: 4}", "controller.speed_bound_factor=.inf", "bounds.u1=[4, 20]",
        "bounds.x_pos=[-20, 6]"]
BLOCKS = ["blocking.kappa={name: structured, size: 5, overlap: 2, transition: ramp, neighbour_sigma: 0.1}",
          "controller.blocking={u1: {name: pattern, lengths: [1, 2, 4, 8]}}"]
# A hard corridor that the vehicle is not in.
TOO_NARROW = ["controller.terms=[{name: corridor, left: 0.01, right: 0.01, hard: true}]", "controller.solver={name: sparse_sqp}"]
LOG = """
name: park
model: {name: bicycle_slip, wheelbase: 2.0, gps_offset: 0}
noise: {outputs: {x_gps: 0.1, y_gps: 0.1, delta: 0.02}, inputs: {u1: 0.1, u2: 0.05}}
variants:
  plain: {}
  robust: {estimator: {robust: {outputs: [x_gps, y_gps]}, horizon: 6}}
  filter: {estimator: {name: ekf}}
"""


def lines_of(file):
    return [json.loads(line) for line in file.read_text().splitlines()]


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("dump")
        self.rhec, self.work, self.count_of_runs = rhec, work, 0

    def run(self, name, settings, *words, expected=FINE):
        """The output, the folder of problems and that of results of a run."""
        self.count_of_runs += 1
        out, problems = self.work / f"out-{self.count_of_runs}", self.work / f"problems-{self.count_of_runs}"
        result = self.rhec("run", FIGURE8, "--out", out, "--dump", problems, *assignments(*SHORT, *settings), *words)
        self.expect(result.returncode == expected and not result.stderr, name, f"{result.returncode}: {result.stderr}")
        files = sorted(path.name for path in problems.iterdir())
        self.expect(files == ["rhc.jsonl", "rhe.jsonl"], name, f"files: {files}")
        return result.stdout, problems, out

    def replay(self, name, stdout, file, expected=FINE):
        """The solutions by the command that was printed; each has the very objective that the run had."""
        commands = [line.split(": ", 1)[1] for line in stdout.splitlines() if f"rhec solve {file} " in line]
        if not self.expect(len(commands) == 1, name, f"expected one command for {file.name} in {stdout}"):
            return []
        result = self.rhec(*shlex.split(commands[0])[1:])
        self.expect(result.returncode == expected, name, f"{result.returncode}: {result.stderr}")
        problems, solutions = lines_of(file), [json.loads(line) for line in result.stdout.splitlines()]
        self.expect(len(problems) == len(solutions) > 0, name, f"{len(problems)} problems, {len(solutions)} solutions")
        for problem, solution in zip(problems, solutions):
            origin = problem["origin"]
            # A controller says of an answer to a problem with a price that it does not keep the limits.
            status = "solved" if "limit_price" in problem and origin["status"] == "relaxed" else origin["status"]
            self.expect(problem["version"] == 5 and problem["id"] == solution["id"], name, f"{problem['id']}")
            self.expect(solution["objective"] == float(origin["objective"]) and solution["status"] == status
                        and solution["iterations"] == int(origin["iterations"]), name,
                        f"{problem['id']} was {origin}, is {solution['objective']!r}, {solution['status']}")
        return solutions

    def priced(self):
        """Hard limits that cannot be kept have a price, which the replay has, too."""
        stdout, problems, _ = self.run("priced", TOO_NARROW, "--dump-every", 1)
        solutions = self.replay("priced", stdout, problems / "rhc.jsonl", NOT_SOLVED)
        prices = {line["id"]: line["limit_price"] for line in lines_of(problems / "rhc.jsonl") if "limit_price" in line}
        self.expect(len(prices) > 5 and len(set(prices.values())) > 1, "priced", f"prices: {prices}")
        solved = sum(solution["status"] == "solved" for solution in solutions if solution["id"] in prices)
        self.expect(solved >= 0.9 * len(prices), "priced", f"{solved} of {len(prices)} solved")

    def every(self):
        for name, settings in {"priors": [], "blocks": BLOCKS, "converge": ["estimator.solver.mode=converge",
                                                                             "controller.solver.mode=converge"]}.items():
            stdout, problems, out = self.run(name, settings, "--dump-every", 1)
            with (out / "steps.csv").open(newline="") as stream:
                rows = list(csv.DictReader(stream))
            for kind in ("rhe", "rhc"):
                solutions = self.replay(name, stdout, problems / f"{kind}.jsonl")
                ids = [solution["id"] for solution in solutions]
                self.expect(ids == [f"figure8/{kind}/{step}" for step in range(len(rows))], name, f"ids: {ids[:3]} ...")
                if kind == "rhe" and settings != BLOCKS:
                    continue  # what is given out is the mixture of all laws
                for row, solution in zip(rows, solutions):
                    # u2, whose rate is weighed, is a state at the end of its interval.
                    got = [solution["inputs"][0][0], solution["states"][1][4]] if kind == "rhc" else solution["states"][-1]
                    told = [row["u1"], row["u2"]] if kind == "rhc" else [row["x_pos"], row["y_pos"], row["beta"], row["delta"]]
                    self.expect(all(math.isclose(a, float(b), rel_tol=1e-6, abs_tol=1e-6) for a, b in zip(got, told)), name,
                                f"{solution['id']}: {got}, but steps.csv has {told}")
            sequence = self.rhec("solve", problems / "rhc.jsonl", "--solver", "gn_rti", "--sequence")
            self.expect(sequence.returncode == FINE and len(sequence.stdout.splitlines()) == len(rows), name, sequence.stderr)

        stdout, problems, _ = self.run("every tenth", [], "--dump-every", 10)
        steps = [line["id"].rsplit("/", 1)[1] for line in lines_of(problems / "rhe.jsonl")]
        self.expect(steps == [str(10 * i) for i in range(len(steps))] and len(steps) > 2, "every tenth", f"steps: {steps}")
        # A guess is where a solve begins, unless that is not wanted.
        guessed = self.rhec("solve", problems / "rhc.jsonl", "--solver", "gn_rti", "--set", "mode=rti")
        cold = self.rhec("solve", problems / "rhc.jsonl", "--solver", "gn_rti", "--set", "mode=rti", "--cold")
        without = self.work / "without.jsonl"
        without.write_text("".join(json.dumps({key: value for key, value in line.items() if key != "guess"}) + "\n"
                                   for line in lines_of(problems / "rhc.jsonl")))
        bare = self.rhec("solve", without, "--solver", "gn_rti", "--set", "mode=rti")
        told = [[json.loads(line)["inputs"] for line in result.stdout.splitlines()] for result in (guessed, cold, bare)]
        self.expect(told[1] == told[2] != told[0], "--cold", "is not the start that a line without a guess has")

    def failing(self):
        stdout, problems, out = self.run("all well", [])
        self.expect(not (problems / "rhe.jsonl").read_text() and not (problems / "rhc.jsonl").read_text(), "all well",
                    "nothing failed, and yet something was saved")
        stdout, problems, out = self.run("wall", WALL)
        summary = json.loads((out / "summary.json").read_text())
        failed = [line for line in lines_of(problems / "rhc.jsonl")]
        self.expect({line["origin"]["status"] for line in failed} <= {"infeasible", "bad_input"} and len(failed) > 0, "wall",
                    f"{[line['origin'] for line in failed]}")
        last = [line for line in failed if "/attempt" not in line["id"]]
        self.expect(len(last) == summary["fallbacks"] > 0, "wall", f"{len(last)} last attempts, {summary['fallbacks']} fallbacks")
        self.expect(len({line["id"] for line in failed}) == len(failed), "wall", "two problems of one id")
        self.replay("wall", stdout, problems / "rhc.jsonl", NOT_SOLVED)

    def estimation(self):
        scenario, rows, fixes = self.work / "park.yaml", self.work / "rows.csv", self.work / "fixes.csv"
        scenario.write_text(LOG)
        rows.write_text("".join(f"{0.05 * i},2.0,{0.1 * math.sin(0.05 * i)}\n" for i in range(200)))
        fixes.write_text("".join(f"{0.3 * i},{0.6 * i},{0.02 * i * i}\n" for i in range(1, 30)))
        words = ["estimate", scenario, "--dead-reckoning", rows, "--gps", fixes, "--out", self.work / "park"]
        result = self.rhec(*words, "--dump", self.work / "park-problems", "--dump-every", 4)
        self.expect(result.returncode == FINE, "estimate", result.stderr)
        files = sorted(path.name for path in (self.work / "park-problems").iterdir())
        self.expect(files == ["rhe.jsonl"], "estimate", f"files: {files}")
        file = self.work / "park-problems" / "rhe.jsonl"
        problems = lines_of(file)
        prefixes = {line["id"].rsplit("/", 1)[0] for line in problems}
        self.expect(prefixes == {"park/plain/rhe", "park/robust/rhe"}, "estimate", f"{prefixes}")
        self.expect(all(("robust" in line) == ("/robust/" in line["id"]) for line in problems), "estimate", "robust losses")
        self.expect(any(line["horizon"]["intervals"] == 0 for line in problems), "estimate", "the first window is missing")
        self.replay("estimate", result.stdout, file)

    def documented(self):
        blocks = re.findall(r"```json\n(.*?)```", (cli.ROOT / "docs" / "problem_format.md").read_text(), re.DOTALL)
        self.expect(len(blocks) == 2, "problem_format.md", f"{len(blocks)} examples")
        file = self.work / "examples.jsonl"
        file.write_text("".join(json.dumps(json.loads(block)) + "\n" for block in blocks))
        result = self.rhec("solve", file, "--solver", "gn_rti", "--set", "mode=converge")
        statuses = [json.loads(line)["status"] for line in result.stdout.splitlines()]
        self.expect(statuses == ["solved"] * len(blocks), "problem_format.md", f"{statuses}: {result.stderr}")

    def refused(self):
        good = self.run("good", [], "--dump-every", 20)[1] / "rhe.jsonl"
        line = lines_of(good)[1]
        file = self.work / "bad.jsonl"
        for change, words in [
                ({"version": 6}, ["version: found 6, expected 1 .. 5"]),
                ({"version": 1}, ["is a key of version 2; add \"version\": 2"]),
                ({"gues": {}}, ["gues: unknown key; did you mean 'guess'?"]),
                ({"guess": {"states": line["guess"]["states"]}}, ["guess.controls: missing"]),
                ({"guess": {**line["guess"], "states": line["guess"]["states"][1:]}}, ["guess.states:", "rows, expected"]),
                ({"guess": {**line["guess"], "controls": [[0.0]] * len(line["inputs"])}}, ["guess.controls[0]: 1 numbers"]),
                ({"arrival": {**line["arrival"], "information": [[-1.0] * 11] * 11}}, ["arrival.information: [0][0] is -1"]),
                ({"processes": {"kappa": 9, "mu": 3}}, ["processes.kappa: found 9, expected", "from 1 to 4"]),
                ({"processes": {"kappa": 4}, "data": [row[:33] for row in line["data"]]}, ["processes.mu: missing"]),
                ({"processes": {"kapa": 4, "mu": 3}}, ["processes.kapa", "did you mean 'kappa'"]),
                ({"data": [row[1:] for row in line["data"]]}, ["data: rows of 51, expected 52"]),
                ({"data": line["data"][1:]}, ["data:", "rows, expected"]),
                ({"transition": {"kappa": "slope"}}, ["transition.kappa: found \"slope\", expected \"step\" or \"ramp\""]),
        ]:
            file.write_text(json.dumps(line) + "\n" + json.dumps({**line, **change}) + "\n")
            result = self.rhec("solve", file, "--solver", "gn_rti")
            # What a line's names and shapes mean is found out when its turn comes.
            self.expect(result.returncode == ERROR and result.stderr.startswith(f"rhec: error: {file}:2: ")
                        and all(word in result.stderr for word in words), f"{change}"[:60], result.stderr)
        for words, code, text in [
                (["--dump-every", 3], USAGE, "--dump"), (["--dump", self.work / "x", "--dump-every", 0], USAGE, "--dump-every"),
                (["--dump", good], ERROR, "is a file"), (["--dump", "/proc/rhec"], ERROR, "/proc"), (["--dump", ""], ERROR, "empty")]:
            result = self.rhec("run", FIGURE8, "--out", self.work / "never", *words)
            self.expect(result.returncode == code and text in result.stderr, f"{words}", f"{result.returncode}: {result.stderr}")
        self.expect(not (self.work / "never").exists() and not (self.work / "x").exists(), "refused", "something was written")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(work).resolve())
        for part in (test.every, test.priced, test.failing, test.estimation, test.documented, test.refused):
            part()
        test.tell()


if __name__ == "__main__":
    main()
