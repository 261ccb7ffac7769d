"""The closed loops of scenarios/faults, with the judge of stamps and measurements and without."""
import concurrent.futures
import json
import pathlib
import subprocess
import tempfile

from jobs import Failure

PATIENCE = 300  # [s]


def drive(rhec, scenario, seed, judged):
    """Mean errors of position and tracking, and whether the robot arrived; None if the run does not end."""
    with tempfile.TemporaryDirectory(prefix="rhec-faults-") as out:
        command = [rhec, "run", str(scenario), "--out", out, "--set", f"seed={seed}", "--set",
                   f"estimator.health.watch={str(judged).lower()}"]
        try:
            result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            return None
        summary = pathlib.Path(out) / "summary.json"
        if not summary.exists():
            raise Failure(f"'{' '.join(command)}' failed:\n{result.stderr}")
        found = json.loads(summary.read_text())
        return found["rmse"]["position"], found["mae"]["tracking"], found["completed"]


def cells(runs):
    ended = [run for run in runs if run]
    if not ended:
        return [f"does not end in {PATIENCE // 60} minutes", "", f"0 of {len(runs)}"]
    position, tracking = (sum(run[i] for run in ended) / len(ended) for i in range(2))
    return [f"{position:.3f}", f"{tracking:.3f}", f"{sum(run[2] for run in ended)} of {len(runs)}"]


def table(root, build, seeds, first_seed, jobs):
    rhec = str(build / "bin" / "rhec")
    scenarios = sorted((root / "scenarios" / "faults").glob("*.yaml"))
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        runs = {(scenario, judged): [pool.submit(drive, rhec, scenario, first_seed + k, judged) for k in range(seeds)]
                for scenario in scenarios for judged in (True, False)}
        lines = ["| scenario | position [m] | tracking [m] | arrives | trusting all: position [m] | tracking [m] | arrives |",
                 "|---|---|---|---|---|---|---|"]
        for scenario in scenarios:
            both = [text for judged in (True, False) for text in cells([run.result() for run in runs[scenario, judged]])]
            lines.append(f"| `{scenario.stem}` | " + " | ".join(both) + " |")
    return "\n".join(lines)
