"""The tables of docs/reproduction.md, one function each: from the study and the assessed claims to Markdown."""
import collections
import math
import statistics

from database import BASE, FHB, IGNORED, PATHS, TRUTH, UNBLOCKED, rate, setting_name
from slices import Slice, mean
from verdicts import PARTLY, describe

Assessed = collections.namedtuple("Assessed", "claim verdict conditions")
SHOWN_SIZES, SHOWN_OVERLAPS = (1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30), (0, 2, 3, 4, 6, 8, 10, 12, 15)
SHORT_BLOCKS = ((1, 0), (1, 2), (2, 0), (2, 2), (3, 0), (3, 2))
STEP = 0.2  # dt [s]


def table(head, rows):
    rows = [[str(cell) for cell in row] for row in rows]
    if not rows:
        return "Nothing: the runs for this are not in the database."
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head)] + ["| " + " | ".join(row) + " |" for row in rows])


def short(value):
    """Three digits, without an exponent."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def percent(share):
    return f"{round(100 * share) + 0:d}" if math.isfinite(share) else "-"


def estimate(part):
    shown = [percent(value) if part.scale == "share" else short(value) for value in part.estimate()]
    return f"{shown[0]}{' %' if part.scale == 'share' else ''}", f"{shown[1]} to {shown[2]}"


def distinct(parts):
    """Parts that have a bound, once each: 'above 1' and 'below 1.1' of the same values are one figure."""
    found = {}
    for part in parts:
        if part.bound is not None:
            found.setdefault(part.name, part)
    return list(found.values())


def cell(condition):
    text = "; ".join("{} ({})".format(*estimate(part)) for part in distinct(condition.parts))
    return f"**{text}**" if condition.confirmed else text


def slice_of(study, speed, setting=BASE):
    paths = study.runs.get((setting, speed))
    return Slice(setting, speed, paths) if paths else None


def speeds_of(study, setting=BASE):
    return sorted(speed for known, speed in study.runs if known == setting)


def settings_of(study):
    return sorted({setting for setting, _ in study.runs}, key=lambda setting: (setting != BASE, [str(value) for value in setting]))


def geometric_ratio(at, quantity, one, other, paths=PATHS):
    logs = mean([at.log_ratio(quantity, one, other, seed, paths) for seed in at.seeds])
    return None if logs is None else math.exp(logs)


def geometric_mean(ratios):
    """Of those that are there; None without any."""
    logs = mean([math.log(ratio) for ratio in ratios if ratio is not None])
    return None if logs is None else math.exp(logs)


def average(at, quantity, method, paths):
    found = [at.figure(quantity, method, path, seed) for path in paths for seed in at.seeds] if at.has(method) else []
    known = [figure for figure in found if figure is not None]
    return statistics.fmean(known) if known else None


# --- One function a table --------------------------------------------------------------------------------------------

def study(study, assessed):
    every = [run for paths in study.runs.values() for methods in paths.values() for runs in methods.values() for run in runs.values()]
    seeds = [len(Slice(setting, speed, paths).seeds) for (setting, speed), paths in study.runs.items()]
    unique = {id(run): run for run in every}.values()
    return table(("what", "how many"), [*((remark, "") for remark in study.remarks),
        ("runs in the database", f"{study.count:,}, {study.bytes / 2 ** 20:,.0f} MiB"),
        ("settings", len({setting for setting, _ in study.runs})),
        ("conditions: settings at speeds", len(study.runs)),
        ("paired seeds of a condition", f"{min(seeds)}" if min(seeds) == max(seeds) else f"{min(seeds)} to {max(seeds)}"),
        ("runs that did not reach the end of their path", sum(not run.completed for run in unique)),
        ("solves, of these fallbacks", f"{sum(run.solves for run in unique):,}, {sum(run.fallbacks for run in unique):,}"),
        ("time of one core", f"{study.seconds:,.0f} s"),
        ("program", ", ".join(sorted(study.programs))),
        ("runs finished", " to ".join(sorted({min(study.days), max(study.days)}))),
    ])


def verdicts(study, assessed):
    rows = []
    for claim, verdict, conditions in assessed:
        main = next((each for each in conditions if each.speed is None), conditions[0])
        parts = distinct(main.parts)
        confirmed, alone = (sum(found) for found in zip(*((each.confirmed, each.claimed_side()) for each in conditions)))
        where = describe(conditions, BASE, setting_name, rate) if verdict == PARTLY else ""
        rows.append((claim.key, claim.text, f"**{verdict}**", "; ".join(f"{part.name}: {estimate(part)[0]}" for part in parts),
                     "; ".join(estimate(part)[1] for part in parts), f"{len(parts[0].known())}", f"{main.runs:,}",
                     f"{confirmed}, {alone} of {len(conditions)}", where))
    return table(("", "claim", "verdict", "effect, base, all speeds", "95 % interval", "seeds", "runs",
                  "conditions: confirmed, by interval alone", "holds when"), rows)


def tests(study, assessed):
    return table(("", "what is tested"), [(claim.key, claim.test + (f"; {claim.paths[0]} alone" if len(claim.paths) == 1 else ""))
                                          for claim, _, _ in assessed])


def speeds(study, assessed):
    speeds = speeds_of(study)
    rows = []
    for claim, _, conditions in assessed:
        for is_map in (False, True):
            found = {each.speed: each for each in conditions if each.setting == BASE and each.is_map == is_map and each.speed}
            if found:
                rows.append((claim.key, f"{max(each.points for each in found.values())}",
                             *(cell(found[speed]) if speed in found else "" for speed in speeds)))
    return table(("", "(S, o)", *(f"{speed:g} m/s" for speed in speeds)), rows)


def settings(study, assessed):
    others = settings_of(study)
    speeds = sorted({speed for setting, speed in study.runs if setting != BASE}) or speeds_of(study)
    rows = []
    for claim, _, conditions in assessed:
        found = {(condition.setting, condition.speed): condition for condition in conditions if not condition.is_map}
        for setting in others:
            rows.append((claim.key, setting_name(setting), *(cell(found[setting, speed]) if (setting, speed) in found else ""
                                                              for speed in speeds)))
    return table(("", "setting", *(f"{speed:g} m/s" for speed in speeds)), rows)


def rates(study, assessed):
    """By v N_e dt / L, over the settings that change L alone, at the (S, o) that all of them have."""
    found = [Slice(setting, speed, paths) for (setting, speed), paths in study.runs.items() if setting[1:] == BASE[1:]]
    if not found:
        return table((), [])
    common = sorted(set.intersection(*(set(at.points("kappa")) for at in found)))
    rows = []
    for at in sorted(found, key=lambda at: (rate(at.setting, at.speed), at.speed)):
        ratios = {quantity: {point: geometric_ratio(at, quantity, ("kappa", *point), FHB) for point in common}
                  for quantity in ("kappa", "position")}
        known = {point: ratio for point, ratio in ratios["kappa"].items() if ratio is not None}
        best = min(known, key=known.get, default=None)
        rows.append((f"{rate(at.setting, at.speed):.2f}", f"{at.setting[0]:g}", f"{at.speed:g}", short(average(at, "kappa", FHB, PATHS)),
                     *(text for quantity in ("kappa", "position") for text in (
                         f"{percent(mean([float(ratio is not None and ratio < 1) for ratio in ratios[quantity].values()]))} %",
                         short(geometric_mean(ratios[quantity].values())))),
                     f"({best[0]}, {best[1]}): {short(known[best])}" if best else "-"))
    return table(("v N_e dt / L", "L [m]", "v [m/s]", "kappa, FHB", "kappa: (S, o) better", "ratio", "position: (S, o) better", "ratio",
                  "least kappa at (S, o)"), rows)


def block_rates(study, assessed):
    """Ratio of kappa to FHB by v S dt / L, in steps of a factor 2."""
    found = [Slice(setting, speed, paths) for (setting, speed), paths in study.runs.items() if setting[1:] == BASE[1:]]
    if not found:
        return table((), [])
    common = sorted(set.intersection(*(set(at.points("kappa")) for at in found)))
    overlaps, bins = sorted({overlap for _, overlap in common}), {}
    for at in found:
        for size, overlap in common:
            place = math.floor(math.log2(at.speed * size * STEP / at.setting[0]))
            ratio = geometric_ratio(at, "kappa", ("kappa", size, overlap), FHB)
            bins.setdefault(place, {}).setdefault(overlap, []).append(ratio)
    rows = [(f"{2.0 ** place:.3g} to {2.0 ** (place + 1):.3g}",
             *(short(geometric_mean(bins[place].get(overlap, ()))) for overlap in overlaps), len(bins[place][overlaps[0]]))
            for place in sorted(bins)]
    return table(("v S dt / L", *(f"o = {overlap}" for overlap in overlaps), "conditions and S"), rows)


def map_of(study, assessed):
    """kappa's ratio to FHB over (S, o), at the speeds that have the whole map with all seeds."""
    texts = []
    for speed in speeds_of(study):
        at = slice_of(study, speed)
        points = set(at.points("kappa"))
        sizes = [size for size in SHOWN_SIZES if any(point[0] == size for point in points)]
        overlaps = [overlap for overlap in SHOWN_OVERLAPS if any(point[1] == overlap for point in points)]
        if not {(4, 3), (30, 15)} <= points:
            continue
        rows = [(size, *(short(geometric_ratio(at, "kappa", ("kappa", size, overlap), FHB)) for overlap in overlaps)) for size in sizes]
        texts.append(f"{speed:g} m/s, {len(at.seeds)} seeds, {len(points)} (S, o):\n\n"
                     + table(("S", *(f"o = {overlap}" for overlap in overlaps)), rows))
    return "\n\n".join(texts) or table((), [])


