#!/usr/bin/env python3
"""Absurd numbers in configuration: every option that the program documents as a number gets each of them, in a scenario that works.

    absurd_values.py <rhec> [--part K/N] [--only REGEX] [--jobs N] [--list] [--report FILE.jsonl]

The options are those that `rhec options --json` and `rhec plugins --json` print, so that a new one is tried without being named
here. Of each, `rhec check`, a short `rhec run` and `rhec estimate` of a small log (of the smoother's, `rhec smooth`) have to end
well: with the exit code 0 or 3 and finite numbers in all that is written, or with one line that names the key and says what was
expected. Never by a signal, after more than 20 s of a processor, with more than 1 GB, or with the words of a library.

Cases are numbered in an order that a hash of their names gives; --part K/N tries those whose number is K modulo N.
"""
import argparse
import collections
import concurrent.futures
import csv
import dataclasses
import hashlib
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import cli
from cli import ERROR, FINE, NOT_SOLVED, ROOT, assignments

NUMBERS = ("1e-300", "1e300", "-1", "0", ".nan", ".inf", "1e-12", "1e12", "5e-324")
INTEGERS = ("0", "-1", "2147483648", "1000000000000000000")
LONGEST = 20    # s of a processor
PATIENT = 300    # s of the clock, on a machine that does other things: what waits for something ends here
MOST_MEMORY = 1 << 30    # bytes that are used
MOST_ADDRESSES = 3 << 30    # bytes that are mapped: programs, libraries and the stacks of threads count as well

# Words of libraries, of the language and of programs that have lost their way.
RAW = re.compile(r"std::|what\(\)|basic_string|vector::|_M_|bad_alloc|YAML::|yaml-cpp|stoi|stod|terminate|[Aa]ssert|Eigen|exception|"
                 r"unexpectedly|CHOLMOD|nlopt_|SQLITE|Segmentation|core dumped")
NOT_FINITE = re.compile(r"(?<![\w.'])[-+]?(?:nan|inf|infinity)(?![\w'])", re.IGNORECASE)

SCENARIOS = ROOT / "scenarios"
SMALL = ("path.laps=1", "path.legs=2")
VEHICLES = {    # a scenario of each vehicle, and what makes it short
    "bicycle_slip": (SCENARIOS / "figure8.yaml", ("path.radius=12",)),
    "bicycle_sideslip": (SCENARIOS / "bicycle_sideslip.yaml", ("path.leg_length=15",)),
    "skid_steer": (SCENARIOS / "skid_steer.yaml", ("path.radius=2",)),
    "tractor_trailer": (SCENARIOS / "tractor_trailer.yaml", ("path.radius=8",)),
    "unicycle_traction": (SCENARIOS / "unicycle_traction.yaml", ("path.leg_length=2",)),
}
EVERY_OUTPUT = "model.outputs=all"


@dataclasses.dataclass(frozen=True)
class Setup:
    """A scenario that works."""
    name: str
    vehicle: str = "bicycle_slip"
    settings: tuple = ()
    commands: tuple = ("check", "run", "estimate")
    keys: str = ""    # which of a section's keys are tried in it

    def words(self):
        scenario, short = VEHICLES[self.vehicle]
        return [str(scenario), *assignments(*SMALL, *short, *self.settings)]


@dataclasses.dataclass(frozen=True)
class Case:
    setup: Setup
    key: str    # that the error has to name
    assignment: str
    command: str

    @property
    def name(self):
        return f"{self.setup.name}: {self.command} --set '{self.assignment}'"


def values_of(kind):
    """What an option of this type is set to; nothing where it is no number."""
    integer, number = "integer" in kind, "number" in kind
    values = INTEGERS if integer else NUMBERS if number or kind == "[lower, upper]" else ()
    if kind in ("[lower, upper]", "list of 2 numbers"):
        return [text for value in values for text in (f"[{value}, null]", f"[null, {value}]", f"[{value}, {value}]")]
    if kind.startswith("list of"):
        return [f"[{value}]" for value in values] + [f"[{value}, {value}]" for value in values] + [f"[{value}, {value}, {value}]" for value in values]
    return list(values)


