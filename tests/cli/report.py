#!/usr/bin/env python3
"""`rhec report`: the numbers of a page are those of the files that it is made of, long runs stay small and say how, and what is
no run, or only half of one, is answered with the file, the line and what to do.

    report.py <rhec>
"""
import csv
import json
import math
import pathlib
import random
import re
import shutil
import sqlite3
import statistics
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, SHORT, USAGE, Program, assignments

DOCUMENT = re.compile(r'<script type="application/json" id="document">(.*?)</script>', re.DOTALL)
MOST_BYTES = 5_000_000
# Of the two-sided 95 % interval, by degrees of freedom: from tables of Student's distribution.
STUDENT = {1: 12.70620474, 3: 3.182446305, 19: 2.093024054}
# Solves of the controller fail where the vehicle cannot stop.
WALL = ["controller.speed_bound_factor=.inf", "bounds.u1=[4, 20]", "bounds.x_pos=[-20, 6]"]
# Means of a sweep are written with five digits, differences of pairs with four.
FIVE_DIGITS, FOUR_DIGITS = 5.1e-5, 5.1e-4
TERMS = ("kappa", "mu", "position", "heading", "tracking")


def strict(text):
    """JSON that has no NaN."""
    def refuse(word):
        raise ValueError(f"{word} is no JSON")
    return json.loads(text, parse_constant=refuse)


