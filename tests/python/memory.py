#!/usr/bin/env python3
"""What Python does with objects of C++ under valgrind: nothing of ours reads or writes memory that is not its own.

The tests of lifetimes, but for those that are about time. Errors of the loader and of Python itself, in which no code of ours
takes part, do not count. Exits with 77 where there is no valgrind.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import run

HERE = pathlib.Path(__file__).resolve().parent
SLOW = "several_threads or others_go_on or other_threads"
ERROR = re.compile(r"^==\d+== (Invalid|Use of uninit|Conditional jump|Mismatched|Source and destination|Process terminating)")
LINE = re.compile(r"^==\d+== ?(.*)$")


def errors_in(text):
    """Blocks of lines that tell an error."""
    block, blocks = None, []
    for line in text.splitlines():
        if ERROR.match(line):
            block = []
            blocks.append(block)
        if block is not None:
            told = LINE.match(line)
            if told and told[1].strip():
                block.append(told[1])
            else:
                block = None
    return ["\n".join(block) for block in blocks]


def of_ours(error):
    return "rhec" in error or "Process terminating" in error


PLANTED = """\
==7== Invalid read of size 8
==7==    at 0x1: strncmp (strcmp.S:162)
==7==    by 0x2: is_dst (dl-load.c:216)
==7==
==7== Invalid read of size 8
==7==    at 0x1: rhec::python::view(double const*) (arrays.cpp:30)
==7==  Address 0x5 is 0 bytes after a block of size 9 free'd
==7==
"""


def main():
    told = errors_in(PLANTED)
    assert len(told) == 2 and [of_ours(error) for error in told] == [False, True], told
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        run.skip("valgrind is not installed")
    environment = {name: value for name, value in os.environ.items() if name not in ("RHEC_PLUGIN_PATH", "PYTHONPATH")}
    environment |= {"PYTHONPATH": os.environ["RHEC_PYTHON_PACKAGE"], "PYTHONMALLOC": "malloc"}
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "valgrind.log"
        command = [valgrind, "--quiet", "--error-limit=no", "--num-callers=20", f"--log-file={log}", sys.executable, "-B", "-m", "pytest", "-q",
                   "-p", "no:cacheprovider", str(HERE / "lifetimes_test.py"), "-k", f"not ({SLOW})"]
        code = subprocess.run(command, env=environment, cwd=HERE, check=False).returncode
        errors = [error for error in errors_in(log.read_text(errors="replace")) if of_ours(error)]
    for error in errors:
        print(error, end="\n\n")
    print(f"memory: {len(errors)} errors")
    sys.exit(1 if errors or code else 0)


if __name__ == "__main__":
    main()