WHOLE = ("silence", "late", "stamp", "doubled", "swapped", "clock")    # faults of whole measurements
SIZELESS = ("stuck", "dropout", "silence", "doubled", "swapped")
HALVES = ("terrain.below={name: constant}", "terrain.above={name: constant}")
PLACES = {"STATE": "states", "INPUT": "inputs", "PARAMETER": "parameters", "OUTPUT": "outputs"}


class Options:
    """What the program documents, and the setups in which it is tried."""

    def __init__(self, rhec):
        told = json.loads(rhec("options", "--json").stdout)
        self.sections = {section["section"]: section["keys"] for section in told["sections"]}
        self.plugins = json.loads(rhec("plugins", "--json").stdout)
        for plugin in self.plugins:
            if "refusal" in plugin:
                sys.exit(f"absurd_values: {plugin['path']}: {plugin['refusal']}")
        self.models = {plugin["name"]: plugin for plugin in self.plugins if plugin["kind"] == "model"}

    def of_kind(self, kind):
        return [plugin for plugin in self.plugins if plugin["kind"] == kind]

    def choices(self, section, name):
        """The values of a choice, as its row says them."""
        row = next(row for row in self.sections[section] if row["name"] == name)
        return row["constraint"].removeprefix("one of ").split(", ")

    def written_out(self, name, model):
        """A row's name with the model's variables in the place of words in capitals."""
        if name == "STATE, INPUT or PARAMETER":
            return [variable["name"] for kind in ("states", "inputs", "parameters") for variable in model[kind]]
        for word, kind in PLACES.items():
            if word in name.split("."):
                return [name.replace(word, variable["name"]) for variable in model[kind]]
        return [name]

    def cases(self):
        for section, setups in self.setups():
            for row in self.sections[section]:
                for setup in setups:
                    for name in self.written_out(row["name"], self.models[setup.vehicle]):
                        key = f"{section}.{name}" if section else name
                        if re.search(setup.keys, key):
                            yield from self.tried(setup, key, row["type"], lambda value, key=key: self.assignment(key, value))
        yield from self.of_items()
        yield from self.of_plugins()

    @staticmethod
    def assignment(key, value):
        """key=value, and in its place the map with what the key does not stand without."""
        place, _, name = key.rpartition(".")
        if re.fullmatch(r"noise\.(biases|scales)\.\w+", place) and name != "sigma":
            return f"{place}={{sigma: 0.05, {name}: {value}}}"
        return f"{key}={value}"

    @staticmethod
    def tried(setup, key, kind, assignment):
        for value in values_of(kind):
            for command in setup.commands:
                yield Case(setup, key, assignment(value), command)

    def setups(self):
        """By section: setups in which its keys count."""
        plain = Setup("figure8")
        estimators = [Setup(f"all sensors, {name}", settings=(EVERY_OUTPUT, f"estimator.name={name}"), commands=("run", "estimate"))
                      for name in self.choices("estimator", "name") if name not in ("rhe", "truth")]
        truth = Setup("all sensors, truth", settings=(EVERY_OUTPUT, "estimator.name=truth"), commands=("run",))
        blocks = Setup("all sensors, blocks", settings=(EVERY_OUTPUT, "blocking.kappa={name: structured, size: 3}", "blocking.mu={name: full_horizon}"))
        robust = Setup("robust", settings=("estimator.robust={outputs: [x_gps, y_gps], delta: 3}",), keys="robust")
        places = Setup("places", settings=("estimator.memory.name=place",), commands=("run",), keys="memory")
        uncertain = "process_noise|_sigma|initial"
        arrivals = [Setup(f"arrival {name}", settings=(f"estimator.arrival.name={name}", *blocks.settings), commands=("run", "estimate"), keys=uncertain)
                    for name in self.choices("estimator", "arrival.name")]
        vehicles = [Setup(f"{vehicle}, all sensors", vehicle, (EVERY_OUTPUT,)) for vehicle in VEHICLES]
        yield "", [plain, *estimators]
        yield "path", [Setup(f"path {name}", settings=(f"path.name={name}",), commands=("run",))
                       for name in self.choices("path", "name") if name != "file"]
        yield "terrain", [Setup(f"terrain {name}", settings=(f"terrain.name={name}", *(HALVES if name == "split" else ())), commands=("run",))
                          for name in self.choices("terrain", "name") if name != "raster"]
        yield "vehicle", [Setup("figure8, run", commands=("run",))]
        yield "noise", [*estimators, truth, *vehicles]
        yield "bounds", [*estimators, truth, blocks, *vehicles]
        yield "estimator", [*(dataclasses.replace(setup, keys="^(?!.*(robust|memory))") for setup in (*estimators, *vehicles)),
                            dataclasses.replace(truth, keys="initial"), dataclasses.replace(blocks, keys=uncertain), robust, places, *arrivals]
        yield "controller", vehicles
        yield "smoother", [Setup("smooth", commands=("smooth",), keys="^(?!.*robust)"),
                           Setup("smooth, robust", settings=("smoother.robust={outputs: [x_gps], delta: 3}",), commands=("smooth",), keys="robust")]

    def of_items(self):
        """Sections of which a scenario has several, each with a name of its own, or in a list."""
        bicycle = self.models["bicycle_slip"]
        run = Setup("figure8, run", commands=("run",))
        for section, place, kind in (("vehicle.actuators.INPUT", "vehicle.actuators", "inputs"), ("sensors.OUTPUT", "sensors", "outputs")):
            for row in self.sections[section]:
                for variable in bicycle[kind]:
                    setup = run if variable.get("usual", True) else dataclasses.replace(run, name=f"{run.name}, all sensors", settings=(EVERY_OUTPUT,))
                    key = f"{place}.{variable['name']}.{row['name']}"
                    yield from self.tried(setup, key, row["type"], lambda value, key=key: f"{key}={value}")
        for kind in self.choices("faults", "kind"):
            fault = f"kind: {kind}"
            if kind not in WHOLE:
                fault += f", sensors: [{'u1' if kind == 'wheel_spin' else 'x_gps'}]"
            for row in self.sections["faults"]:
                name = row["name"]
                if kind in SIZELESS and name == "size":
                    continue
                others = "" if kind in SIZELESS or name == "size" else ", size: 0.5"
                if name == "every":
                    others += ", length: 0.5"
                yield from self.tried(run, f"faults[0].{name}", row["type"],
                                      lambda value, fault=fault, name=name, others=others: f"faults=[{{{fault}{others}, {name}: {value}}}]")
        estimate = Setup("figure8, signals", commands=("estimate",))
        for row in self.sections["signals"]:
            if "." not in row["name"]:
                yield from self.tried(estimate, f"signals.{row['name']}", row["type"], lambda value, row=row: f"signals.{row['name']}={value}")
        for row in self.sections["signals.SIGNAL"]:
            for variable, place in (("x_gps", "outputs"), ("delta", "outputs"), ("u1", "inputs")):
                yield from self.tried(estimate, f"signals.{place}.{variable}.{row['name']}", row["type"],
                                      lambda value, row=row, variable=variable, place=place:
                                      f"signals.{place}.{variable}={{from: {variable}, {row['name']}: {value}}}")

    def of_plugins(self):
        for vehicle, model in self.models.items():
            if vehicle in VEHICLES:
                setup = Setup(f"{vehicle}, its options", vehicle, (EVERY_OUTPUT,))
                for option in model["options"]:
                    yield from self.tried(setup, f"model.{option['name']}", option["type"], lambda value, option=option: f"model.{option['name']}={value}")
        for plugin in self.of_kind("blocking"):
            for place in ("blocking.kappa", "controller.blocking.u1"):
                yield from self.of_plugin(plugin, place, Setup(f"figure8, {place}"))
        for plugin in self.of_kind("prior"):
            for name in ("rhe", "bank"):
                yield from self.of_plugin(plugin, "estimator.priors.kappa", Setup(f"figure8, {name}, priors", settings=(f"estimator.name={name}",)))
            yield from self.of_plugin(plugin, "smoother.priors.kappa", Setup("figure8, smoother.priors", commands=("smooth",)))
        for plugin in self.of_kind("solver"):
            short = ("estimator.horizon=4", "controller.horizon=4", "controller.solver={name: gn_rti}")
            yield from self.of_plugin(plugin, "estimator.solver", Setup("figure8, estimator.solver", settings=short))
            yield from self.of_plugin(plugin, "controller.solver", Setup("figure8, controller.solver", settings=short[:2]))
            yield from self.of_plugin(plugin, "smoother.solver", Setup("figure8, smoother.solver", commands=("smooth",)))
        for plugin in self.of_kind("term"):
            setup = Setup("figure8, terms")
            for option in plugin["options"]:
                for path in self.written_out(option["name"], self.models["bicycle_slip"]):
                    *groups, name = path.split(".")
                    listed = {"obstacles", "lines"}
                    for value in values_of(option["type"]):
                        inner = f"{name}: {value}"
                        if name.endswith("along"):    # a table, whose columns are of one length
                            other = "along: [0, 10, 20]" if name != "along" else "left_along: [2, 2, 2]"
                            inner = f"{other}, {name}: {value}"
                        key = f"controller.terms[0].{path}"
                        for group in reversed(groups):
                            inner = f"{group}: [{{{inner}}}]" if group in listed else f"{group}: {{{inner}}}"
                            key = key.replace(f"{group}.", f"{group}[0].") if group in listed else key
                        for command in setup.commands:
                            yield Case(setup, key, f"controller.terms=[{{name: {plugin['name']}, {inner}}}]", command)

    def of_plugin(self, plugin, place, setup):
        if plugin["name"] == "nlopt" and place.startswith("smoother"):    # no whole drive is small enough for it
            return
        for option in plugin["options"]:
            if "." in option["name"]:
                continue
            others = "lengths: [3], " if plugin["name"] == "pattern" and option["name"] != "lengths" else ""
            yield from self.tried(setup, f"{place}.{option['name']}", option["type"],
                                  lambda value, option=option, others=others: f"{place}={{name: {plugin['name']}, {others}{option['name']}: {value}}}")