def rows_of(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def close(a, b, relative=2e-6, absolute=1e-9):
    return math.isclose(a, b, rel_tol=relative, abs_tol=absolute)


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("report")
        self.rhec, self.work = rhec, work
        self.run_folder = work / "run"
        self.make_run("run", "seed=3")

    def make_run(self, name, *settings, short=True):
        result = self.rhec("run", FIGURE8, "--out", self.work / name, *assignments(*(SHORT if short else ()), *settings))
        self.expect(result.returncode == FINE, name, result.stderr)
        return self.work / name

    def page_of(self, source, name="page"):
        """The document of a page that must be made, and the page."""
        page = self.work / f"{name}.html"
        result = self.rhec("report", source, "-o", page, timeout=240)
        self.expect(result.returncode == FINE and not result.stderr, f"report {source}", result.stderr)
        text = page.read_text(encoding="utf-8") if page.is_file() else ""
        found = DOCUMENT.findall(text)
        self.expect(len(found) == 1, f"report {source}", f"{len(found)} documents in the page")
        document = strict(found[0])
        self.expect(document["form"] == "rhec report" and document["version"] == 1, f"report {source}", "form or version")
        self.expect(len(text.encode()) < MOST_BYTES, f"report {source}", f"the page has {len(text.encode())} bytes")
        for word in ("http-equiv", "src=\"http", "href=\"http", "@import", "url(http"):
            self.expect(word not in text.replace(found[0], ""), f"report {source}", f"the page fetches: {word}")
        return document, text

    def notes(self, document, about):
        return " ".join(note["text"] for note in document["notes"] if note["about"] == about)

    # ---- a run

    def numbers_of_a_run(self):
        document, _ = self.page_of(self.run_folder)
        summary = json.loads((self.run_folder / "summary.json").read_text())
        rows = rows_of(self.run_folder / "steps.csv")
        self.expect(document["kind"] == "run" and document["summary"] == summary, "run", "the summary is not summary.json")
        self.expect(document["samples"] == {"total": len(rows), "kept": len(rows), "how": "every sample"}, "run", "samples")
        column = lambda name: [float(row[name]) for row in rows]
        for kind in ("states", "parameters"):
            for series in document[kind]:
                name = series["name"]
                self.expect(series["time"] == "all", name, "is thinned")
                for key, of in (("true", f"true_{name}"), ("estimate", name), ("sigma", f"sigma_{name}")):
                    self.expect(all(map(close, series[key], column(of))), name, f"{key} is not that of steps.csv")
        self.expect(all(map(close, document["times"]["all"], column("time"))), "run", "time")
        for series in document["inputs"]:
            self.expect(all(map(close, series["values"], column(series["name"]))), series["name"], "values")
            self.expect(series["lower"] is not None and series["upper"] is not None, series["name"], "bounds")
            self.expect(all(series["lower"] - 1e-6 <= value <= series["upper"] + 1e-6 for value in series["values"]),
                        series["name"], "an input is beyond its bounds")
        # Errors of the page, put together again, are those of the summary.
        means = {series["name"]: statistics.fmean(map(abs, series["error"])) for series in document["parameters"]}
        means |= {series["name"]: statistics.fmean(map(abs, series["values"])) for series in document["errors"]}
        for name in TERMS:
            self.expect(close(means[name], summary["mae"][name], 1e-5), "run", f"{name}: {means[name]}, {summary['mae'][name]}")
        self.expect(close(means["nees"], summary["nees"], 1e-5), "run", f"nees: {means['nees']}, {summary['nees']}")
        times = rows_of(self.run_folder / "times.csv")
        for who in ("rhe", "rhc"):
            self.expect(document["statuses"][who]["counts"] == summary["statuses"][who], who, "statuses")
            histogram = document["solve_times"][who]
            self.expect({key: histogram[key] for key in ("median", "p99", "max")} == summary["solve_time_us"][who], who, "spread")
            of_file = [float(row[f"{who}_us"]) for row in times]
            for low, high, count in zip(histogram["edges"], histogram["edges"][1:], histogram["counts"]):
                inside = sum(low <= value < high for value in of_file)
                near = sum(close(value, edge, 1e-5) for value in of_file for edge in (low, high))
                self.expect(abs(inside - count) <= near, who, f"{count} solves from {low} to {high} us, {inside} in times.csv")
            self.expect(histogram["count"] == sum(histogram["counts"]) == len(rows), who, "solves")
        changes = document["statuses"]["rhc"]["changes"]
        told = [changes[max(i for i, change in enumerate(changes) if change[0] <= k)][2] for k in range(len(rows))]
        self.expect(told == [row["controller_status"] for row in rows], "run", "statuses by sample")
        self.expect(len(document["map"]["path"]["x"]) > 50, "run", "path")
        slip = document["map"]["slip"]
        self.expect([raster["parameter"] for raster in slip] == ["kappa", "mu"], "run", "rasters")
        for raster in slip:
            self.check_raster(raster, rows)

    def check_raster(self, raster, rows):
        """The map of slip agrees with what the vehicle met, as far as cells are small against the terrain."""
        self.expect(len(raster["values"]) == raster["nx"] * raster["ny"], "slip", "cells")
        self.expect((raster["lower"], raster["upper"]) == (min(raster["values"]), max(raster["values"])), "slip", "range")
        for row in rows[::7]:
            ix = round((float(row["true_x_pos"]) - raster["x0"]) / raster["dx"])
            iy = round((float(row["true_y_pos"]) - raster["y0"]) / raster["dy"])
            value = raster["values"][iy * raster["nx"] + ix]
            self.expect(abs(value - float(row[f"true_{raster['parameter']}"])) < 0.05, "slip",
                        f"{value} where the vehicle met {row['true_' + raster['parameter']]}")

    def horizons_of_a_run(self):
        size, overlap = 2, 4
        folder = self.make_run("blocks", f"blocking.kappa={{name: structured, size: {size}, overlap: {overlap}}}",
                               "blocking.mu={name: full_horizon}")
        document, _ = self.page_of(folder)
        rows = rows_of(folder / "steps.csv")
        horizons = document["horizons"]
        self.expect(horizons["kept"] == horizons["total"] == len(rows) == len(horizons["list"]), "horizons", "count")
        self.expect(horizons["estimation_horizon"] == horizons["control_horizon"] == 15, "horizons", "lengths")
        states = [variable["name"] for variable in document["model"]["states"]]
        for k, record in enumerate(horizons["list"]):
            window, plan, row = record["rhe"], record["rhc"], rows[k]
            first, newest = max(0, k - 15), k
            place = f"sample {k}"
            self.expect(record["sample"] == k and window["first"] == first, place, "which it is")
            self.expect(len(window["time"]) == newest - first + 1 == len(window["true"][0]), place, "nodes")
            for j, name in enumerate(states):
                self.expect(abs(window["state"][j][-1] - float(row[name])) < 2e-4, place, f"{name} at the newest node")
                self.expect(abs(plan["state"][j][0] - float(row[name])) < 2e-4, place, f"{name} where the plan starts")
            for i in range(first, newest + 1):
                self.expect(close(window["time"][i - first], float(rows[i]["time"])), place, "time")
                for j, name in enumerate(("kappa", "mu")):
                    self.expect(close(window["true"][j][i - first], float(rows[i][f"true_{name}"]), 2e-5), place, "truth")
                # The antenna is 0.4 m behind the axle; its noise has a standard deviation of 0.03 m.
                antenna = float(rows[i]["true_x_pos"]) - 0.4 * math.cos(float(rows[i]["true_beta"]))
                self.expect(abs(window["measured"][0][i - first] - antenna) < 0.3, place, "measurements")
            for j, name in enumerate(("u1", "u2")):
                self.expect(abs(plan["input"][j][0] - float(row[name])) < 1e-4, place, f"{name} is not the plan's first")
                self.expect(len(plan["input"][j]) == 15, place, "plan")
            if k == 0:
                self.expect(window["blocks"] == [], place, "a window without intervals has blocks")
                continue
            kappa, mu = window["blocks"]
            there = [s for s in range(first + 1, newest) if s % size == 0 and newest - s >= overlap]
            held = [s for s in range(first + 1, newest) if s % size == 0 and newest - s < overlap]
            self.expect(kappa["starts"] == [first] + there, place, f"starts {kappa['starts']}")
            self.expect(kappa["suppressed"] == held, place, f"suppressed {kappa['suppressed']}, expected {held}")
            self.expect(kappa["next_start"] == newest + newest % size, place, f"next start {kappa['next_start']}")
            if newest - first >= overlap:
                self.expect(kappa["first_start"] == first - first % size, place, f"first start {kappa['first_start']}")
            self.expect((mu["starts"], mu["suppressed"], mu["next_start"]) == ([first], [], None), place, "full horizon")
            self.expect(abs(kappa["values"][-1] - float(row["kappa"])) < 1e-5, place, "kappa of the newest block")
            self.expect(close(kappa["sigmas"][-1], float(row["sigma_kappa"]), 1e-3, 1e-6), place,
                        f"sigma {kappa['sigmas'][-1]} of the newest block, {row['sigma_kappa']}")
            self.expect(len(kappa["values"]) == len(kappa["sigmas"]) == len(kappa["starts"]), place, "blocks")
            if self.failures:
                return

    def other_estimators(self):
        for name, sigma in (("ekf", True), ("truth", False)):
            folder = self.make_run(name, f"estimator.name={name}")
            document, _ = self.page_of(folder)
            self.expect((document["parameters"][0]["sigma"] is not None) == sigma, name, "sigma")
            self.expect(document["statuses"]["rhe"] is None and document["solve_times"]["rhe"] is None, name, "estimator")
            self.expect(all(record["rhe"] is None for record in document["horizons"]["list"]), name, "windows")
            self.expect("no window" in self.notes(document, "horizons"), name, "nothing is said of windows")

    def fallbacks(self):
        """Where solves fail, each of them is shown, and is in the table."""
        folder = self.work / "failing"
        self.rhec("run", FIGURE8, "--out", folder, *assignments(*SHORT, *WALL))
        summary = json.loads((folder / "summary.json").read_text())
        self.expect(summary["fallbacks"] > 0, "fallbacks", "there are none")
        document, _ = self.page_of(folder)
        count = sum(len(document["fallbacks"][who]) for who in ("rhe", "rhc"))
        self.expect(count == summary["fallbacks"], "fallbacks", f"{count}, summary.json has {summary['fallbacks']}")

    def long_run(self):
        """More samples than a page draws."""
        folder = self.make_run("long", "speed=1", "path.laps=3", short=False)
        rows = rows_of(folder / "steps.csv")
        document, _ = self.page_of(folder)
        self.expect(len(rows) > 3000 > document["samples"]["kept"] - 1, "long", f"{len(rows)} samples")
        said = self.notes(document, "samples")
        self.expect(f"{len(rows):,}" in said and "extremes stay" in said, "long", f"what is said of thinning: {said}")
        self.expect(f"of {len(rows):,} samples" in self.notes(document, "horizons"), "long", self.notes(document, "horizons"))
        for series in document["states"] + document["parameters"]:
            name, times = series["name"], document["times"][series["time"]]
            self.expect(len(times) == len(series["estimate"]) < len(rows), name, "is not thinned")
            for key, of in (("true", f"true_{name}"), ("estimate", name), ("sigma", f"sigma_{name}")):
                values = [float(row[of]) for row in rows]
                self.expect(close(min(values), min(series[key])) and close(max(values), max(series[key])), name,
                            f"an extreme of {key} was lost")
            at = {round(float(row["time"]), 6): row for row in rows}
            self.expect(all(close(value, float(at[round(time, 6)][name])) for time, value in zip(times, series["estimate"])),
                        name, "a value is at another time")
        self.expect(sum(document["solve_times"]["rhc"]["counts"]) == len(rows), "long", "solve times are not those of all solves")
        self.expect(100 < document["horizons"]["kept"] < 1000, "long", f"{document['horizons']['kept']} windows")
        lines = len((folder / "horizons.jsonl").read_text().splitlines())
        self.expect(lines < 1100, "long", f"horizons.jsonl has {lines} lines")

    def older_program(self):
        folder = self.copy_of(self.run_folder, "older")
        (folder / "horizons.jsonl").unlink()
        document, _ = self.page_of(folder)
        self.expect(document["horizons"] is None and document["map"] is None, "older", "there are horizons")
        self.expect("older program" in self.notes(document, "horizons"), "older", f"notes: {document['notes']}")
        self.expect([series["name"] for series in document["parameters"]] == ["kappa", "mu"], "older", "parameters")

    def harmless_names(self):
        name = "</script><script>alert('x')</script><!-- \u2028"
        document, text = self.page_of(self.make_run("named", f"name={json.dumps(name)}"))
        self.expect(document["title"] == name, "name", f"the title is {document['title']!r}")
        self.expect("<script>alert" not in text and "\u2028" not in DOCUMENT.sub("", text), "name", "the name is part of the page's script")

    # ---- a log

    def log_of_1500_seconds(self):
        """A drive with gaps, as long as a real one."""
        noise = random.Random(4)
        rows, fixes, x, y, heading = [], [], 0.0, 0.0, 0.3
        gaps = ((200.0, 230.0), (900.0, 955.0))
        for i in range(15000):
            time, steering = 0.1 * i, 0.25 * math.sin(0.02 * i) + 0.05 * math.sin(0.0031 * i)
            rows.append(f"{time:.3f},{4.0 + 0.1 * noise.gauss(0, 1):.5f},{steering + 0.005 * noise.gauss(0, 1):.6f}")
            if i % 4 == 0 and not any(a < time < b for a, b in gaps):
                fixes.append(f"{time:.3f},{x + 0.1 * noise.gauss(0, 1):.4f},{y + 0.1 * noise.gauss(0, 1):.4f}")
            rate = 0.9 * 4.0 / 2.83 * math.tan(steering)
            x += 0.36 * math.cos(heading + 0.05 * rate)
            y += 0.36 * math.sin(heading + 0.05 * rate)
            heading += 0.1 * rate
        drs, gps = self.work / "drs.txt", self.work / "gps.txt"
        drs.write_text("\n".join(rows) + "\n")
        gps.write_text("\n".join(fixes) + "\n")
        folder = self.work / "log"
        result = self.rhec("estimate", cli.ROOT / "scenarios" / "victoria_park.yaml", "--dead-reckoning", drs, "--gps", gps,
                           "--hold-out", 5, "--out", folder)
        self.expect(result.returncode == FINE, "estimate", result.stderr)
        document, text = self.page_of(folder)
        summary = json.loads((folder / "summary.json").read_text())
        rows = rows_of(folder / "estimates.csv")
        self.expect(document["kind"] == "log" and document["summary"] == summary, "log", "the summary is not summary.json")
        for gap in gaps:
            self.expect(any(close(found["from"], gap[0], absolute=0.6) and close(found["to"], gap[1], absolute=0.6)
                            for found in document["gaps"]), "log", f"the gap {gap} is not in {document['gaps']}")
        self.expect(document["fixes"]["total"] == len(fixes), "log", "fixes")
        self.expect("Nobody knows" in self.notes(document, "truth"), "log", "nothing is said of the truth")
        self.expect("extremes stay" in self.notes(document, "samples"), "log", "nothing is said of thinning")
        nodes = next(nodes for nodes in map(json.loads, (folder / "horizons.jsonl").read_text().splitlines()) if nodes.get("node_time"))
        self.expect([series["name"] for series in document["inputs"]] == ["u1", "u2"], "log", "inputs")
        for series, measured in zip(document["inputs"], nodes["input"]):
            self.expect(min(series["values"]) == min(measured) and max(series["values"]) == max(measured), series["name"], "extremes")
            self.expect(len(series["values"]) == len(document["times"][series["time"]]) < len(measured), series["name"], "is not thinned")
        names = [variant["name"] for variant in document["variants"]]
        self.expect(names == list(summary["variants"]), "log", f"variants {names}")
        for variant in document["variants"]:
            self.check_variant(variant, [row for row in rows if row["variant"] == variant["name"]], document, summary)
        self.cut_log(folder)
        older = self.copy_of(folder, "older log")
        for name in ("horizons.jsonl", "times.csv"):
            (older / name).unlink()
        document, _ = self.page_of(older)
        self.expect("older program" in self.notes(document, "horizons") and "older program" in self.notes(document, "times"),
                    "older log", f"notes: {document['notes']}")

    def smoothed_log(self):
        """What `rhec smooth` leaves has no windows, but a track."""
        drs, gps = (self.work / name for name in ("short_drs.txt", "short_gps.txt"))
        for short, full, count in ((drs, "drs.txt", 300), (gps, "gps.txt", 75)):
            short.write_text("".join((self.work / full).read_text().splitlines(keepends=True)[:count]))
        folder = self.work / "smoothed"
        result = self.rhec("smooth", cli.ROOT / "scenarios" / "victoria_park.yaml", "--variant", "rhe_robust",
                           "--dead-reckoning", drs, "--gps", gps, "--hold-out", 5, "--out", folder)
        self.expect(result.returncode == FINE, "smooth", result.stderr)
        document, _ = self.page_of(folder)
        self.expect([variant["name"] for variant in document["variants"]] == ["rhe_robust", "rhe_robust causal"], "smooth", "variants")
        rows = rows_of(folder / "estimates.csv")
        for variant in document["variants"]:
            nodes = [row for row in rows if row["variant"] == variant["name"] and row["held_out"] == "0"]
            self.expect(variant["horizons"] is None and all(map(close, variant["track"]["x"], (float(row["x_pos"]) for row in nodes))),
                        variant["name"], "track")
        self.expect("smoother" in self.notes(document, "horizons"), "smooth", f"notes: {document['notes']}")

    def check_variant(self, variant, rows, document, summary):
        name, nodes = variant["name"], [row for row in rows if row["held_out"] == "0"]
        numbers = summary["variants"][name]
        self.expect(variant["samples"]["total"] == len(nodes) == numbers["nodes"], name, "nodes")
        for series in variant["states"] + variant["parameters"]:
            of = series["name"]
            values = [float(row[of]) for row in nodes]
            self.expect(close(min(values), min(series["estimate"])) and close(max(values), max(series["estimate"])), name,
                        f"an extreme of {of} was lost")
            at = {round(float(row["time"]), 4): row for row in nodes}
            for time, value, sigma in zip(document["times"][series["time"]], series["estimate"], series["sigma"]):
                row = at.get(round(time, 4))
                if not self.expect(row and close(value, float(row[of])) and close(sigma, float(row[f"sigma_{of}"])), name,
                                   f"{of} at {time} is not that of estimates.csv"):
                    break
        residuals = [float(row["residual"]) for row in rows if row["kind"] == "fix" and row["residual"]]
        self.expect(close(max(residuals), max(variant["residuals"]["values"])), name, "the largest residual was lost")
        histogram, is_filter = variant["solve_times"]["rhe"], name == "ekf"
        self.expect((histogram is None) == is_filter == (variant["horizons"] is None), name, "what a filter has not")
        if is_filter:
            return
        self.expect(sum(histogram["counts"]) == numbers["solves"], name, "solve times are not those of all solves")
        self.expect(sum(variant["statuses"]["rhe"]["counts"].values()) == numbers["nodes"], name, "statuses")
        self.expect(len(variant["fallbacks"]["rhe"]) == numbers["fallbacks"], name, "fallbacks")
        at = {round(float(row["time"]), 4): row for row in nodes}
        for record in variant["horizons"]["list"]:
            window, row = record["rhe"], at[round(record["time"], 4)]
            self.expect(close(window["time"][-1], record["time"]) and record["rhc"] is None, name, "window")
            self.expect(abs(window["state"][0][-1] - float(row["x_pos"])) < 1e-3, name, "the newest node")
            measured = [value for value, time in zip(window["measured"][0], window["time"])
                        if at[round(time, 4)]["kind"] == "fix"]
            self.expect(None not in measured, name, "a fix is missing in its window")

    def cut_log(self, good):
        folder = self.copy_of(good, "cut log")
        file = folder / "estimates.csv"
        lines = file.read_text().splitlines(keepends=True)
        file.write_text("".join(lines[:200]))
        self.refused(folder, "estimates.csv:200", "summary.json says", "rhec estimate")

    # ---- a sweep

    def numbers_of_a_sweep(self):
        database = self.work / "blocks.sqlite"
        sweep = self.work / "sweep.yaml"
        shutil.copy(FIGURE8, self.work / "figure8.yaml")
        sweep.write_text("""\
name: blocks
scenario: figure8.yaml
set: {path.laps: 1, path.radius: 12}
grid:
  - blocking.kappa: [{name: structured}]
    blocking.kappa.size: [2, 10]
    blocking.kappa.overlap: [0, 4]
    speed: [10, 8]
    seed: {from: 1, to: 4}
  - blocking.kappa: [{name: full_horizon}, {name: unblocked}]
    speed: [10, 8]
    seed: {from: 1, to: 4}
""")
        result = self.rhec("sweep", sweep, "--out", database)
        self.expect(result.returncode == FINE, "sweep", result.stderr)
        before, beside = database.read_bytes(), sorted(self.work.glob("blocks*"))
        document, _ = self.page_of(database)
        self.expect(database.read_bytes() == before and sorted(self.work.glob("blocks*")) == beside, "sweep",
                    "the database was written to")
        self.expect(document["runs"] == {"total": 48, "completed": 48, "not_completed": 0, "refused": 0, "failed": 0}, "sweep",
                    f"{document['runs']}")
        self.expect([(choice["key"], choice["values"]) for choice in document["choices"]] == [("speed", [8, 10])], "sweep",
                    f"choices {document['choices']}")
        self.expect(len(document["maps"]) == 2 and document["others"] is None, "sweep", "maps")
        self.check_maps(document, database)

    def check_maps(self, document, database, every=1):
        """Every n-th cell's means and pairs, from the database by another way."""
        runs = {}
        with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
            query = "SELECT configuration, seed, status, mae, mae_after_start, solve_time_us, nees FROM runs"
            for text, seed, status, mae, later, times, nees in connection.execute(query):
                configuration = json.loads(text)
                kappa = configuration["blocking"]["kappa"]
                key = configuration["speed"], kappa["name"], kappa.get("size"), kappa.get("overlap", 0)
                values = None
                if status == "completed":
                    times = json.loads(times)
                    values = {f"mae.{name}": value for name, value in json.loads(mae).items()}
                    values |= {f"mae_after_start.{name}": value for name, value in json.loads(later).items()}
                    values |= {f"{who}.{part}": times[who][part] for who in times for part in ("median", "p99")}
                    values["nees"] = nees
                runs.setdefault(key, {})[seed] = values
        measures = [measure["name"] for measure in document["measures"]]
        self.expect({"mae.kappa", "mae.mu", "mae.position", "mae.tracking", "rhe.median"} <= set(measures), "sweep", f"{measures}")
        speeds = next(choice["values"] for choice in document["choices"] if choice["key"] == "speed")
        checked = 0
        for shown in document["maps"]:
            speed = speeds[shown["setting"][[choice["key"] for choice in document["choices"]].index("speed")]]
            full = runs[speed, "full_horizon", None, 0]
            for measure in measures:
                mean = statistics.fmean(run[measure] for run in full.values() if run)
                self.expect(close(shown["reference"]["means"][measure], mean, 1e-6), "sweep", f"full horizon, {measure}")
            cells = [(i, j) for i in range(len(shown["axes"][0]["values"])) for j in range(len(shown["axes"][1]["values"]))]
            for i, j in cells[::every]:
                checked += 1
                cell = runs[speed, "structured", shown["axes"][0]["values"][i], shown["axes"][1]["values"][j]]
                completed = {seed: run for seed, run in cell.items() if run}
                place = f"S {shown['axes'][0]['values'][i]}, o {shown['axes'][1]['values'][j]}, {speed} m/s"
                self.expect(shown["runs"][i][j] == len(completed), place, "runs")
                self.expect(shown["lost"][i][j] == len(cell) - len(completed), place, "lost")
                for measure in measures:
                    mean = statistics.fmean(run[measure] for run in completed.values())
                    self.expect(close(shown["means"][measure][i][j], mean, FIVE_DIGITS), place,
                                f"{measure}: {shown['means'][measure][i][j]}, in the database {mean}")
                both = [seed for seed in completed if full.get(seed)]
                self.expect(shown["pairs"]["count"][i][j] == len(both), place, "pairs")
                for measure in shown["pairs"]["difference"]:
                    differences = [completed[seed][measure] - full[seed][measure] for seed in both]
                    half = STUDENT[len(both) - 1] * statistics.stdev(differences) / math.sqrt(len(both))
                    found = shown["pairs"]["difference"][measure][i][j], shown["pairs"]["half_width"][measure][i][j]
                    self.expect(close(found[0], statistics.fmean(differences), FOUR_DIGITS) and close(found[1], half, FOUR_DIGITS), place,
                                f"pairs of {measure}: {found}, in the database {statistics.fmean(differences)} and {half}")
        self.expect(checked >= 8, "sweep", f"{checked} cells were looked at")

    def sweep_of_100_000_runs(self):
        """A database as a large sweep leaves it, of made-up numbers."""
        small, large = self.work / "blocks.sqlite", self.work / "large.sqlite"
        noise = random.Random(5)
        with sqlite3.connect(small) as connection:
            schema, = connection.execute("SELECT sql FROM sqlite_schema WHERE name = 'runs'").fetchone()
            template, = connection.execute("SELECT configuration FROM runs LIMIT 1").fetchone()
            identity = [connection.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")]
        base = json.loads(template)

        def rows():
            number = 0
            for speed in range(1, 11):
                blockings = [{"name": "full_horizon"}]
                blockings += [{"name": "structured", "size": size, "overlap": overlap} for size in range(1, 31) for overlap in range(16)]
                for kappa in blockings:
                    for seed in range(1, 21):
                        number += 1
                        # Of some cells a seed is lost, so that pairs are fewer than runs there; whole cells are not.
                        is_lost = number % 997 == 0 and kappa.get("size", 0) > 25
                        base["blocking"]["kappa"], base["speed"], base["seed"] = kappa, speed, seed
                        errors = json.dumps({name: noise.uniform(0.01, 0.5) for name in TERMS})
                        times = json.dumps({who: {"median": noise.uniform(5, 50), "p99": 80.5, "max": 100.25} for who in ("rhe", "rhc")})
                        yield (f"{number:032x}", json.dumps(base, separators=(",", ":"), sort_keys=True), seed,
                               "not completed" if is_lost else "completed", "", 10, 20, 0, noise.uniform(1, 9),
                               errors, errors, errors, "{}", times, 0.1, "2026-01-01T00:00:00Z", "made up")

        with sqlite3.connect(large) as connection:
            connection.execute(schema)
            connection.execute(f"PRAGMA application_id = {identity[0]}")
            connection.execute(f"PRAGMA user_version = {identity[1]}")
            connection.executemany(f"INSERT INTO runs VALUES ({', '.join('?' * 17)})", rows())
        document, text = self.page_of(large)
        self.expect(document["runs"]["total"] == 96_200, "large", f"{document['runs']}")
        self.expect(document["runs"]["not_completed"] > 0, "large", "nothing is lost")
        self.expect(len(document["maps"]) == 10, "large", f"{len(document['maps'])} maps")
        left_out = {"mae_after_start.kappa"} - {measure["name"] for measure in document["measures"]}
        for name in left_out:
            self.expect(name in self.notes(document, "runs"), "large", "what was left out is not said")
        self.expect(document["choices"][0]["values"] == list(range(1, 11)), "large", f"{document['choices']}")
        STUDENT.setdefault(18, 2.100922040)
        STUDENT.setdefault(17, 2.109815578)
        self.check_maps(document, large, every=37)

    def sweep_of_other_keys(self):
        sweep, database = self.work / "others.yaml", self.work / "others.sqlite"
        sweep.write_text("""\
name: others
scenario: figure8.yaml
set: {path.laps: 1, path.radius: 12}
grid:
  - speed: [6, 8, 10]
    estimator.name: [rhe, ekf]
    seed: [1, 2]
""")
        result = self.rhec("sweep", sweep, "--out", database)
        self.expect(result.returncode == FINE, "others", result.stderr)
        document, _ = self.page_of(database)
        shown = document["maps"][0]
        self.expect(not shown["is_blocking"] and shown["axes"][0]["key"] == "speed" and shown["axes"][0]["values"] == [6, 8, 10],
                    "others", f"axes {shown['axes']}")
        names = shown["axes"][1]["values"]
        self.expect(sorted(names) == ["ekf", "rhe"] and shown["reference"] is None and shown["pairs"] is None, "others", f"{names}")
        with sqlite3.connect(database) as connection:
            for i, speed in enumerate((6, 8, 10)):
                for j, name in enumerate(names):
                    values = [row[0] for row in connection.execute(
                        "SELECT mae ->> 'kappa' FROM runs WHERE configuration ->> '$.speed' = ? AND "
                        "configuration ->> '$.estimator.name' = ?", (speed, name))]
                    self.expect(len(values) == 2 and close(shown["means"]["mae.kappa"][i][j], statistics.fmean(values), FIVE_DIGITS),
                                "others", f"{speed} m/s, {name}: {shown['means']['mae.kappa'][i][j]}, {values}")

    # ---- a comparison

    def comparison(self):
        folder = self.work / "compare"
        result = self.rhec("compare", FIGURE8, "--solvers", "gn_rti,fine=gn_rti:mode=converge", "--every", 10, "--out", folder,
                           *assignments(*SHORT))
        self.expect(result.returncode == FINE, "compare", result.stderr)
        comparison = json.loads((folder / "compare.json").read_text())
        for source in (folder, folder / "compare.json"):
            document, _ = self.page_of(source)
            self.expect(document["kind"] == "comparison" and document["comparison"] == comparison, "compare", "is not compare.json")
            self.expect(document["labels"] == ["gn_rti", "fine"], "compare", f"labels {document['labels']}")
        for name, change, *words in (
                ("no solvers", lambda c: c.pop("solvers"), "there is no solvers"),
                ("another form", lambda c: c.update(same_problems=[]), "same_problems is array"),
                ("no times", lambda c: c["same_problems"]["rhe"]["solvers"][1].pop("time_us"), "same_problems.rhe.solvers[1].time_us"),
                ("too few", lambda c: c["same_problems"]["rhc"]["solvers"].pop(), "same_problems.rhc.solvers has 1 entries")):
            broken = json.loads((folder / "compare.json").read_text())
            change(broken)
            file = self.work / "broken.json"
            file.write_text(json.dumps(broken))
            self.refused(file, "broken.json", *words, "rhec compare")
        text = (folder / "compare.json").read_text()
        file.write_text(text[:len(text) // 2])
        self.refused(file, f"broken.json:{text[:len(text) // 2].count(chr(10)) + 1}", "cut off", "rhec compare")
        file.write_text("{}")
        self.refused(file, "broken.json", "rhec compare")

    # ---- what is no report

    def copy_of(self, folder, name):
        copy = self.work / name
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        return copy

    def refused(self, source, *words, out=None, code=ERROR):
        page = out or self.work / "kept.html"
        if out is None:
            page.write_text("as it was")
        result = self.rhec("report", source, "-o", page)
        self.expect(result.returncode == code and not result.stdout, f"report {source}", f"exit code {result.returncode}: {result.stdout}")
        line = result.stderr
        self.expect(line.startswith("rhec: error: ") and line.count("\n") == 1, f"report {source}", f"said {line!r}")
        for word in words:
            self.expect(str(word) in line, f"report {source}", f"'{word}' is not in {line!r}")
        if out is None:
            self.expect(page.read_text() == "as it was", f"report {source}", "the page was written to")

    def no_run(self):
        empty = self.work / "empty"
        empty.mkdir()
        everything = ("steps.csv", "estimates.csv", "rhec run", "rhec estimate", "rhec sweep", "rhec compare")
        self.refused(empty, "empty", "no run", *everything)
        (empty / ".empty.partial-0").mkdir()
        self.refused(empty, ".empty.partial-0", "ended before it was done", *everything)
        self.refused(self.work / "nowhere", "nowhere", *everything)
        text = self.work / "text.txt"
        text.write_text("some words\n")
        self.refused(text, "text.txt", *everything)
        text.write_text("")
        self.refused(text, "text.txt", "empty")
        self.refused(self.run_folder / "steps.csv", "give the folder", self.run_folder)
        (empty / "summary.json").write_text("{}")
        self.refused(empty, "summary.json", "no summary")

    def half_a_run(self):
        good = self.run_folder
        for name in ("steps.csv", "summary.json", "times.csv"):
            folder = self.copy_of(good, "half")
            (folder / name).unlink()
            self.refused(folder, folder / name, "is missing", "rhec run")
        for name in ("steps.csv", "times.csv", "horizons.jsonl", "summary.json"):
            text = (good / name).read_text()
            lines = text.splitlines(keepends=True)
            folder = self.copy_of(good, "half")
            file = folder / name
            file.write_text("")
            self.refused(folder, file, "empty", "rhec run")
            cut = "".join(lines[:9]) + lines[9][:len(lines[9]) // 2]
            file.write_text(cut)
            self.refused(folder, f"{file}:10", "rhec run")
            if name == "summary.json":
                continue
            file.write_text("".join(lines[:-3]))
            self.refused(folder, f"{file}:{len(lines) - 3 + (name == 'horizons.jsonl')}", "rhec run")
        folder = self.copy_of(good, "half")
        rows = (good / "steps.csv").read_text().splitlines(keepends=True)
        fields = rows[6].split(",")
        fields[3] = "four"
        (folder / "steps.csv").write_text("".join(rows[:6] + [",".join(fields)] + rows[7:]))
        self.refused(folder, "steps.csv:7", "true_y_pos", "'four'", "expected a number")
        (folder / "steps.csv").write_text("".join(rows[:6] + [",".join(fields[:4]) + "\n"] + rows[7:]))
        self.refused(folder, "steps.csv:7", "4 fields")
        (folder / "steps.csv").write_text("".join([rows[0].replace("tracking", "distance")] + rows[1:]))
        self.refused(folder, "steps.csv:1", "tracking")
        folder = self.copy_of(good, "half")
        horizons = (good / "horizons.jsonl").read_text()
        lines = horizons.splitlines(keepends=True)
        for text, line, *words in (
                (horizons.replace('"version":1', '"version":2', 1), 1, "version 2", "version 1"),
                (horizons.replace("rhec horizons", "something", 1), 1, "rhec horizons"),
                (horizons + lines[-1], len(lines) + 1, "more lines"),
                ("".join(lines[:5] + ["{\n"] + lines[6:]), 6, "no whole line"),
                ("".join(lines[:5] + ["{}\n"] + lines[6:]), 6, "sample, rhe and rhc")):
            (folder / "horizons.jsonl").write_text(text)
            self.refused(folder, f"horizons.jsonl:{line}", *words, "rhec run")
        other = self.make_run("other", "seed=4")
        shutil.copy(other / "horizons.jsonl", folder / "horizons.jsonl")
        self.refused(folder, "horizons.jsonl", "another run", "rhec run")
        # A number that is none stays valid JSON.
        text = (good / "steps.csv").read_text().splitlines(keepends=True)
        index = text[0].split(",").index("sigma_mu")
        fields = text[20].split(",")
        fields[index] = "nan"
        (folder / "steps.csv").write_text("".join(text[:20] + [",".join(fields)] + text[21:]))
        shutil.copy(good / "horizons.jsonl", folder / "horizons.jsonl")
        document, _ = self.page_of(folder)
        self.expect(document["parameters"][1]["sigma"][19] is None, "nan", "is not null")

    def no_sweep(self):
        database = self.work / "bad.sqlite"

        def make(*statements):
            database.unlink(missing_ok=True)
            shutil.copy(self.work / "blocks.sqlite", database)
            connection = sqlite3.connect(database)
            for statement in statements:
                connection.execute(statement)
            connection.commit()
            connection.close()

        make("PRAGMA user_version = 2")
        self.refused(database, database, "version 2", "version 1")
        make("PRAGMA application_id = 7")
        self.refused(database, database, "not one of rhec's sweeps")
        make("DELETE FROM runs")
        self.refused(database, database, "no runs")
        make("ALTER TABLE runs RENAME COLUMN mae TO errors")
        self.refused(database, database, "mae")
        make("UPDATE runs SET mae = 'x' WHERE rowid = 5")
        self.refused(database, database, "mae", "is no map")
        make()
        database.write_bytes(database.read_bytes()[:-1000])
        self.refused(database, database, "damaged or cut short")
        database.write_bytes(b"SQLite format 3\0 and nothing else")
        self.refused(database, database, "no SQLite database")

    def no_output(self):
        folder = self.work / "a folder"
        folder.mkdir()
        self.refused(self.run_folder, folder, "is a folder", out=folder)
        file = self.work / "a file"
        file.write_text("")
        self.refused(self.run_folder, file, out=file / "page.html")
        page = self.work / "kept.html"
        page.write_text("as it was")
        result = self.rhec("report", self.run_folder, "-o", page, "--svg", file)
        self.expect(result.returncode == ERROR and str(file) in result.stderr and page.read_text() == "as it was", "--svg",
                    f"{result.returncode}: {result.stderr}")
        for words in (["report"], ["report", self.run_folder, "--sgv", "x"], ["report", self.run_folder, "another"]):
            result = self.rhec(*words)
            self.expect(result.returncode == USAGE and "rhec report --help" in result.stderr, " ".join(map(str, words)), result.stderr)
        left = [path.name for path in self.work.iterdir() if "partial" in path.name]
        self.expect(not left, "output", f"left behind: {left}")

    def figures(self):
        folder = self.work / "figures"
        result = self.rhec("report", self.run_folder, "-o", self.work / "page.html", "--svg", folder, timeout=240)
        self.expect(result.returncode == FINE, "--svg", result.stderr)
        files = sorted(folder.iterdir()) if folder.is_dir() else []
        self.expect(len(files) >= 5 and all(file.read_text().startswith("<svg") or "<svg" in file.read_text()[:400] for file in files),
                    "--svg", f"{[file.name for file in files]}")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-report-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(work))
        for part in (test.numbers_of_a_run, test.horizons_of_a_run, test.other_estimators, test.fallbacks, test.long_run,
                     test.older_program, test.harmless_names, test.log_of_1500_seconds, test.smoothed_log, test.numbers_of_a_sweep,
                     test.sweep_of_100_000_runs, test.sweep_of_other_keys, test.comparison, test.no_run, test.half_a_run,
                     test.no_sweep, test.no_output, test.figures):
            part()
        test.tell()


if __name__ == "__main__":
    main()