def shares(study, assessed):
    """Of the whole map at each speed, with the one seed that it was run with everywhere."""
    rows = []
    for speed in speeds_of(study):
        paths = study.runs[BASE, speed]
        seed = min(paths[PATHS[0]][FHB])
        one = Slice(BASE, speed, {path: {method: {seed: runs[seed]} for method, runs in methods.items() if seed in runs}
                                  for path, methods in paths.items()})
        cells = []
        for kind, quantities in (("kappa", ("kappa", "position", "tracking")), ("both", ("kappa", "position", "mu", "tracking"))):
            points = one.points(kind)
            for quantity in quantities:
                ratios = [one.log_ratio(quantity, (kind, *point), FHB, seed) for point in points]
                cells.append(f"{percent(mean([float(ratio is not None and ratio < 0) for ratio in ratios]))} %")
            cells.append(len(points))
        rows.append((f"{speed:g}", *cells))
    return table(("v [m/s]", "SB-O on kappa: kappa", "position", "tracking", "(S, o)", "SB-O on both: kappa", "position", "mu", "tracking",
                  "(S, o)"), rows)


def tracking(study, assessed):
    rows = []
    for setting in settings_of(study):
        if setting[2] == BASE[2] and setting != BASE:
            continue
        for speed in speeds_of(study, setting):
            at = slice_of(study, speed, setting)
            for path in PATHS:
                rows.append((setting[2], f"{speed:g}", path, *(short(average(at, "tracking", method, (path,)))
                                                               for method in (IGNORED, FHB, ("kappa", 2, 4), UNBLOCKED, TRUTH))))
    return table(("reference speed", "v [m/s]", "path", "no slip estimation", "FHB", "SB-O (2, 4)", "unblocked", "slip and state known"),
                 rows)


