#!/usr/bin/env python3
"""`rhec ros`, live, in two processes on the loopback interface: ros.py <rhec>

The commands of docs/live.md work, at the same time. A node stops the robot when it is stopped itself. Mistakes are told.
"""
import concurrent.futures
import fcntl
import json
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import cli
from cli import ERROR, FINE, NOT_SOLVED, PATIENCE, USAGE, Findings, Program, assignments

BLOCK = re.compile(r"<!-- run: tests/cli/ros.py -->\n```sh\n(.*?)```\n", re.DOTALL)
ROBOT = cli.ROOT / "examples" / "ros" / "field_robot.yaml"
# Others test at the same time: a domain is whose lock is held. Ports of domains above 101 are those that Linux hands out.
DOMAINS = range(10, 70)
# Sooner at the end than by the page.
QUICK = assignments("speed=1.5")


class Domain:
    def __enter__(self):
        for number in DOMAINS:
            self.lock = open(pathlib.Path(tempfile.gettempdir()) / f"rhec-domain-{number}", "w")
            try:
                fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                self.lock.close()
                continue
            self.environment = dict(cli.CLEAN, ROS_DOMAIN_ID=str(number))
            return self
        sys.exit("ros: no domain is free")

    def __exit__(self, *_):
        self.lock.close()

    def start(self, rhec, *words):
        return subprocess.Popen([str(rhec.path), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                env=self.environment, cwd=cli.ROOT)


def end_of(process, seconds):
    """Its exit code and what it said; killed if it does not end."""
    try:
        text, _ = process.communicate(timeout=PATIENCE * seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        text, _ = process.communicate()
        return "did not end", text
    return process.returncode, text


def report_in(text):
    """What --json prints last, after what is told on standard error."""
    start = text.find("\n{\n")
    try:
        return json.loads(text[start:])
    except ValueError:
        return {}


def number_in(pattern, text):
    found = re.search(pattern, text)
    return float(found.group(1)) if found else float("nan")


def commands_in(page):
    return [shlex.split(line, comments=True)[1:] for block in BLOCK.findall((cli.ROOT / page).read_text()) for line in block.splitlines()]


def commands_of_the_page(rhec, findings):
    commands = commands_in("docs/live.md")
    findings.expect(len(commands) == 2, "docs/live.md", f"{len(commands)} commands")
    with Domain() as domain:
        robot, node = (domain.start(rhec, *command, *QUICK) for command in commands)
        node_code, node_text = end_of(node, 120)
        robot_code, robot_text = end_of(robot, 60)
    findings.expect(node_code == FINE, "the node", f"{node_code}: {node_text}")
    findings.expect(robot_code == FINE, "the robot", f"{robot_code}: {robot_text}")
    findings.expect("the end of the path was reached" in robot_text, "the robot arrives", robot_text)
    off = number_in(r"distance from the path \[m\]: median ([\d.]+)", robot_text)
    findings.expect(off < 0.1, "the robot is on its path", f"{off} m: {robot_text}")
    steered = number_in(r"steps, (\d+) of them steered", node_text)
    heard = number_in(r"([\d]+) commands heard", robot_text)
    findings.expect(steered > 50 and heard >= 0.8 * steered, "commands arrive", f"{steered} sent, {heard} heard")
    for topic in ("/fix", "/imu", "/joint_states"):
        used = number_in(rf"{topic} +(\d+) +0 ", node_text)
        findings.expect(used > 50, f"{topic} is used", node_text)
    findings.expect("latency from the last measurement" in node_text, "latency is told", node_text)


def a_stopped_node_stops_the_robot(rhec, findings):
    with Domain() as domain:
        robot = domain.start(rhec, "ros", ROBOT, "--simulate", "--seconds", 12)
        node = domain.start(rhec, "ros", ROBOT)
        time.sleep(5)
        node.send_signal(signal.SIGINT)
        node_code, node_text = end_of(node, 20)
        robot_code, robot_text = end_of(robot, 30)
    findings.expect(node_code == FINE, "a node that is stopped ends well", f"{node_code}: {node_text}")
    findings.expect("drives" in node_text, "it had driven", node_text)
    findings.expect(robot_code == NOT_SOLVED, "the robot is not at the end", f"{robot_code}: {robot_text}")
    # It rests from then on: at 1 m/s, in 12 s, it would have come farther.
    driven = number_in(r"refused; ([\d.]+) of", robot_text)
    findings.expect(0.5 < driven < 8.0, "the robot was stopped", f"{driven} m: {robot_text}")


def silence_stops_the_robot(rhec, findings):
    with Domain() as domain:
        robot = domain.start(rhec, "ros", ROBOT, "--simulate", "--seconds", 5)
        node = domain.start(rhec, "ros", ROBOT, "--once", "--seconds", 9)
        end_of(robot, 30)
        node_code, node_text = end_of(node, 30)
    findings.expect("stopped: no measurements" in node_text, "silence is told", node_text)
    findings.expect(node_code == NOT_SOLVED, "--once without the end", f"{node_code}: {node_text}")


def two_nodes_do_not_steer_one_robot(rhec, findings):
    """Each tells that the other one commands, too; a node that is steered by hand before it drives says nothing."""
    with Domain() as domain:
        robot = domain.start(rhec, "ros", ROBOT, "--simulate", "--seconds", 5)
        nodes = [domain.start(rhec, "ros", ROBOT, "--seconds", 5, *assignments(f"ros.node=node{i}", "ros.frames.publish=false")) for i in range(2)]
        texts = [end_of(node, 30)[1] for node in nodes]
        end_of(robot, 30)
    for text in texts:
        findings.expect(text.count("another node commands on /cmd_vel, too") == 1, "two nodes that steer", text)


def who_does_not_steer(rhec, findings):
    with Domain() as domain:
        robot = domain.start(rhec, "ros", ROBOT, "--simulate", "--seconds", 4 * PATIENCE, "--json")
        node = domain.start(rhec, "ros", ROBOT, "--seconds", 4 * PATIENCE, "--json", *assignments("ros.command.steer=false"))
        _, robot_text = end_of(robot, 30)
        node_code, node_text = end_of(node, 30)
    findings.expect(node_code == FINE and "estimates, does not steer" in node_text, "a node that only estimates", node_text)
    node_report, robot_report = report_in(node_text), report_in(robot_text)
    findings.expect(robot_report.get("commands") == 0 and not robot_report.get("has_arrived", True), "nobody is steered unbidden", robot_text)
    used = {topic["topic"]: topic["used"] for topic in node_report.get("topics", [])}
    findings.expect(min(used.get(topic, 0) for topic in ("/fix", "/imu", "/joint_states")) > 10 and node_report["steered"] == 0
                    and node_report["latency_ms"]["median"] > 0, "the report as JSON", node_text)
    parts = [node_report.get(part, {}).get("median", -1) for part in ("hearing_ms", "estimate_ms", "control_ms")]
    findings.expect(all(part >= 0 for part in parts) and parts[1] > 0, "parts of the latency", node_text)
    findings.expect(node_report.get("jumps_of_time") == 0, "no jump of the time", node_text)


def mistakes(rhec, findings):
    def expect(words, code, *parts):
        result = rhec("ros", *words, cwd=cli.ROOT)
        findings.expect(result.returncode == code and all(part in result.stderr for part in parts), f"rhec ros {words}",
                        f"{result.returncode}: {result.stderr}")

    expect([ROBOT, "--interface", "nowhere0"], ERROR, "no network interface 'nowhere0'", "lo (127.0.0.1)")
    expect([ROBOT, "--ros-distro", "jazz"], ERROR, "--ros-distro", "jazzy")
    expect([ROBOT, "--domain", "233"], USAGE, "--domain")
    expect([ROBOT, *assignments("ros.comand.steer=true")], ERROR, "comand", "did you mean 'command'?")
    expect([ROBOT, *assignments("ros.trigger=/nothing")], ERROR, "ros.trigger", "/nothing")
    expect([ROBOT, *assignments("signals.outputs.heading=/box/compass:data")], ERROR, "/box/compass", "ros.types")
    expect([ROBOT, *assignments("ros.patience=0.2", "ros.lever_arms.antenna_x=gps_link.x")], ERROR, "gps_link", "/tf_static")
    expect([ROBOT, "--cpu", "1023"], ERROR, "--cpu 1023")
    expect([ROBOT, "--path", "nowhere.csv"], ERROR, "nowhere.csv")
    expect([cli.ROOT / "examples" / "robot" / "robot.yaml", "--simulate"], ERROR, "path")


def node_of(rhec):
    """The library of the node in the build tree."""
    found = sorted((rhec.path.parent.parent / "lib").glob("**/rhec/ros_node.so"))
    return found[0] if found else pathlib.Path("no ros_node.so")


def without_the_node(rhec, findings):
    """The same program, in a tree of links that has no node, a broken one, and another version's."""
    build = rhec.path.parent.parent
    node = node_of(rhec)
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder).resolve()
        (copy / "bin").mkdir()
        shutil.copy2(rhec.path, copy / "bin" / "rhec")
        inside = copy / node.parent.relative_to(build)
        inside.mkdir(parents=True)
        for library in node.parent.parent.glob("librhec_*"):
            shutil.copy2(library, inside.parent / library.name, follow_symlinks=False)
        (inside / "plugins").mkdir()
        for other in (node.parent / "plugins").iterdir():
            (inside / "plugins" / other.name).symlink_to(other)
        (inside / "examine_plugin").symlink_to(node.parent / "examine_plugin")
        program = Program(copy / "bin" / "rhec")

        def expect(what, *parts):
            result = program("ros", ROBOT, "--seconds", 0.1)
            findings.expect(result.returncode == ERROR and all(part in result.stderr for part in parts), what,
                            f"{result.returncode}: {result.stderr}")

        expect("without the node", "the node is not installed", str(inside / node.name), "the package rhec-ros")
        (inside / node.name).write_text("not a library")
        expect("a broken node", str(inside / node.name), "cannot be loaded", "rhec-ros")
        (inside / node.name).unlink()
        (inside / node.name).symlink_to(next(path for path in node.parent.parent.glob("librhec_core.so") if path.exists()))
        expect("another library for a node", "install both of one build")


def main():
    rhec, findings = Program(sys.argv[1]), Findings("ros")
    if not node_of(rhec).exists():
        missing = rhec("ros", ROBOT, "--seconds", 0.1)
        findings.expect(missing.returncode == ERROR and "rhec-ros" in missing.stderr and "cyclonedds-dev" in missing.stderr,
                        "a build without the node", missing.stderr)
        return findings.tell()
    without_the_node(rhec, findings)
    mistakes(rhec, findings)
    # They wait more than they compute, each in a domain of its own.
    drives = (commands_of_the_page, a_stopped_node_stops_the_robot, silence_stops_the_robot, two_nodes_do_not_steer_one_robot, who_does_not_steer)
    with concurrent.futures.ThreadPoolExecutor(len(drives)) as pool:
        for drive in [pool.submit(drive, rhec, findings) for drive in drives]:
            drive.result()
    findings.tell()


if __name__ == "__main__":
    main()
