#!/usr/bin/env python3
"""rhec sweep under mpirun: the same rows, whoever is killed, and its messages.

    sweep_mpi.py <rhec> <mpirun>
    sweep_mpi.py <rhec>             of a build without MPI: what it says
"""
import math
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import cli
from cli import CLEAN, ERROR, FINE, NOT_SOLVED, Program
from sweeps import SHORT, rows

# mpirun itself does not like to be run by root, as tests in containers are, nor to have more ranks than cores.
# What it leaves behind when it ends is its own business, not that of a build with AddressSanitizer.
MPI = CLEAN | {"ASAN_OPTIONS": "detect_leaks=0", "OMPI_ALLOW_RUN_AS_ROOT": "1",
               "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
FLAGS = ("--oversubscribe", "--bind-to", "none")


def children(pid):
    """Processes that a process has started."""
    found = []
    for folder in pathlib.Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) == pid:
                    found.append(int(folder.name))
            except (OSError, IndexError):
                pass  # it has ended meanwhile
    return sorted(found)


class Test(cli.Findings):
    def __init__(self, rhec, mpirun, work):
        super().__init__("sweep_mpi")
        self.rhec, self.mpirun, self.work = rhec, mpirun, work

    def sweep(self, text, name="sweep.yaml"):
        path = self.work / name
        path.write_text(text)
        return path

    def command(self, ranks, *words):
        return [self.mpirun, *FLAGS, "-n", str(ranks), str(self.rhec.path), "sweep", *map(str, words)]

    def run(self, ranks, *words):
        return subprocess.run(self.command(ranks, *words), capture_output=True, text=True, timeout=120, env=MPI)

    def good(self):
        """As many rows, and the same, whatever the number of ranks and threads; a run that is refused is one of them."""
        text = self.sweep(SHORT + "grid: {seed: {from: 1, to: 15}, estimator.horizon: [3, 12],\n"
                          "  'blocking.kappa': [{name: structured, size: 2}, {name: structured, size: 2, overlap: 4}]}\n")
        alone = self.work / "alone.sqlite"
        self.rhec("sweep", text, "--out", alone)
        expected = rows(alone)
        self.expect(len(expected) == 60, "alone", f"{len(expected)} rows")
        for ranks, words in ((2, []), (3, ["--threads", 2])):
            out = self.work / f"ranks-{ranks}.sqlite"
            result = self.run(ranks, text, "--out", out, *words)
            self.expect(result.returncode == NOT_SOLVED and "60 runs made" in result.stdout, f"{ranks} ranks",
                        f"{result.returncode}: {result.stdout}{result.stderr}")
            self.expect(rows(out) == expected, f"{ranks} ranks", "other rows than alone")

    def long_sweep(self, alone):
        """A sweep of 300 runs that lasts long enough to be killed four times, in whatever build: its rows come in batches
        of a fifth of a second, and are seen a little later. `alone` becomes its database."""
        laps, seconds, enough = 1, 0.0, 5.0
        for _ in range(3):
            text = self.sweep(SHORT.replace("path.laps: 1", f"path.laps: {laps}") + "grid: {seed: {from: 1, to: 300}}\n")
            alone.unlink(missing_ok=True)
            start = time.monotonic()
            self.rhec("sweep", text, "--out", alone, timeout=240)
            seconds = time.monotonic() - start
            if seconds >= enough:
                break
            laps = math.ceil(1.5 * laps * enough / seconds)
        self.expect(seconds >= enough, "killed", f"the sweep lasts {seconds:.1f} s alone, with {laps} laps")
        return text

    def killed(self):
        """Any rank, mpirun, or all at once: what was written stays, and the rest is made by who comes after."""
        alone, out = self.work / "whole.sqlite", self.work / "killed.sqlite"
        text = self.long_sweep(alone)
        chance, before, victims = random.Random(1), 0, [0, 1, "mpirun", "all"]
        for _ in range(12):
            if not victims:
                break
            victim = victims[0]
            with subprocess.Popen(self.command(3, text, "--out", out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                  env=MPI, start_new_session=True) as process:
                deadline = time.monotonic() + 60
                while process.poll() is None and (len(rows(out)) if out.exists() else 0) < before + 10 and time.monotonic() < deadline:
                    time.sleep(chance.uniform(0.01, 0.03))
                ranks = children(process.pid)
                pids = {"mpirun": [process.pid], "all": [process.pid, *ranks]}.get(victim) or ranks[victim:victim + 1]
                if process.poll() is None and pids:
                    victims.pop(0)
                    for pid in pids:
                        try:
                            os.kill(pid, signal.SIGKILL)
                        except ProcessLookupError:
                            pass
                process.wait(timeout=60)
                # Those whose mpirun is gone end by themselves, or are ended; then nobody holds the database.
                deadline = time.monotonic() + 60
                while any(pathlib.Path(f"/proc/{pid}").exists() for pid in ranks) and time.monotonic() < deadline:
                    time.sleep(0.05)
                self.expect(time.monotonic() < deadline, f"{victim}", "ranks are left over")
            now = rows(out)
            self.expect(len(now) >= before + 10 or len(now) == 300, f"{victim}", f"{before} rows became {len(now)}")
            before = len(now)
            if victims and before == 300:  # it was done before its turn: once more from the beginning
                for left in self.work.glob(f"{out.name}*"):
                    left.unlink()
                before = 0
        self.expect(not victims, "killed", f"not {victims}: each time, all was done before")
        result = self.run(2, text, "--out", out)
        self.expect(result.returncode == FINE, "after", result.stdout + result.stderr)
        self.expect(rows(out) == rows(alone), "after", "other rows than alone")

    def mistakes(self):
        bad = self.sweep(SHORT + "grid: {spede: [1]}\n", "bad.yaml")
        result = self.run(3, bad, "--out", self.work / "none.sqlite")
        self.expect(result.returncode == ERROR and result.stderr.count("did you mean 'speed'") == 1, "bad key", result.stderr)
        result = self.run(3, self.sweep("gird: 4\n", "worse.yaml"), "--out", self.work / "none.sqlite")
        self.expect(result.returncode == ERROR and result.stderr.count("did you mean 'grid'") == 1, "bad form", result.stderr)
        self.expect(not (self.work / "none.sqlite").exists(), "mistakes", "made a database")
        good = self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "good.yaml")
        # A rank that reads another file under the same name, as on a host with a disk of its own.
        shutil.copytree(self.work, self.work / "here")
        shutil.copytree(self.work / "here", self.work / "there")
        (self.work / "there" / "good.yaml").write_text(SHORT + "grid: {seed: [1, 3]}\n")
        one = [str(self.rhec.path), "sweep", "good.yaml", "--out", "runs.sqlite"]
        result = subprocess.run([self.mpirun, *FLAGS, "-n", "1", "-wdir", self.work / "here", *one,
                                 ":", "-n", "1", "-wdir", self.work / "there", *one],
                                capture_output=True, text=True, timeout=120, env=MPI)
        self.expect(result.returncode == ERROR and "rank 1 on" in result.stderr and "reads another sweep" in result.stderr,
                    "another sweep", result.stderr)
        # Started as a part, but not by mpirun.
        result = subprocess.run([self.rhec.path, "sweep", good], capture_output=True, text=True, timeout=60,
                                env=MPI | {"PMI_SIZE": "4"})
        self.expect(result.returncode == ERROR and "one of 4 processes, but MPI sees 1" in result.stderr, "alone", result.stderr)

    def alone_without_mpi(self):
        """The program never loads MPI where it is alone."""
        good = self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "good.yaml")
        result = subprocess.run([self.rhec.path, "sweep", good, "--out", self.work / "debug.sqlite"], capture_output=True,
                                text=True, timeout=60, env=CLEAN | {"LD_DEBUG": "libs"})
        self.expect(result.returncode == FINE and "librhec_sim" in result.stderr, "alone", result.stderr[-300:])
        self.expect("libmpi" not in result.stderr and "sweep_mpi" not in result.stderr, "alone", "loads MPI")

    def built_without(self):
        """A tree without the library says so where ranks are asked for, and does the same as ever alone."""
        good = self.sweep(SHORT + "grid: {seed: [1, 2]}\n", "good.yaml")
        result = subprocess.run([self.rhec.path, "sweep", good, "--out", self.work / "none.sqlite"], capture_output=True,
                                text=True, timeout=60, env=CLEAN | {"OMPI_COMM_WORLD_SIZE": "2"})
        self.expect(result.returncode == ERROR and "built without MPI" in result.stderr, "without MPI", result.stderr)
        result = self.rhec("sweep", good, "--out", self.work / "without.sqlite")
        self.expect(result.returncode == FINE and len(rows(self.work / "without.sqlite")) == 2, "without MPI", result.stderr)


