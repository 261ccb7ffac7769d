#!/usr/bin/env python3
"""`rhec report` of a sweep, of a comparison and of a fault campaign: every map's means and pairs are those of the database.

    report_study.py <rhec>
"""
import json
import math
import random
import shutil
import sqlite3
import statistics

import reports
from cli import FIGURE8, FINE, SHORT, assignments
from reports import TERMS, Reports, close

# Of the two-sided 95 % interval, by degrees of freedom: from tables of Student's distribution.
STUDENT = {1: 12.70620474, 3: 3.182446305, 17: 2.109815578, 18: 2.100922040, 19: 2.093024054}
# Means of a sweep are written with five digits, differences of pairs with four.
FIVE_DIGITS, FOUR_DIGITS = 5.1e-5, 5.1e-4


class StudyReports(Reports):
    parts = ("numbers_of_a_sweep", "sweep_of_100_000_runs", "sweep_of_other_keys", "no_sweep", "comparison", "faults")

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

    def faults(self):
        folder = self.work / "campaign"
        folder.mkdir()
        spread = {"median": 3, "p99": None}
        measures = {"rides": 7, "recovered": spread, "ok_again": spread, "never": 1, "unsaid": 0, "followed": 0, "honest": 0.97, "honest_heading": 1,
                    "longest_dishonest": 4, "volume": 1.0, "wide": None, "curve": [[0, 0.1, 2.0], [10, 0.05, 0.3]]}
        campaign = {"form": "rhec faults", "version": 2, "steps": 4200, "drives": 7, "window": 15, "samples": [0, 10], "vehicles": ["bicycle_slip"],
                    "estimators": ["ekf", "rhe"], "wanted": {"honest": 0.95}, "figures": 6, "missed": ["spike: not reached: this"],
                    "kinds": [{"name": "spike", "group": "transient", "estimators": {"ekf": measures, "rhe": measures}}]}
        file = folder / "faults.json"
        file.write_text(json.dumps(campaign))
        for source in (folder, file):
            document, _ = self.page_of(source)
            self.expect(document["kind"] == "faults" and document["campaign"] == campaign, "faults", "is not faults.json")
            self.expect("spike" in self.notes(document, "not reached"), "faults", "what is not reached is not told")
        for change, *words in (
                (lambda c: c.update(version=1), "version is 1"),
                (lambda c: c.pop("kinds"), "there is no kinds"),
                (lambda c: c.update(kinds=[]), "kinds or estimators are empty"),
                (lambda c: c["kinds"][0]["estimators"].pop("rhe"), "there is no kinds[0].estimators.rhe"),
                (lambda c: c["kinds"][0]["estimators"]["ekf"]["recovered"].pop("p99"), "kinds[0].estimators.ekf.recovered.p99"),
                (lambda c: c["kinds"][0]["estimators"]["rhe"].update(honest="all"), "kinds[0].estimators.rhe.honest is string"),
                (lambda c: c["kinds"][0]["estimators"]["rhe"]["curve"].append([1]), "kinds[0].estimators.rhe.curve[2]")):
            broken = json.loads(json.dumps(campaign))
            change(broken)
            file.write_text(json.dumps(broken))
            self.refused(file, "faults.json", *words, "scripts/fault-campaign")

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


if __name__ == "__main__":
    reports.main(StudyReports)
