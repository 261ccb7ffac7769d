#!/usr/bin/env python3
"""`rhec report` of a run: the numbers of the page are those of the run's files, a long run stays small and says how.

    report_run.py <rhec>
"""
import json
import math
import statistics

import reports
from cli import FIGURE8, FINE, PAPER, SHORT, assignments
from reports import DOCUMENT, TERMS, Reports, close, rows_of

# Solves of the controller fail where the vehicle cannot stop.
WALL = ["controller.speed_bound_factor=.inf", "bounds.u1=[4, 20]", "bounds.x_pos=[-20, 6]"]


class RunReports(Reports):
    parts = ("numbers_of_a_run", "horizons_of_a_run", "faults_and_findings", "other_estimators", "fallbacks", "long_run",
             "older_program", "harmless_names", "figures")

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.run_folder = self.make_run("run", "seed=3")

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

    def horizons_of_a_run(self):
        size, overlap = 2, 4
        folder = self.make_run("blocks", f"blocking.kappa={{name: structured, size: {size}, overlap: {overlap}}}",
                               "blocking.mu={name: full_horizon}", "estimator.covariance=blocks")
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
        self.rhec("run", PAPER, "--out", folder, *assignments(*SHORT, *WALL))
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

    def faults_and_findings(self):
        """What a simulation did to the sensors, and what the estimator found, are told apart."""
        fault = "{kind: offset, sensors: [x_gps], start: 4, length: 3, size: 20}"
        folder = self.make_run("fault", f"faults=[{fault}]")
        document, _ = self.page_of(folder)
        rows = rows_of(folder / "steps.csv")
        for column in ("faults", "findings"):
            told = {row[column] for row in rows} - {""}
            self.expect(told and {span["what"] for span in document[column]} == told, column, f"{document[column]}, {told}")
            inside = [row for row in rows if any(span["from"] <= float(row["time"]) <= span["to"] for span in document[column])]
            self.expect(inside == [row for row in rows if row[column]], column, "spans are not where the rows are")
        self.expect(not {span["what"] for span in document["faults"]} & {span["what"] for span in document["findings"]}, "faults",
                    "a finding is among them")
        figures = self.work / "fault_figures"
        result = self.rhec("report", folder, "-o", self.work / "fault.html", "--svg", figures, timeout=240)
        legend = (figures / "state-beta.svg").read_text() if result.returncode == FINE else result.stderr
        self.expect(">fault</text>" in legend and ">finding</text>" in legend, "stripes", legend[:300])

    def harmless_names(self):
        name = "</script><script>alert('x')</script><!-- \u2028"
        document, text = self.page_of(self.make_run("named", f"name={json.dumps(name)}"))
        self.expect(document["title"] == name, "name", f"the title is {document['title']!r}")
        self.expect("<script>alert" not in text and "\u2028" not in DOCUMENT.sub("", text), "name", "the name is part of the page's script")

    def figures(self):
        folder = self.work / "figures"
        result = self.rhec("report", self.run_folder, "-o", self.work / "page.html", "--svg", folder, timeout=240)
        self.expect(result.returncode == FINE, "--svg", result.stderr)
        files = sorted(folder.iterdir()) if folder.is_dir() else []
        self.expect(len(files) >= 5 and all(file.read_text().startswith("<svg") or "<svg" in file.read_text()[:400] for file in files),
                    "--svg", f"{[file.name for file in files]}")

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


if __name__ == "__main__":
    reports.main(RunReports)
