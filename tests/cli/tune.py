#!/usr/bin/env python3
"""`rhec tune` on a drive made here whose errors are known, and of a controller.

    tune.py <rhec>
"""
import csv
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree

from cli import CLEAN, ERROR, FIGURE8, FINE, NOT_SOLVED, PATIENCE, ROOT, SHORT, USAGE, Findings, Program, assignments

sys.path.insert(0, str(ROOT / "scripts" / "measure"))
from drives import TRUTH, drive  # noqa: E402

LOG = ("--dead-reckoning", "drs.txt", "--gps", "gps.txt")
# What the drive tells of most is enough here.
KEEP = [word for key in ("noise.inputs", "noise.outputs.delta", "estimator", "log.speed_bias", "log.steering_delay",
                         "log.wheel_offset") for word in ("--keep", key)]


def check_log(rhec, folder, findings):
    drive(folder, 1, 100)
    done = rhec("tune", "drive.yaml", *LOG, *KEEP, "--out", "out", cwd=folder, timeout=120)
    if not findings.expect(done.returncode == FINE, "tune", done.stdout + done.stderr):
        return
    summary = json.loads((folder / "out" / "summary.json").read_text())
    for name, truth in TRUTH.items():
        number = summary["numbers"][name]
        findings.expect(abs(number["after"] - truth) < 3.0 * number["standard_error"] and number["told"], name, number)
        findings.expect(name in done.stdout, f"{name} is not in the table", done.stdout)
    picture = xml.etree.ElementTree.parse(folder / "out" / "tuning.svg")  # throws where it is not well-formed
    texts = [element.text for element in picture.iter() if element.tag.endswith("text")]
    findings.expect(all(name in texts for name in TRUTH), "tuning.svg", texts)
    # The scenario that is written can be used, and predicts what the table says.
    judged = {figure["name"]: figure for figure in summary["judged"]}
    used = rhec("estimate", "out/tuned.yaml", *LOG, "--hold-out", "5", "--out", "used", cwd=folder)
    findings.expect(used.returncode == FINE, "estimate with tuned.yaml", used.stderr)
    held_out = json.loads((folder / "used" / "summary.json").read_text())["held_out"]
    findings.expect(abs(held_out["median_m"] - judged["withheld fixes: median"]["after"]) < 1e-9, "median", held_out)
    findings.expect(held_out["median_m"] < 0.6 * judged["withheld fixes: median"]["before"], "no better", judged)

    # Ctrl-C keeps the best, and writes it.
    command = [str(rhec.path), "tune", "drive.yaml", *LOG, "--out", "stopped"]
    process = subprocess.Popen(command, cwd=folder, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    text, errors = process.communicate(timeout=60 * PATIENCE)
    findings.expect(process.returncode == NOT_SOLVED and "stopped: this is the best" in text, "Ctrl-C", text + errors)
    findings.expect((folder / "stopped" / "tuned.yaml").exists(), "Ctrl-C writes nothing")


def check_mistakes(rhec, folder, findings):
    drive(folder, 1, 100)
    rows = (folder / "gps.txt").read_text().splitlines()
    (folder / "short.txt").write_text("\n".join(rows[:40]) + "\n")
    (folder / "holes.txt").write_text("\n".join("nan,1,2" if i == 7 else row for i, row in enumerate(rows)) + "\n")
    (folder / "missing.txt").write_text("\n".join(row.split(",")[0] + ",nan,nan" for row in rows) + "\n")
    for words, code, part in (
            (("drive.yaml", *LOG, "--tune", "model.wheelbse"), ERROR, "no number 'model.wheelbse'"),
            (("drive.yaml", *LOG, "--keep", "noize"), ERROR, "noise.outputs.x_gps"),
            (("drive.yaml", *LOG, "--set", "log.fix_dealy=1"), ERROR, "did you mean 'fix_delay'"),
            (("drive.yaml", *LOG, "--set", "log.speed_scale=0"), ERROR, "greater than 0"),
            (("drive.yaml", *LOG, "--variant", "rhe"), ERROR, "variant"),
            (("drive.yaml", "--gps", "gps.txt"), USAGE, "--dead-reckoning"),
            (("drive.yaml",), ERROR, "--dead-reckoning"),
            (("drive.yaml", *LOG, "--controller"), ERROR, "leave --dead-reckoning"),
            (("drive.yaml", *LOG, "--hold-out", "5", "--hold-out-phase", "5"), ERROR, "below it"),
            (("drive.yaml", *LOG, "--threads", "0"), USAGE, "--threads"),
            (("drive.yaml", "--dead-reckoning", "drs.txt", "--gps", "short.txt"), ERROR, "expected at least 30"),
            (("drive.yaml", "--dead-reckoning", "drs.txt", "--gps", "holes.txt"), ERROR, "holes.txt:8"),
            (("drive.yaml", "--dead-reckoning", "drs.txt", "--gps", "missing.txt"), ERROR, "expected at least 30"),
            (("none.yaml", *LOG), ERROR, "none.yaml")):
        done = rhec("tune", *words, "--out", "mistake", cwd=folder)
        findings.expect(done.returncode == code and part in done.stderr, " ".join(words), f"{done.returncode} {done.stderr}")
    findings.expect(not (folder / "mistake").exists(), "something was written beside a mistake")

    # A coordinate that is missing here and there does no harm.
    few = "\n".join(row.rsplit(",", 1)[0] + ",nan" if i % 50 == 3 else row for i, row in enumerate(rows)) + "\n"
    (folder / "few.txt").write_text(few)
    done = rhec("tune", "drive.yaml", "--dead-reckoning", "drs.txt", "--gps", "few.txt", *KEEP, "--keep", "log",
                "--no-smoother", "--out", "few", cwd=folder, timeout=120)
    findings.expect(done.returncode == FINE, "a few coordinates missing", done.stdout + done.stderr)


def check_controller(rhec, folder, findings):
    quick = [*assignments(*SHORT, "speed=5", "estimator.name=ekf", "controller.weights.stage.u2=20"), "--seeds", "1",
             "--judges", "2", "--evaluations", "6"]
    done = rhec("tune", FIGURE8, "--controller", *quick, "--effort", "2", "--case", "speed=4; seed=3", "--case", "speed=6",
                "--out", folder / "controller", timeout=120)
    if findings.expect(done.returncode == FINE, "tune --controller", done.stdout + done.stderr):
        with open(folder / "controller" / "pareto.csv", newline="") as file:
            tried = list(csv.DictReader(file))
        findings.expect(sum(row["chosen"] == "1" for row in tried) == 1, "one is chosen", tried)
        findings.expect(float(tried[0]["tracking_ratio"]) == 1.0, "the first is the scenario's", tried[0])
        chosen = next(row for row in tried if row["chosen"] == "1")
        findings.expect(float(chosen["tracking_ratio"]) < 1.0 and float(chosen["effort_ratio"]) <= 2.0, "chosen", chosen)
        xml.etree.ElementTree.parse(folder / "controller" / "pareto.svg")
        used = rhec("run", folder / "controller" / "tuned.yaml", "--out", folder / "driven")
        findings.expect(used.returncode == FINE, "run with tuned.yaml", used.stderr)
    done = rhec("tune", FIGURE8, "--controller", "--case", "speeed=4", "--out", folder / "mistake")
    findings.expect(done.returncode == ERROR and "did you mean 'speed'" in done.stderr, "a wrong case", done.stderr)


def main():
    findings, rhec = Findings("tune"), Program(sys.argv[1])
    for check in (check_log, check_mistakes, check_controller):
        with tempfile.TemporaryDirectory() as name:
            check(rhec, pathlib.Path(name), findings)
    findings.tell()


if __name__ == "__main__":
    main()
