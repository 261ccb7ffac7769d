#!/usr/bin/env python3
"""`rhec options` of a section, of a key and of a word that is neither: options.py <rhec>"""
import json
import sys

from cli import ERROR, FINE, Findings, Program


def main():
    rhec, findings = Program(sys.argv[1]), Findings("options")
    section = rhec("options", "estimator")
    findings.expect(section.stdout.startswith("## estimator\n") and "`estimator.horizon`" in section.stdout, "estimator", section.stderr)
    for word, expected in (("estimator.horizon", ["`estimator.horizon`"]), ("speed", ["`speed`"]), ("horizon", ["`estimator.horizon`", "`controller.horizon`"])):
        found = rhec("options", word)
        rows = [line.split(" | ")[0][2:] for line in found.stdout.splitlines() if line.startswith("| `")]
        findings.expect(found.returncode == FINE and set(expected) <= set(rows) and len(rows) < 6, word, found.stdout + found.stderr)
    for word, expected in (("estimater", "did you mean 'estimator'?"), ("estimator.horizn", "did you mean 'estimator.horizon'?"),
                           ("xyzzy", "expected a key or one of the sections"), ("gnrti", "did you mean 'gn_rti'?")):
        wrong = rhec("options", word)
        findings.expect(wrong.returncode == ERROR and expected in wrong.stderr, word, wrong.stderr)
    for word, expected in (("bicycle", "did you mean 'bicycle_slip'?"), ("gnrti", "did you mean 'gn_rti'?")):
        wrong = rhec("plugins", word)
        findings.expect(wrong.returncode == ERROR and expected in wrong.stderr, f"plugins {word}", wrong.stderr)
    plugin = rhec("options", "corridor")
    findings.expect(plugin.returncode == FINE and plugin.stdout.startswith("## term `corridor`\n") and "| `margin` |" in plugin.stdout, "a plugin", plugin.stdout)
    plugin = json.loads(rhec("options", "ipopt", "--json").stdout)
    findings.expect(len(plugin) == 1 and plugin[0]["kind"] == "solver" and plugin[0]["options"], "a plugin, --json", str(plugin))
    key = json.loads(rhec("options", "estimator.horizon", "--json").stdout)
    findings.expect(len(key) == 1 and key[0]["section"] == "estimator" and [row["name"] for row in key[0]["keys"]] == ["horizon"], "--json", str(key))
    everything = json.loads(rhec("options", "--json").stdout)
    findings.expect({"model", "noise", "path", "log"} <= {each["section"] for each in everything["sections"]}, "--json of all")
    findings.expect(any(each["name"] == "gn_rti" and each["options"] for each in everything["plugins"]), "--json of all: plugins")
    findings.tell()


if __name__ == "__main__":
    main()
