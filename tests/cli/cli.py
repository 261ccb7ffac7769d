"""What the tests of the command line share: running it, and telling what went wrong."""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FIGURE8 = ROOT / "scenarios" / "figure8.yaml"
PAPER = ROOT / "scenarios" / "paper" / "figure8.yaml"  # with blocks
ZIGZAG = ROOT / "scenarios" / "zigzag.yaml"
# A run of a second at most.
SHORT = ("speed=10", "path.laps=1", "path.radius=12", "path.legs=2", "path.leg_length=40")
# Nothing of the developer's shell may make a difference.
CLEAN = {name: value for name, value in os.environ.items() if name != "RHEC_PLUGIN_PATH"}

# How many times as long things may take as in an optimised program, as with sanitizers.
PATIENCE = float(os.environ.get("RHEC_PATIENCE", 1))

# apps/commands.hpp
FINE, ERROR, USAGE, NOT_SOLVED = 0, 1, 2, 3


def assignments(*settings):
    return [part for setting in settings for part in ("--set", setting)]


class Program:
    def __init__(self, path):
        self.path = pathlib.Path(path).resolve()

    def __call__(self, *words, timeout=60, **options):
        return subprocess.run([str(self.path), *map(str, words)], capture_output=True, text=True, timeout=PATIENCE * timeout, env=CLEAN,
                              **options)


class Findings:
    def __init__(self, title):
        self.title, self.failures, self.count = title, [], 0

    def expect(self, truth, name, text=""):
        self.count += 1
        if not truth:
            self.failures.append(f"{name}: {text}" if text else name)
        return truth

    def tell(self):
        for failure in self.failures:
            print(failure)
        print(f"{self.title}: {self.count} expectations, {len(self.failures)} failed")
        sys.exit(1 if self.failures or not self.count else 0)
