#!/usr/bin/env python3
"""`rhec completion`: what a shell completes with it: completion.py <rhec>"""
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from cli import CLEAN, ERROR, FIGURE8, FINE, ROOT, Findings, Program

# What a key makes of a line: what the shell then runs. The program is a script that keeps what it is called with.
CASES = (
    ("plugins gn_", ["plugins", "gn_rti"]),
    ("check bicycle_sl", ["check", "bicycle_slip"]),
    ("check corri", ["check", "corridor"]),
    ("check corridor --vehicle bicycle_sl", ["check", "corridor", "--vehicle", "bicycle_slip"]),
    ("check corridor --vehicle bicycle_slip --set marg", ["check", "corridor", "--vehicle", "bicycle_slip", "--set", "margin="]),
    ("check scen", ["check", "scenarios"]),
    ("run scenarios/fig", ["run", "scenarios/figure8.yaml"]),
    ("run scenarios/figure8.yaml --set spe", ["run", "scenarios/figure8.yaml", "--set", "speed="]),
    ("run scenarios/figure8.yaml --set noise.outputs.x", ["run", "scenarios/figure8.yaml", "--set", "noise.outputs.x_gps="]),
    ("run scenarios/figure8.yaml --set estimator.name=e", ["run", "scenarios/figure8.yaml", "--set", "estimator.name=ekf"]),
    ("check skid_steer --set tra", ["check", "skid_steer", "--set", "track_width="]),
    ("options estimator.mem", ["options", "estimator.memory."]),
    ("compare scenarios/figure8.yaml --solvers gn_rti,sp", ["compare", "scenarios/figure8.yaml", "--solvers", "gn_rti,sparse_sqp"]),
    ("init it --vehicle tract", ["init", "it", "--vehicle", "tractor_trailer"]),
    ("comple", ["completion"]),
    ("run --js", ["run", "--json"]),
)
# How a shell is started without anything of its user's, and with the script.
SHELLS = {
    "bash": (["bash", "--norc", "--noprofile", "-i"], "bind 'set bell-style none'; source {}"),
    "zsh": (["zsh", "-f", "-i"], "autoload -U compinit; compinit -u -D; setopt no_beep; source {}"),
    "fish": (["fish", "--no-config", "-i"], "source {}"),
}
KEEPER = """#!/bin/sh
if [ "$1" = completion ] && [ $# -gt 1 ]; then exec '{rhec}' "$@"; fi
printf '%s\\n' "$@" "" > '{called}.new' && mv '{called}.new' '{called}'
"""


class Shell:
    """A shell on a terminal of its own, at whose prompt is typed."""

    def __init__(self, name, work, rhec, script):
        self.called = work / "called"
        (work / "rhec").write_text(KEEPER.format(rhec=rhec, called=self.called))
        (work / "rhec").chmod(0o755)
        self.patience = 0.05 if name == "bash" else 0.3  # [s] bash takes what is typed while it is busy
        words, ready = SHELLS[name]
        environment = CLEAN | {"PATH": f"{work}:{CLEAN['PATH']}", "HOME": str(work), "TERM": "dumb", "XDG_CONFIG_HOME": str(work)}
        self.process, self.terminal = pty.fork()
        if not self.process:
            os.chdir(ROOT)
            os.execvpe(words[0], words, environment)
        self.told = ""
        self.type(ready.format(script) + "\n")
        self.ran("")  # it is there

    def type(self, keys):
        os.write(self.terminal, keys.encode())

    def ran(self, line):
        """The words that `rhec` is called with after `line` and the key that completes; None if it is not called."""
        self.called.unlink(missing_ok=True)
        self.type(f"rhec {line}" + ("\t" if line else ""))
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            # The return key is pressed once the shell has answered: some shells forget what is typed meanwhile.
            quiet = not select.select([self.terminal], [], [], self.patience)[0]
            if self.called.exists():
                return self.called.read_text().split("\n")[:-2]
            if quiet:
                self.type("\n")
            else:
                try:
                    self.told += os.read(self.terminal, 65536).decode(errors="replace")
                except OSError:  # the shell has ended
                    return None
        return None

    def close(self):
        os.kill(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)
        os.close(self.terminal)


def in_shell(name, work, rhec, script, findings):
    shell = Shell(name, work, rhec, script)
    try:
        for line, expected in CASES:
            found = [word.rstrip("/") for word in shell.ran(line) or []]  # zsh takes away a folder's stroke
            findings.expect(found == expected, f"{name}: {line}", f"{found}, not {expected}; the terminal: {shell.told[-400:]!r}")
    finally:
        shell.close()


def main():
    rhec, findings = Program(sys.argv[1]), Findings("completion")
    commands = re.findall(r"^  (\w+) ", rhec("--help").stdout.split("Subcommands:")[1].split("\n\n")[0], re.MULTILINE)
    findings.expect(len(commands) > 12, "--help", str(commands))
    script = rhec("completion", "bash")
    findings.expect(script.returncode == FINE, "bash", script.stderr)
    for command in commands:
        words = re.search(rf"^ +{command}\) words='(.*)' ;;$", script.stdout, re.MULTILINE)
        options = set(re.findall(r"^ +(?:-\w,)?(--[\w-]+)", rhec(command, "--help").stdout, re.MULTILINE))
        findings.expect(words and options and options <= set(words.group(1).split()), command, f"{words} lacks some of {options}")
    for name in SHELLS:
        script = rhec("completion", name)
        findings.expect(all(command in script.stdout for command in commands), name, script.stderr)
        if shutil.which(name) is None:
            print(f"{name} is not installed: not tried in it")
            continue
        with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
            file = pathlib.Path(work) / f"rhec.{name}"
            file.write_text(script.stdout)
            in_shell(name, pathlib.Path(work), rhec.path, file, findings)
    # What a key, a value and a list can become, without a shell.
    for line, files, expected in (
            (["rhec", "plugins", "wal"], "yaml", ["walk"]),
            (["rhec", "run", FIGURE8, "--set", "estimator.solver.mod"], "none", ["estimator.solver.mode="]),
            (["rhec", "run", "nothing.yaml", "--set", "noise.outputs"], "none", ["noise.outputs."]),
            (["rhec", "run", FIGURE8, "--set", "noise.adapt="], "none", ["noise.adapt=false", "noise.adapt=true"]),
            (["rhec", "run", FIGURE8, "--set", "model=skid_steer", "--set", "noise.states.x"], "none", ["noise.states.x="]),
            (["rhec", "solve", "problems.jsonl", "--solver", "gn_rti", "--set", "mod"], "none", ["mode="]),
            (["rhec", "run", "--plugin-path", "/nowhere", "--out", ""], "folders", []),
            (["rhec", "run", FIGURE8, "--set", "no_such_key="], "none", []),
            (["rhec", "nonsense", ""], "none", []), (["rhec"], "none", [])):
        found = rhec("completion", "--line", "--", *line)
        findings.expect(found.returncode == FINE and not found.stderr and found.stdout.splitlines() == [files, *expected],
                        " ".join(map(str, line)), found.stdout + found.stderr)
    wrong = rhec("completion", "bsh")
    findings.expect(wrong.returncode == ERROR and "did you mean 'bash'?" in wrong.stderr, "bsh", wrong.stderr)
    wrong = rhec("completion", "bash", "zsh")
    findings.expect(wrong.returncode == ERROR and "expected one shell" in wrong.stderr, "two shells", wrong.stderr)
    findings.tell()


if __name__ == "__main__":
    main()