@dataclasses.dataclass
class Ended:
    code: int
    seconds: float
    memory: int
    out: str
    err: str
    hung: bool = False


def run_limited(words, work, sanitized):
    """The program within its limits; what it says goes to files, since a pipe of a program that hangs fills."""
    out, err = work / "stdout", work / "stderr"

    def limit():
        if not sanitized:
            resource.setrlimit(resource.RLIMIT_AS, (MOST_ADDRESSES, MOST_ADDRESSES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(LONGEST * cli.PATIENCE), int(LONGEST * cli.PATIENCE) + 5))
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))

    start, most = time.monotonic(), PATIENT * cli.PATIENCE
    with open(out, "w") as out_file, open(err, "w") as err_file:
        process = subprocess.Popen([str(word) for word in words], stdout=out_file, stderr=err_file, stdin=subprocess.DEVNULL, env=cli.CLEAN,
                                   preexec_fn=limit, cwd=work)
        hung = False
        while True:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            if ended:
                break
            if not hung and time.monotonic() - start > most:
                process.send_signal(signal.SIGKILL)
                hung = True
            time.sleep(0.005)
        process.returncode = os.waitstatus_to_exitcode(status)
    hung = hung or process.returncode == -signal.SIGXCPU
    return Ended(process.returncode, usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss, out.read_text(errors="replace"), err.read_text(errors="replace"), hung)


