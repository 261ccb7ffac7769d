#!/usr/bin/env python3
"""Plugins written to harm: no command goes down while it looks at them, and what crashes in use names its plugin.

    crash_report.py <rhec> <fixtures of tests/plugins> [--sanitized]

With sanitizers a program ends with an exit code where it would crash, tells that in their words, and has no limit of memory:
--sanitized expects that.
"""
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile

import cli
from cli import CLEAN, ERROR, FINE, NOT_SOLVED, PAPER, Program, assignments

# Each is refused; those that take the examination's whole time are left to tests/plugins/host/examiner_test.cpp, but for one.
LOOKED_AT = {
    "constructor_crashes": "it crashed (Segmentation fault, SIGSEGV) while it was loaded",
    "constructor_exits": "it ended the program with exit code 0 while it was loaded",
    "constructor_hangs": "it had not returned after 10 s while it was loaded",
    "factory_crashes": "it crashed (Segmentation fault, SIGSEGV) while it made an object",
    "factory_exits": "it ended the program with exit code 0 while it made an object",
    "factory_allocates": "it asked for more than the 1024 MiB of memory",
    "forks": "it started another process",
    "closes_stdout": "it closed standard output",
}


class Test(cli.Findings):
    def __init__(self, rhec, fixtures, work, is_sanitized):
        super().__init__("crash report")
        self.is_sanitized = is_sanitized
        self.words = dict(LOOKED_AT)
        if is_sanitized:
            self.words["factory_allocates"] = "while it made an object"
            for name in ("constructor_crashes", "factory_crashes"):
                self.words[name] = self.words[name].replace("crashed (Segmentation fault, SIGSEGV)", "ended the program with exit code 1")
        self.rhec, self.harmful, self.work = rhec, fixtures / "harmful" / "harmful.so", work
        self.environment = {**CLEAN, "XDG_CACHE_HOME": str(work / "cache")}

    def run(self, *words, environment=None):
        return subprocess.run([self.rhec.path, *map(str, words)], capture_output=True, text=True, timeout=120 * cli.PATIENCE,
                              env=environment or self.environment)

    def folder_of(self, *names):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.work))
        for name in names:
            shutil.copy(self.harmful, folder / f"{name}.so")
        return folder

    def looked_at(self):
        folder = self.folder_of(*LOOKED_AT)
        for attempt in ("examined", "kept"):
            result = self.run("plugins", "--plugin-path", folder)
            self.expect(result.returncode == FINE and not result.stderr, attempt, f"{result.returncode}: {result.stderr}")
            self.expect("bicycle_slip" in result.stdout, attempt, "the others are not listed")
            for name, words in self.words.items():
                self.expect(f"{folder / name}.so:" in result.stdout and words in result.stdout, f"{attempt}: {name}", result.stdout)
        run = self.run("run", PAPER, *assignments("path.laps=1", "path.radius=12", "speed=10"), "--plugin-path", folder, "--out", self.work / "run")
        self.expect(run.returncode == FINE, "run", f"{run.returncode}: {run.stderr}")
        named = self.run("plugins", "constructor_crashes", "--plugin-path", folder)
        self.expect(named.returncode == ERROR and self.words["constructor_crashes"] in named.stderr, "by name", named.stderr)
        used = self.run("run", PAPER, *assignments("blocking.kappa={name: harmful}"), "--plugin-path", folder, "--out", self.work / "run")
        self.expect(used.returncode == ERROR and "there is no blocking plugin 'harmful'" in used.stderr
                    and self.words["factory_exits"] in used.stderr, "used by name", used.stderr)
        doctor = self.run("plugins", "--doctor", "factory_exits", "--plugin-path", self.folder_of("factory_exits"))
        self.expect(doctor.returncode == NOT_SOLVED and "refused   factory_exits.so" in doctor.stdout, "doctor", doctor.stdout + doctor.stderr)

    def verdicts(self):
        """Kept where that is possible, asked for anew by --doctor, and done without where it is not."""
        kept = self.work / "cache" / "rhec" / "plugins"
        before = {file.name: file.stat().st_mtime_ns for file in kept.iterdir()}
        self.expect(len(before) > len(LOOKED_AT), "kept", f"{sorted(before)}")
        self.run("plugins")
        self.expect(before == {file.name: file.stat().st_mtime_ns for file in kept.iterdir()}, "kept", "verdicts were written anew")
        self.run("plugins", "--doctor")
        after = {file.name: file.stat().st_mtime_ns for file in kept.iterdir()}
        self.expect(any(after[name] != before[name] for name in before), "doctor", "no verdict was written anew")
        nowhere = {name: text for name, text in CLEAN.items() if name not in ("HOME", "XDG_CACHE_HOME")}
        for name, environment in {"no home": nowhere, "a file": {**CLEAN, "XDG_CACHE_HOME": str(self.harmful)}}.items():
            result = self.run("plugins", environment=environment)
            self.expect(result.returncode == FINE and "bicycle_slip" in result.stdout and not result.stderr, name, result.stderr)

    def used(self):
        """A plugin that is accepted, and ends the program when it is used."""
        for name, code in {"use_crashes": -signal.SIGSEGV, "use_overflows": -signal.SIGSEGV, "use_exits": ERROR}.items():
            folder = self.folder_of(name)
            result = self.run("run", PAPER, *assignments("blocking.kappa={name: harmful}"), "--plugin-path", folder, "--out", self.work / "used")
            if self.is_sanitized:
                self.expect(result.returncode != FINE and result.stderr, name, f"{result.returncode}: {result.stderr}")
                continue
            self.expect(result.returncode == code, name, f"{result.returncode}: {result.stderr}")
            self.expect(f"in the blocking 'harmful' 1, or in what it called: {folder / name}.so" in result.stderr, name, result.stderr)


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), pathlib.Path(work).resolve(), "--sanitized" in sys.argv[3:])
        for part in (test.looked_at, test.verdicts, test.used):
            part()
        test.tell()


if __name__ == "__main__":
    main()
