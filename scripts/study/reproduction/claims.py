"""The paper's claims, as statements about a slice of the study. They were written down before the study was run.

Each claim is a function of a slice and a list of (S, o), and gives its parts; errors are means over a run, ratios are paired
run by run. Bounds and margins stand here and nowhere else.
"""
import dataclasses
import math
from typing import Callable

from database import BASE, FHB, IGNORED, UNBLOCKED, Mistake
from slices import Slice, mean
from verdicts import Condition, Part

PAPERS_CHOICE = (2, 4)      # S and o of the paper's own comparison
PAPERS_SPEED = 8            # [m/s]
SMALL, LARGE = (1, 2, 3), (10, 20)  # S, for claims that tell small from large
HELPFUL = 4                 # the overlap that is compared with none
MILLISECOND = math.log(1000.0)  # [us]
COMPETITIVE_TIME = math.log(2.0)
ABOUT_EQUAL = math.log(1.10)
GUESS_ERROR = 0.25          # mean of |kappa - 0.5| for kappa uniform in [0.5, 1]: what holding on to the initial guess gives


@dataclasses.dataclass
class Claim:
    key: str
    text: str       # what is claimed
    test: str       # what the parts are, in words
    parts: Callable
    kinds: tuple    # of blocking that it looks at: kappa, both
    paths: tuple = ("figure8", "zigzag")
    over_map: bool = True  # whether it is about (S, o) at large, and so about the whole map where that is there


def per_seed(at, function):
    """A value for each seed, None where nothing reached its end."""
    return [function(seed) for seed in at.seeds]


def over_points(at, points, quantity, kind, reference, paths):
    """By seed: mean log ratio over (S, o), and the share of (S, o) at which the ratio is below 1. A run that was lost is not."""
    at.require(reference)
    means, shares = [], []
    for seed in at.seeds:
        ratios = [at.log_ratio(quantity, (kind, *point), reference, seed, paths) for point in points]
        means.append(mean(ratios))
        shares.append(sum(ratio is not None and ratio < 0 for ratio in ratios) / len(ratios))
    return means, shares


def better_for_most(quantity, kind):
    def parts(at, points, paths):
        means, shares = over_points(at, points, quantity, kind, FHB, paths)
        return [Part("share of (S, o) better than FHB", shares, 1, 0.5, "share"), Part("mean ratio to FHB", means)]
    return parts


def solve_times(at, points, paths):
    at.require(FHB, UNBLOCKED)
    blocked = [FHB, *(("kappa", *point) for point in points if is_blocked(point))]

    def slowest(seed):
        levels = [at.log_level("median", method, seed, paths) for method in blocked]
        return max((level for level in levels if level is not None), default=None)
    return [Part("unblocked [us]", per_seed(at, lambda seed: at.log_level("median", UNBLOCKED, seed, paths)), 1, MILLISECOND, "us"),
            Part("slowest blocked [us]", per_seed(at, slowest), -1, MILLISECOND, "us")]


def is_blocked(point):
    """S = 1 with o <= 1 is a value for every interval."""
    return point[0] > 1 or point[1] > 1


def unblocked_slower(at, points, paths):
    blocked = [point for point in points if is_blocked(point)]
    means, shares = over_points(at, blocked, "median", "kappa", UNBLOCKED, paths)
    return [Part("share of (S, o) faster than unblocked", shares, 1, 0.5, "share"), Part("mean ratio to unblocked", means)]


def competitive_time(at, points, paths):
    means, shares = over_points(at, [point for point in points if is_blocked(point)], "median", "kappa", FHB, paths)
    return [Part("share of (S, o) faster than FHB", shares, -1, 0.5, "share"), Part("mean ratio to FHB", means, -1, COMPETITIVE_TIME)]


