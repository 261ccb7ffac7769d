"""Databases as `rhec sweep` writes them, of runs that nobody made: their figures are what a test says, times noise."""
import hashlib
import json
import math
import random
import sqlite3

SCHEMA = """CREATE TABLE runs (identity TEXT PRIMARY KEY NOT NULL, configuration TEXT NOT NULL, seed INTEGER, status TEXT NOT NULL,
reason TEXT NOT NULL, steps INTEGER, solves INTEGER, fallbacks INTEGER, nees REAL, mae TEXT, rmse TEXT, mae_after_start TEXT,
statuses TEXT, solve_time_us TEXT, seconds REAL NOT NULL, finished TEXT NOT NULL, program TEXT NOT NULL);
PRAGMA application_id = 1919444323; PRAGMA user_version = 1;"""
SIZES, OVERLAPS = (1, 2, 3, 5, 10, 20), (0, 2, 4, 8)
POINTS = [(size, overlap) for size in SIZES for overlap in OVERLAPS]
METHODS = [("fhb",), ("unblocked",), ("ignored",), ("truth",), *((kind, *point) for kind in ("kappa", "both") for point in POINTS)]
BASE = {}


def configuration(path, speed, seed, method, changes):
    """`changes` as a map of dotted keys."""
    tree = {"path": {"name": path}, "speed": speed, "seed": seed, "bounds": {"kappa": [0, 1], "mu": [0, 1]},
            "terrain": {"correlation_length": 10}, "controller": {"reference_speed": "ground"},
            "blocking": {"kappa": {"name": "full_horizon"}, "mu": {"name": "full_horizon"}},
            "estimator": {"name": "rhe", "horizon": 15, "arrival": {"name": "ekf"}, "block_sigma": {"kappa": ".inf", "mu": ".inf"}}}
    if method[0] in ("kappa", "both"):
        blocks = {"name": "structured", "size": method[1], "overlap": method[2]}
        tree["blocking"]["kappa"] = blocks
        if method[0] == "both":
            tree["blocking"]["mu"] = dict(blocks)
    elif method == ("unblocked",):
        tree["blocking"]["kappa"] = {"name": "unblocked"}
    elif method == ("ignored",):
        tree["bounds"] = {"kappa": [1, 1], "mu": [1, 1]}
    elif method == ("truth",):
        tree["estimator"]["name"] = "truth"
    for key, value in changes.items():
        *folders, last = key.split(".")
        node = tree
        for folder in folders:
            node = node[folder]
        node[last] = value
    return tree


def write(file, figures, **options):
    with sqlite3.connect(file) as database:
        database.executescript(SCHEMA)
    database.close()
    add(file, figures, **options)


def add(file, figures, seeds=20, conditions=((BASE, 8),), spread=0.05, noise_seed=1, methods=METHODS):
    """`figures(quantity, method, path, changes, speed)` is a run's figure before noise; a seed's ground scales all alike."""
    chance = random.Random(noise_seed)
    with sqlite3.connect(file) as database:
        for changes, speed in conditions:
            for path in ("figure8", "zigzag"):
                for seed in range(1, seeds + 1):
                    ground = math.exp(random.Random(f"{path} {seed} {noise_seed}").gauss(0.0, 0.3))
                    for method in methods:
                        def of(quantity, scale=ground):
                            return figures(quantity, method, path, changes, speed) * scale * math.exp(chance.gauss(0.0, spread))
                        text = json.dumps(configuration(path, speed, seed, method, changes), sort_keys=True)
                        mae = {name: of(name) for name in ("kappa", "mu", "position", "heading", "tracking")}
                        median = of("median", 1.0)
                        if method == ("truth",):
                            mae.update(kappa=0.0, mu=0.0, position=0.0, heading=0.0)
                        times = {"rhe": {"median": median, "p99": 2 * median, "max": 3 * median}} if method != ("truth",) else {}
                        after = {"kappa": figures("after_start", method, path, changes, speed)}
                        database.execute("INSERT INTO runs VALUES (?, ?, ?, 'completed', 'the end', 300, 600, 0, 6.0, ?, ?, ?, "
                                         "'{}', ?, 0.01, '2026-01-01T00:00:00Z', 'synthetic')",
                                         (hashlib.sha256(text.encode()).hexdigest()[:32], text, seed, json.dumps(mae), json.dumps(mae),
                                          json.dumps(after), json.dumps(times)))
    database.close()


def as_claimed(quantity, method, path, changes, speed):
    """A world in which all claims are so."""
    kind, small = method[0], method[0] in ("kappa", "both") and method[1] <= 3 and method[2] == 0
    both, blocked = kind == "both", kind in ("kappa", "both")
    if quantity == "kappa":
        return (0.03 * (1.5 if small else 1.0) * (1.3 if both else 1.0)) if blocked else 0.08
    if quantity == "position":
        return (0.06 if both else 0.05) if blocked else 0.1
    if quantity == "mu":
        return 0.1 * (1.5 if both else 1.0) * (1.3 if both and method[2] == 0 else 1.0)
    if quantity == "heading":
        return 0.02
    if quantity == "tracking":
        if path == "zigzag":
            return {"ignored": 1.0, "fhb": 0.5}.get(kind, 0.4 * (1.2 if small else 1.0))
        return {"ignored": 0.5, "fhb": 0.5}.get(kind, 0.52 * (1.1 if small else 1.0))
    if quantity == "median":
        return {"unblocked": 1500.0, "fhb": 60.0}.get(kind, 100.0)
    if quantity == "after_start":
        return 0.3 if both and method[1] in (1, 3) and method[2] < 2 else 0.1
    raise KeyError(quantity)


CENTRE = {"kappa": 0.08, "position": 0.1, "mu": 0.1, "heading": 0.02, "tracking": 0.5, "median": 300.0}


def contrary(quantity, method, path, changes, speed):
    """Every effect the other way round."""
    value = as_claimed(quantity, method, path, changes, speed)
    if quantity == "after_start":
        return 0.1
    if quantity == "heading":
        return 0.04 if method[0] in ("kappa", "both") else 0.02
    return CENTRE[quantity] ** 2 / value


def alike(quantity, method, path, changes, speed):
    """No method differs from another."""
    return 0.1 if quantity == "after_start" else CENTRE[quantity]
