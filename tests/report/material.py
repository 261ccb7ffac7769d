"""What reports are made of in these tests: a run, an estimation of a drive made here, a sweep, a comparison, a fault campaign, all short."""
import importlib.util
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
KINDS = ("run", "log", "sweep", "comparison", "faults")
SWEEP = """\
name: small
scenario: {scenario}
set: {{path.laps: 1, path.radius: 12}}
grid:
  - blocking.kappa: [{{name: structured}}]
    blocking.kappa.size: [1, 2, 5]
    blocking.kappa.overlap: [0, 4]
    speed: [6, 8, 10]
    seed: {{from: 1, to: 2}}
  - blocking.kappa: [{{name: full_horizon}}]
    speed: [6, 8, 10]
    seed: {{from: 1, to: 2}}
"""


def call(*command, fine=(0,), **options):
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if result.returncode not in fine:
        sys.exit(f"'{' '.join(map(str, command))}' ended with {result.returncode}:\n{result.stdout}{result.stderr}")
    return result.stdout


def drive(folder):
    """The drive that the test of `rhec smooth` makes: a circle with an outage of the receiver."""
    spec = importlib.util.spec_from_file_location("smooth", ROOT / "tests" / "cli" / "smooth.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.drive(folder)


def make(kind, rhec, folder):
    """The source of a report of this kind."""
    figure8 = ROOT / "scenarios" / "figure8.yaml"
    if kind == "run":
        call(rhec, "run", figure8, "--set", "speed=8", "--set", "path.laps=1", "--set", "blocking.kappa={name: structured, size: 5, overlap: 4}",
             "--out", folder / "run")
        return folder / "run"
    if kind == "log":
        drive(folder)
        call(rhec, "estimate", folder / "circle.yaml", "--dead-reckoning", folder / "drs.txt", "--gps", folder / "gps.txt", "--hold-out", "5",
             "--out", folder / "log")
        return folder / "log"
    if kind == "sweep":
        (folder / "sweep.yaml").write_text(SWEEP.format(scenario=figure8))
        call(rhec, "sweep", folder / "sweep.yaml", "--out", folder / "runs.sqlite")
        return folder / "runs.sqlite"
    if kind == "faults":
        call(ROOT / "scripts" / "fault-campaign", pathlib.Path(rhec).parents[1], "--kinds", "spike 100 m", "no position, 10 samples", "moved for good, 10 m",
             "--vehicles", "bicycle_slip", "--steps", "1000", "--loop-seeds", "0", "--out", folder / "faults")
        return folder / "faults"
    call(rhec, "compare", figure8, "--solvers", "gn_rti:mode=converge,sparse_sqp", "--seeds", "2", "--every", "20", "--set", "speed=10",
         "--set", "path.laps=1", "--set", "path.radius=12", "--out", folder / "compare", fine=(0, 3))
    return folder / "compare" / "compare.json"


def document_of(page):
    text = page.read_text(encoding="utf-8")
    start = text.index('id="document">') + len('id="document">')
    return json.loads(text[start:text.index("</script>", start)])
