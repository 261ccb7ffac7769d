#!/usr/bin/env python3
"""Bad input gets one clear line that names the place, and the exit code of apps/commands.hpp; results stay as they were.

    bad_input.py <rhec>
"""
import json
import math
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, NOT_SOLVED, PAPER, SHORT, USAGE, Program, assignments

# What is set over the scenario, and what the line must say beside the key itself: the first part before '=', unless given.
SETTINGS = [
    # key names
    ("spede=4", "did you mean 'speed'"),
    ("noise.outputs.x_gsp=1", "did you mean 'x_gps'"),
    ("noise.output={}", "did you mean 'outputs'"),
    ("bounds.kapa=[0, 1]", "did you mean 'kappa'"),
    ("blocking.kapa={name: full_horizon}", "did you mean 'kappa'"),
    ("blocking.kappa.siez=3", "did you mean 'size'"),
    ("blocking.kappa={name: full_horizon, size: 3}", "remove 'size'"),
    ("estimator.process_noise.kapa=1", "did you mean 'kappa'"),
    ("estimator.forgetting.kappa=1", "is called 'process_noise' now"),
    ("estimator.restart_sigma.m=1", "did you mean 'mu'"),
    ("estimator.initial.states={}", "did you mean 'state'"),
    ("estimator.initial.state={x: 0}", "x_pos, y_pos, beta, delta"),
    ("estimator.initial.sigma.kapa=1", "did you mean 'kappa'"),
    ("estimator.robust={outputs: [x_gps], detla: 1}", "did you mean 'delta'"),
    ("estimator.robust={outputs: [speed]}", "x_gps, y_gps, delta"),
    ("controller.horizont=3", "did you mean 'horizon'"),
    ("controller.weights.stage.z=1", "x_pos, y_pos, beta, delta, u1, u2"),
    ("controller.weights.terminal.u1=1", "x_pos, y_pos, beta, delta"),
    ("controller.blocking.u3={name: full_horizon}", "did you mean 'u1'"),
    ("model.wheelbse=1", "did you mean 'wheelbase'"),
    ("terrain.correlation=1", "terrain has no option"),
    ("terrain={name: constant, values: {kapa: 1}}", "did you mean 'kappa'"),
    ("path.lap=1", "did you mean 'laps'"),
    ("vehicle.steps=1", "did you mean 'step'"),
    # types
    ("speed=fast", "expected a number"),
    ("speed=", "found nothing"),
    ("speed=.nan", "expected a number"),
    ("seed=1.5", "expected an integer"),
    ("name=[1]", "expected a text"),
    ("vehicle.mechanical_stops=yes", "true or false"),
    ("noise=5", "expected a map"),
    ("noise.outputs=[1, 2]", "expected a map"),
    ("model=[bicycle_slip]", "a map"),
    ("blocking=5", "expected a map"),
    ("blocking.kappa=[5]", "a map"),
    ("estimator=rhe", "expected a map"),
    ("estimator.solver=[gn_rti]", "a map"),
    ("estimator.initial=3", "expected a map"),
    ("estimator.robust={outputs: x_gps}", "a list"),
    ("estimator.robust={}", "expected the key 'outputs'"),
    ("controller.weights=[1]", "expected a map"),
    ("path=zigzag", "expected a map"),
    ("terrain.values=3", "expected a map"),
    ("terrain.files=a.csv", "expected a list"),
    ("bounds.kappa=0", "[lower, upper]"),
    ("bounds.kappa=[0]", "[lower, upper]"),
    ("bounds.kappa=[a, 1]", "expected a number"),
    ("bounds.kappa=[.nan, 1]", "expected a number"),
    ("speed.x=3", "only a map has keys"),
    # values
    ("speed=0", "between 0.01 and 100"),
    ("seed=-1", "between 0"),
    ("step=0", "step: found '0', expected a number, between 1e-05 and 100000"),
    ("step=1e-300", "step: found '1e-300', expected a number, between 1e-05 and 100000"),
    ("step=.inf", "step: found '.inf', expected a number, between 1e-05 and 100000"),
    ("step=1e-5", "steps of 1e-05 s"),
    ("path={name: headland, lateral_acceleration: 1e-12}", "path.lateral_acceleration"),
    ("estimator.horizon=0", "between 1"),
    ("controller.horizon=0", "between 1"),
    ("estimator.substeps=0", "between 1"),
    ("estimator.heading_starts=0", "between 1"),
    ("blocking.kappa.size=0", "at least 1"),
    ("blocking.kappa.overlap=-1", "at least 0"),
    ("blocking.kappa.neighbour_sigma=-1", "greater than 0"),
    ("blocking.kappa.transition=jump", "one of step, ramp"),
    ("blocking.kappa={name: pattern, lengths: [0]}", "at least 1"),
    ("blocking.kappa={name: pattern, lengths: 3}", "a list of integers"),
    ("blocking.kappa={name: pattern}", "at least one block length"),
    ("controller.blocking={u1: {name: pattern}}", "at least one block length"),
    ("noise.outputs.x_gps=-1", "greater than 0"),
    ("noise.outputs.x_gps=0", "greater than 0"),
    ("noise.outputs.x_gps=1e-300", "noise.outputs.x_gps: found '1e-300', expected a standard deviation between 1e-09 and 1e+09"),
    ("noise.outputs.x_gps=1e-12", "noise.outputs.x_gps: found '1e-12', expected a standard deviation between 1e-09 and 1e+09"),
    ("noise.states.beta=1e12", "noise.states.beta: found '1e12', expected a standard deviation between 1e-09 and 1e+09, in the variable's unit, or 0"),
    ("noise.inputs.u1=1e300", "noise.inputs.u1: found '1e300', expected a standard deviation"),
    ("noise.states.beta=1e-300", "noise.states.beta: found '1e-300', expected a standard deviation"),
    ("noise.biases={delta: {sigma: 1e300}}", "noise.biases.delta.sigma: found '1e300'"),
    ("noise.scales={delta: {sigma: 0.1, drift: 1e300}}", "noise.scales.delta.drift: found '1e300'"),
    ("estimator.initial.sigma={beta: 1e300}", "estimator.initial.sigma.beta: found '1e300'"),
    ("estimator.process_noise.kappa=1e300", "estimator.process_noise.kappa: found '1e300'"),
    ("noise.inputs.u1=.inf", "finite"),
    ("estimator.initial.sigma={beta: -1}", "greater than 0"),
    ("estimator.initial.parameters={kappa: .inf}", "between -1000000000 and 1000000000"),
    ("estimator.initial.state={x_pos: 1e12}", "between -1000000000 and 1000000000"),
    ("estimator.priors={kappa: {name: matern, mean: .inf}}", "estimator.priors.kappa.mean: found '.inf', expected a finite number"),
    ("estimator.bank.memory=1e-300", "estimator.bank.memory: found '1e-300', expected a number of a magnitude between 1e-100 and 1e+100, greater than 0"),
    ("estimator.process_noise.kappa=-1", "at least 0"),
    ("estimator.restart_sigma.kappa=.inf", "finite"),
    ("estimator.block_sigma.kappa=0", "greater than 0"),
    ("estimator.block_sigma.kapa=1", "did you mean 'kappa'"),
    ("estimator.robust={outputs: [x_gps], delta: 0}", "greater than 0"),
    ("bounds.kappa=[.inf, null]", "bounds.kappa: found [inf, inf], expected bounds of a magnitude of at most 1e+09, or null for none"),
    ("bounds.kappa=[null, -.inf]", "bounds.kappa: found [-inf, -inf], expected bounds"),
    ("bounds.mu=[1e300, null]", "bounds.mu: found [1e+300, inf], expected bounds"),
    ("bounds.kappa=[5e-324, 5e-324]", "bounds.kappa: found [5e-324, 5e-324], expected bounds"),
    ("bounds.y_pos=[2, 2]", "bounds.y_pos: found [2, 2], expected lower < upper: a state of the vehicle moves"),
    ("bounds.y_pos=[1000, 1001]", "bounds.y_pos: [1000, 1001] leave out the start, 0 m, whose standard deviation is 0.05 m; expected bounds that hold it"),
    ("bounds.kappa=[1, 0]", "found [1, 0], expected lower <= upper"),
    ("controller.least_speed_factor=0", "greater than 0"),
    ("controller.speed_bound_factor=-1", "at least 0"),
    ("controller.weights.stage.u1=-1", "at least 0"),
    ("controller.reference_speed=lit", "one of ground, literal"),
    ("model.wheelbase=0", "between 0.001 and 1000"),
    ("model.wheelbase=1e-300", "model.wheelbase: found '1e-300', expected a number, between 0.001 and 1000"),
    ("model.gps_offset=1e12", "between -1000 and 1000"),
    ("path.laps=0", "between 1"),
    ("path.radius=0", "greater than 0"),
    ("path.spacing=1e-9", "more than 2e+06"),
    ("path.radius=1e-9", "path.radius: the 3 waypoints, 0.1 m from each other at most, are all in one place"),
    ("path.spacing=1e50", "are all in one place; expected a longer path, or a smaller path.spacing"),
    ("terrain.correlation_length=1e-9", "terrain.correlation_length: gaussian slip field: a period of 500 m takes 7.143e+11 x"),
    ("terrain.period=1e50", "terrain.period: gaussian slip field: a period of 1e+50 m"),
    ("terrain.period=1e300", "terrain.period: found '1e300', expected a number of a magnitude between 1e-100 and 1e+100"),
    ("terrain.upper=1e12", "between -1000000000 and 1000000000"),
    ("terrain.lower=2", "expected lower <= upper"),
    ("terrain.correlation_length=0", "greater than 0"),
    ("vehicle.step=0", "between 1e-06"),
    # names
    ("estimator.name=nonsense", "one of rhe, ekf, bank, truth"),
    ("estimator.arrival.name=ekv", "did you mean 'ekf'"),
    ("path.name=zig", "one of figure8, zigzag, headland, file"),
    ("terrain.name=gauss", "one of gaussian"),
    ("estimator.solver.mode=fast", "one of rti, converge"),
    # files
    ("path.name=file", "path.file"),
    ("path={name: file, file: none.csv}", "none.csv"),
    ("terrain.name=raster", "expected 2"),
    ("terrain={name: raster, files: [none.csv]}", "expected 2"),
    ("terrain={name: raster, files: [none.csv, none.csv]}", "terrain.files[0]"),
    # the form of an assignment
    ("speed", "expected key.path=value"),
    ("=4", "expected key.path=value"),
    ("a..b=3", "empty part"),
    ("speed=[1", "not valid YAML"),
    ("speed=*x", "not valid YAML"),
]