def convergence(study, assessed):
    rows = []
    for setting in settings_of(study):
        for speed in speeds_of(study, setting):
            at = slice_of(study, speed, setting)
            cells = []
            for point in SHORT_BLOCKS:
                method = ("both", *point)
                runs = [at.paths[path][method][seed] for path in PATHS for seed in at.seeds] if at.has(method) else []
                bad = sum(not run.completed or run.fallbacks > 0 for run in runs)
                cells.append(f"{bad} of {len(runs)}" if runs else "")
            rows.append((setting_name(setting), f"{speed:g}", *cells))
    return table(("setting", "v [m/s]", *(f"({size}, {overlap})" for size, overlap in SHORT_BLOCKS)), rows)


def times(study, assessed):
    rows = []
    for speed in speeds_of(study):
        at = slice_of(study, speed)
        methods = [("FHB", FHB), ("SB-O on kappa (2, 4)", ("kappa", 2, 4)), ("SB-O on kappa (10, 4)", ("kappa", 10, 4)),
                   ("unblocked", UNBLOCKED), ("SB-O on both (2, 4)", ("both", 2, 4)), ("SB-O on both (1, 0)", ("both", 1, 0))]
        for name, method in methods:
            if speed in (2, 8) and at.has(method):
                runs = [at.paths[path][method][seed] for path in PATHS for seed in at.seeds]
                middle, late = ([getattr(run, name) for run in runs if getattr(run, name) is not None] for name in ("median", "p99"))
                rows.append((f"{speed:g}", name, short(statistics.median(middle)), short(statistics.median(late)), short(max(late)),
                             short(geometric_ratio(at, "median", method, FHB)) if method != FHB else "1"))
    return table(("v [m/s]", "method", "median solve [us]", "99th percentile [us]", "... of the worst run [us]", "median / FHB"), rows)


def ratios(study, assessed):
    """The error of kappa as a ratio to FHB at the (S, o) that docs/ratios.md shows as well."""
    places = [((2, 4), "SB-O (2, 4)"), ((5, 4), "SB-O (5, 4)"), ((3, 2), "SB-O (3, 2)"), ((3, 0), "SB (3, 0)"), ((5, 8), "SB-O (5, 8)")]
    rows = []
    for setting in settings_of(study):
        for speed in speeds_of(study, setting):
            at = slice_of(study, speed, setting)
            if setting == BASE and speed not in (2, 5, 8):
                continue
            rows.append((setting_name(setting), f"{speed:g}", short(average(at, "kappa", FHB, PATHS)),
                         *(short(geometric_ratio(at, "kappa", ("kappa", *point), FHB)) if at.has(("kappa", *point)) else ""
                           for point, _ in places)))
    return table(("setting", "v [m/s]", "FHB, absolute", *(name for _, name in places)), rows)


TABLES = {"study": study, "verdicts": verdicts, "tests": tests, "speeds": speeds, "settings": settings, "rates": rates,
          "block_rates": block_rates, "ratios": ratios, "map": map_of, "shares": shares, "tracking": tracking,
          "convergence": convergence, "times": times}
