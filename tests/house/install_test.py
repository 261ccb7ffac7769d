#!/usr/bin/env python3
"""The installed tree can be moved and used: install, move away, run, and build against it from outside.

    install_test.py <build directory> --source <source root> [--cxxflags <flags>] [--cmake <cmake>] [--cxx <compiler>]
                    [--instruction-sets <set>,<set>] [--python <python>]
"""
import argparse
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile

# No variable of the developer's shell may be what makes the moved tree work.
CLEAN = {name: value for name, value in os.environ.items()
         if name not in ("LD_LIBRARY_PATH", "RHEC_PLUGIN_PATH", "CMAKE_PREFIX_PATH", "rhec_DIR", "rhec_ROOT")}

# A block of docs/plugin.md that this test runs.
RUN_BLOCK = re.compile(r"<!-- run: tests/house/install_test\.py -->\n```sh\n(.*?)```\n", re.DOTALL)

CONSUMER_CMAKE = """\
cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES CXX)
find_package(rhec REQUIRED)
add_executable(consumer main.cpp)
target_link_libraries(consumer PRIVATE rhec::core rhec::plugins @ROOMS@)
rhec_add_plugin(outside SOURCES plugin.cpp)
if(NOT IS_DIRECTORY "${rhec_PLUGIN_DIRECTORY}")
  message(FATAL_ERROR "no plugin directory ${rhec_PLUGIN_DIRECTORY}")
endif()
"""
CONSUMER_MAIN = """\
#include <cstdio>

int main() {
  try {
    throw rhec::Error("reached");
  } catch (const std::exception& error) {
    std::puts(error.what());
  }
}
"""
PLUGIN = """\
#include "rhec/core/model/model.hpp"

extern "C" __attribute__((visibility("default"))) const int outside = 1;
"""


def run(*command, **options):
    command = [str(part) for part in command]
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=CLEAN, **options)
    if result.returncode:
        sys.exit(f"install: '{' '.join(command)}' ended with {result.returncode}:\n{result.stdout}")
    return result.stdout


def expect(truth, text):
    if not truth:
        sys.exit(f"install: {text}")


def is_elf(path):
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


def check_relocatable(prefix, old_places):
    """No run path and no file of the package names a place that is not relative."""
    binaries = [path for path in prefix.rglob("*") if is_elf(path)]
    expect(binaries, f"nothing that runs in {prefix}")
    for path in binaries:
        dynamic = run("readelf", "--dynamic", "--wide", path)
        for entry in re.findall(r"\((?:RUNPATH|RPATH)\).*\[(.*)\]", dynamic):
            for part in entry.split(":"):
                expect(part.startswith("$ORIGIN"), f"{path.relative_to(prefix)} looks for libraries in '{part}'")
        for line in run("ldd", path).splitlines():
            match = re.match(r"\s*(librhec_\S+) => (\S+)", line)
            expect(not match or match.group(2).startswith(str(prefix)), f"{path.relative_to(prefix)}: {line.strip()}")
    for path in prefix.rglob("*.cmake"):
        text = path.read_text()
        for place in old_places:
            expect(place not in text, f"{path.relative_to(prefix)} names {place}")


def check_plugins(prefix):
    """Each plugin that was installed has its line in `rhec plugins`, seen from any directory."""
    modules = sorted(prefix.glob("lib*/**/rhec/plugins/*.so"))
    expect(modules, "no plugin was installed")
    text = run(prefix / "bin" / "rhec", "plugins", cwd="/")
    lines = [re.findall(r"[\w.-]+", line) for line in text.splitlines()]
    for module in modules:
        stem = module.stem
        expect(any(stem in line or any(word.endswith(f"{stem}.so") for word in line) or
                   any(f"{a}_{b}" == stem for a in line for b in line) for line in lines),
               f"'rhec plugins' says nothing of {stem}:\n{text}")
    return len(modules)


