#!/usr/bin/env python3
"""`rhec completion`: what a shell completes with it: completion.py <rhec>"""
import re
import shutil
import subprocess
import sys
import tempfile

from cli import CLEAN, ERROR, FINE, Findings, Program

# Asks bash as it would be asked by the tab key.
ASK = """
source "$1"
COMP_WORDS=({words}) COMP_CWORD={place} COMPREPLY=()
_rhec
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def completed(script, words):
    text = ASK.format(words=" ".join(f"'{word}'" for word in words), place=len(words) - 1)
    result = subprocess.run(["bash", "-c", text, "bash", script], capture_output=True, text=True, env=CLEAN)
    return result.stdout.split(), result.stderr


def main():
    rhec, findings = Program(sys.argv[1]), Findings("completion")
    commands = re.findall(r"^  (\w+) ", rhec("--help").stdout.split("Subcommands:")[1].split("\n\n")[0], re.MULTILINE)
    findings.expect(len(commands) > 12, "--help", str(commands))
    script = rhec("completion", "bash")
    findings.expect(script.returncode == FINE, "bash", script.stderr)
    with tempfile.NamedTemporaryFile("w", suffix=".bash") as file:
        file.write(script.stdout)
        file.flush()
        found, problem = completed(file.name, ["rhec", ""])
        findings.expect(set(commands) <= set(found) and not problem, "commands", f"{found} {problem}")
        findings.expect(completed(file.name, ["rhec", "comp"])[0] == ["compare", "completion"], "a part of a command", str(completed(file.name, ["rhec", "comp"])))
        for command in commands:
            found, problem = completed(file.name, ["rhec", command, "--"])
            options = set(re.findall(r"^ +(?:-\w,)?(--[\w-]+)", rhec(command, "--help").stdout, re.MULTILINE))
            findings.expect(options and options <= set(found) and not problem, command, f"{options - set(found)} {problem}")
        findings.expect(completed(file.name, ["rhec", "run", "/et"])[0] == ["/etc"], "files")
    for shell in ("zsh", "fish"):
        script = rhec("completion", shell)
        findings.expect(all(command in script.stdout for command in commands), shell, script.stderr)
        if shutil.which(shell):
            checked = subprocess.run([shell, "-n"], input=script.stdout, capture_output=True, text=True)
            findings.expect(checked.returncode == 0, f"{shell} reads it", checked.stderr)
    wrong = rhec("completion", "bsh")
    findings.expect(wrong.returncode == ERROR and "did you mean 'bash'?" in wrong.stderr, "bsh", wrong.stderr)
    findings.tell()


if __name__ == "__main__":
    main()