def overlap_helps_small(at, points, paths):
    small = [size for size in SMALL if {(size, 0), (size, HELPFUL)} <= set(points)]
    large = [size for size in LARGE if {(size, 0), (size, HELPFUL)} <= set(points)]
    if not small or not large:
        raise Mistake(f"{at}: S of {SMALL} and of {LARGE}, each with o = 0 and {HELPFUL}, are needed; the database has {points}")

    def gain(sizes, seed):
        return mean([at.log_ratio("kappa", ("kappa", size, HELPFUL), ("kappa", size, 0), seed, paths) for size in sizes])

    def contrast(seed):
        one, other = gain(small, seed), gain(large, seed)
        return None if one is None or other is None else one - other
    return [Part("o = 4 / o = 0, small S", per_seed(at, lambda seed: gain(small, seed)), -1, 0.0),
            Part("small S / large S", per_seed(at, contrast), -1, 0.0)]


def mu_hurt(at, points, paths):
    def ratio(seed):
        return mean([at.log_ratio("mu", ("both", *point), ("kappa", *point), seed, paths) for point in points])
    _, shares = over_points(at, points, "mu", "both", FHB, paths)
    return [Part("mu, both / kappa alone", per_seed(at, ratio), 1, 0.0),
            Part("share of (S, o) better than FHB", shares, -1, 0.5, "share")]


def mu_hurt_by_small_overlap(at, points, paths):
    sizes = sorted(size for size, overlap in points if overlap == 0 and (size, 8) in points)

    def contrast(seed):
        pairs = [[at.log_ratio("mu", ("both", size, o), ("kappa", size, o), seed, paths) for o in (0, 8)] for size in sizes]
        return mean([none - much for none, much in pairs if none is not None and much is not None])
    return [Part("mu, both / kappa alone: o = 0 against o = 8", per_seed(at, contrast), 1, 0.0)]


def mu_free_improves(quantity):
    def parts(at, points, paths):
        def ratio(seed):
            return mean([at.log_ratio(quantity, ("kappa", *point), ("both", *point), seed, paths) for point in points])
        return [Part(f"{quantity}, kappa alone / both", per_seed(at, ratio), -1, 0.0)]
    return parts


def tracking(reference, worse):
    """With the paper's choice: better, or worse by less than the margin."""
    def parts(at, points, paths):
        at.require(reference, ("kappa", *PAPERS_CHOICE))
        values = per_seed(at, lambda seed: at.log_ratio("tracking", ("kappa", *PAPERS_CHOICE), reference, seed, paths))
        name = f"SB-O / {'FHB' if reference == FHB else 'no slip estimation'}"
        return [Part(name, values, 1, 0.0), Part(name, values, -1, ABOUT_EQUAL)] if worse else [Part(name, values, -1, 0.0)]
    return parts


def tracking_over_map(worse):
    """The same over (S, o). Counted rather than averaged: one (S, o) that goes astray outweighs all others in a mean."""
    def parts(at, points, paths):
        means, shares = over_points(at, points, "tracking", "kappa", FHB, paths)
        most = Part("share of (S, o) better than FHB", shares, -1 if worse else 1, 0.5, "share")
        return [most, Part("mean ratio to FHB", means, -1, ABOUT_EQUAL)] if worse else [most, Part("mean ratio to FHB", means)]
    return parts


def small_blocks_track_worse(at, points, paths):
    small, large = [(size, 0) for size in SMALL], [(size, HELPFUL) for size in (5, 10, 20)]
    at.require(*(("kappa", *point) for point in small + large))

    def contrast(seed):
        one, other = (mean([at.log_level("tracking", ("kappa", *point), seed, paths) for point in group]) for group in (small, large))
        return None if one is None or other is None else one - other
    return [Part("S = 1, 2, 3, o = 0 / S = 5, 10, 20, o = 4", per_seed(at, contrast), 1, 0.0)]


def lost_or_held(run):
    """Did not converge: no end of the path, a solve that could not be used, or a kappa no better than the initial guess."""
    return not run.completed or run.fallbacks > 0 or not run.kappa_after_start < GUESS_ERROR


def does_not_converge(size):
    return lambda at, points, paths: share_not_converged(at, points, paths, size)


