"""One condition of the study (a setting at a speed), and figures of it by seed.

The seed is the unit: it makes the ground and the noise, so whatever is averaged over paths and over (S, o) is averaged within a
seed first, and only the seeds' means are taken for independent.
"""
import math
import statistics

from database import FHB, PATHS, AGAIN, Mistake, method_name, setting_name

MOST_LEFT_OUT = 0.1  # share of runs without an end; where there are more, no claim is confirmed


class Slice:
    def __init__(self, setting, speed, paths):
        self.setting, self.speed, self.paths = setting, speed, paths
        absent = [path for path in PATHS if FHB not in paths.get(path, {})]
        if absent:
            raise Mistake(f"{self}: no run of FHB on {' and '.join(absent)}; {AGAIN}")
        self.seeds = sorted(set().union(*(paths[path][FHB] for path in PATHS)))
        self.used, self.lost = set(), set()

    def __str__(self):
        return f"{setting_name(self.setting)} at {self.speed:g} m/s"

    def has(self, method):
        """Whether the method belongs to this condition: with all seeds, on both paths. One seed alone is the map's."""
        counts = [len(self.paths[path].get(method, ())) for path in PATHS]
        if min(counts) == len(self.seeds):
            return True
        if max(counts) > 1 or (max(counts) == 1 and len(self.seeds) <= 1):
            seeds = {path: sorted(set(self.seeds) - set(self.paths[path].get(method, ()))) for path in PATHS}
            absent = "; ".join(f"{path}: {', '.join(map(str, missing))}" for path, missing in seeds.items() if missing)
            raise Mistake(f"{self}: {method_name(method)} has no runs of seeds {absent}; {AGAIN}")
        return False

    def points(self, kind):
        """The (S, o) that this condition has with all seeds; `kind` is kappa or both."""
        there = set().union(*(self.paths[path] for path in PATHS))
        return sorted((size, overlap) for name, *size_overlap in there if name == kind and self.has((kind, *size_overlap))
                      for size, overlap in [size_overlap])

    def require(self, *methods):
        for method in methods:
            if not self.has(method):
                raise Mistake(f"{self}: no runs of {method_name(method)}; {AGAIN}")

    def figure(self, quantity, method, path, seed):
        """None where the run did not reach its end, or has a figure of 0 or none, which has no ratio to others."""
        run = self.paths[path][method][seed]
        self.used.add((method, path, seed))
        figure = getattr(run, quantity) if run.completed else None
        if figure is None or not figure > 0.0:
            self.lost.add((method, path, seed))
            return None
        return figure

    def log_ratio(self, quantity, one, other, seed, paths=PATHS):
        """Mean over paths of log(one / other) of a seed; None without any pair."""
        pairs = [(self.figure(quantity, one, path, seed), self.figure(quantity, other, path, seed)) for path in paths]
        logs = [math.log(a / b) for a, b in pairs if a is not None and b is not None]
        return statistics.fmean(logs) if logs else None

    def log_level(self, quantity, method, seed, paths=PATHS):
        """Mean over paths of log(figure)."""
        figures = [self.figure(quantity, method, path, seed) for path in paths]
        logs = [math.log(figure) for figure in figures if figure is not None]
        return statistics.fmean(logs) if logs else None


def mean(values):
    """Of those that are there; None without any."""
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None