def without_mpi(rhec, work):
    """A copy of a built tree, all but the library that MPI needs."""
    build = rhec.path.parent.parent
    library = next(path.parent for path in build.glob("lib*/**/rhec/sweep_mpi.so"))
    copy = work / "tree"
    for path in (rhec.path, *library.parent.glob("librhec_*.so*")):
        target = copy / path.relative_to(build)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, target, follow_symlinks=False)
    plugins = copy / library.relative_to(build) / "plugins"
    plugins.mkdir(parents=True)
    shutil.copy2(library / "examine_plugin", plugins.parent)
    for plugin in (library / "plugins").glob("*.so"):
        (plugins / plugin.name).symlink_to(plugin)
    return Program(copy / rhec.path.relative_to(build))


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        work, rhec = pathlib.Path(work).resolve(), Program(sys.argv[1])
        if len(sys.argv) == 2:
            test = Test(rhec, None, work)
            test.built_without()
            test.tell()
        test = Test(rhec, sys.argv[2], work)
        for part in (test.good, test.killed, test.mistakes, test.alone_without_mpi):
            start = time.monotonic()
            part()
            print(f"{part.__name__}: {time.monotonic() - start:.1f} s")
        test.rhec = without_mpi(rhec, work)
        test.built_without()
        test.tell()


if __name__ == "__main__":
    main()