# A mistake in the file: what takes the place of its last line, and what the error must say after the line's number.
IN_THE_FILE = [
    ("spede: 4", "3", "spede: scenario has no option 'spede'; did you mean 'speed'?"),
    ("speed: fast", "3", "speed: found 'fast', expected a number"),
    ("estimator:\n  horizon: 0", "4", "estimator.horizon: found '0'"),
    ("blocking:\n  kappa: {name: structured, size: 3, overlap: 16}", "4", "overlap of 16 needs a horizon"),
    ("blocking:\n  kappa:\n    name: pattern", "4", "blocking.kappa: blocking 'pattern': lengths"),
    ("estimator: {name: ekf}\nblocking: {mu: {name: structured, size: 0}}", "4", "blocking.mu.size"),
    ("estimator: {name: truth, process_noise: {kapa: 1}}", "3", "did you mean 'kappa'"),
    ("path:\n  name: file", "4", "path.name: found 'file', but no path.file"),
    ("path: {name: file, file: none.csv}", "3", "path.file: found 'none.csv', expected a file"),
    ("terrain: {name: raster, files: [none.csv, none.csv]}", "3", "terrain.files[0]: found 'none.csv'"),
    ("speed: 3\nspeed: 4", "4", "written twice"),
    ("speed: [3", "", "not valid YAML"),
    ("\tspeed: 3", "", "not valid YAML"),
    ("speed: 3\n---\nspeed: 4", "", "2 documents"),
    ("- speed", "", "not valid YAML"),
    ("speed: !number 3", "3", "the tag"),
]