def check_consumer(prefix, work, arguments):
    """A project of someone else finds the package, includes every public header, links, runs, and builds a plugin."""
    include = next(path.parent for path in prefix.glob("include/rhec"))
    rooms = sorted({path.parts[-2] for path in include.glob("rhec/sim/*/*.hpp")})
    expect(rooms, "no header of a room of sim was installed")
    headers = sorted(str(path.relative_to(include)) for path in include.rglob("*.hpp"))
    source = work / "consumer"
    source.mkdir()
    (source / "CMakeLists.txt").write_text(CONSUMER_CMAKE.replace("@ROOMS@", " ".join(f"rhec::sim_{room}" for room in rooms)))
    (source / "main.cpp").write_text("".join(f'#include "{header}"\n' for header in headers) + CONSUMER_MAIN)
    (source / "plugin.cpp").write_text(PLUGIN)
    settings = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_FLAGS={arguments.cxxflags}", "-DCMAKE_BUILD_TYPE=Debug"]
    if arguments.cxx:
        settings.append(f"-DCMAKE_CXX_COMPILER={arguments.cxx}")
    run(arguments.cmake, "-S", source, "-B", work / "build", *settings)
    run(arguments.cmake, "--build", work / "build")
    expect("reached" in run(work / "build" / "consumer", cwd="/"), "the consumer did not say what it should")
    expect((work / "build" / "outside.so").is_file(), "rhec_add_plugin built no outside.so")
    return len(headers)


def build_example(name, prefix, work, arguments):
    """A folder of examples/, copied and built as a reader would; the copy and its build."""
    settings = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_FLAGS={arguments.cxxflags}", "-DCMAKE_BUILD_TYPE=Debug"]
    if arguments.cxx:
        settings.append(f"-DCMAKE_CXX_COMPILER={arguments.cxx}")
    source, build = work / name, work / f"build-{name}"
    shutil.copytree(arguments.source / "examples" / name, source)
    run(arguments.cmake, "-S", source, "-B", build, *settings)
    run(arguments.cmake, "--build", build)
    return source, build


def check_robot(prefix, work, arguments):
    """The program of docs/in_a_vehicle.md with a robot in it."""
    source, build = build_example("robot", prefix, work, arguments)
    lines = run(build / "robot", source / "robot.yaml", cwd="/").splitlines()
    expect(len(lines) > 20 and "kappa 0.7" in lines[-1], "the robot did not learn its slip:\n" + "\n".join(lines))


def check_without_exceptions(prefix, work, arguments):
    """The program of docs/embed.md, and the robot that is installed."""
    _, build = build_example("without_exceptions", prefix, work, arguments)
    installed = prefix / "share" / "rhec" / "robot"
    expect(sorted(file.name for file in installed.iterdir()) == ["CMakeLists.txt", "main.cpp", "robot.yaml"], f"{installed} is not examples/robot")
    lines = run(build / "drive", installed / "robot.yaml", cwd="/").splitlines()
    expect(len(lines) > 20 and "kappa 0.7" in lines[-1], "without exceptions the robot did not learn its slip:\n" + "\n".join(lines))
    wrong = subprocess.run([build / "drive", work / "none.yaml"], capture_output=True, text=True)
    expect(wrong.returncode == 1 and "none.yaml" in wrong.stderr, f"a mistake is told without exceptions: {wrong.stderr}")


def check_problem(prefix, work, arguments):
    """A kind of problem that rhec does not know, against the installed headers, with every solver that is installed."""
    _, build = build_example("problem", prefix, work, arguments)
    for solver in ("sparse_sqp", "ipopt", "nlopt"):
        told = run(build / "parking", solver, cwd="/")
        expect(told.startswith("solved"), f"the parking problem by {solver}: {told}")


def check_minimum_time(prefix, work, arguments):
    """A problem with limits that derives from Ocp itself: both solvers for it find a manoeuvre, and it is drawn."""
    _, build = build_example("minimum_time", prefix, work, arguments)
    for solver in ("ipopt", "sparse_sqp"):
        picture = work / f"{solver}.svg"
        told = run(build / "minimum_time", solver, picture, cwd="/")
        found = re.match(r"solved .* T (\S+) s, (\d+) changes of direction, front axle (\S+) m", told)
        expect(found is not None, f"minimum time by {solver}: {told}")
        time, changes, distance = float(found[1]), int(found[2]), float(found[3])
        expect(10.0 < time < 12.0 and changes >= 2 and distance > 2.0 - 1e-3, f"minimum time by {solver}: {told}")
        expect(picture.read_text().count("<rect") > 20, f"{picture} shows no car")


