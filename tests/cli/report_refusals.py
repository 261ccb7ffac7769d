#!/usr/bin/env python3
"""`rhec report` of what is no run, or only half of one: the answer names the file, the line and what to do, and nothing is written.

    report_refusals.py <rhec>
"""
import shutil

import reports
from cli import ERROR, USAGE
from reports import Reports



class Refusals(Reports):
    parts = ("no_run", "half_a_run", "no_output")

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.run_folder = self.make_run("run", "seed=3")

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


if __name__ == "__main__":
    reports.main(Refusals)
