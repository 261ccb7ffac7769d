"""Assesses every claim, and rewrites the tables of a page between their marks."""
import json
import math
import os
import pathlib
import re

from claims import CLAIMS, conditions_of
from database import BASE, AXES, Mistake, setting_name
from tables import TABLES, Assessed
from verdicts import PAGE_LEVEL, assess


def assess_all(study, claims=CLAIMS, level=PAGE_LEVEL):
    """Every claim with its verdict and its conditions; the page's level is shared evenly."""
    found = []
    for claim in claims:
        conditions = conditions_of(study, claim)
        found.append(Assessed(claim, assess(conditions, level / len(claims)), conditions))
    return found


def as_json(assessed):
    """All numbers behind the verdicts, for other programs to read."""
    def known(value):
        return value if value is None or math.isfinite(value) else None

    def part(each):
        shown, low, high = each.estimate()
        return {"name": each.name, "scale": each.scale, "direction": each.direction, "bound": each.bound, "by_seed": each.values,
                "effect": known(shown), "interval": [known(low), known(high)]}
    return [{"claim": claim.key, "text": claim.text, "test": claim.test, "paths": claim.paths, "verdict": verdict,
             "conditions": [{"setting": setting_name(each.setting), **{axis.name: str(value) for axis, value in zip(AXES, each.setting)},
                             "speed": each.speed, "points": each.points, "whole_map": each.is_map, "runs": each.runs,
                             "without_end": each.lost, "p": each.p(), "confirmed": each.confirmed,
                             "parts": [part(one) for one in each.parts]} for each in conditions]}
            for claim, verdict, conditions in assessed]


def write_aside(path, text):
    path = pathlib.Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(path.name + ".aside")
    aside.write_text(text, encoding="utf-8")
    os.replace(aside, path)


def rewrite(text, name, content, page):
    pattern = re.compile(rf"(<!-- table: {name} -->\n).*?(\n?<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        raise Mistake(f"{page}: has no place for the table '{name}'; expected <!-- table: {name} --> ... <!-- end -->")
    return pattern.sub(lambda match: match[1] + content + "\n<!-- end -->", text)


def write_page(template, page, study, assessed):
    """The template's text with all tables anew; nothing is written unless all of them could be made."""
    text = pathlib.Path(template).read_text(encoding="utf-8")
    for name, make in TABLES.items():
        text = rewrite(text, name, make(study, assessed), template)
    write_aside(page, text)


def write_json(path, assessed):
    write_aside(path, json.dumps(as_json(assessed), indent=1) + "\n")


EXPECTED_SPEEDS, SETTING_SPEEDS, MAP_SPEEDS, EXPECTED_SEEDS = range(1, 11), (2, 5, 8), (5, 8), 20
CHANGES = {"correlation length": (5, 20, 40), "arrival cost": ("smoothing", "constant", "off"), "reference speed": ("literal",),
           "intervals": (14,), "block_sigma": (0.25,), "transition": ("ramp",), "neighbour_sigma": (0.04,)}  # scenarios/paper/settings.yaml


def require_whole(study):
    """Throws unless the database has every condition of the study with its seeds."""
    expected = [(BASE, speed) for speed in EXPECTED_SPEEDS]
    for place, axis in enumerate(AXES):
        for value in CHANGES[axis.name]:
            expected += [((*BASE[:place], value, *BASE[place + 1:]), speed) for speed in SETTING_SPEEDS]
    absent = []
    for setting, speed in expected:
        seeds = study.runs.get((setting, speed), {}).get("figure8", {}).get(("fhb",), {})
        if len(seeds) < EXPECTED_SEEDS:
            absent.append(f"{setting_name(setting)} at {speed:g} m/s: {len(seeds)} of {EXPECTED_SEEDS} seeds")
    for speed in MAP_SPEEDS:
        methods = study.runs.get((BASE, speed), {}).get("figure8", {})
        whole = [method for method, runs in methods.items() if method[0] == "kappa" and len(runs) >= EXPECTED_SEEDS]
        if len(whole) < 30 * 16:
            absent.append(f"the map of SB-O on kappa at {speed} m/s: {len(whole)} of {30 * 16} (S, o)")
    if absent:
        raise Mistake("the study is not whole, so that verdicts would be of something else:\n  " + "\n  ".join(absent) +
                      "\nscripts/study/reproduce makes what is missing; --partial assesses what is there")
