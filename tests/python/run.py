#!/usr/bin/env python3
"""Runs tests of the Python package by pytest: run.py <name> ... | run.py --environment <folder> | run.py --casadi <folder>

A name stands for <name>_test.py beside this file. With --environment all are run by a Python of its own in that folder, with
the newest packages from PyPI; it is made where it is not there. With --casadi those that compare with CasADi are run by this
Python, or where it has no CasADi by one in that folder, which has it from PyPI besides. Exits with 77, and says why, where
what a test needs is missing.
"""
import argparse
import importlib.util
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
SKIPPED, NO_TEST_RAN = 77, 5
# Names of modules, and of Debian's packages.
NEEDED = {"numpy": "python3-numpy", "pytest": "python3-pytest"}
NEWEST = ["numpy>=2", "pytest", "sympy", "casadi", "pandas", "mypy", "nbclient", "ipykernel"]


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(SKIPPED)


def make_environment(folder, packages, *more):
    """The interpreter of the environment; its last step is a file that says what is in it."""
    python, told = folder / "bin" / "python", folder / "packages.txt"
    wanted = "\n".join(packages)
    if told.is_file() and told.read_text() == wanted:
        return python
    for command in ([sys.executable, "-m", "venv", "--clear", *more, str(folder)],
                    [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages]):
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if result.returncode:
            skip(f"'{' '.join(command)}' failed, so that there is no {packages[0]} from PyPI: {result.stdout[-500:]}")
    told.write_text(wanted)
    return python


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--environment", type=pathlib.Path)
    parser.add_argument("--casadi", type=pathlib.Path)
    parser.add_argument("--preload", help="libraries that the Python of the tests loads first, with colons between them")
    arguments = parser.parse_args()
    paths = [os.environ["RHEC_PYTHON_PACKAGE"]]
    if arguments.environment:
        python, files = str(make_environment(arguments.environment.resolve(), NEWEST)), sorted(map(str, HERE.glob("*_test.py")))
    else:
        python, files = sys.executable, [str(HERE / f"{name}_test.py") for name in arguments.names]
        if arguments.casadi:
            files = [str(HERE / "casadi_test.py"), "notebooks_test.py::test_notebooks_run[beside_casadi]"]
        missing = [package for module, package in NEEDED.items() if importlib.util.find_spec(module) is None]
        if missing:
            skip(f"{' and '.join(missing)} is not installed for {sys.executable}")
        if arguments.casadi and importlib.util.find_spec("casadi") is None:
            python = str(make_environment(arguments.casadi.resolve(), ["casadi"], "--system-site-packages"))
            # Of the notebook's kernel, too, which is the system's.
            paths += map(str, arguments.casadi.resolve().glob("lib/python*/site-packages"))
    environment = {name: value for name, value in os.environ.items() if name not in ("RHEC_PLUGIN_PATH", "PYTHONPATH")}
    environment["PYTHONPATH"] = os.pathsep.join(paths)
    if arguments.preload:
        environment["LD_PRELOAD"] = arguments.preload
    # -rs: why tests were skipped.
    code = subprocess.run([python, "-B", "-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", *files], env=environment,
                          cwd=HERE, check=False).returncode
    sys.exit(SKIPPED if code == NO_TEST_RAN else code)


if __name__ == "__main__":
    main()
