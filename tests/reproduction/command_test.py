#!/usr/bin/env python3
"""scripts/study/reproduce --quick from end to end, scripts/study/assess-claims on what is no whole study, and their messages.

    command_test.py <rhec>
"""
import json
import pathlib
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(ROOT / "tests" / "cli"), str(HERE), str(ROOT / "scripts" / "study" / "reproduction")]

import claims     # noqa: E402
import cli        # noqa: E402
import synthetic  # noqa: E402
import tables     # noqa: E402

REPRODUCE, ASSESS, PAGE = ROOT / "scripts" / "study" / "reproduce", ROOT / "scripts" / "study" / "assess-claims", ROOT / "docs" / "reproduction.md"


def call(*words):
    return subprocess.run([sys.executable, "-B", *map(str, words)], capture_output=True, text=True, env=cli.CLEAN, timeout=800)


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("reproduction")
        self.rhec, self.work = rhec, work
        self.committed = PAGE.read_bytes()

    def refused(self, name, code, expected, *words):
        """The exit code, all of the message's parts, no page, and no traceback."""
        page = self.work / "refused.md"
        result = call(ASSESS, *words, "--page", page) if words[0] != REPRODUCE else call(*words)
        message = result.stderr.strip()
        self.expect(result.returncode == code, name, f"{result.returncode}: {message}")
        for part in expected:
            self.expect(part in message, name, f"'{part}' is not in: {message}")
        self.expect("Traceback" not in message and not result.stdout, name, message + result.stdout)
        self.expect(not page.exists() and not list(self.work.glob("*.aside")), name, "left a page behind")

    def quick(self):
        out = self.work / "quick"
        first = call(REPRODUCE, "--quick", "--program", self.rhec, "--out", out, "--threads", 2)
        self.expect(first.returncode == 0, "quick", f"{first.returncode}: {first.stdout}{first.stderr}")
        page = (out / "reproduction.md").read_text()
        for name in tables.TABLES:
            found = re.search(rf"<!-- table: {name} -->\n(.*?)\n<!-- end -->", page, re.DOTALL)
            if self.expect(found, name, "is not in the page") and name != "map":
                self.expect(found[1].count("\n") >= 2 and "nan" not in found[1], name, found[1])
        verdicts = json.loads((out / "verdicts.json").read_text())
        self.expect({each["claim"][0] for each in verdicts} == set("123456789"), "verdicts.json", "a claim is missing")
        self.expect(all(each["verdict"] == "did not hold" for each in verdicts), "quick", "four seeds confirmed something")
        with sqlite3.connect(out / "paper.sqlite") as database:
            self.expect(database.execute("SELECT count(*) FROM runs WHERE status IN ('failed', 'refused')").fetchone() == (0,), "quick",
                        "runs failed")
        database.close()
        self.effects_from_the_database(out / "paper.sqlite", verdicts)
        again = call(REPRODUCE, "--quick", "--program", self.rhec, "--out", out)
        self.expect(again.returncode == 0 and ": 0 runs made" in again.stdout, "again", again.stdout + again.stderr)
        self.expect((out / "reproduction.md").read_text() == page, "again", "another page came out")
        shuffled = call(ASSESS, out / "paper.sqlite", "--partial", "--shuffle", 1)
        self.expect(shuffled.returncode == 0 and "held " not in shuffled.stdout, "--shuffle", shuffled.stdout + shuffled.stderr)
        self.expect(PAGE.read_bytes() == self.committed, "quick", "docs/reproduction.md was changed")
        self.database = out / "paper.sqlite"

    def effects_from_the_database(self, file, verdicts):
        """Two effects by SQL alone: the ratio of kappa over (S, o), and tracking with the paper's choice on the zig-zag."""
        query = """
          WITH r AS (SELECT configuration ->> '$.path.name' AS path, seed, status, {figure} AS figure,
                            configuration ->> '$.blocking.kappa.name' AS name, configuration ->> '$.blocking.kappa.size' AS size,
                            configuration ->> '$.blocking.kappa.overlap' AS overlap FROM runs
                     WHERE configuration ->> '$.terrain.correlation_length' = 10
                       AND configuration ->> '$.controller.reference_speed' = 'ground' AND configuration ->> '$.blocking.mu.name' = 'full_horizon' AND configuration ->> '$.estimator.name' = 'rhe'
                       AND configuration ->> '$.bounds.kappa' = '[0,1]')
          SELECT a.seed, avg(ln(a.figure / b.figure)) FROM r AS a JOIN r AS b USING (path, seed)
          WHERE a.name = 'structured' AND b.name = 'full_horizon' {and_where} GROUP BY 1 ORDER BY 1"""
        with sqlite3.connect(file) as database:
            kappa = database.execute(query.format(figure="mae ->> 'kappa'", and_where="")).fetchall()
            zigzag = database.execute(query.format(figure="mae ->> 'tracking'", and_where="AND path = 'zigzag' AND a.size = 2 "
                                                   "AND a.overlap = 4")).fetchall()
        database.close()
        by_key = {each["claim"]: next(one for one in each["conditions"] if one["setting"] == "base") for each in verdicts}
        for key, part, found in (("2", 1, kappa), ("6", 0, zigzag)):
            mine = by_key[key]["parts"][part]["by_seed"]
            self.expect(len(found) == len(mine) == 4 and all(abs(one - other) < 1e-9 for (_, one), other in zip(found, mine)), key,
                        f"{found} in the database, {mine} in verdicts.json")

    def bad_databases(self):
        self.refused("none", 1, ["none.sqlite: no such database", "scripts/study/reproduce"], self.work / "none.sqlite")
        text = self.work / "text.sqlite"
        text.write_text("no database " * 1000)
        self.refused("text", 1, ["text.sqlite: cannot be read as a database", "make it anew"], text)
        other = self.work / "other.sqlite"
        with sqlite3.connect(other) as database:
            database.execute("CREATE TABLE things (name TEXT)")
        database.close()
        self.refused("other", 1, ["other.sqlite: is a database, but not one of rhec's"], other)
        empty = self.work / "empty.sqlite"
        with sqlite3.connect(empty) as database:
            database.executescript(synthetic.SCHEMA)
        database.close()
        self.refused("empty", 1, ["empty.sqlite: has no runs", "scripts/study/reproduce"], empty)
        whole = self.work / "whole.sqlite"
        synthetic.write(whole, synthetic.as_claimed, seeds=4)
        good = call(ASSESS, whole, "--partial")
        self.expect(good.returncode == 0, "whole", good.stderr)

        def changed(name, *statements):
            copy = self.work / f"{name}.sqlite"
            shutil.copy(whole, copy)
            with sqlite3.connect(copy) as database:
                for statement in statements:
                    database.execute(statement)
            database.close()
            return copy
        self.refused("version", 1, ["has version 7 of the schema, expected 1"], changed("version", "PRAGMA user_version = 7"), "--partial")
        cut = self.work / "cut.sqlite"
        for length in (0.999, 0.5):
            cut.write_bytes(whole.read_bytes()[:int(length * whole.stat().st_size)])
            self.refused(f"cut at {length}", 1, ["cut.sqlite: cannot be read as a database"], cut, "--partial")
        self.refused("failed", 1, ["seed 3", "failed: it broke", "delete such rows"],
                     changed("failed", "UPDATE runs SET status = 'failed', reason = 'it broke', mae = NULL WHERE seed = 3"), "--partial")
        self.refused("a seed", 1, ["base at 8 m/s", "SB-O on kappa (2, 4) has no runs of seeds zigzag: 2", "scripts/study/reproduce"],
                     changed("seed", "DELETE FROM runs WHERE seed = 2 AND configuration ->> '$.path.name' = 'zigzag' AND configuration ->> "
                             "'$.blocking.kappa.size' = 2 AND configuration ->> '$.blocking.kappa.overlap' = 4 AND configuration ->> "
                             "'$.blocking.mu.name' = 'full_horizon'"), "--partial")
        self.refused("a method", 1, ["base at 8 m/s: no runs of unblocked"],
                     changed("method", "DELETE FROM runs WHERE configuration ->> '$.blocking.kappa.name' = 'unblocked'"), "--partial")
        self.refused("no FHB", 1, ["base at 8 m/s: no run of FHB on zigzag"],
                     changed("fhb", "DELETE FROM runs WHERE configuration ->> '$.blocking.kappa.name' = 'full_horizon' AND "
                             "configuration ->> '$.path.name' = 'zigzag'"), "--partial")
        self.refused("another key", 1, ["differs from others in a key that the study does not vary"],
                     changed("key", "UPDATE runs SET configuration = json_set(configuration, '$.vehicle', 'other') WHERE seed = 4"),
                     "--partial")
        self.refused("another method", 1, ["is no method of the study"],
                     changed("method2", "UPDATE runs SET configuration = json_set(configuration, '$.blocking.mu.name', 'pattern') "
                             "WHERE seed = 4"), "--partial")
        self.refused("no JSON", 1, ["is not as `rhec sweep` writes it"], changed("json", "UPDATE runs SET mae = '{' WHERE seed = 4"),
                     "--partial")
        self.refused("not whole", 1, ["the study is not whole", "base at 1 m/s: 0 of 20 seeds", "arrival cost off at 5 m/s",
                                      "the map of SB-O on kappa", "--partial"], whole)
        template = self.work / "template.md"
        template.write_text(PAGE.read_text().replace("<!-- table: rates -->", ""))
        self.refused("template", 1, ["template.md: has no place for the table 'rates'"], whole, "--partial", "--template", template)

    def shuffled_by_hand(self):
        """What came out is dealt anew among the methods of a path and seed, in the database itself and whatever the method."""
        file, page, chance = self.work / "dealt.sqlite", self.work / "dealt.md", random.Random(2)
        synthetic.write(file, synthetic.as_claimed)
        columns = "status, steps, solves, fallbacks, mae, rmse, mae_after_start, solve_time_us"
        with sqlite3.connect(file) as database:
            groups = {}
            for identity, path, seed, *results in database.execute(
                    f"SELECT identity, configuration ->> '$.path.name', seed, {columns} FROM runs").fetchall():
                groups.setdefault((path, seed), []).append((identity, results))
            for group in groups.values():
                dealt = [results for _, results in group]
                chance.shuffle(dealt)
                for (identity, _), results in zip(group, dealt):
                    database.execute("UPDATE runs SET " + ", ".join(f"{name} = ?" for name in columns.split(", ")) + " WHERE identity = ?",
                                     (*results, identity))
        database.close()
        result = call(ASSESS, file, "--partial", "--page", page)
        self.expect(result.returncode == 0, "dealt", result.stderr)
        self.expect(page.read_text().count("**did not hold**") == len(claims.CLAIMS) and page.read_text().count("**held**") == 0, "dealt", result.stdout)

    def bad_arguments(self):
        for words in ([REPRODUCE, "--quick", "--page", PAGE], [REPRODUCE, "--threads", "0"], [REPRODUCE, "--quik"]):
            result = call(*words)
            self.expect(result.returncode == 2 and "Traceback" not in result.stderr, f"{words}", f"{result.returncode}: {result.stderr}")
        result = call(ASSESS, self.work / "whole.sqlite", "--partial", "--page", PAGE)
        self.expect(result.returncode == 2 and "is for the whole study" in result.stderr, "committed page", result.stderr)
        result = call(REPRODUCE, "--quick", "--program", self.work / "none", "--out", self.work / "out")
        self.expect(result.returncode == 1 and "there is no program" in result.stderr, "no program", result.stderr)
        self.expect(PAGE.read_bytes() == self.committed, "arguments", "docs/reproduction.md was changed")

    def whole_grids(self):
        """The sweeps are sound, and each of their runs is one of the study's."""
        rhec = cli.Program(self.rhec)
        for name in ("slices", "settings", "map_seeds", "map", "quick"):
            result = rhec("sweep", ROOT / "scenarios" / "paper" / f"{name}.yaml", "--dry-run")
            self.expect(result.returncode == 0 and re.search(r": \d+ runs;", result.stdout), name, result.stdout + result.stderr)


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-reproduction-") as work:
        test = Test(sys.argv[1], pathlib.Path(work).resolve())
        for part in (test.bad_databases, test.shuffled_by_hand, test.bad_arguments, test.whole_grids, test.quick):
            part()
        test.tell()


if __name__ == "__main__":
    main()
