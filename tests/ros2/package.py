#!/usr/bin/env python3
"""The package of ros2/: package.py <rhec> <folder for colcon> <cmake>

Its manifest is one of REP 149 (catkin_pkg reads it), colcon builds it with ament_cmake against this build of rhec, what it installs
starts the node, and CMake configures it with rhec's sources, too. The launch file is run with stand-ins for `launch` and
`launch_ros`, which are not to be had here. Without colcon (PyPI) or ament_cmake (Debian: ament-cmake) what needs them is skipped (77).
"""
import importlib.machinery
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import types

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "cli"))
import cli  # noqa: E402
import ros  # noqa: E402

PACKAGE = ROOT / "ros2"
PACKAGES = ("colcon-core==0.21.3", "colcon-cmake==0.2.30", "colcon-ros==0.5.0", "catkin-pkg==1.1.1")
SKIPPED = 77
DEBIANS_PYTHON = "/usr/bin/python3"  # which has ament_package


def module_of(path, name):
    loader = importlib.machinery.SourceFileLoader(name, str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


def arguments_of_ros(findings):
    node = module_of(PACKAGE / "scripts" / "node.in", "node")
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as parameters:
        parameters.write("/**:\n  ros__parameters: {use_sim_time: true, ros: {command: {steer: false}}, origin: [1, 2]}\n")
        parameters.flush()
        for words, expected in (
                (["robot.yaml", "--once"], ["robot.yaml", "--once"]),
                (["robot.yaml", "--ros-args"], ["robot.yaml"]),
                (["robot.yaml", "--ros-args", "-r", "__node:=slip", "-r", "__ns:=/"], ["robot.yaml", "--set", "ros.node=slip"]),
                (["r", "--ros-args", "-r", "cmd_vel:=base/cmd", "--", "--once"], ["r", "--once", "--set", "ros.names.command=/base/cmd"]),
                (["r", "--ros-args", "-p", "use_sim_time:=true", "-p", "speed:=0.5", "--log-level", "info"],
                 ["r", "--set", "ros.use_sim_time=true", "--set", "speed=0.5"]),
                (["r", "--ros-args", "--params-file", parameters.name],
                 ["r", "--set", "ros.use_sim_time=true", "--set", "ros.command.steer=false", "--set", "origin=[1, 2]"])):
            findings.expect(node.translated(words) == expected, f"arguments {words}", node.translated(words))
    for words, part in ((["-r", "__ns:=/robot1"], "no namespace"), (["-r", "/scan:=/x"], "no topic of ros.names"), (["-r", "a"], "FROM:=TO"),
                        (["-p", "a"], "NAME:=VALUE"), (["--enclave", "/x"], "no such argument"), (["--param"], "a value"),
                        (["--params-file", "/nowhere.yaml"], "/nowhere.yaml")):
        try:
            node.translated(["r", "--ros-args", *words])
            findings.expect(False, f"{words} is refused")
        except node.Refused as refusal:
            findings.expect(part in str(refusal), f"{words} is refused", refusal)
    # The topics are those that the program has.
    table = (ROOT / "apps" / "ros" / "ros_options.hpp").read_text()
    names = dict(re.findall(r'(\w+) = "(/[^"]+)"', table[table.index("struct NameOptions"):table.index("struct FrameOptions")]))
    findings.expect({topic: name for name, topic in names.items()} == node.TOPICS, "topics of ros.names", f"{names} {node.TOPICS}")


def launch_file(findings):
    """Run with stand-ins that keep what they are given."""
    class Given:
        def __init__(self, *values, **options):
            self.values, self.options = values, options

    stand_ins = {"launch": ["LaunchDescription"], "launch.actions": ["DeclareLaunchArgument"], "launch.conditions": ["IfCondition"],
                 "launch.substitutions": ["LaunchConfiguration"], "launch_ros": [], "launch_ros.actions": ["Node"]}
    for name, classes in stand_ins.items():
        module = sys.modules[name] = types.ModuleType(name)
        for each in classes:
            setattr(module, each, type(each, (Given,), {}))
    description = module_of(PACKAGE / "launch" / "rhec.launch.py", "rhec_launch").generate_launch_description()
    actions = description.values[0]
    declared = {action.values[0] for action in actions if type(action).__name__ == "DeclareLaunchArgument"}
    nodes = [action for action in actions if type(action).__name__ == "Node"]
    findings.expect(declared == {"file", "interface", "use_sim_time", "simulate"}, "arguments of the launch file", declared)
    findings.expect(len(nodes) == 2 and all(node.options["package"] == "rhec_ros" and node.options["executable"] == "node" for node in nodes),
                    "nodes of the launch file", nodes)
    used = {each.values[0] for node in nodes for each in node.options["arguments"] if isinstance(each, Given)}
    findings.expect(used <= declared and "--simulate" in nodes[1].options["arguments"], "what nodes are told", used)


def python_with_colcon(folder):
    python = folder / "venv" / "bin" / "python"
    if (folder / "done").exists():
        return python
    folder.mkdir(parents=True, exist_ok=True)
    for command in ([sys.executable, "-m", "venv", folder / "venv"], [python, "-m", "pip", "install", "--quiet", *PACKAGES]):
        result = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=400)
        if result.returncode:
            print(f"skipped: {' '.join(map(str, command))}: {(result.stderr or result.stdout).strip().splitlines()[-1:]}")
            return None
    (folder / "done").write_text("")
    return python