def not_finite_in(folder):
    """What is not finite in the files of a folder: file and column, or file and the end of a key's path."""
    found = collections.Counter()
    for file in sorted(folder.iterdir()):
        if file.suffix == ".csv":
            with open(file, newline="") as text:
                for row in csv.DictReader(line for line in text if not line.startswith("#")):
                    for column, value in row.items():
                        if isinstance(value, str) and value and NOT_FINITE.fullmatch(value.strip()):
                            found[f"{file.name}: {column}"] += 1
        elif file.suffix == ".json":
            text = file.read_text()
            for match in NOT_FINITE.finditer(re.sub(r'"(?:[^"\\]|\\.)*"', '""', text)):
                found[f"{file.name}: {match.group()}"] += 1
            if not found:
                nulls(json.loads(text), file.name, found)
        else:
            text = file.read_text()
            if file.suffix == ".jsonl":
                text = re.sub(r'"(?:[^"\\]|\\.)*"', '""', text)
            for match in NOT_FINITE.finditer(text):
                found[f"{file.name}: {match.group()}"] += 1
    return found


def nulls(value, path, found, few=3):
    """JSON writes a number that is not finite as null."""
    if value is None:
        found[f"{path}: null"] += 1
    elif isinstance(value, dict):
        # Statistics of nothing: a sensor of which all was rejected, a run that was over before its first horizon.
        if value.get("used", few) < few or path.endswith(".mae_after_start") and not any(value.values()):
            return
        for key, item in value.items():
            nulls(item, f"{path}.{key}", found)
    elif isinstance(value, list):
        for item in value:
            nulls(item, f"{path}[]", found)


