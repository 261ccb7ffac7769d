#!/usr/bin/env python3
"""`rhec init` writes files that run, of every vehicle: init.py <rhec>"""
import json
import os
import pathlib
import pty
import re
import subprocess
import sys
import tempfile

import cli
from cli import CLEAN, ERROR, FINE, Findings, Program

EQUATIONS = cli.ROOT / "examples" / "vehicles" / "bicycle.yaml"


def models(rhec):
    return [plugin["name"] for plugin in json.loads(rhec("plugins", "--json").stdout) if plugin.get("kind") == "model"]


def files_run(rhec, findings, work):
    for name in [*models(rhec), EQUATIONS]:
        folder = f"robot_{pathlib.Path(name).stem}" + ("_file" if name == EQUATIONS else "")
        made = rhec("init", folder, "--vehicle", name, cwd=work)
        findings.expect(made.returncode == FINE, f"init of {name}", made.stderr)
        check = rhec("check", f"{folder}/robot.yaml", cwd=work, timeout=120)
        findings.expect(check.returncode == FINE, f"check of {name}", check.stdout + check.stderr)
        run = rhec("run", f"{folder}/field.yaml", "--out", f"{folder}/out", cwd=work, timeout=120)
        if findings.expect(run.returncode == FINE and not run.stderr, f"run of {name}", f"{run.returncode}: {run.stdout} {run.stderr}"):
            summary = json.loads((work / folder / "out" / "summary.json").read_text())
            findings.expect(summary["mae"]["tracking"] < 1.0, f"run of {name}", f"{summary['mae']}")
        elsewhere = rhec("run", work / folder / "field.yaml", "--out", work / "elsewhere", cwd="/", timeout=120)
        findings.expect(elsewhere.returncode == FINE, f"run of {name} from elsewhere", elsewhere.stderr)
    robot = (work / "robot_bicycle_slip" / "robot.yaml").read_text()
    for words in ("wheelbase: 1.4", "outputs: [x_gps, y_gps, delta]", "it could have heading, yaw_rate", "[rad]"):
        findings.expect(words in robot, "robot.yaml", f"has no '{words}':\n{robot}")


def choices(rhec, findings, work):
    made = rhec("init", "mine", "--vehicle", "skid_steer", "--sensors", "yaw_rate, x_gps,y_gps", "--set", "track_width=0.8", cwd=work)
    robot = (work / "mine" / "robot.yaml").read_text()
    findings.expect(made.returncode == FINE and "track_width: 0.8" in robot, "--set", made.stderr + robot)
    findings.expect("outputs: [x_gps, y_gps, yaw_rate]" in robot, "--sensors", robot)
    before = {file: file.read_bytes() for file in (work / "mine").iterdir()}
    for words, expected in ((["mine"], "is there already"), (["new", "--vehicle", "bicycle"], "did you mean 'bicycle_slip'?"),
                            (["new", "--sensors", "x_gsp"], "did you mean 'x_gps'?"), (["new", "--set", "wheelbse=2"], "did you mean 'wheelbase'?")):
        wrong = rhec("init", *words, cwd=work)
        findings.expect(wrong.returncode == ERROR and expected in wrong.stderr, " ".join(words), wrong.stderr)
    findings.expect(before == {file: file.read_bytes() for file in (work / "mine").iterdir()}, "what is there stays")
    findings.expect(not (work / "new").exists(), "nothing is left of a mistake")
    replaced = rhec("init", "mine", "--force", "--json", cwd=work)
    findings.expect(json.loads(replaced.stdout)["scenario"] == "mine/field.yaml", "--force --json", replaced.stdout + replaced.stderr)


def names(rhec, findings, work):
    """Files of a robot with an unusual name are read again, and what is to be typed next is one word."""
    for name in ("a b", "\u00fc", "#x", "{x}", "null", "&a", "*b", "x: y", "it's", 'say "x"', "two\nlines", "-x", "1", "true"):
        made = rhec("init", "--vehicle", "skid_steer", "--", name, cwd=work)
        findings.expect(made.returncode == FINE, f"init of {name!r}", made.stderr)
        word = re.search(r"^  rhec run ((?:.|\n)*?)\n  rhec log", made.stdout, re.MULTILINE)
        told = subprocess.run(["bash", "-c", f"printf %s {word.group(1)}"], capture_output=True, text=True).stdout if word else made.stdout
        findings.expect(told == f"{name}/field.yaml", f"next, of {name!r}", told)
        run = rhec("run", f"./{name}/field.yaml", "--set", "path.laps=1", "--set", "path.radius=3", "--out", work / "named" / str(len(name)), "--json", cwd=work)
        findings.expect(run.returncode == FINE and json.loads(run.stdout)["steps"] > 10, f"run of {name!r}", run.stdout[:200] + run.stderr)
    for name, expected in (("", "folder: found nothing"), ("x" * 300, "File name too long")):
        wrong = rhec("init", name, "--vehicle", "skid_steer", cwd=work)
        findings.expect(wrong.returncode == ERROR and expected in wrong.stderr and "unexpectedly" not in wrong.stderr, f"init of {name[:9]!r}", wrong.stderr)


def asks(rhec, findings, work):
    """On a terminal it asks; an empty answer is the proposal."""
    leader, follower = pty.openpty()
    process = subprocess.Popen([str(rhec.path), "init", "asked"], stdin=follower, stdout=subprocess.PIPE, stderr=follower, cwd=work, env=CLEAN)
    os.close(follower)
    os.write(leader, b"unicycle_traction\n\n")
    told, _ = process.communicate(timeout=60)
    shown = os.read(leader, 1 << 16).decode()
    os.close(leader)
    findings.expect(process.returncode == FINE, "asking", f"{process.returncode}: {shown}")
    findings.expect("Which one" in shown and "Sensors that it could have" in shown, "asking", shown)
    findings.expect("name: unicycle_traction" in (work / "asked" / "robot.yaml").read_text(), "asking", told.decode())


def robots_are_shared(rhec, findings, work):
    """The key `robot` of a scenario."""
    (work / "shared.yaml").write_text("robot: mine/robot.yaml\nestimator: {horizon: 7}\npath: {laps: 1, radius: 5}\nspeed: 1\n")
    fine = rhec("run", "shared.yaml", "--out", "shared", cwd=work)
    findings.expect(fine.returncode == FINE, "robot", fine.stderr)
    for text, expected in (("robot: none.yaml\n", "shared.yaml:1: robot: found 'none.yaml', expected the file of a robot"),
                           ("robot: shared.yaml\n", "a robot's file names no other one")):
        (work / "shared.yaml").write_text(text)
        wrong = rhec("run", "shared.yaml", "--out", "shared", cwd=work)
        findings.expect(wrong.returncode == ERROR and expected in wrong.stderr, text, wrong.stderr)


def main():
    rhec, findings = Program(sys.argv[1]), Findings("init")
    with tempfile.TemporaryDirectory(prefix="rhec-init-") as folder:
        work = pathlib.Path(folder)
        files_run(rhec, findings, work)
        choices(rhec, findings, work)
        names(rhec, findings, work)
        asks(rhec, findings, work)
        robots_are_shared(rhec, findings, work)
    findings.tell()


if __name__ == "__main__":
    main()
