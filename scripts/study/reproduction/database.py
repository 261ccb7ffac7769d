"""The runs of the study, read from the database that `rhec sweep` made (docs/sweep.md).

A run is known by its path, speed, seed, setting (what verdicts may depend on) and method (what claims compare).
"""
import collections
import json
import math
import pathlib
import random
import sqlite3
import urllib.parse

APPLICATION, VERSION = 1919444323, 1  # docs/sweep.md
PATHS = ("figure8", "zigzag")
AGAIN = "scripts/study/reproduce makes what is missing"

# What the settings of the study change one at a time. A base value is that of scenarios/paper/; where a configuration
# says nothing, rhec's default holds (docs/configuration.md).
Axis = collections.namedtuple("Axis", "name key base default")
AXES = (
    Axis("correlation length", "terrain.correlation_length", 10, 10),
    Axis("arrival cost", "estimator.arrival.name", "ekf", "ekf"),
    Axis("reference speed", "controller.reference_speed", "ground", "ground"),
    Axis("intervals", "estimator.horizon", 15, 15),
    Axis("block_sigma", "estimator.block_sigma.kappa", math.inf, 0.25),
    Axis("transition", "blocking.kappa.transition", "step", "step"),
    Axis("neighbour_sigma", "blocking.kappa.neighbour_sigma", "none", "none"),
)
BASE = tuple(axis.base for axis in AXES)
OF_BLOCKING = tuple(axis.key.startswith("blocking.") for axis in AXES)  # what only a blocked parameter has

FHB, UNBLOCKED, IGNORED, TRUTH = ("fhb",), ("unblocked",), ("ignored",), ("truth",)

Run = collections.namedtuple("Run", "kappa mu position heading tracking median p99 kappa_after_start completed fallbacks "
                                    "solves steps")


class Mistake(Exception):
    """A mistake that the caller can mend; the text says how."""


def rate(setting, speed, step=0.2):
    """v N_e dt / L: how many correlation lengths of the slip the horizon is long."""
    return speed * setting[3] * step / setting[0]


def setting_name(setting):
    changed = [f"{axis.name} {value:g} m" if axis.name == "correlation length" else
               f"{value:g} intervals" if axis.name == "intervals" else f"{axis.name} {value}"
               for axis, value in zip(AXES, setting) if value != axis.base]
    return ", ".join(changed) or "base"


def method_name(method):
    if method[0] in ("kappa", "both"):
        return f"{'SB-O on kappa' if method[0] == 'kappa' else 'SB-O on both'} ({method[1]}, {method[2]})"
    return {FHB: "FHB", UNBLOCKED: "unblocked", IGNORED: "no slip estimation", TRUTH: "slip and state known"}[method]


def at(configuration, key, default):
    for part in key.split("."):
        if not isinstance(configuration, dict) or part not in configuration:
            return default
        configuration = configuration[part]
    return configuration


def number(value):
    """YAML's infinity has no place in JSON but as a text."""
    return math.inf if value in (".inf", "inf", "+.inf", "+inf") else value


def method_of(configuration, where):
    kappa, mu = (at(configuration, f"blocking.{name}", {"name": "full_horizon"}) for name in ("kappa", "mu"))
    if at(configuration, "estimator.name", "rhe") == "truth":
        return TRUTH
    if at(configuration, "bounds.kappa", None) == [1, 1] == at(configuration, "bounds.mu", None):
        return IGNORED
    names = kappa["name"], mu["name"]
    if names == ("full_horizon", "full_horizon"):
        return FHB
    if names == ("unblocked", "full_horizon"):
        return UNBLOCKED
    if names == ("structured", "full_horizon"):
        return "kappa", kappa.get("size", 5), kappa.get("overlap", 0)
    if names == ("structured", "structured") and kappa == mu:
        return "both", kappa.get("size", 5), kappa.get("overlap", 0)
    raise Mistake(f"{where}: kappa is blocked by {kappa} and mu by {mu}, which is no method of the study; give a database "
                  "that the sweeps of scenarios/paper/ made")


def without(configuration, keys):
    """What is left of a configuration without these keys, as a text."""
    def strip(node, prefix):
        if not isinstance(node, dict):
            return node
        return {name: strip(value, f"{prefix}{name}.") for name, value in node.items() if f"{prefix}{name}" not in keys}
    return json.dumps(strip(configuration, ""), sort_keys=True)


VARIED = frozenset({"name", "path", "seed", "speed", "blocking", "bounds.kappa", "bounds.mu", "estimator.name",
                    "estimator.initial.parameters", "estimator.arrival", "estimator.block_sigma"}
                   | {axis.key for axis in AXES})