def share_not_converged(at, points, paths, size):
    named = [point for point in points if point[0] == size and point[1] < 2]
    others = [point for point in points if point[0] not in (1, 3) or point[1] >= 2]
    if not named or not others:
        raise Mistake(f"{at}: (S, o) with S = {size}, o < 2 and others are needed; the database has {points}")

    def share(group, seed):
        found = []
        for point in group:
            for path in paths:
                at.used.add((("both", *point), path, seed))
                found.append(lost_or_held(at.paths[path]["both", *point][seed]))
        return sum(found) / len(found) if found else None

    def contrast(seed):
        one, other = share(named, seed), share(others, seed)
        return None if one is None or other is None else one - other
    return [Part(f"share not converged, S = {size}, o < 2", per_seed(at, lambda seed: share(named, seed)), 1, 0.5, "share"),
            Part("more than elsewhere by", per_seed(at, contrast), 1, 0.0, "share")]


def state_kept(at, points, paths):
    method = ("kappa", *PAPERS_CHOICE)
    at.require(method, FHB)
    ratio = {quantity: per_seed(at, lambda seed, quantity=quantity: at.log_ratio(quantity, method, FHB, seed, paths))
             for quantity in ("kappa", "heading", "mu")}
    return [Part("kappa", ratio["kappa"], -1, 0.0), Part("heading", ratio["heading"], -1, ABOUT_EQUAL),
            Part("mu", ratio["mu"], -1, ABOUT_EQUAL)]


ON_KAPPA, ON_BOTH, EITHER, EIGHT, ZIGZAG = ("kappa",), ("both",), ("kappa", "both"), ("figure8",), ("zigzag",)
TRACKED = "tracking error of SB-O (2, 4) on kappa against"
MOST = "share of (S, o) whose error is below FHB's is above 1/2"
CLAIMS = (
    Claim("1", "solves take less than a millisecond in all but the unblocked case",
          "median solve of the estimator: unblocked above 1 ms, and the slowest blocked case below", solve_times, ON_KAPPA),
    Claim("1a", "the unblocked case is the slow one",
          "median solve: at more than half of (S, o) below unblocked's", unblocked_slower, ON_KAPPA),
    Claim("1b", "the time of SB-O is competitive with FHB",
          "median solve: at less than half of (S, o) below FHB's, and a mean ratio below 2", competitive_time, ON_KAPPA),
    Claim("2", "kappa is estimated better than by FHB for most (S, o)",
          f"SB-O on kappa: {MOST}", better_for_most("kappa", "kappa"), ON_KAPPA),
    Claim("2a", "... also when both parameters are blocked",
          f"SB-O on both: {MOST}", better_for_most("kappa", "both"), ON_BOTH),
    Claim("3", "the position is estimated better than by FHB for most (S, o)",
          f"SB-O on kappa: {MOST}", better_for_most("position", "kappa"), ON_KAPPA),
    Claim("3a", "... also when both parameters are blocked",
          f"SB-O on both: {MOST}", better_for_most("position", "both"), ON_BOTH),
    Claim("4", "overlap helps small S most",
          "error of kappa, o = 4 against o = 0: ratio below 1 at S = 1, 2, 3, and less there than at S = 10, 20",
          overlap_helps_small, ON_KAPPA, over_map=False),
    Claim("5", "mu is hurt when it is blocked too, and best left to FHB",
          "error of mu, both against kappa alone at the same (S, o): ratio above 1; and at less than half of (S, o) below FHB's",
          mu_hurt, EITHER),
    Claim("5a", "... above all for small overlaps",
          "that ratio at o = 0 against o = 8: above 1", mu_hurt_by_small_overlap, EITHER),
    Claim("5b", "leaving mu to FHB improves the estimate of kappa",
          "error of kappa, kappa alone against both: ratio below 1", mu_free_improves("kappa"), EITHER),
    Claim("5c", "leaving mu to FHB improves the estimate of the position",
          "error of the position, kappa alone against both: ratio below 1", mu_free_improves("position"), EITHER),
    Claim("6", "tracking improves with estimation on the zig-zag",
          f"{TRACKED} FHB: ratio below 1", tracking(FHB, False), ON_KAPPA, ZIGZAG, over_map=False),
    Claim("6a", "... for most (S, o)",
          "share of (S, o) whose tracking error is below FHB's is above 1/2", tracking_over_map(False), ON_KAPPA, ZIGZAG),
    Claim("6b", "... against no slip estimation",
          f"{TRACKED} kappa = mu = 1: ratio below 1", tracking(IGNORED, False), ON_KAPPA, ZIGZAG, over_map=False),
    Claim("6c", "small S and o go with a larger tracking error",
          "tracking error at S = 1, 2, 3 without overlap against S = 5, 10, 20 with o = 4: ratio above 1",
          small_blocks_track_worse, ON_KAPPA, over_map=False),
    Claim("7", "tracking is about equal, slightly worse, on the figure-8",
          f"{TRACKED} FHB: ratio above 1 and below 1.10", tracking(FHB, True), ON_KAPPA, EIGHT, over_map=False),
    Claim("7a", "... for most (S, o)",
          "that share is below 1/2, and the mean ratio below 1.10", tracking_over_map(True), ON_KAPPA, EIGHT),
    Claim("7b", "... against no slip estimation",
          f"{TRACKED} kappa = mu = 1: ratio above 1 and below 1.10", tracking(IGNORED, True), ON_KAPPA, EIGHT, over_map=False),
    Claim("8", "with both blocked, S = 1 with o < 2 does not converge",
          "share of runs without an end, with a fallback, or with kappa no better than the initial guess: above 1/2 there, and more "
          "than at the other (S, o)", does_not_converge(1), ON_BOTH),
    Claim("8a", "... and S = 3 with o < 2 neither", "the same for S = 3", does_not_converge(3), ON_BOTH),
    Claim("9", "on the figure-8 SB-O (2, 4) improves kappa and keeps heading and mu",
          "errors against FHB: kappa below 1, heading and mu below 1.10", state_kept, ON_KAPPA, EIGHT, over_map=False),
)