class Sweep:
    def __init__(self, rhec, work):
        self.rhec, self.work = rhec, work
        self.sanitized = re.search(r"preset +(asan|tsan)", rhec("--version").stdout) is not None
        self.usual = {}    # by setup and command
        self.lock = threading.Lock()

    def words(self, setup, command, folder, settings=()):
        words = [self.rhec.path, command, *setup.words(), *assignments(*settings)]
        if command != "check":
            words += ["--out", folder / "out"]
        if command == "run":
            words += ["--log", folder / "out.csv"]
        if command in ("estimate", "smooth"):
            words.insert(3, self.log_of(setup))
        return words

    def log_of(self, setup):
        return self.work / "logs" / (hashlib.sha1(repr((setup.vehicle, "all" if EVERY_OUTPUT in setup.settings else "")).encode()).hexdigest() + ".csv")

    def make_logs(self, cases):
        """The drives that `estimate` and `smooth` read."""
        (self.work / "logs").mkdir(exist_ok=True)
        for setup in {case.setup: None for case in cases if case.command in ("estimate", "smooth")}:
            log = self.log_of(setup)
            if log.exists():
                continue
            plain = Setup("log", setup.vehicle, tuple(each for each in setup.settings if each == EVERY_OUTPUT))
            folder = self.fresh("log")
            wrong = self.must_work(self.words(plain, "run", folder), folder, f"log of {setup.vehicle}")
            if wrong:
                sys.exit(wrong)
            shutil.copy(folder / "out.csv", log)

    def usual_of(self, setup, command):
        """What a setup that is left as it is writes that is not finite, and what is wrong with it, if it does not work."""
        with self.lock:
            if (setup, command) not in self.usual:
                folder = self.fresh("usual")
                wrong = self.must_work(self.words(setup, command, folder), folder, f"{setup.name}: {command}")
                self.usual[setup, command] = (self.written(folder), wrong)
            return self.usual[setup, command]

    def must_work(self, words, folder, name):
        ended = run_limited(words, folder, self.sanitized)
        return "" if ended.code == FINE else f"{name}, as it is: exit code {ended.code}: {ended.err}"

    def fresh(self, name):
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder

    @staticmethod
    def written(folder):
        found = not_finite_in(folder / "out") if (folder / "out").exists() else collections.Counter()
        said = re.sub(r"'[^']*'|a NaN or an infinity", "''", (folder / "stdout").read_text(errors="replace"))
        for match in NOT_FINITE.finditer(said):
            line = said[said.rfind("\n", 0, match.start()) + 1:].splitlines()[0]
            if line.startswith("description "):    # of `rhec check`: bounds as they are given
                continue
            found[f"stdout: {line.split()[0]} {match.group()}"] += 1
        return found

    def attempt(self, number, case):
        folder = self.fresh(f"case{number}")
        ended = run_limited(self.words(case.setup, case.command, folder, (case.assignment,)), folder, self.sanitized)
        findings = self.judge(case, ended, folder)
        shutil.rmtree(folder, ignore_errors=True)
        return case, ended, findings

    def judge(self, case, ended, folder):
        findings = []
        if ended.hung:
            return [("hang", f"more than {LONGEST:g} s")]
        if ended.code < 0:
            findings.append(("signal", signal.Signals(-ended.code).name))
        if ended.memory > MOST_MEMORY and not self.sanitized:
            findings.append(("memory", f"{ended.memory / 1e9:.1f} GB"))
        raw = RAW.search(ended.err + ended.out)
        if raw:
            findings.append(("raw", f"{raw.group()!r} in: {ended.err}"))
        if ended.code in (FINE, NOT_SOLVED):
            new = self.written(folder)
            if new:
                new = [what for what in new if what not in self.usual_of(case.setup, case.command)[0]]
            if new:
                findings.append(("not finite", ", ".join(new[:4])))
            if ended.code == NOT_SOLVED and not ended.out.strip() + ended.err.strip():
                findings.append(("silent", "exit code 3, and nothing is said"))
        elif ended.code > 0:
            if ended.code != ERROR:
                findings.append(("exit code", str(ended.code)))
            if not ended.err.startswith("rhec: error: "):
                findings.append(("form", ended.err))
            said = re.sub(r"--set .*?: (?=[a-z_]+[.:\[])", "", ended.err)    # the assignment itself names the key always
            place, _, name = case.key.rpartition(".")
            is_signal = place.startswith("signals.") and place in said    # what does not fit is the signal as a whole
            if case.key not in said and not is_signal and not (place in said and re.search(rf"\b{re.escape(name)}\b", said)):
                findings.append(("no key", ended.err))
            if not re.search(r"expected|[;,] (?:use|give|take|let|write|name|drop|remove|set|choose|lower|raise|change|leave)", ended.err):
                findings.append(("no remedy", ended.err))
        return findings


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("rhec")
    parser.add_argument("--part", default="0/1")
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--report")
    arguments = parser.parse_args()
    rhec = cli.Program(arguments.rhec)
    cases = list({case.name: case for case in Options(rhec).cases()}.values())
    cases.sort(key=lambda case: hashlib.sha1(case.name.encode()).hexdigest())
    part, parts = map(int, arguments.part.split("/"))
    cases = [case for case in cases if re.search(arguments.only, case.name)][part::parts]
    if arguments.list:
        print(*(case.name for case in cases), f"{len(cases)} cases", sep="\n")
        return
    with tempfile.TemporaryDirectory(prefix="rhec-absurd-") as work:
        sweep = Sweep(rhec, pathlib.Path(work).resolve())
        findings = cli.Findings("absurd_values")
        sweep.make_logs(cases)
        report = open(arguments.report, "w") if arguments.report else None
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            for case, ended, found in pool.map(sweep.attempt, range(len(cases)), cases):
                findings.expect(not found, case.name, "; ".join(f"{kind}: {text.strip()}" for kind, text in found))
                if report:
                    report.write(json.dumps({"name": case.name, "key": case.key, "code": ended.code, "seconds": round(ended.seconds, 2),
                                             "memory": ended.memory, "found": found, "err": ended.err}) + "\n")
                    report.flush()
            if parts < 100:    # a small part trusts its setups
                for wrong in pool.map(lambda each: sweep.usual_of(*each)[1], {(case.setup, case.command): None for case in cases}):
                    findings.expect(not wrong, "a setup", wrong)
        findings.tell()


if __name__ == "__main__":
    main()
