#!/usr/bin/env python3
"""Every simulated scenario drives: vehicles.py <rhec>

For each file of scenarios/ that has a path, with two seeds: the end of the path is reached, no number in steps.csv is
missing, no solve fell back, the vehicle tracks its path better than the same one does that believes in no slip, and it learns
each parameter to well within the distance of the truth from that belief.
"""
import csv
import json
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "cli"))
import cli  # noqa: E402
from cli import FINE, NOT_SOLVED, Program, assignments  # noqa: E402

SEEDS = (1, 2)


def parameters_of(rhec, model):
    plugins = json.loads(rhec("plugins", model, "--json").stdout)
    return {entry["name"]: entry["nominal"] for plugin in plugins if plugin["kind"] == "model"
            for entry in plugin["parameters"]}


def summary_of(rhec, scenario, settings, folder, findings, fine=(FINE,)):
    result = rhec("run", str(scenario), "--out", str(folder), *assignments(*settings))
    if not findings.expect(result.returncode in fine, scenario.name, f"{settings}: {result.returncode}: {result.stderr}"):
        return None
    with open(folder / "steps.csv", newline="") as file:
        for number, row in enumerate(csv.DictReader(file), 2):
            missing = [name for name, value in row.items() if value in ("", "nan") and name not in ("nees", "faults", "findings")]
            if not findings.expect(not missing, f"{scenario.name}: steps.csv:{number}", f"no {missing}"):
                break
    return json.loads((folder / "summary.json").read_text())


def main():
    rhec, findings = Program(sys.argv[1]), cli.Findings("vehicles")
    scenarios = [path for path in sorted((cli.ROOT / "scenarios").glob("*.yaml")) if "\npath:" in path.read_text()]
    findings.expect(len(scenarios) >= 2, "scenarios", f"{len(scenarios)} with a path")
    with tempfile.TemporaryDirectory(prefix="rhec-vehicles-") as work:
        for scenario in scenarios:
            model = next(line.split("name:")[1].split()[0] for line in scenario.read_text().split("\nmodel:")[1].splitlines()
                         if "name:" in line)
            nominal = parameters_of(rhec, model)
            believes = ["bounds={" + ", ".join(f"{name}: [{value}, {value}]" for name, value in nominal.items()) + "}",
                        "estimator.initial.parameters={" + ", ".join(f"{name}: {value}" for name, value in nominal.items())
                        + "}",
                        "estimator.health.watch=false"]  # which would find that it is wrong
            for seed in SEEDS:
                folder = pathlib.Path(work) / f"{scenario.stem}-{seed}"
                own = summary_of(rhec, scenario, [f"seed={seed}"], folder, findings)
                # It may end beside its path.
                other = summary_of(rhec, scenario, [f"seed={seed}", *believes], folder, findings, fine=(FINE, NOT_SOLVED))
                if not own or not other:
                    continue
                place = f"{scenario.name}, seed {seed}"
                findings.expect(own["completed"] and own["fallbacks"] == 0, place, f"{own['ended']}; {own['fallbacks']} fallbacks")
                findings.expect(own["mae"]["tracking"] < other["mae"]["tracking"], place,
                                f"tracks to {own['mae']['tracking']:.3g} m, without learning to {other['mae']['tracking']:.3g}")
                for name in nominal:
                    findings.expect(own["mae"][name] < 0.6 * other["mae"][name], place,
                                    f"{name} is off by {own['mae'][name]:.3g}, the nominal value by {other['mae'][name]:.3g}")
    findings.tell()


if __name__ == "__main__":
    main()