def rows_of(file):
    """Rows of the table `runs` of a database that is whole and ours."""
    path = pathlib.Path(file)
    if not path.is_file():
        raise Mistake(f"{file}: no such database; {AGAIN}")
    try:
        database = sqlite3.connect(f"file:{urllib.parse.quote(str(path.resolve()))}?mode=rw", uri=True)
        try:
            pragma = lambda name: database.execute(f"PRAGMA {name}").fetchone()[0]
            if pragma("application_id") != APPLICATION:
                raise Mistake(f"{file}: is a database, but not one of rhec's sweeps; give the one that scripts/study/reproduce made")
            if pragma("user_version") != VERSION:
                raise Mistake(f"{file}: has version {pragma('user_version')} of the schema, expected {VERSION}; assess it with "
                              "the program that made it, or make it anew")
            if path.stat().st_size < pragma("page_count") * pragma("page_size"):
                raise sqlite3.DatabaseError("the file is shorter than it says")
            yield from database.execute("SELECT configuration, seed, status, reason, steps, solves, fallbacks, mae, "
                                        "mae_after_start, solve_time_us, program, finished, seconds FROM runs ORDER BY identity")
        finally:
            database.close()
    except sqlite3.Error as problem:
        raise Mistake(f"{file}: cannot be read as a database ({problem}); give the one that scripts/study/reproduce made, or remove "
                      "it and make it anew") from None


class Study:
    """runs[setting, speed][path][method][seed], and where they came from."""

    def __init__(self):
        self.runs, self.programs, self.days = {}, set(), set()
        self.count, self.bytes, self.seconds = 0, 0, 0.0
        self.remarks = []  # what a reader of its page must know

    def put(self, setting, speed, path, method, seed, run):
        methods = self.runs.setdefault((setting, speed), {}).setdefault(path, {})
        methods.setdefault(method, {})[seed] = run

    @staticmethod
    def read(file):
        study, rests = Study(), {}
        for place, row in enumerate(rows_of(file), 1):
            study.take(row, f"{file}: run {place}", rests)
        if not study.runs:
            raise Mistake(f"{file}: has no runs; {AGAIN}")
        study.borrow()
        study.bytes = pathlib.Path(file).stat().st_size
        return study

    def take(self, row, where, rests):
        (text, seed, status, reason, steps, solves, fallbacks, mae, after_start, times, program, finished, seconds) = row
        try:
            configuration = json.loads(text)
            path = configuration["path"]["name"]
            if status in ("failed", "refused"):
                raise Mistake(f"{where} (path {path}, seed {seed}): {status}: {reason}; mend the cause, delete such rows "
                              "(docs/sweep.md), and start scripts/study/reproduce again")
            rest = without(configuration, VARIED)
            if rests.setdefault(path, rest) != rest:
                raise Mistake(f"{where} (path {path}, seed {seed}): differs from others in a key that the study does not vary; "
                              "give a database that only the sweeps of scenarios/paper/ wrote to")
            setting = tuple(number(at(configuration, axis.key, axis.default)) for axis in AXES)
            mae, times = json.loads(mae), json.loads(times).get("rhe") or {}
            run = Run(mae["kappa"], mae["mu"], mae["position"], mae["heading"], mae["tracking"], times.get("median"),
                      times.get("p99"), json.loads(after_start)["kappa"], status == "completed", fallbacks, solves, steps)
            self.put(setting, configuration["speed"], path, method_of(configuration, where), seed, run)
        except (KeyError, TypeError, ValueError, AttributeError) as problem:
            raise Mistake(f"{where}: is not as `rhec sweep` writes it ({type(problem).__name__}: {problem}); make the database "
                          "anew") from None
        self.count += 1
        self.seconds += seconds
        self.programs.add(program)
        self.days.add(finished[:10])

    def borrow(self):
        """Methods without blocks are the same run whatever the options of blocking are; they take part in each."""
        for (setting, speed), paths in list(self.runs.items()):
            plain = tuple(axis.base if own else value for axis, own, value in zip(AXES, OF_BLOCKING, setting))
            if plain == setting:
                continue
            for path, methods in self.runs.get((plain, speed), {}).items():
                for method in (FHB, IGNORED, TRUTH):
                    if method in methods and path in paths:
                        paths[path].setdefault(method, methods[method])

    def shuffled(self, seed):
        """The same runs with the methods permuted at random within each path, speed, seed and setting. What knows the truth is
        no method that is compared, and stays."""
        chance, other = random.Random(seed), Study()
        other.programs, other.days = self.programs, self.days
        other.count, other.bytes, other.seconds = self.count, self.bytes, self.seconds
        other.remarks = [*self.remarks, f"methods shuffled at random ({seed}): nothing here says anything about them"]
        for (setting, speed), paths in sorted(self.runs.items(), key=repr):
            for path, methods in sorted(paths.items()):
                by_seed = {}
                for method, runs in sorted(methods.items(), key=repr):
                    for each, run in runs.items():
                        by_seed.setdefault(each, []).append((method, run))
                for each, pairs in sorted(by_seed.items()):
                    names = [method for method, _ in pairs if method != TRUTH]
                    chance.shuffle(names)
                    pairs.sort(key=lambda pair: pair[0] == TRUTH)
                    names += [TRUTH] * (len(pairs) - len(names))
                    for method, (_, run) in zip(names, pairs):
                        other.put(setting, speed, path, method, each, run)
        return other
