#!/usr/bin/env python3
"""Programs of others read the logs that rhec writes, and rhec reads theirs: strangers.py <rhec> <folder for their packages>

From PyPI rosbags, mcap and mcap-ros2-support, from npm @mcap/core and @foxglove/rosmsg2-serialization. What cannot be
installed is skipped with a word; without any, the test is skipped (77).
"""
import csv
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PYTHON_PACKAGES = ("rosbags==0.11.9", "mcap==1.6.0", "mcap-ros2-support==0.6.0")
NODE_PACKAGES = ("@mcap/core@2.2.2", "@foxglove/rosmsg@5.0.5", "@foxglove/rosmsg2-serialization@3.1.0", "fzstd@0.1.1")
SKIPPED = 77


def install(command, done, folder):
    """Runs a command once; whether it has succeeded."""
    if done.exists():
        return True
    folder.mkdir(parents=True, exist_ok=True)
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=400)
    if result.returncode:
        print(f"{' '.join(map(str, command))}: {(result.stderr or result.stdout).strip().splitlines()[-1:]}")
        return False
    done.write_text("")
    return True


def python_of(folder):
    python = folder / "venv" / "bin" / "python"
    if not python.exists() and subprocess.run([sys.executable, "-m", "venv", folder / "venv"], capture_output=True).returncode:
        return None
    return python if install([python, "-m", "pip", "install", "--quiet", *PYTHON_PACKAGES], folder / "venv" / "done", folder) else None


def node_of(folder):
    home = folder / "node"
    if not shutil.which("npm") or not install(["npm", "install", "--silent", "--no-fund", "--no-audit", *NODE_PACKAGES], home / "done", home):
        return None
    return home


class Findings:
    def __init__(self):
        self.failures, self.count = [], 0

    def expect(self, truth, what, text=""):
        self.count += 1
        if not truth:
            self.failures.append(f"{what}: {text}")


def run(findings, *words):
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=200)
    findings.expect(result.returncode == 0, " ".join(map(str, words)), f"{result.returncode} {result.stdout[-500:]} {result.stderr[-1500:]}")
    return result.stdout


def ranges(listing):
    """(least, most) of each signal in what `rhec log` prints."""
    found = {}
    for name, least, most in re.findall(r"^  (/\S+)\s+(\S+?)(?: to (\S+?))?(?:,.*)?$", listing, re.MULTILINE):
        found[name] = (float(least), float(most or least))
    return found


def check_ranges(findings, what, listing):
    """What tests/logs/strangers/write.py has written."""
    found = ranges(listing)
    for name, expected in {"/fix:latitude": (48.0, 48.0000495), "/fix:status.status": (0, 0), "/imu:angular_velocity.z": (-9.9e-5, 0.0),
                           "/joint_states:position[left_wheel]": (0.0, 49.5), "/joint_states:velocity[right_wheel]": (10.0, 10.0),
                           "/odom:twist.twist.linear.x": (0.0, 49.5), "/odom:pose.pose.position.y": (-99.0, 0.0)}.items():
        least, most = found.get(name, (float("nan"), float("nan")))
        findings.expect(abs(least - expected[0]) < 1e-7 and abs(most - expected[1]) < 1e-7, f"{what}: {name}", f"{least} to {most}")
    findings.expect(listing.count(": 100 records, 20 1/s") == 4, f"{what}: counts and rates", listing)


def check_estimates(findings, bag, rhec, work, robot=ROOT / "examples" / "logs" / "skid_steer.yaml"):
    """The robot of the tutorial, whose wheels slip by a fifth."""
    run(findings, rhec, "estimate", robot, work / "bags" / bag, "--set", "estimator.name=ekf", "--out", work / "drive")
    with open(work / "drive" / "estimates.csv", newline="") as stream:
        last = list(csv.DictReader(stream))[-1]
    for side in ("left", "right"):
        findings.expect(abs(float(last[f"lambda_{side}"]) - 0.206) < 0.03, f"{bag}: slip", last[f"lambda_{side}"])
    # The antenna is 0.2 m before the centre; the last estimate is one message behind the last fix.
    findings.expect(abs(float(last["y"]) - (5.56 - 0.2)) < 0.03 and abs(float(last["x"]) - 0.1) < 0.02 and
                    abs(float(last["psi"]) - 1.5708) < 0.01, f"{bag}: place", f"{last}")


def check_proposal(findings, bag, rhec, work):
    """What `rhec log` proposes runs as it is."""
    robot = work / "proposed.yaml"
    without = (ROOT / "examples" / "logs" / "skid_steer.yaml").read_text().split("signals:")[0]
    robot.write_text(without)
    proposal = run(findings, rhec, "log", work / "bags" / bag, "--vehicle", robot)
    robot.write_text(without + proposal[proposal.index("signals:"):])
    check_estimates(findings, bag, rhec, work, robot)


def main():
    rhec, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    here = pathlib.Path(__file__).resolve().parent / "strangers"
    python, node = python_of(folder), node_of(folder)
    for name, found in (("rosbags, mcap, mcap-ros2-support (PyPI)", python), ("@mcap/core (npm)", node)):
        if not found:
            print(f"skipped: {name} cannot be installed here")
    if not python and not node:
        sys.exit(SKIPPED)
    findings = Findings()
    with tempfile.TemporaryDirectory(prefix="rhec-strangers-") as work:
        work = pathlib.Path(work)
        run(findings, rhec, "run", ROOT / "scenarios" / "figure8.yaml", "--set", "path.laps=1", "--set", "path.radius=12", "--out", work / "run",
            "--mcap", work / "estimate.mcap", "--log", work / "drive.mcap")
        if python:
            for bag in run(findings, python, here / "write.py", work / "bags").split():
                if bag != "no_slash.mcap":
                    check_ranges(findings, bag, run(findings, rhec, "log", work / "bags" / bag))
                    check_estimates(findings, bag, rhec, work)
                check_proposal(findings, bag, rhec, work)
            # As a recorder that was killed leaves it.
            (work / "bags" / "rosbag2_sqlite3_plain" / "metadata.yaml").unlink()
            check_estimates(findings, "rosbag2_sqlite3_plain", rhec, work)
            print(run(findings, python, here / "read.py", work / "estimate.mcap", work / "drive.mcap", work / "run" / "steps.csv"), end="")
        if node:
            script = node / "read.mjs"
            script.write_text((here / "read.mjs").read_text())  # packages are found beside it
            print(run(findings, "node", script, work / "estimate.mcap", work / "run" / "steps.csv"), end="")
    for failure in findings.failures:
        print(failure)
    print(f"strangers: {findings.count} expectations, {len(findings.failures)} failed")
    sys.exit(1 if findings.failures or not findings.count else 0)


if __name__ == "__main__":
    main()