def check_template(home, arguments):
    """What docs/plugin.md says of a plugin from outside, command by command, as someone whose rhec lies in ~/rhec.

    Where the page names a build of rhec itself, it is the one under test, and the vehicle is compiled for the instruction
    sets that its models have.
    """
    blocks = RUN_BLOCK.findall((arguments.source / "docs" / "plugin.md").read_text())
    expect(len(blocks) == 5, f"docs/plugin.md has {len(blocks)} blocks of commands that are run here, and not 5")
    environment = CLEAN | {"HOME": str(home), "CXXFLAGS": arguments.cxxflags,
                           "PATH": f"{pathlib.Path(arguments.cmake).parent}:{CLEAN['PATH']}",
                           "RHEC_CONFORMANCE_FOLDER": str(home / "verdicts")}
    if arguments.cxx:
        environment["CXX"] = arguments.cxx
    script = "set -euo pipefail\n" + "".join(blocks).replace("build/release", shlex.quote(str(arguments.build.resolve())))
    configure = "cmake -S my_robot -B my_robot/build -DCMAKE_PREFIX_PATH=~/rhec"
    expect(script.count(configure) == 1, f"docs/plugin.md does not say '{configure}'")
    if arguments.instruction_sets:
        script = script.replace(configure, f"{configure} -DRHEC_MODEL_INSTRUCTION_SETS={shlex.quote(arguments.instruction_sets.replace(',', ';'))}")
    result = subprocess.run(["bash", "-c", script], cwd=home, env=environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    expect(result.returncode == 0, f"docs/plugin.md, on plugins from outside, ends with {result.returncode}:\n{result.stdout}")
    expect(not arguments.source.resolve().joinpath("my_robot").exists(), "the page wrote into the source tree")
    for name in ("articulated", "geometric", "plain_sqp", "slow_zone"):
        expect(re.search(rf"^\w+ +{name} .*my_robot/build/{name}\.so$", result.stdout, re.MULTILINE),
               f"'rhec plugins' did not list {name} from where it was built:\n{result.stdout}")
    for out in ("field", "installed", "my_vehicle"):
        summary = json.loads((home / "out" / out / "summary.json").read_text())
        statuses = summary["statuses"]
        expect(summary["completed"] and summary["mae"]["kappa"] < 0.05 and summary["mae"]["tracking"] < 0.2 and
               all(list(each) == ["solved"] for each in statuses.values()),
               f"out/{out}: the loader from outside does not drive: {summary['mae']}, {statuses}")
    told = run(home / "rhec" / "bin" / "rhec", "plugins", "articulated", cwd="/")
    expect(str(home / "rhec") in told, f"the installed model is not the one that is found by name:\n{told}")


PYTHON = """\
import rhec
robot = rhec.Robot({"model": "bicycle_slip", "estimator": {"name": "ekf"}})
estimator = robot.make_estimator()
estimator.push_measurement(0.0, [1.0, 2.0, 0.1])
print(rhec.__file__, estimator.estimate(0.0).state.shape, rhec.plugins().rows)
"""


def check_python(prefix, python):
    """The package that was installed, if one was built: it finds the libraries and the plugins beside it."""
    packages = list(prefix.glob("lib/python3/dist-packages/rhec"))
    if not packages or not python:
        return
    has_numpy = subprocess.run([python, "-c", "import numpy"], capture_output=True, check=False).returncode == 0
    if not has_numpy:
        print(f"install: {python} has no numpy, so the Python package was not tried")
        return
    result = subprocess.run([python, "-B", "-c", PYTHON], env=CLEAN | {"PYTHONPATH": str(packages[0].parent)}, text=True, cwd="/",
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    expect(result.returncode == 0 and str(prefix) in result.stdout and "(4,)" in result.stdout,
           f"the installed Python package: {result.stdout}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--cxx", default="")
    parser.add_argument("--cxxflags", default="")
    parser.add_argument("--instruction-sets", default="")
    parser.add_argument("--python", default="", help="for which the Python package was built")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rhec-install-") as directory:
        work = pathlib.Path(directory).resolve()
        home = work / "home"
        home.mkdir()
        first, moved = work / "first", home / "rhec"
        run(arguments.cmake, "--install", arguments.build, "--prefix", first)
        first.rename(moved)
        check_relocatable(moved, [str(place.resolve()) for place in (arguments.build, arguments.source, first)])
        plugins = check_plugins(moved)
        check_python(moved, arguments.python)
        headers = check_consumer(moved, work, arguments)
        check_robot(moved, work, arguments)
        check_without_exceptions(moved, work, arguments)
        check_problem(moved, work, arguments)
        check_minimum_time(moved, work, arguments)
        check_template(home, arguments)
    print(f"install: moved, {plugins} plugins seen, {headers} headers included from outside, the manual's examples run")


if __name__ == "__main__":
    main()
