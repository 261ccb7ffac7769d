#!/usr/bin/env python3
"""Logs of a robot's own sensors: `rhec run --log`, `rhec log`, and `rhec estimate` and `rhec smooth` of a LOG.

    log.py <rhec>
"""
import csv
import datetime
import json
import math
import pathlib
import random
import re
import shutil
import sys
import tempfile

import cli
from cli import ERROR, FINE, USAGE, Findings, Program, assignments

# A tracked robot that nobody here has seen: GPS in degrees, a quaternion, rotations of sprockets, by clocks of their own.
ROBOT = """\
name: stranger
step: 0.1
model: {name: unicycle_traction, outputs: [x_gps, y_gps, heading], antenna_x: 0}
noise:
  outputs: {x_gps: 0.02, y_gps: 0.02, heading: 0.02}
  inputs: {v: 0.02, omega: 0.02}
bounds: {mu: [0, 1.3], kappa: [0, 1.3]}
estimator:
  name: ekf
  process_noise: {mu: 0.005, kappa: 0.005}
  initial:
    sigma: {x: 0.1, y: 0.1, psi: 0.1, mu: 0.3, kappa: 0.3}
signals:
  outputs:
    x_gps: {from: [lat, lon, height], as: east}
    y_gps: {from: [lat, lon, height], as: north}
    heading: {from: [qx, qy, qz, qw], as: heading, clock: "imu time [ms]", delay: 0.02}
  inputs:
    v: {from: [left rpm, right rpm], as: mean, unit: rpm, radius: 0.1}
    omega: {from: [left rpm, right rpm], as: turn, unit: rpm, radius: 0.1, track: 0.5}
"""
TRACTION, TURNING, RADIUS, TRACK = 0.8, 0.7, 0.1, 0.5


def stranger_table(path):
    """A drive with constant traction; 10 Hz, since 1970."""
    noise = random.Random(7)
    x = y = 0.0
    heading, start, step = 0.5, 1_700_000_000.25, 0.1
    rows = ["time;imu time [ms];lat;lon;height;qx;qy;qz;qw;left rpm;right rpm;state"]
    for k in range(600):
        speed, turn = 1.0, 0.4 * math.sin(0.02 * k)
        left, right = ((speed + side * 0.5 * TRACK * turn) / RADIUS * 60.0 / (2.0 * math.pi) for side in (-1, 1))
        # Radii of curvature at this latitude, by WGS84.
        latitude = 48.0 + math.degrees((y + noise.gauss(0, 0.02)) / 6366700.0)
        longitude = 11.0 + math.degrees((x + noise.gauss(0, 0.02)) / (6389800.0 * math.cos(math.radians(48.0))))
        measured = heading + noise.gauss(0, 0.02)
        time = start + step * k
        fix = f"{latitude:.10f};{longitude:.10f};520.0" if k % 5 == 0 else ";;"
        rows.append(f"{time:.6f};{1000 * (time + 0.02):.3f};{fix};0;0;{math.sin(measured / 2):.9f};{math.cos(measured / 2):.9f};"
                    f"{left:.6f};{right:.6f};driving")
        middle = heading + 0.5 * step * TURNING * turn
        x += step * TRACTION * speed * math.cos(middle)
        y += step * TRACTION * speed * math.sin(middle)
        heading += step * TURNING * turn
    path.write_text("\n".join(rows) + "\n")


SPRAYER = """\
name: sprayer
step: 0.1
model: {name: bicycle_slip, wheelbase: 2.5, gps_offset: -1.0, outputs: [x_gps, y_gps, heading, delta, ground_speed]}
noise:
  outputs: {x_gps: 0.02, y_gps: 0.02, heading: 0.02, delta: 0.01, ground_speed: 0.05}
estimator: {name: ekf, initial: {sigma: {x_pos: 0.5, y_pos: 0.5, beta: 0.3, delta: 0.1, kappa: 0.3, mu: 0.3}}}
signals:
  outputs:
    x_gps: {from: ["GPS vorn Lat", "GPS vorn Lon"], as: east}
    y_gps: {from: ["GPS vorn Lat", "GPS vorn Lon"], as: north}
    heading: {from: ["GPS hinten Lat", "GPS hinten Lon", "GPS vorn Lat", "GPS vorn Lon"], as: direction}
    delta: {from: "Steer sensor, left", sign: -1, offset: 0.05236}
    ground_speed: Radar speed
  inputs:
    u1: {from: ["rpm left", "rpm right"], as: mean, radius: 0.6}
    u2: {from: "Steer sensor, left", sign: -1, derivative: true}
"""


