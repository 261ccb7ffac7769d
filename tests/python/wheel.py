#!/usr/bin/env python3
"""`pip install .` works: wheel.py <source root> <where rhec is> <folder of the environment> <folder to work in>

Makes the source package, a wheel of it against an rhec that is built or installed, installs that into an environment of its own, and
drives a robot with it. Exits with 77, and says why, where PyPI cannot be reached.
"""
import os
import pathlib
import shutil
import subprocess
import sys

import run

BUILDERS = ["scikit-build-core>=0.10", "pybind11>=2.12", "numpy>=2", "build"]
DRIVE = """
import numpy, rhec
print(rhec.__file__, numpy.__version__)
run = rhec.run({"path": {"laps": 1}, "speed": 10})
assert run.completed, run.ended
view = run.problems
robot = rhec.Robot({"model": "bicycle_slip"})
estimator = robot.make_estimator()
estimator.push_measurement(0.0, [1.0, 2.0, 0.1])
assert estimator.estimate(0.0).covariance.shape == (6, 6)
"""


def call(*words, **options):
    words = [str(word) for word in words]
    result = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options)
    if result.returncode:
        sys.exit(f"wheel: '{' '.join(words)}' ended with {result.returncode}:\n{result.stdout}")
    return result.stdout


def main():
    source, prefix, environment, work = (pathlib.Path(word).resolve() for word in sys.argv[1:])
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    python = run.make_environment(environment, BUILDERS)
    clean = {name: value for name, value in os.environ.items() if name not in ("RHEC_PLUGIN_PATH", "PYTHONPATH")}
    clean["CMAKE_PREFIX_PATH"] = str(prefix)
    call(python, "-m", "build", "--no-isolation", "--sdist", "--outdir", work, source, env=clean)
    package, = work.glob("rhec-*.tar.gz")
    call(python, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--wheel-dir", work, package, env=clean)
    wheel, = work.glob("rhec-*.whl")
    call(python, "-m", "pip", "install", "--no-deps", "--target", work / "site", wheel, env=clean)
    told = call(python, "-c", DRIVE, env=clean | {"PYTHONPATH": str(work / "site")}, cwd=work)
    if str(work / "site") not in told:
        sys.exit(f"wheel: another package was imported: {told}")
    print(f"wheel: {package.name} has {package.stat().st_size} bytes, {wheel.name} drives a robot: {told.strip()}")


if __name__ == "__main__":
    main()
