#!/usr/bin/env python3
"""Maps of slip: runs that leave one and use it, and `rhec map`.

    map.py <rhec>
"""
import pathlib
import sqlite3
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, SHORT, USAGE, ZIGZAG, Program, assignments


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("map")
        self.rhec, self.work = rhec, work

    def drive(self, file, *settings, scenario=FIGURE8):
        memory = f"estimator.memory={{name: place, file: {file}}}"
        return self.rhec("run", scenario, "--out", self.work / "out", *assignments(*SHORT, memory, *settings))

    def refused(self, name, result, *words, code=ERROR):
        self.expect(result.returncode == code, name, f"{result.returncode}: {result.stdout}{result.stderr}")
        for word in words:
            self.expect(str(word) in result.stderr, name, f"'{word}' is not in: {result.stderr}")

    def files(self):
        one, other = self.work / "one.sqlite", self.work / "other.sqlite"
        for file, scenario in ((one, FIGURE8), (other, ZIGZAG)):
            result = self.drive(file, scenario=scenario)
            self.expect(result.returncode == FINE and str(file) in result.stdout, "a drive", result.stdout + result.stderr)
        again = self.drive(one, "seed=2")
        self.expect(again.returncode == FINE, "a second drive", again.stderr)
        with sqlite3.connect(one) as database:
            visits = database.execute("SELECT max(visits) FROM cells").fetchone()[0]
            self.expect(visits >= 2, "a second drive", f"{visits} visits")
        leftovers = [path.name for path in self.work.iterdir() if path.name.startswith(".")]
        self.expect(not leftovers, "nothing is left beside the map", str(leftovers))
        return one, other

    def commands(self, one, other):
        result = self.rhec("map", one)
        self.expect(result.returncode == FINE and "kappa" in result.stdout and "mu" in result.stdout, "list",
                    result.stdout + result.stderr)
        both, rasters, tiffs = self.work / "both.sqlite", self.work / "rasters", self.work / "tiffs"
        result = self.rhec("map", one, other, "--merge", both, "--ascii", rasters, "--geotiff", tiffs)
        self.expect(result.returncode == FINE, "merge and export", result.stderr)
        counts = []
        for file in (one, other, both):
            with sqlite3.connect(file) as database:
                counts.append(database.execute("SELECT count(*) FROM cells").fetchone()[0])
        self.expect(max(counts[:2]) < counts[2] <= counts[0] + counts[1], "merge", str(counts))
        names = sorted(path.name for path in rasters.iterdir())
        self.expect(names == ["kappa.asc", "kappa_sigma.asc", "mu.asc", "mu_sigma.asc"], "rasters", str(names))
        lines = (rasters / "kappa.asc").read_text().splitlines()
        columns, rows = int(lines[0].split()[1]), int(lines[1].split()[1])
        self.expect(len(lines) == 6 + rows and all(len(line.split()) == columns for line in lines[6:]), "a raster's shape")
        known = [float(word) for line in lines[6:] for word in line.split() if word != "-9999"]
        self.expect(len(known) == counts[2] and all(0.3 < value < 1.2 for value in known), "a raster's values")
        self.expect(sorted(path.name for path in tiffs.iterdir()) == ["kappa.tif", "mu.tif"], "tiffs")
        self.expect((tiffs / "mu.tif").read_bytes()[:4] in (b"II*\0", b"MM\0*"), "a TIFF")

    def report(self, one):
        page, figures = self.work / "map.html", self.work / "figures"
        result = self.rhec("report", one, "-o", page, "--svg", figures)
        if "RHEC_REPORT=OFF" in result.stderr:
            return
        self.expect(result.returncode == FINE, "report", result.stderr)
        names = sorted(path.name for path in figures.iterdir()) if figures.is_dir() else []
        self.expect(names == ["kappa-mean.svg", "kappa-sigma.svg", "mu-mean.svg", "mu-sigma.svg"], "figures", str(names))

    def mistakes(self, one):
        self.refused("no file", self.rhec("map"), code=USAGE)
        self.refused("missing", self.rhec("map", self.work / "none.sqlite"), "none.sqlite", "no such file")
        self.refused("no database", self.rhec("map", FIGURE8), FIGURE8, "no SQLite database")
        self.refused("unwritable", self.rhec("map", one, "--merge", one / "x.sqlite"), "one.sqlite")
        blue = self.work / "blue.sqlite"
        memory = f"estimator.memory={{name: place, file: {blue}, vehicle: the blue one}}"
        result = self.rhec("run", FIGURE8, "--out", self.work / "out", *assignments(*SHORT, memory))
        self.expect(result.returncode == FINE, "another vehicle", result.stderr)
        self.refused("another vehicle's map", self.rhec("map", one, blue, "--merge", self.work / "m.sqlite"), blue, "the blue one")
        self.expect(not (self.work / "m.sqlite").exists(), "nothing is written")
        before = blue.read_bytes()
        self.refused("drive with another vehicle's map", self.drive(blue), blue, "the blue one")
        self.expect(blue.read_bytes() == before, "a map that is refused stays as it is")
        self.refused("ekf", self.drive(one, "estimator.name=ekf"), "estimator.memory", "bank")
        self.refused("dump", self.rhec("run", FIGURE8, "--dump", self.work / "dump", *assignments(*SHORT, "estimator.memory=place")),
                     "--dump", "memory")


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-map-") as folder:
        test = Test(Program(sys.argv[1]), pathlib.Path(folder))
        one, other = test.files()
        test.commands(one, other)
        test.report(one)
        test.mistakes(one)
        test.tell()


if __name__ == "__main__":
    main()
