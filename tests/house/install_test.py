#!/usr/bin/env python3
"""The installed tree can be moved and used: install, move away, run, and build against it from outside.

    install_test.py <build directory> --source <source root> [--cxxflags <flags>] [--cmake <cmake>] [--cxx <compiler>]
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

# No variable of the developer's shell may be what makes the moved tree work.
CLEAN = {name: value for name, value in os.environ.items()
         if name not in ("LD_LIBRARY_PATH", "RHEC_PLUGIN_PATH", "CMAKE_PREFIX_PATH", "rhec_DIR", "rhec_ROOT")}

CONSUMER_CMAKE = """\
cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES CXX)
find_package(rhec REQUIRED)
add_executable(consumer main.cpp)
target_link_libraries(consumer PRIVATE rhec::core rhec::plugins rhec::sim)
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
#include "rhec/core/model.hpp"

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
    headers = sorted(str(path.relative_to(include)) for path in include.rglob("*.hpp"))
    source = work / "consumer"
    source.mkdir()
    (source / "CMakeLists.txt").write_text(CONSUMER_CMAKE)
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


def check_examples(prefix, work, arguments):
    """What the README shows, built as a reader would: a program with a robot in it, and a model as a plugin."""
    settings = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_FLAGS={arguments.cxxflags}", "-DCMAKE_BUILD_TYPE=Debug"]
    if arguments.cxx:
        settings.append(f"-DCMAKE_CXX_COMPILER={arguments.cxx}")
    for name in ("robot", "model"):
        source, build = work / "examples" / name, work / f"build-{name}"
        shutil.copytree(arguments.source / "examples" / name, source)
        run(arguments.cmake, "-S", source, "-B", build, *settings)
        run(arguments.cmake, "--build", build)
    robot, model = work / "examples" / "robot", work / "examples" / "model"
    lines = run(work / "build-robot" / "robot", robot / "robot.yaml", cwd="/").splitlines()
    expect(len(lines) > 20 and "kappa 0.7" in lines[-1], "the robot did not learn its slip:\n" + "\n".join(lines))
    rhec, out = prefix / "bin" / "rhec", work / "out"
    run(rhec, "run", model / "field.yaml", "--plugin-path", work / "build-model", "--out", out, cwd="/")
    summary = json.loads((out / "summary.json").read_text())
    expect(summary["completed"] and summary["mae"]["kappa"] < 0.05, f"the model outside does not drive: {summary['mae']}")
    run(arguments.cmake, "--install", work / "build-model")
    expect("skid_steer" in run(rhec, "plugins", cwd="/"), "the model outside is not found once it is installed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--cxx", default="")
    parser.add_argument("--cxxflags", default="")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rhec-install-") as directory:
        work = pathlib.Path(directory).resolve()
        first, moved = work / "first", work / "moved"
        run(arguments.cmake, "--install", arguments.build, "--prefix", first)
        first.rename(moved)
        check_relocatable(moved, [str(place.resolve()) for place in (arguments.build, arguments.source, first)])
        plugins = check_plugins(moved)
        headers = check_consumer(moved, work, arguments)
        check_examples(moved, work, arguments)
    print(f"install: moved, {plugins} plugins seen, {headers} headers included from outside, examples run")


if __name__ == "__main__":
    main()
