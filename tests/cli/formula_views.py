#!/usr/bin/env python3
"""A model's formula to be looked at: rhec check --trace at a point, rhec plugins --graph and rhec check --graph.

    formula_views.py <rhec>
"""
import json
import pathlib
import sys
import tempfile
import xml.etree.ElementTree

import cli
from cli import ERROR, FIGURE8, FINE, NOT_SOLVED, USAGE, Program, assignments

BICYCLE = cli.ROOT / "examples" / "vehicles" / "bicycle.yaml"
IN_SCENARIO = assignments(f"model={{equations: {BICYCLE}}}")
# The outflow's slope is infinite where the tank is empty, and its value 0.
TANK = """
options: {hole: {default: 0.25, above: 0}}
states: {level: {unit: m, bounds: [0, null]}, v: {unit: m/s}}
inputs: {u: {unit: m/s}}
outputs: {level: {unit: m}}
equations: |
  outflow = sqrt(level)
  level' = u - hole * outflow
  v' = u / v
"""


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("formula views")
        self.rhec, self.work = rhec, work
        self.tank = work / "tank.yaml"
        self.tank.write_text(TANK, encoding="utf-8")

    def trace(self):
        result = self.rhec("check", BICYCLE, "--trace", "--at", "u1=2", "--at", "kappa=0.5")
        for part in ("speed    u1 * kappa", "all 24 nodes are finite", "d x_pos' / d beta"):
            self.expect(result.returncode == FINE and " ".join(part.split()) in " ".join(result.stdout.split()), f"trace: {part}",
                        result.stdout + result.stderr)
        result = self.rhec("check", BICYCLE, "--trace", "--json", "--at", "u1=2", "--at", "kappa=0.5", *assignments("wheelbase=4"))
        found = json.loads(result.stdout)
        values = {node["name"]: node["value"] for node in found["values"]["nodes"]}
        self.expect(found["finite"] and values["speed"] == 1.0 and values["wheelbase"] == 4.0, "values", result.stdout)

    def start_of_a_scenario(self):
        """Along the path, at the scenario's speed, with nothing slipping; each value can be another one."""
        found = json.loads(self.rhec("check", FIGURE8, *IN_SCENARIO, *assignments("speed=6"), "--trace", "--json").stdout)
        self.expect(found["at"]["u1"] == 6.0 and found["at"]["kappa"] == 1.0 and 0.0 < found["at"]["beta"] < 0.1, "the start",
                    str(found["at"]))
        result = self.rhec("check", FIGURE8, *IN_SCENARIO, "--trace", "--json", "--at", "beta=1.5")
        self.expect(json.loads(result.stdout)["at"]["beta"] == 1.5, "--at", result.stdout)

    def not_finite(self):
        result = self.rhec("check", self.tank, "--trace", "--at", "v=1", "--at", "level=0")
        for part in ("all 9 nodes are finite", "1 / outflow = inf", "the slope of a square root is infinite there",
                     "(outflow) = sqrt(level) = 0", "results that are not finite: d level' / d level", "sqrt(a + w^2)"):
            self.expect(result.returncode == NOT_SOLVED and part in result.stdout, f"a root of 0: {part}", result.stdout)
        result = self.rhec("check", self.tank, "--trace", "--at", "v=0")
        for part in ("1 / v = inf", "it divides by 0", "results that are not finite: v'", "smooth_abs(v, w)"):
            self.expect(result.returncode == NOT_SOLVED and part in result.stdout, f"a divisor of 0: {part}", result.stdout)
        found = json.loads(self.rhec("check", self.tank, "--trace", "--at", "v=1", "--at", "level=-4", "--json").stdout)
        first = found["values"]["first_not_finite"]
        self.expect(first["name"] == "outflow" and first["why"] == "the square root of a negative number, -4"
                    and first["spoiled"] == ["level'"], "a root of -4", str(first))

    def graph(self):
        drawing = self.work / "bicycle.svg"
        result = self.rhec("plugins", BICYCLE, "--graph", drawing)
        for part in ("depth 3", "of f and h: 8 *", "df/dz, z = [x; p; u]: 11 of 32 entries", "beta'  . . . x x x x ."):
            self.expect(result.returncode == FINE and part in result.stdout, f"graph: {part}", result.stdout + result.stderr)
        root = xml.etree.ElementTree.parse(drawing).getroot()
        labels = {text.text for text in root.iter("{http://www.w3.org/2000/svg}text")}
        self.expect({"speed", "wheelbase", "beta'", "tan(n17)"} <= labels, "labels", str(sorted(labels)))
        found = json.loads(self.rhec("plugins", BICYCLE, "--graph", "--json").stdout)
        self.expect(found["operations"]["f"] == 10 and found["kinds"]["tan"] == 1, "--json", str(found["operations"]))
        result = self.rhec("check", FIGURE8, *IN_SCENARIO, "--graph")
        self.expect(result.returncode == FINE and "df/dz" in result.stdout, "of a scenario", result.stderr)

    def mistakes(self):
        for words, code, expected in (
            (["check", BICYCLE, "--trace", "--at", "w=1"], ERROR, "'w' is no state, input or parameter of bicycle"),
            (["check", BICYCLE, "--trace", "--at", "kapa=1"], ERROR, "did you mean 'kappa'?"),
            (["check", BICYCLE, "--trace", "--at", "u1"], ERROR, "expected VARIABLE=NUMBER"),
            (["check", BICYCLE, "--trace", "--at", "u1=nan"], ERROR, "found 'nan', expected a finite number"),
            (["check", BICYCLE, "--at", "u1=1"], USAGE, "--trace"),
            (["plugins", "--graph", BICYCLE], ERROR, "name it before --graph"),
            (["plugins", BICYCLE, "--graph", "picture.png"], ERROR, "the name of a drawing, *.svg"),
            (["plugins", "gn_rti", "--graph"], ERROR, "gn_rti"),
        ):
            result = self.rhec(*words)
            self.expect(result.returncode == code and expected in result.stderr, " ".join(map(str, words)), result.stderr)


def main():
    with tempfile.TemporaryDirectory() as folder:
        test = Test(Program(sys.argv[1]), pathlib.Path(folder))
        test.trace()
        test.start_of_a_scenario()
        test.not_finite()
        test.graph()
        test.mistakes()
        test.tell()


if __name__ == "__main__":
    main()