def points_of(at, claim):
    found = [at.points(kind) for kind in claim.kinds]
    points = sorted(set(found[0]).intersection(*found[1:]))
    if not points:
        raise Mistake(f"{at}: no (S, o) of SB-O on {' and on '.join(claim.kinds)} with all seeds; "
                      "scripts/study/reproduce makes what is missing")
    return points


def condition(at, claim, points, is_map=False):
    at.used, at.lost = set(), set()
    parts = claim.parts(at, points, claim.paths)
    return Condition(at.setting, at.speed, parts, len(at.used), len(at.lost), len(points), is_map)


def together(slices, claim, points):
    """All speeds of the base: means within a seed over the speeds."""
    seeds = set.intersection(*(set(at.seeds) for at in slices))
    found = []
    for at in slices:
        limited = Slice(at.setting, at.speed, at.paths)
        limited.seeds = sorted(seeds)
        found.append(condition(limited, claim, points))
    parts = []
    for group in zip(*(each.parts for each in found)):
        parts.append(dataclasses.replace(group[0], values=[mean(values) for values in zip(*(part.values for part in group))]))
    return Condition(BASE, None, parts, sum(each.runs for each in found), sum(each.lost for each in found), len(points))


def conditions_of(study, claim):
    """All speeds of the base together, which is the main one; each of them, and every other setting at its speeds, at the (S, o) that
    all speeds of the base have; and the whole map where there is one."""
    slices = [Slice(setting, speed, paths) for (setting, speed), paths in
              sorted(study.runs.items(), key=lambda item: (item[0][0] != BASE, repr(item[0][0]), item[0][1]))]
    base = [at for at in slices if at.setting == BASE]
    if not base:
        raise Mistake("the database has no run of the base settings; scripts/study/reproduce makes what is missing")
    known = {at: points_of(at, claim) for at in slices}
    common = sorted(set.intersection(*(set(known[at]) for at in base)))
    conditions = [together(base, claim, common)] if len(base) > 1 else []
    for at in slices:
        shared = [point for point in known[at] if point in common]
        if not shared:
            raise Mistake(f"{at}: none of the (S, o) {common} of the base; scripts/study/reproduce makes what is missing")
        conditions.append(condition(at, claim, shared))
    return conditions + [condition(at, claim, known[at], True) for at in base if claim.over_map and len(known[at]) > len(common)]