# Waypoints, and what the error must say after the file's name.
WAYPOINTS = [
    ("0,0\n1\n2,0\n", ":2: 1 field(s) where 2 are expected"),
    ("x,y\n0,0\n1,0,5\n", ":3: 3 field(s) where 2"),
    ("0,0\n1,here\n2,0\n", ":2: field 2 is 'here'"),
    ("0,0\n", ": 1 waypoint(s)"),
    ("x,y\n", ": "),
    ("", ": the file is empty"),
    ("0,0\n1,\n", ":2: a coordinate is missing"),
    ("0,0,3\n1,0,-3\n", ":2: path: the speed is 3 m/s at waypoint 1 and -3 m/s"),
    ("0,0,3\n1,0,nan\n", ":2: the speed is missing"),
    ("0\n1\n", ": 1 column(s)"),
    ("0,0\n\n1,0\n", ":2: a blank line"),
    ("0,0\n0,0\n", "path: 1 distinct waypoint"),
]

PLUGINS = [
    ("model.name=bicycle", "model.name: there is no model plugin 'bicycle'", "bicycle_slip"),
    ("blocking.kappa.name=structurd", "did you mean 'structured'?", "unblocked"),
    ("estimator.solver.name=gnrti", "estimator.solver.name: there is no solver plugin 'gnrti'; did you mean 'gn_rti'?", "gn_rti"),
    ("controller.solver={name: nothing}", "controller.solver.name: there is no solver plugin 'nothing'", "gn_rti"),
    ("controller.blocking={u2: {name: blocks}}", "controller.blocking.u2.name: there is no blocking plugin", "structured"),
]


