#!/usr/bin/env python3
"""`rhec ros` and a node in Rust, which has another implementation of DDS and of ROS's client library: stranger.py <rhec> <folder for its build>

The node of stranger/ (ros2-client on RustDDS) measures; rhec estimates from that, and its estimates are heard. Each finds the other's topics, and
the stranger rhec's name in the graph of ROS. Without cargo or its registry the test is skipped (77).
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "cli"))
import cli  # noqa: E402
import ros  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
SKIPPED = 77


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def stranger(folder):
    """Its program; built once, which takes a minute or two."""
    cargo = shutil.which("cargo")
    if cargo is None:
        skip("there is no cargo")
    manifest = ["--manifest-path", str(HERE / "stranger" / "Cargo.toml"), "--locked"]
    fetched = subprocess.run([cargo, "fetch", *manifest], capture_output=True, text=True, timeout=300)
    if fetched.returncode:
        skip(f"cargo cannot fetch ros2-client: {fetched.stderr.strip().splitlines()[-1:]}")
    result = subprocess.run([cargo, "build", "--offline", *manifest, "--target-dir", str(folder)], capture_output=True, text=True, timeout=900)
    if result.returncode:
        sys.exit(f"stranger: cargo build: {result.stderr}")
    return folder / "debug" / "stranger"


def main():
    rhec, findings = cli.Program(sys.argv[1]), cli.Findings("stranger")
    if not ros.node_of(rhec).exists():
        skip("this build has no node")
    program = stranger(pathlib.Path(sys.argv[2]).resolve())
    with ros.Domain() as domain:
        node = domain.start(rhec, "ros", HERE / "stranger.yaml", "--seconds", 40)
        time.sleep(1)
        result = subprocess.run([program, domain.environment["ROS_DOMAIN_ID"], "30"], capture_output=True, text=True, timeout=60,
                                env=dict(domain.environment, RUST_LOG="off"))
        node.send_signal(2)
        node_code, node_text = ros.end_of(node, 20)
    said = f"{result.returncode}: {result.stdout[-3000:]} {result.stderr[-1000:]}"
    findings.expect(result.returncode == 0, "the stranger found and heard everything", f"{said}\n{node_text}")
    findings.expect("node /rhec\n" in result.stdout, "rhec's name is in the graph", said)
    for topic, kind in (("rt/rhec/odometry", "nav_msgs::msg::dds_::Odometry_"), ("rt/rhec/state", "sensor_msgs::msg::dds_::JointState_"),
                        ("rt/tf", "tf2_msgs::msg::dds_::TFMessage_"), ("rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_"),
                        ("rt/rhec/measured", "sensor_msgs::msg::dds_::JointState_")):
        findings.expect(f"topic {topic} {kind}\n" in result.stdout, f"{topic} is found", said)
    state = re.search(r'^state (\[.*\]) (\[.*\]) (\S*)$', result.stdout, re.MULTILINE)
    findings.expect(state is not None and state.group(1) == '["x", "y", "psi"]' and state.group(3) == "base_link", "what is estimated, by name", said)
    used = re.search(r"/rhec/measured +(\d+) +0 ", node_text)
    findings.expect(node_code == cli.FINE and used is not None and int(used.group(1)) >= 10, "what the stranger measured is used", f"{node_code}: {node_text}")
    findings.tell()


if __name__ == "__main__":
    main()