def sprayer_table(path):
    """The wheels slip by 15 %; 10 Hz, fixes at 2 Hz, in local time."""
    noise, radius, slip = random.Random(4), 0.6, 0.85
    start = datetime.datetime(2024, 5, 1, 12, tzinfo=datetime.timezone(datetime.timedelta(hours=2)))
    rows = ["sep=;", '"Zeit";"GPS vorn Lat (°)";"GPS vorn Lon (°)";"GPS hinten Lat (°)";"GPS hinten Lon (°)";"Radar speed [km/h]";"Radar sigma [m/s]";'
            '"Steer sensor, left [°]";"rpm left [1/min]";"rpm right [1/min]";"ticks left";"ticks right";"Bemerkung"']
    x, y, heading, step = 0.0, 0.0, 0.4, 0.01

    def place(ahead):
        east, north = (value + noise.gauss(0, 0.01) for value in (x + ahead * math.cos(heading), y + ahead * math.sin(heading)))
        return [f"{48.0 + math.degrees(north / 6366700.0):.9f}", f"{11.0 + math.degrees(east / (6389800.0 * math.cos(math.radians(48.0)))):.9f}"]

    for k in range(6000):
        steering, speed = 0.25 * math.sin(0.3 * step * k), 2.0
        if k % 10 == 0:
            time = (start + datetime.timedelta(seconds=step * k)).isoformat(timespec="milliseconds")
            fixes = place(1.0) + place(-1.0) if k % 50 == 0 else [""] * 4
            wheel = f"{speed / radius * 60.0 / (2.0 * math.pi):.2f}"
            ticks = str(int(speed * step * k / radius / (2.0 * math.pi) * 81920) % 65536)
            cells = [time, *fixes, f"{3.6 * slip * speed + noise.gauss(0, 0.1):.3f}", "0.05", f"{3.0 - math.degrees(steering) + noise.gauss(0, 0.1):.3f}",
                     wheel, wheel, ticks, ticks]
            rows.append(";".join([time] + [cell.replace(".", ",") for cell in cells[1:]] + ['"gut; weiter"']))
        x += step * slip * speed * math.cos(heading)
        y += step * slip * speed * math.sin(heading)
        heading += step * slip * speed * math.tan(steering) / 2.5
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(rows).encode() + b"\r\n")