def change(record, path, value):
    """A copy of a record with the value at a path of keys changed; `...` drops the key."""
    copy = json.loads(json.dumps(record))
    place = copy
    for key in path[:-1]:
        place = place[key]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return copy


RHE = {
    "id": "run/rhe/2", "problem": "rhe", "model": {"name": "bicycle_slip", "wheelbase": 1.4, "gps_offset": 0.4},
    "horizon": {"intervals": 2, "dt": 0.2, "integrator": "rk4", "substeps": 1},
    "arrival": {"state": [0, 0, 0, 0], "parameters": [0.8, 0.8],
                "information": [[100.0 * (i == j) for j in range(6)] for i in range(6)]},
    "outputs": [[-0.4, 0, 0], [-0.1, None, 0], [0.25, 0, 0]], "inputs": [[2, 0], [2, None]],
    "weights": {"outputs": [1000, 1000, 3000], "inputs": [100, 100]},
    "bounds": {"delta": [-0.6, 0.6], "kappa": [0, 1], "mu": [0, None]},
    "block_starts": {"kappa": [0, 1], "mu": [0]},
}
RHC = {
    "id": "run/rhc/2", "problem": "rhc", "model": {"name": "bicycle_slip"},
    "horizon": {"intervals": 2, "dt": 0.2, "integrator": "rk4", "substeps": 1},
    "initial_state": [0, 0, 0, 0], "parameters": [0.8, 0.8],
    "reference": {"x_pos": [0, 0.4, 0.8], "y_pos": [0, 0, 0], "u1": [2, 2], "u2": [0, 0]},
    "weights": {"stage": {"x_pos": 1, "y_pos": 1, "u1": 5, "u2": 5}, "terminal": {"x_pos": 10, "y_pos": 10}},
    "bounds": {"delta": [-0.6, 0.6], "u2": [-0.6, 0.6]},
}
# Problem, path of keys, value, what the error must say after "problems.jsonl:1: ".
PROBLEMS = [
    (RHE, ["id"], ..., "id: missing"),
    (RHE, ["id"], 3, "id: found 3, expected a text"),
    (RHE, ["problem"], "mhe", 'problem: found "mhe"'),
    (RHE, ["weight"], 3, "weight: unknown key; did you mean 'weights'?"),
    (RHE, ["arrival"], ..., "arrival: missing"),
    (RHE, ["arrival", "mean"], 0, "arrival.mean: unknown key"),
    (RHE, ["arrival", "state"], [0, 0, 0], "arrival."),
    (RHE, ["arrival", "information"], [[1]], "arrival.information: 1 rows, expected 6"),
    (RHE, ["outputs"], RHE["outputs"][:2], "outputs: 2 rows, expected 3"),
    (RHE, ["outputs", 1], [0, 0], "outputs[1]: 2 numbers, expected 3"),
    (RHE, ["outputs", 0, 0], "a", 'outputs[0][0]: found "a"'),
    (RHE, ["outputs", 0, 0], math.nan, "a number that is not finite, which JSON does not have"),
    (RHE, ["inputs"], [[2, 0]], "inputs: 1 rows, expected 2"),
    (RHE, ["inputs"], [[2], [2]], "inputs[0]: 1 numbers, expected 2"),
    (RHE, ["horizon", "intervals"], 0, "horizon.intervals: found 0"),
    (RHE, ["horizon", "intervals"], 2.5, "horizon.intervals: found 2.5"),
    (RHE, ["horizon", "dt"], 0, "horizon.dt: found 0"),
    (RHE, ["horizon", "integrator"], "euler", "horizon.integrator: found"),
    (RHE, ["model", "name"], ..., "model.name: missing"),
    (RHE, ["model", "wheel"], 1, "wheel: model 'bicycle_slip' has no option 'wheel'"),
    (RHE, ["model", "wheelbase"], -1, "wheelbase: found '-1"),
    (RHE, ["bounds", "kappa"], [1, 0], "bounds.kappa: found [1, 0], expected lower <= upper"),
    (RHE, ["bounds", "kapa"], [0, 1], "bounds.kapa: model 'bicycle_slip' has no such variable here; did you mean 'kappa'?"),
    (RHE, ["block_starts", "kappa"], [1], "block_starts.kappa: expected"),
    (RHE, ["block_starts", "kappa"], [0, 2], "block_starts.kappa[1]: found 2"),
    (RHE, ["block_starts", "kappa"], ..., "block_starts.kappa: missing"),
    (RHE, ["weights", "outputs", 0], -1, "weights.outputs[0]: found -1"),
    (RHC, ["initial_state"], [0, 0, 0], "initial_state: 3 numbers, expected 4"),
    (RHC, ["reference", "u1"], ..., "reference.u1: missing"),
    (RHC, ["reference", "x_pos"], [0, 1], "reference.x_pos: 2 numbers, expected 3"),
    (RHC, ["weights", "stage", "z"], 1, "weights.stage.z: model 'bicycle_slip' has no such variable"),
    (RHC, ["bounds", "kappa"], [0, 1], "bounds.kappa: "),
    (RHC, ["parameters"], [1], "parameters: 1 numbers, expected 2"),
]
LINES = [("{", "column 2: no JSON"), ("[]", "expected a map"), ("3", "expected a map"), ("NaN", "column 1: a number that is not finite, which JSON does not have"),
         ('{"a": 1, "a": 2}', "a: the key is written twice"), ('{"a": 1e999}', "a number is too large")]


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("bad_input")
        self.rhec, self.work = rhec, work
        self.out = work / "out"

    def refused(self, name, result, code, *texts, lines=1):
        """One line (or `lines` at least), of the right form, with all of the texts in it; nothing is written."""
        said = result.stderr
        self.expect(result.returncode == code, name, f"exit code {result.returncode}, expected {code}; it says: {said}")
        self.expect(said.startswith("rhec: error: ") and said.count("rhec: error:") == 1, name, f"it says: {said!r}")
        self.expect("unexpectedly" not in said, name, f"it says: {said!r}")
        count = said.count("\n")
        self.expect(said.endswith("\n") and (count == 1 if lines == 1 else count >= lines), name, f"{count} lines: {said}")
        for text in texts:
            self.expect(text in said, name, f"it does not say {text!r} but: {said}")
        self.expect(not result.stdout, name, f"it prints {result.stdout!r}")
        self.expect(not self.out.exists(), name, "an output folder was left behind")

    def run(self, *settings, scenario=FIGURE8, out=None, words=()):
        return self.rhec("run", scenario, "--out", out or self.out, *assignments(*SHORT, *settings), *words)

    def settings(self):
        for assignment, text in SETTINGS:
            scenario = PAPER if assignment.startswith("blocking.") else FIGURE8
            self.refused(assignment, self.run(assignment, scenario=scenario), ERROR, text, assignment.split("=")[0].split(".")[0])
        self.refused("overlap over the horizon", self.run("blocking.kappa.overlap=16", scenario=PAPER), ERROR, "blocking.kappa",
                     "an overlap of 16 needs a horizon of at least 16 intervals", "estimator.horizon", "figure8.yaml:")
        for option in ("transition: ramp", "neighbour_sigma: 1"):
            self.refused(f"{option} of an input", self.run("controller.blocking={u1: {name: structured, %s}}" % option), ERROR,
                         "controller.blocking.u1", "an input jumps")
        self.refused("overlap of an input", self.run("controller.blocking={u1: {name: structured, overlap: 20}}"), ERROR,
                     "controller.blocking.u1", "controller.horizon")

    def memory(self):
        """A horizon that there is no memory for; a program with sanitizers needs more address space than any limit."""
        if re.search(r"preset +(asan|tsan)", self.rhec("--version").stdout):
            return

        def within(most, *words):
            return self.rhec("run", FIGURE8, "--out", self.out, *assignments(*words),
                             preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (most, most)))

        for key, room in (("estimator.horizon", "estimator.between"), ("controller.horizon", "")):
            for value in ("100000", "20000 s"):
                self.refused(f"{key}: {value}", within(600 << 20, f"{key}={value}"), ERROR, f"--set {key}={value}: {key}: 100000 intervals of",
                             "GB of memory", "GB are free", "expected at most", room)
        self.refused("room", within(200 << 20, "estimator.between=10000"), ERROR, "--set estimator.between=10000: estimator.between: 15 intervals")
        self.refused("cells", within(600 << 20, "estimator.memory={name: place, cells: 100000000}"), ERROR,
                     "estimator.memory", "a map of 100000000 cells", "GB are free")
        # Where what fails is not known before, the program says so, from as little as it starts with.
        self.refused("no memory", within(6 << 20, "estimator.name=bank"), ERROR, "not enough memory", "shorter horizons")

    def files(self):
        scenario = self.work / "scenario.yaml"
        for text, line, message in IN_THE_FILE:
            scenario.write_text(f"# a comment\nname: test\n{text}\n")
            result = self.rhec("run", scenario, "--out", self.out)
            self.refused(text, result, ERROR, message, f"{scenario}:{line}")
            self.expect(re.search(r"scenario\.yaml:[1-9]", result.stderr), text, f"no line is named: {result.stderr}")
        scenario.write_text("")
        self.refused("an empty file", self.rhec("run", scenario, "--out", self.out), ERROR, f"{scenario}: there is nothing in it")
        missing = self.work / "missing.yaml"
        self.refused("missing file", self.run(scenario=missing), ERROR, str(missing), "no such file")
        self.refused("folder", self.run(scenario=self.work), ERROR, str(self.work), "is a directory")
        path = self.work / "path.csv"
        for text, message in WAYPOINTS:
            path.write_text(text)
            place = "" if message.startswith("path") else str(path)
            self.refused(repr(text), self.run(f"path={{name: file, file: {path}}}"), ERROR, place + message)
        raster = self.work / "raster.csv"
        raster.write_text("origin_x,origin_y,cell_size\n0,0,1\n1,2\n3\n")
        self.refused("ragged raster", self.run(f"terrain={{name: raster, files: [{raster}, {raster}]}}"), ERROR, f"{raster}:4")

    def plugins(self):
        for assignment, text, known in PLUGINS:
            self.refused(assignment, self.run(assignment), ERROR, text, "available: ", known, "searched:", lines=3)
        result = self.rhec("plugins", "gn_rit")
        self.refused("plugins NAME", result, ERROR, "there is no plugin 'gn_rit'; did you mean 'gn_rti'?", lines=2)
        nowhere = self.work / "nowhere"
        for words in (["plugins"], ["options"], ["run", FIGURE8], ["solve", "-", "--solver", "gn_rti"]):
            self.refused(f"{words[0]} --plugin-path", self.rhec(*words, "--plugin-path", nowhere), ERROR,
                         f"--plugin-path {nowhere}", "no such directory")

    def first_steps(self):
        result = self.rhec()
        self.expect(result.returncode == 0 and "rhec run" in result.stdout, "no arguments", result.stdout + result.stderr)
        for line in result.stdout.splitlines():
            if line.startswith("  rhec") and "--help" in line:
                words = line.split()[1:3]
                self.expect(self.rhec(*words).returncode == 0, "no arguments", line)

    def outputs(self):
        with open("/dev/full", "w") as full:
            for words in (["plugins"], ["options"], ["--version"]):
                result = subprocess.run([sys.argv[1], *words], stdout=full, stderr=subprocess.PIPE, text=True)
                self.expect(result.returncode == ERROR, "a full disk", f"exit code {result.returncode} of {words}")
                self.expect("standard output could not be written: No space left" in result.stderr, "a full disk", result.stderr)
        file = self.work / "file"
        file.write_text("precious")
        self.refused("a file in the place of the folder", self.run(out=file), ERROR, str(file), "is a file")
        self.refused("a folder below a file", self.run(out=file / "deep" / "out"), ERROR, str(file))
        self.refused("a folder that cannot be", self.run(out="/proc/rhec/out"), ERROR, "/proc")
        self.expect(file.read_text() == "precious", "outputs", "the file in the place of the folder was changed")
        kept = self.work / "kept"
        kept.mkdir()
        (kept / "steps.csv").write_text("old")
        (kept / "run.svg").mkdir()
        result = self.run(out=kept)
        self.refused("a folder in the place of a file", result, ERROR, "run.svg")
        self.expect((kept / "steps.csv").read_text() == "old", "outputs", "old results were replaced although the run failed")
        self.expect(sorted(path.name for path in kept.iterdir()) == ["run.svg", "steps.csv"], "outputs", "litter was left")
        good = self.work / "good.jsonl"
        good.write_text(json.dumps(RHE) + "\n")
        solve = ["solve", good, "--solver", "gn_rti", "--out"]
        self.refused("solve to a folder", self.rhec(*solve, kept), ERROR, str(kept), "is a folder")
        self.refused("solve below a file", self.rhec(*solve, file / "x" / "y.jsonl"), ERROR, str(file))
        self.refused("solve to nowhere", self.rhec(*solve, "/proc/rhec/y.jsonl"), ERROR, "/proc")

    def problems(self):
        file = self.work / "problems.jsonl"

        def solve(text, *words):
            file.write_text(text)
            return self.rhec("solve", file, "--solver", "gn_rti", *words)

        for record in (RHE, RHC):
            result = solve(json.dumps(record))
            self.expect(result.returncode == 0, "a good problem", result.stderr)
        for record, path, value, text in PROBLEMS:
            result = solve(json.dumps(change(record, path, value)))
            place = f"{file}:1: " + ("column" if "JSON" in text else text)
            self.refused(f"{path} = {value}", result, ERROR, place, text)
        for line, text in LINES:
            self.refused(line, solve(line), ERROR, f"{file}:1: ", text)
        self.refused("empty file", solve(""), ERROR, str(file), "no problem in it")
        self.refused("missing file", self.rhec("solve", self.work / "none.jsonl", "--solver", "gn_rti"), ERROR, "none.jsonl")
        self.refused("folder", self.rhec("solve", self.work, "--solver", "gn_rti"), ERROR, "is a folder")
        self.refused("unknown model", solve(json.dumps(change(RHE, ["model", "name"], "bicycle"))), ERROR,
                     f"{file}:1: model: there is no model plugin 'bicycle'", lines=3)
        self.refused("unknown solver", self.rhec("solve", file, "--solver", "gnrti"), ERROR,
                     "--solver gnrti: there is no solver plugin", "did you mean 'gn_rti'?", lines=3)
        good = json.dumps(RHE)
        self.refused("--set without =", solve(good, "--set", "mode"), ERROR, "--set mode")
        self.refused("--set wrong", solve(good, "--set", "mode=x"), ERROR, "--set mode=x: mode: found 'x'")
        self.refused("--set unknown", solve(good, "--set", "modes=rti"), ERROR, "did you mean 'mode'?")
        self.refused("no step", solve(json.dumps(change(RHE, ["id"], "x")), "--sequence"), ERROR, f"{file}:1: id: 'x'")
        self.refused("same step", solve(good + "\n" + good, "--sequence"), ERROR, f"{file}:2: id: step 2 comes after step 2")
        file.write_text(good + "\n\n{}\n")
        result = self.rhec("solve", file, "--solver", "gn_rti")
        self.refused("an error in line 3", result, ERROR, f"{file}:3: ")

    def usage(self):
        for words, text in [
            (["rnu"], "did you mean 'run'?"), (["frobnicate"], "unknown command 'frobnicate'"),
            (["run"], "scenario is required"), (["run", FIGURE8, "--bogus"], "--bogus"),
            (["run", FIGURE8, "two"], "two"), (["run", FIGURE8, "--out"], "--out"), (["run", FIGURE8, "--set"], "--set"),
            (["solve", FIGURE8], "--solver is required"), (["solve", "--solver", "gn_rti"], "problems is required"),
            (["plugins", "one", "two"], "two"), (["--bogus"], "--bogus"), (["run", FIGURE8, "--plugin-path"], "--plugin-path"),
        ]:
            self.refused(f"rhec {' '.join(map(str, words))}", self.rhec(*words), USAGE, text)

    def wrong_commands(self):
        """A file that is given to another command than its own says what it is."""
        drive = ("--dead-reckoning", self.work / "drs.txt", "--gps", self.work / "gps.txt")
        (self.work / "drs.txt").write_text("0,1,0\n1,1,0\n")
        (self.work / "gps.txt").write_text("0,0,0\n1,1,0\n")
        park = cli.ROOT / "scenarios" / "victoria_park.yaml"
        for command in ("estimate", "smooth", "tune"):
            self.refused(f"{command} of a simulation", self.rhec(command, FIGURE8, *drive), ERROR, str(FIGURE8), "this scenario is for 'rhec run'")
        self.refused("run of a log", self.rhec("run", park), ERROR, str(park), "'rhec estimate'")
        self.refused("smooth of a log without files", self.rhec("smooth", park), ERROR, str(park), "--dead-reckoning")
        sweep, scenario = cli.ROOT / "scenarios" / "sweep_blocks.yaml", cli.ROOT / "scenarios" / "figure8.yaml"
        for words in (["estimate", sweep, sweep], ["smooth", sweep], ["check", sweep], ["compare", sweep, "--solvers", "gn_rti"],
                      ["tune", sweep, sweep]):
            self.refused(f"{words[0]} of a sweep", self.rhec(*words), ERROR, "'rhec sweep'")
        self.refused("sweep of a scenario", self.rhec("sweep", scenario), ERROR, "'rhec run' or 'rhec estimate'; a sweep names it")
        self.refused("estimate of a simulated drive", self.rhec("estimate", scenario), USAGE, "simulated drive, which is for 'rhec run'")
        self.refused("a word of an option", self.rhec("run", scenario, "--st", "seed=1"), USAGE, "there is no option '--st'; did you mean '--set'?")
        self.refused("a word too many", self.rhec("run", scenario, "seed=1"), USAGE, "found 'seed=1', which nothing takes")
        self.refused("run of a sweep", self.rhec("run", cli.ROOT / "scenarios" / "sweep_blocks.yaml"), ERROR, "'rhec sweep'")
        self.refused("run of a vehicle", self.rhec("run", cli.ROOT / "examples" / "vehicles" / "bicycle.yaml"), ERROR, "model: {equations: FILE}")
        for word, near in (("bicycle", "bicycle_slip"), ("skid", "skid_steer"), ("bicycle_slpi", "bicycle_slip")):
            result = self.rhec("check", word)
            self.expect(result.returncode == ERROR and f"did you mean '{near}'?" in result.stderr, f"check {word}", result.stderr)

    def lost(self):
        """A robot that leaves its path: exit code 3, and all files are there."""
        result = self.run("bounds.u2=[0, 0]")
        self.expect(result.returncode == NOT_SOLVED, "lost", f"exit code {result.returncode}: {result.stderr}")
        files = sorted(path.name for path in self.out.iterdir())
        self.expect(files == ["horizons.jsonl", "run.svg", "steps.csv", "summary.json", "times.csv"], "lost", f"files: {files}")
        summary = json.loads((self.out / "summary.json").read_text())
        self.expect(summary["completed"] is False and "end of the path" not in summary["ended"], "lost", summary["ended"])
        self.expect(summary["ended"] in result.stdout, "lost", f"it does not say why it ended: {result.stdout}")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(work).resolve())
        for part in (test.settings, test.memory, test.files, test.plugins, test.outputs, test.problems, test.usage, test.first_steps, test.wrong_commands, test.lost):
            part()
        test.tell()


if __name__ == "__main__":
    main()