def run(findings, what, *words, **options):
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=300, **options)
    findings.expect(result.returncode == 0, what, f"{result.returncode}: {(result.stdout + result.stderr)[-3000:]}")
    return result.stdout + result.stderr


def manifest(findings, python):
    text = run(findings, "the manifest", python, "-c", "import catkin_pkg.package as p, sys\n"
               "m = p.parse_package(sys.argv[1]); m.validate()\nprint(m.name, m.version, m.get_build_type(), m.package_format)", PACKAGE)
    version = re.search(r"project\(rhec VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
    findings.expect(text.split() == ["rhec_ros", version, "ament_cmake", "3"], "what the manifest says", text)


def linked(work):
    """The package as a link in a workspace, as docs/live.md has it."""
    link = work / "src" / "rhec_ros"
    if not link.is_symlink():
        link.parent.mkdir(parents=True)
        link.symlink_to(PACKAGE)
    return link


def build(findings, rhec, python, work):
    """As in a workspace; `ros2 run` looks for lib/<package>/<executable>."""
    environment = dict(cli.CLEAN, PATH=f"{python.parent}:{os.environ['PATH']}")
    text = run(findings, "colcon build", python.parent / "colcon", "--log-base", work / "log", "build", "--paths", linked(work), "--build-base", work / "build",
               "--install-base", work / "install", "--event-handlers", "console_direct+", "--cmake-args", f"-DRHEC_PROGRAM={rhec.path}", f"-DPython3_EXECUTABLE={DEBIANS_PYTHON}",
               env=environment)
    findings.expect(f"uses {rhec.path}" in text, "an installed rhec is used", text)
    prefix = work / "install" / "rhec_ros"
    if findings.failures:
        return
    for place in ("share/rhec_ros/launch/rhec.launch.py", "share/rhec_ros/package.xml", "share/ament_index/resource_index/packages/rhec_ros"):
        findings.expect((prefix / place).exists(), f"{place} is installed")
    with ros.Domain() as domain:
        result = subprocess.run([prefix / "lib/rhec_ros/node", ros.ROBOT, "--seconds", "0.3", "--ros-args", "-r", "__node:=slip", "-p", "use_sim_time:=true"],
                                capture_output=True, text=True, timeout=60, env=domain.environment)
    findings.expect(result.returncode == cli.FINE and "node slip in domain" in result.stdout and "waits for the time on /clock" in result.stdout,
                    "the node that colcon has installed", f"{result.returncode}: {result.stdout} {result.stderr}")


def configure_with_sources(findings, cmake, work):
    """Without an installed rhec: its sources become part of the package."""
    text = run(findings, "configured with the sources", cmake, "-S", linked(work), "-B", work / "sources", "-DRHEC_PROGRAM=", f"-DPython3_EXECUTABLE={DEBIANS_PYTHON}", "-DRHEC_MODEL_INSTRUCTION_SETS=generic",
               "-DCMAKE_INSTALL_PREFIX=" + str(work / "prefix"), env=cli.CLEAN)
    findings.expect("builds rhec from the sources" in text, "rhec's sources", text)
    targets = run(findings, "what would be built", cmake, "--build", work / "sources", "--target", "help", env=cli.CLEAN)
    findings.expect("ros_node" in targets and "rhec_cli" in targets, "the node is among what would be built", targets[-2000:])


def main():
    rhec, folder, cmake = cli.Program(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
    findings, is_skipped = cli.Findings("ros2"), []
    arguments_of_ros(findings)
    launch_file(findings)
    python = python_with_colcon(folder)
    if python is None:
        is_skipped.append("colcon")
    else:
        manifest(findings, python)
    if not ros.node_of(rhec).exists():
        is_skipped.append("the node, which this build does not have")
    elif not pathlib.Path("/usr/share/ament_cmake/cmake").is_dir():
        is_skipped.append("ament_cmake (Debian: apt-get install ament-cmake)")
    elif python is not None:
        work = folder / "work"
        shutil.rmtree(work, ignore_errors=True)
        build(findings, rhec, python, work)
        configure_with_sources(findings, cmake, work)
        shutil.rmtree(work, ignore_errors=True)
    if is_skipped and not findings.failures:
        print("skipped: " + ", ".join(is_skipped))
        sys.exit(SKIPPED)
    findings.tell()


if __name__ == "__main__":
    main()