class Suite(Findings):
    def __init__(self, rhec, work):
        super().__init__("log")
        self.rhec, self.work = rhec, work

    def run(self, *words, code=FINE):
        result = self.rhec(*words, timeout=120)
        self.expect(result.returncode == code, f"rhec {' '.join(map(str, words))}",
                    f"{result.returncode}: {result.stdout[-800:]} {result.stderr[-800:]}")
        return result

    def refused(self, text, *words, code=ERROR):
        result = self.run(*words, code=code)
        self.expect(text in result.stderr, f"rhec {' '.join(map(str, words))}", f"expected '{text}' in {result.stderr}")

    def rows(self, folder, file="estimates.csv"):
        with open(self.work / folder / file, newline="") as stream:
            return list(csv.DictReader(stream))

    def vehicles(self):
        for name in ("figure8", "unicycle_traction", "tractor_trailer", "bicycle_sideslip", "skid_steer"):
            scenario = cli.ROOT / "scenarios" / f"{name}.yaml"
            short = assignments("path.laps=1", "path.legs=1", "path.radius=6", "path.leg_length=8", "estimator.name=ekf")
            for ending in ("csv", "mcap"):
                log = self.work / f"{name}.{ending}"
                self.run("run", scenario, *short, "--log", log, "--out", self.work / "run")
                result = self.run("estimate", scenario, log, *short, "--out", self.work / "out")
                self.expect("NIS" in result.stdout and "withheld, 1 of 5" in result.stdout, f"{name}: what is told", result.stdout)
                driven, replayed = self.rows("run", "steps.csv"), self.rows("out")
                self.expect(len(driven) == len(replayed), f"{name}.{ending}", f"{len(driven)} samples, {len(replayed)} estimates")
                names = [key for key in replayed[0] if key in driven[0] and key not in ("time", "health", "findings")]
                worst = max(abs(float(a[key] or 0) - float(b[key] or 0)) for a, b in zip(driven, replayed) for key in names)
                self.expect(worst < 1e-8, f"{name}.{ending}: the replay is the run", f"differs by {worst}")
                listed = self.run("log", log, "--vehicle", scenario)
                self.expect("signals:" in listed.stdout and "none" not in listed.stdout, f"{name}: a proposal", listed.stdout)

    def stranger(self):
        robot, log = self.work / "robot.yaml", self.work / "field.csv"
        robot.write_text(ROBOT)
        stranger_table(log)
        files = [word for kind in ("mcap", "csv", "tum") for word in (f"--{kind}", self.work / f"track.{kind}")]
        result = self.run("estimate", robot, log, "--out", self.work / "out", *files)
        self.expect(re.search(r"local plane: origin (48\.0000|47\.9999)", result.stdout), "the origin", result.stdout)
        last = self.rows("out")[-1]
        self.expect(abs(float(last["mu"]) - TRACTION) < 0.05 and abs(float(last["kappa"]) - TURNING) < 0.1, "slip", f"{last}")
        summary = json.loads((self.work / "out" / "summary.json").read_text())
        accuracy = summary["variants"]["stranger"]["held_out"]
        self.expect(accuracy["count"] == 24 and accuracy["median"] < 0.08, "accuracy", f"{accuracy}")
        self.expect(abs(summary["start"] - 1_700_000_000.23) < 0.03, "start", f"{summary['start']}")
        self.expect(len((self.work / "track.tum").read_text().splitlines()) == len(self.rows("out")), "a pose for each estimate")
        listed = self.run("log", self.work / "track.mcap")
        for topic in ("/rhec/odometry  nav_msgs/msg/Odometry", "/tf  tf2_msgs/msg/TFMessage", "/rhec/slip:position[mu]", "/diagnostics"):
            self.expect(topic in listed.stdout, "the log of an estimation", f"no {topic} in {listed.stdout}")
        self.run("log", self.work / "track.csv")
        smoothed = self.run("smooth", robot, log, "--out", self.work / "smooth", *assignments("smoother.solver={name: gn_rti, mode: converge}"))
        self.expect("interpolated" in smoothed.stdout, "smoothed", smoothed.stdout)
        variants = {row["variant"] for row in self.rows("smooth")}
        self.expect(variants == {"stranger", "stranger causal"}, "variants of a smoothing", f"{variants}")
        self.expect(self.rhec("report", self.work / "out", "-o", self.work / "page.html").returncode == FINE, "report", "of an estimation")
        proposal = self.run("log", log, "--vehicle", "unicycle_traction").stdout
        self.expect("{from: [lat, lon, height], as: east}" in proposal, "a proposal for columns", proposal)

    def sprayer(self):
        """A table as a spreadsheet in Europe saves it: commas, dates, units in heads, counts, two antennas, a sensor that counts the other way."""
        robot, log = self.work / "sprayer.yaml", self.work / "sprayer.csv"
        robot.write_text(SPRAYER)
        sprayer_table(log)
        proposal = self.run("log", log, "--vehicle", robot).stdout
        for line in ('x_gps: {from: ["GPS vorn Lat", "GPS vorn Lon"], as: east}', 'delta: "Steer sensor, left"', 'ground_speed: "Radar speed"',
                     'u1: {from: ["rpm left", "rpm right"], as: mean, radius: 0.3}', "Radar speed [km/h]"):
            self.expect(line in proposal, "a proposal for a sprayer", f"no {line} in {proposal}")
        proposed = self.work / "proposed.yaml"
        proposed.write_text(SPRAYER.split("signals:")[0] + proposal[proposal.index("signals:"):])
        self.run("estimate", proposed, log, "--out", self.work / "proposed")
        told = json.loads(self.run("log", log, "--json").stdout)["topics"][0]
        self.expect({field["name"]: field.get("unit") for field in told["fields"]}.get("rpm left") == "rpm" and told["broken"] == 0, "units as JSON", f"{told}")
        counts = 'signals.inputs.u1={from: ["ticks left", "ticks right"], as: mean, counts: 81920, wraps: 65536, radius: 0.6, derivative: true}'
        for settings in ((), ("--set", counts)):
            self.run("estimate", robot, log, *settings, "--out", self.work / "sprayer")
            last = self.rows("sprayer")[-1]
            self.expect(abs(float(last["kappa"]) - 0.85) < 0.03, "slip of a sprayer", f"{last}")
            summary = json.loads((self.work / "sprayer" / "summary.json").read_text())["variants"]["sprayer"]
            self.expect(summary["held_out"]["median"] < 0.04, "accuracy of a sprayer", f"{summary['held_out']}")
        self.run("estimate", robot, log, "--set", "signals.outputs.ground_speed={from: Radar speed, sigma: Radar sigma}", "--out", self.work / "sprayer")
        measured = self.rows("sprayer", "measurements.csv")
        self.expect({row["sigma_ground_speed"] for row in measured if row["ground_speed"]} == {"0.05"}, "stated deviations", f"{measured[0]}")
        self.expect("sigma_x_gps" not in measured[0], "stated deviations", "of a sensor that states none")
        self.refused("the head of the column 'Steer sensor, left'", "estimate", robot, log, "--set", "signals.outputs.ground_speed='Steer sensor, left'", "--out", self.work / "no")

    def mistakes(self):
        robot, log = self.work / "robot.yaml", self.work / "field.csv"
        estimate = ["--out", self.work / "no"]
        for setting, text in (("signals.outputs.heading=yaw_of_compass", "no column 'yaw_of_compass'"),
                              ("signals.inputs.v={from: left rpn, unit: rpm, radius: 0.1}", "did you mean 'left rpm'"),
                              ("signals.inputs.v={from: left rpm, unit: rmp, radius: 0.1}", "did you mean 'rpm'"),
                              ("signals.inputs.v={from: left rpm, unit: rpm}", "`radius` of a wheel"),
                              ("signals.outputs.x_gps={from: state}", "found 'driving' in the column 'state'")):
            self.refused(text, "estimate", robot, log, "--set", setting, *estimate)
        self.expect(not (self.work / "no").exists(), "a refused log leaves nothing")
        cut = self.work / "cut.csv"
        cut.write_text("\n".join(log.read_text().splitlines()[:300])[:-20])
        result = self.run("estimate", robot, cut, "--hold-out", 0, "--out", self.work / "cut")
        self.expect("warning" in result.stderr and "cut.csv:300" in result.stderr, "a cut table", result.stderr)
        self.expect(len(self.rows("cut")) > 250, "what was before the cut", f"{len(self.rows('cut'))}")
        bag = self.work / "old.bag"
        bag.write_bytes(b"#ROSBAG V2.0\n")
        self.refused("rosbags-convert", "log", bag)
        self.refused("no such file", "log", self.work / "gone.mcap")
        self.refused("give the one or the other", "estimate", robot, log, "--dead-reckoning", log, "--gps", log)
        self.refused("no log", "estimate", robot, code=USAGE)
        self.refused(".csv or .mcap", "run", cli.FIGURE8, "--log", self.work / "x.bag")
        drive = self.work / "skid_steer.mcap"
        half = self.work / "half.mcap"
        half.write_bytes(drive.read_bytes()[:drive.stat().st_size // 4])
        self.expect("cut within" in self.run("log", half).stderr, "a cut bag")


def main():
    work = pathlib.Path(tempfile.mkdtemp(prefix="rhec-log-"))
    try:
        suite = Suite(Program(sys.argv[1]), work)
        suite.vehicles()
        suite.stranger()
        suite.sprayer()
        suite.mistakes()
    finally:
        shutil.rmtree(work)
    suite.tell()


if __name__ == "__main__":
    main()
