#!/usr/bin/env python3
"""rhec sweep: its rows, going on after Ctrl-C and SIGKILL, its exit codes and its messages.

    sweep.py <rhec>
"""
import hashlib
import json
import os
import pathlib
import pty
import random
import re
import resource
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

import cli
from cli import CLEAN, ERROR, FIGURE8, FINE, NOT_SOLVED, PAPER, USAGE, Program
from sweeps import SHORT, rows

LINE = re.compile(r"\d+(\.\d+)? %, \d+ of \d+ runs, \d+\.\d a second, .* left")


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("sweep")
        self.rhec, self.work, self.files = rhec, work, 0

    def sweep(self, text, name="sweep.yaml"):
        path = self.work / name
        path.write_text(text)
        return path

    def out(self):
        self.files += 1
        return self.work / f"runs-{self.files}.sqlite"

    def rows(self, file):
        """Those of a database that is sound, whose identities are those of their configurations."""
        with sqlite3.connect(file) as database:
            self.expect(database.execute("PRAGMA integrity_check").fetchone() == ("ok",), "database", "is not sound")
        database.close()
        found = rows(file)
        for row in found.values():
            digest = hashlib.sha256(row["configuration"].encode()).hexdigest()
            self.expect(row["identity"] == digest[:32], "identity", row["identity"])
        return found

    def good(self):
        out = self.out()
        result = self.rhec("sweep", cli.ROOT / "scenarios" / "sweep_blocks.yaml", "--out", out)
        self.expect(result.returncode == FINE, "example", f"{result.returncode}: {result.stderr}")
        self.expect(not result.stderr, "example", f"standard error: {result.stderr}")
        rows = self.rows(out)
        self.expect(len(rows) == 28 and all(row["status"] == "completed" for row in rows.values()), "example", f"{rows}")
        # One of them against `rhec run`.
        row = next(row for row in rows.values() if row["seed"] == 2)
        configuration = json.loads(row["configuration"])
        scenario = self.sweep(json.dumps(configuration), "one.yaml")
        self.rhec("run", scenario, "--out", self.work / "one")
        summary = json.loads((self.work / "one" / "summary.json").read_text())
        for key in ("steps", "nees", "solves", "fallbacks"):
            self.expect(row[key] == summary[key], key, f"{row[key]}, of rhec run {summary[key]}")
        for key in ("mae", "rmse", "mae_after_start", "statuses"):
            self.expect(json.loads(row[key]) == summary[key], key, f"{row[key]}, of rhec run {summary[key]}")
        again = self.rhec("sweep", cli.ROOT / "scenarios" / "sweep_blocks.yaml", "--out", out, "--threads", 1)
        self.expect(again.returncode == FINE and "0 runs made" in again.stdout and "28 there before" in again.stdout,
                    "again", again.stdout + again.stderr)
        self.expect(self.rows(out) == rows, "again", "rows changed")
        for words, expected in ((["--out", "here.sqlite"], "here.sqlite"), ([], "out/short.sqlite")):
            result = self.rhec("sweep", self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "short.yaml"), *words, cwd=self.work)
            self.expect(result.returncode == FINE and len(self.rows(self.work / expected)) == 2, expected, result.stderr)
        result = self.rhec("sweep", cli.ROOT / "scenarios" / "sweep_blocks.yaml", "--dry-run", "--out", self.out())
        self.expect(result.returncode == FINE and "28 runs" in result.stdout, "--dry-run", result.stdout + result.stderr)
        self.expect(not (self.work / f"runs-{self.files}.sqlite").exists(), "--dry-run", "made a database")
        self.queries(out)

    def queries(self, out):
        """Those of docs/sweep.md work on the example."""
        page = (cli.ROOT / "docs" / "sweep.md").read_text()
        queries = re.findall(r"```sql\n(.*?)```", page, re.DOTALL)
        self.expect(len(queries) == 3, "docs/sweep.md", f"{len(queries)} queries")
        with sqlite3.connect(out) as database:
            counts = [len(database.execute(query).fetchall()) for query in reversed(queries)]
        database.close()
        self.expect(counts == [6, 7, 0], "docs/sweep.md", f"queries have {counts} rows")

    def killed(self):
        """SIGKILL at random moments, and on: the rows are those of a sweep that nobody disturbed."""
        text = self.sweep(SHORT.replace(str(FIGURE8), str(PAPER)) +
                          "grid: {seed: {from: 1, to: 100}, estimator.horizon: [3, 12], blocking.kappa.overlap: [0, 4]}\n")
        whole, out = self.out(), self.out()
        result = self.rhec("sweep", text, "--out", whole)
        self.expect(result.returncode == NOT_SOLVED, "refused runs", f"{result.returncode}: {result.stderr}")
        expected = self.rows(whole)
        statuses = [row["status"] for row in expected.values()]
        self.expect(len(expected) == 400 and statuses.count("refused") == 100, "killed", f"{len(expected)} rows")
        chance, kills, before = random.Random(1), 0, 0
        for turn in range(100):
            process = subprocess.Popen([self.rhec.path, "sweep", text, "--out", out, "--threads", str(1 + turn % 3)],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=CLEAN)
            try:
                process.wait(timeout=chance.uniform(0.02, 0.1 + 0.05 * turn))  # longer and longer, for slow machines
            except subprocess.TimeoutExpired:
                process.kill()
                kills += 1
            errors = process.communicate()[1]
            if process.returncode >= 0:
                self.expect(process.returncode == NOT_SOLVED, "killed", errors.decode())
                break
            if out.exists():
                now = self.rows(out)
                self.expect(len(now) >= before, "killed", f"{before} rows became {len(now)}")
                before = len(now)
        self.expect(process.returncode == NOT_SOLVED, "killed", f"not done after {kills} kills, with {before} rows")
        self.expect(kills >= 3, "killed", f"only {kills} times, so little is known")
        self.expect(self.rows(out) == expected, "killed", "other rows than without")

    def stopped(self):
        """Ctrl-C ends it after the runs under way; a second sweep on its file is refused meanwhile."""
        text = self.sweep(SHORT + "grid: {seed: {from: 1, to: 10000}}\n")
        for number in (signal.SIGINT, signal.SIGTERM):
            out = self.out()
            with subprocess.Popen([self.rhec.path, "sweep", text, "--out", out], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True, env=CLEAN) as process:
                deadline = time.monotonic() + 30
                while not (out.exists() and out.stat().st_size > 50000) and time.monotonic() < deadline:
                    time.sleep(0.02)
                second = self.rhec("sweep", text, "--out", out)
                self.expect(second.returncode == ERROR and "another sweep writes to it" in second.stderr, "second",
                            f"{second.returncode}: {second.stderr}")
                process.send_signal(number)
                process.send_signal(number)  # as timeout does
                printed, errors = process.communicate(timeout=30 * cli.PATIENCE)
            self.expect(process.returncode == NOT_SOLVED and not errors, "stopped", f"{process.returncode}: {errors}")
            made = re.search(r"(\d+) runs made", printed)
            self.expect(made and len(self.rows(out)) == int(made[1]), "stopped", printed)
            self.expect(re.search(r"stopped with \d+ runs still to make", printed), "stopped", printed)

    def terminal(self):
        """A line that is drawn anew; a grid of a million runs and more is asked about."""
        text = self.sweep(SHORT + "grid: {seed: {from: 1, to: 40}}\n")
        shown, code = self.on_terminal("", "sweep", text, "--out", self.out())
        self.expect(code == FINE and LINE.search(shown), "progress", shown)
        many = self.sweep(SHORT + "grid: {seed: {from: 1, to: 1000000000}}\n", "many.yaml")
        shown, code = self.on_terminal("n\n", "sweep", many, "--out", self.out())
        self.expect(code == ERROR and "the grid has 1000000000 runs. Begin? [y/N]" in shown, "asked", shown)
        self.expect(not (self.work / f"runs-{self.files}.sqlite").exists(), "asked", "made a database")
        for answer, words in (("y\n", []), ("", ["--yes"])):
            out = self.out()
            shown, code = self.on_terminal(answer, "sweep", many, "--out", out, *words, until=LINE)
            self.expect(code == NOT_SOLVED and len(self.rows(out)) > 0, "begun", f"{code}: {shown}")

    def on_terminal(self, answer, *words, until=None):
        """What is shown on a terminal, and the exit code; ended by Ctrl-C once it shows what is given."""
        master, slave = pty.openpty()
        with subprocess.Popen([self.rhec.path, *map(str, words)], stdin=slave, stdout=slave, stderr=slave, env=CLEAN) as process:
            os.close(slave)
            os.write(master, answer.encode())
            shown = ""
            try:
                while part := os.read(master, 10000):
                    shown += part.decode(errors="replace")
                    if until and until.search(shown):
                        process.send_signal(signal.SIGINT)
                        until = None
            except OSError:  # the other side is closed
                pass
            process.wait(timeout=30 * cli.PATIENCE)
        os.close(master)
        return shown, process.returncode

    def mistakes(self):
        good = self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "good.yaml")
        for grid, expected in (
                ("", "the grid is empty"),
                ("grid: {spede: [1]}\n", r"bad\.yaml:3: .*did you mean 'speed'"),
                ("grid: {speed: [1, -1]}\n", r"bad\.yaml:3: speed: found '-1'"),
                ("grid: {seed: [1, 1]}\n", "two runs of the grid are the same"),
                ("grid: {seed: {from: 1, to: 1000001}}\n", "has 1000001 runs, more than 1000000; .*--yes")):
            out = self.out()
            result = self.rhec("sweep", self.sweep(SHORT + grid, "bad.yaml"), "--out", out)
            self.expect(result.returncode == ERROR and re.search(expected, result.stderr), grid, f"{result.returncode}: {result.stderr}")
            self.expect(not out.exists() and not result.stdout, grid, "made a database")
        result = self.rhec("sweep", self.work / "none.yaml")
        self.expect(result.returncode == ERROR and "no such file" in result.stderr, "no file", result.stderr)
        for words in (["--threads", "0"], ["--thread", "1"], ["--out"]):
            result = self.rhec("sweep", good, *words)
            self.expect(result.returncode == USAGE, f"{words}", f"{result.returncode}: {result.stderr}")
        self.expect(self.rhec("sweep").returncode == USAGE, "no sweep")
        text = self.work / "text"
        text.write_text("no database" * 1000)
        result = self.rhec("sweep", good, "--out", text)
        self.expect(result.returncode == ERROR and "is no SQLite database" in result.stderr, "text", result.stderr)
        self.expect(text.read_text() == "no database" * 1000, "text", "was changed")
        out = self.out()
        self.rhec("sweep", good, "--out", out)
        with sqlite3.connect(out) as database:
            database.execute("PRAGMA user_version = 7")
        database.close()
        result = self.rhec("sweep", good, "--out", out)
        self.expect(result.returncode == ERROR and "has version 7 of the schema" in result.stderr, "version", result.stderr)

    def full_disk(self):
        """A file that cannot grow ends the sweep; what was written stays, and the rest is made once it can."""
        text = self.sweep(SHORT + "grid: {seed: {from: 1, to: 60}}\n")
        whole, out = self.out(), self.out()
        self.rhec("sweep", text, "--out", whole)

        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000))

        result = self.rhec("sweep", text, "--out", out, preexec_fn=limit, restore_signals=False)
        self.expect(result.returncode == ERROR and "start again" in result.stderr, "full", f"{result.returncode}: {result.stderr}")
        written = len(self.rows(out))
        self.expect(0 < written < 60, "full", f"{written} rows")
        result = self.rhec("sweep", text, "--out", out)
        self.expect(result.returncode == FINE and f"{60 - written} runs made" in result.stdout, "after", result.stdout)
        self.expect(self.rows(out) == self.rows(whole), "after", "other rows than without")

    def read_only(self):
        """A file, or a folder, that whoever calls may not write; root becomes somebody else for that."""
        someone = {"user": 65534, "cwd": "/"} if os.geteuid() == 0 else {}
        self.work.chmod(0o755)
        good = self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "good.yaml")
        good.chmod(0o644)
        try:
            reachable = self.rhec("sweep", good, "--dry-run", **someone).returncode == FINE
        except PermissionError:
            reachable = False
        if not reachable:
            print("read_only: left out, since the program is in a folder of root's alone")
            return
        folder = self.work / "folder"
        folder.mkdir()
        out = folder / "runs.sqlite"
        self.rhec("sweep", good, "--out", out)
        before = out.read_bytes()
        for mode, expected in ((0o777, "cannot be opened and written"), (0o555, "runs.sqlite.lock beside it cannot be made")):
            out.chmod(0o444)
            folder.chmod(mode)
            result = self.rhec("sweep", good, "--out", out, **someone)
            self.expect(result.returncode == ERROR and expected in result.stderr, f"mode {mode:o}", result.stderr)
            self.expect(out.read_bytes() == before, f"mode {mode:o}", "the database was changed")
        folder.chmod(0o755)


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(work).resolve())
        for part in (test.good, test.killed, test.stopped, test.terminal, test.mistakes, test.full_disk, test.read_only):
            start = time.monotonic()
            part()
            print(f"{part.__name__}: {time.monotonic() - start:.1f} s")
        test.tell()


if __name__ == "__main__":
    main()
