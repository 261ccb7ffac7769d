#!/usr/bin/env python3
"""A build tree that is configured anew without a part loses what that part had made: cmake/RhecStale.cmake, in a project of
two modules.

    stale.py <source root> [--cmake <cmake>] [--cxx <compiler>]
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

PROJECT = """\
cmake_minimum_required(VERSION 3.25)
project(parts LANGUAGES CXX)
option(OPTIONAL_PART "" ON)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/lib")
add_library(kept MODULE part.cpp)
add_subdirectory(below)
include("@SOURCE@/cmake/RhecStale.cmake")
rhec_remove_stale_modules()
"""
BELOW = """\
if(OPTIONAL_PART)
  add_library(optional MODULE ../part.cpp)
  set_target_properties(optional PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/lib/below")
endif()
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--cxx", default="c++")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rhec-stale-") as name:
        root = pathlib.Path(name)
        build = root / "build"
        (root / "below").mkdir()
        (root / "CMakeLists.txt").write_text(PROJECT.replace("@SOURCE@", str(arguments.source)))
        (root / "below" / "CMakeLists.txt").write_text(BELOW)
        (root / "part.cpp").write_text("int part() { return 1; }\n")

        def run(*words):
            result = subprocess.run([arguments.cmake, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                    check=False)
            if result.returncode:
                sys.exit(f"stale: '{' '.join(map(str, words))}' failed:\n{result.stdout}")
            return result.stdout

        def made():
            return {str(file.relative_to(build)) for file in (build / "lib").rglob("*.so")}

        one = {"lib/libkept.so", "lib/someone_elses.so"}  # what was not made here stays
        both = one | {"lib/below/optional.so"}
        run("-S", root, "-B", build, f"-DCMAKE_CXX_COMPILER={arguments.cxx}")
        run("--build", build)
        (build / "lib" / "someone_elses.so").write_text("not made here")
        steps = [("built", made(), both), ("configured again", (run("-S", root, "-B", build), made())[1], both)]
        told = run("-S", root, "-B", build, "-DOPTIONAL_PART=OFF")
        steps.append(("configured without the part", made(), one))
        run("-S", root, "-B", build, "-DOPTIONAL_PART=ON")
        run("--build", build)
        steps.append(("configured and built with it again", made(), both))
    failures = [f"{what}: there are {sorted(found)}, expected {sorted(expected)}" for what, found, expected in steps if found != expected]
    if "optional.so, which is no longer built" not in told:
        failures.append(f"nothing is said of what is removed:\n{told}")
    print("\n".join(failures) or f"stale: {len(steps)} configurations have what they build")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
