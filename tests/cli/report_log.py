#!/usr/bin/env python3
"""`rhec report` of a log: a drive as long as a real one, with gaps, filtered and smoothed; and one with a robot's own sensors.

    report_log.py <rhec>
"""
import json
import math
import random

import cli
import reports
from cli import FINE
from reports import Reports, close, rows_of



class LogReports(Reports):
    parts = ("log_of_1500_seconds", "smoothed_log", "log_of_own_sensors")

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

    def log_of_own_sensors(self):
        """A robot's own sensors, with a spike and a sensor that falls silent; by two estimators, and with hindsight."""
        scenario, log, folder = cli.ROOT / "scenarios" / "skid_steer.yaml", self.work / "drive.csv", self.work / "own"
        faults = "faults=[{kind: spike, start: 20, sensors: [x_gps, y_gps], size: 30}, {kind: dropout, start: 30, length: 4, sensors: [x_gps, y_gps]}]"
        self.expect(self.rhec("run", scenario, *cli.assignments("seed=7", faults), "--log", log, "--out", self.work / "world").returncode == FINE,
                    "own sensors", "run")
        both = cli.assignments("variants={rhe: {estimator.name: rhe}, ekf: {estimator.name: ekf}}")
        result = self.rhec("estimate", scenario, log, *both, "--out", folder)
        self.expect(result.returncode == FINE, "own sensors", result.stderr)
        document, _ = self.page_of(folder)
        summary = json.loads((folder / "summary.json").read_text())
        tables = {name: rows_of(folder / f"{name}.csv") for name in ("estimates", "innovations", "measurements", "predictions")}
        self.expect(document["kind"] == "log" and document["summary"] == summary, "own sensors", "the summary is not summary.json")
        measured = [row for row in tables["measurements"] if row["x_gps"]]
        self.expect(document["fixes"]["total"] == len(measured) and all(map(close, document["fixes"]["x"], (float(row["x_gps"]) for row in measured))),
                    "own sensors", "fixes")
        withheld = summary["variants"]["rhe"]["held_out"]["count"]
        self.expect(sum(document["fixes"]["held_out"]) == sum(row["held_out"] == "1" for row in measured) == withheld, "own sensors", "withheld fixes")
        self.expect(any(close(gap["to"] - gap["from"], 4.2, absolute=0.3) for gap in document["gaps"]), "own sensors", f"gaps {document['gaps']}")
        self.expect([variant["name"] for variant in document["variants"]] == ["rhe", "ekf"], "own sensors", "variants")
        for variant in document["variants"]:
            self.check_drive(variant, {name: [row for row in rows if row.get("variant") == variant["name"]] for name, rows in tables.items()},
                             document, summary["variants"][variant["name"]])
        self.expect(document["variants"][0]["horizons"] and document["variants"][1]["horizons"] is None, "own sensors", "windows")
        figures = self.work / "own_figures"
        self.expect(self.rhec("report", folder, "-o", self.work / "page.html", "--svg", figures).returncode == FINE, "own sensors", "--svg")
        names = {file.stem for file in figures.iterdir()}
        self.expect({"track", "rhe-innovations-heading", "rhe-innovations-x-gps-and-y-gps", "ekf-residuals", "window-map"} <= names, "own sensors",
                    f"figures {sorted(names)}")
        for name, cut, words in (("innovations.csv", None, ("innovations.csv", "is missing")), ("estimates.csv", 100, ("estimates.csv:100", "summary.json says"))):
            broken = self.copy_of(folder, "broken own")
            if cut is None:
                (broken / name).unlink()
            else:
                (broken / name).write_text("".join((broken / name).read_text().splitlines(keepends=True)[:cut]))
            self.refused(broken, *words, "rhec estimate")
        smoothed = self.work / "own_smoothed"
        self.expect(self.rhec("smooth", scenario, log, "--out", smoothed).returncode == FINE, "own sensors", "smooth")
        document, _ = self.page_of(smoothed)
        self.expect([variant["name"] for variant in document["variants"]] == ["skid_steer", "skid_steer causal"], "own sensors", "smoothed variants")
        self.expect("smoother" in self.notes(document, "horizons"), "own sensors", f"notes: {document['notes']}")

    def check_drive(self, variant, tables, document, numbers):
        name, rows = variant["name"], tables["estimates"]
        for series in variant["states"] + variant["parameters"]:
            values = [float(row[series["name"]]) for row in rows]
            self.expect(len(series["estimate"]) == len(rows) and all(map(close, series["estimate"], values)), name, series["name"])
        self.expect({sensor["sensor"] for sensor in variant["innovations"]} == set(numbers["innovations"]), name, "sensors")
        for sensor in variant["innovations"]:
            told = [row for row in tables["innovations"] if row["sensor"] == sensor["sensor"]]
            self.expect(sum(sensor["is_rejected"]) == sum(row["accepted"] == "0" for row in told) == sensor["rejected"], name, "rejected")
            self.expect(all(map(close, sensor["values"], (float(row["nis"]) for row in told))), name, f"NIS of {sensor['sensor']}")
        self.expect(any(sensor["rejected"] for sensor in variant["innovations"]), name, "the spike is not there")
        self.expect(len(variant["residuals"]["values"]) == numbers["held_out"]["count"], name, "predictions")
        bad = [float(row["time"]) for row in rows if row["health"] != "ok"]
        self.expect(bad and all(any(span["from"] - 1e-3 <= time <= span["to"] + 1e-3 for span in variant["findings"]) for time in bad), name, "findings")

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


if __name__ == "__main__":
    reports.main(LogReports)
