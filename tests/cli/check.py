#!/usr/bin/env python3
"""rhec check: its exit codes, its table and its JSON, on every model that is found, on a scenario, and on bad input.

    check.py <rhec>
"""
import json
import pathlib
import re
import sys
import tempfile

import cli
from cli import ERROR, FIGURE8, FINE, NOT_SOLVED, PAPER, USAGE, Program, assignments

CHECKS = ["description", "symmetry", "straight_motion", "integration", "derivatives", "numbers", "scaling", "observability", "time"]
CHECKS_OF_TERM = ["description", "vehicle", "rows", "derivatives", "numbers", "time"]
DRIVES = ["straight", "turn", "slalom", "standing"]
# Words, exit code, and what the one line of the error must say.
BAD = [
    (["check"], USAGE, "model is required"),
    (["check", "bicycle_slip", "--speed", "-1"], USAGE, "--speed"),
    (["check", "bicycle_slip", "--seed", "-1"], USAGE, "--seed"),
    (["check", "bicycle_slpi"], ERROR, "bicycle_slip"),
    (["check", "bicycle"], ERROR, "did you mean 'bicycle_slip'"),
    (["check", "gn_rti"], ERROR, "gn_rti"),
    (["check", "bicycle_slip", *assignments("wheelbse=1")], ERROR, "did you mean 'wheelbase'"),
    (["check", "bicycle_slip", *assignments("wheelbase=0")], ERROR, "between 0.001 and 1000"),
    (["check", "bicycle_slip", *assignments("name=bicycle_slip")], ERROR, "--set name=bicycle_slip"),
    (["check", "bicycle_slip", *assignments("outputs=[x_gsp]")], ERROR, "x_gps"),
    (["check", "none.yaml"], ERROR, "none.yaml: no such file"),
    (["check", FIGURE8, *assignments("bounds.kapa=[0, 1]")], ERROR, "did you mean 'kappa'"),
    (["check", FIGURE8, *assignments("spede=4")], ERROR, "did you mean 'speed'"),
    (["check", "bicycle_slip", "--plugin-path", "nowhere"], ERROR, "nowhere"),
    (["check", "corridr"], ERROR, "did you mean the term 'corridor'?"),
    (["check", "corridor", *assignments("lefft=3")], ERROR, "did you mean 'left'"),
    (["check", "corridor", *assignments("left=-5")], ERROR, "no room is left"),
    (["check", "corridor", *assignments("name=effort")], ERROR, "--set name=effort"),
    (["check", "corridor", "--vehicle", "bicycle_slpi"], ERROR, "did you mean 'bicycle_slip'"),
    (["check", "corridor", "--speed", "3"], ERROR, "--speed: it is for a model"),
    (["check", "corridor", "--graph"], ERROR, "--graph: it draws the formula of a model"),
    (["check", "corridor", "--trace"], ERROR, "--trace: a term is traced on one vehicle"),
    (["check", "bicycle_slip", "--vehicle", "bicycle_slip"], ERROR, "--vehicle: it is for a term"),
]


# Scenario, outputs, sigmas of biases and of scale errors; which of them are told and how, which hardly, which by no drive. What is
# right is found in docs/sensors.md, by the covariance at the end of long drives.
GPS = "x_gps, y_gps, delta"
TRAILER = "x_trailer_gps, y_trailer_gps, x_tractor_gps, y_tractor_gps, delta, articulation"
SEPARABLE = [
    ("figure8", GPS, {"delta": 0.1}, {}, {"delta_bias": " (straight, slalom)"}, [], []),
    ("figure8", GPS, {"x_gps": 1, "y_gps": 1}, {}, {}, [], ["x_gps_bias", "y_gps_bias"]),
    ("figure8", GPS + ", heading", {"heading": 0.2, "delta": 0.1}, {}, {"heading_bias": " (straight, turn, slalom)"}, [], []),
    # The bias is seen at rest, and then the scale while driving.
    ("figure8", GPS + ", ground_speed", {"ground_speed": 0.5}, {"ground_speed": 0.1},
     {"ground_speed_bias": " (standing)", "ground_speed_scale": " (by several drives together)"}, [], []),
    ("skid_steer", "x_gps, y_gps, heading, ground_speed", {"ground_speed": 0.5}, {"ground_speed": 0.1},
     {"ground_speed_bias": " (standing)", "ground_speed_scale": " (by several drives together)"}, [], []),
    # Without GPS the scale is that of slip, but for the curvature of a tangent.
    ("figure8", "delta, heading, ground_speed", {}, {"ground_speed": 0.1}, {}, ["ground_speed_scale"], []),
    ("figure8", "delta, heading, ground_speed", {"ground_speed": 0.5}, {}, {"ground_speed_bias": " (standing)"}, [], []),
    ("unicycle_traction", "heading, yaw_rate, ground_speed", {}, {"yaw_rate": 0.1, "ground_speed": 0.1}, {"yaw_rate_scale": " (turn, slalom)"}, [], ["ground_speed_scale"]),
    ("figure8", GPS, {}, {"x_gps": 0.1, "y_gps": 0.1}, {}, ["x_gps_scale", "y_gps_scale"], []),
    ("figure8", GPS + ", {x_b: x_gps}, {y_b: y_gps}", {"x_b": 1, "y_b": 1}, {}, {"x_b_bias": "", "y_b_bias": ""}, [], []),
    ("figure8", GPS + ", {x_b: x_gps}", {"x_gps": 1, "x_b": 1}, {}, {}, [], ["x_gps_bias", "x_b_bias"]),
    ("bicycle_sideslip", GPS + ", heading", {"delta": 0.1}, {}, {}, [], ["delta_bias"]),
    ("bicycle_sideslip", GPS + ", heading, yaw_rate", {"yaw_rate": 0.1}, {"delta": 0.2}, {"yaw_rate_bias": "", "delta_scale": " (slalom)"}, [], []),
    ("tractor_trailer", TRAILER, {"articulation": 0.1, "delta": 0.1}, {}, {"articulation_bias": " (straight, turn, slalom)"}, [], []),
    ("tractor_trailer", TRAILER, {"x_tractor_gps": 1, "x_trailer_gps": 1}, {}, {}, [], ["x_tractor_gps_bias", "x_trailer_gps_bias"]),
    ("skid_steer", "x_gps, y_gps, yaw_rate", {"yaw_rate": 0.1}, {"yaw_rate": 0.1}, {"yaw_rate_scale": " (slalom)"}, [], []),
]


class Test(cli.Findings):
    def __init__(self, rhec):
        super().__init__("check")
        self.rhec = rhec

    def check(self, name, *words, code=FINE, checks=CHECKS):
        """What --json says, once the table has been seen to say the same."""
        result, table = self.rhec("check", *words, "--json"), self.rhec("check", *words)
        for each in (result, table):
            self.expect(each.returncode == code and not each.stderr, name, f"exit code {each.returncode}: {each.stderr}")
        try:
            found = json.loads(result.stdout)
        except json.JSONDecodeError as problem:
            self.expect(False, name, f"--json: {problem}")
            return None
        rows = [finding for finding in found["findings"] if finding["check"] != "time"]
        for finding in rows:
            row = re.compile(rf"^{finding['check']}\s+{finding['verdict']}\s+{re.escape(finding['where'])}.*"
                             rf"{re.escape(finding['found'])}$", re.MULTILINE)
            self.expect(row.search(table.stdout), name, f"the table does not say: {finding}\n{table.stdout}")
        counts = [sum(finding["verdict"] == verdict for finding in found["findings"]) for verdict in ("fail", "warn")]
        of_what = found.get("model") or found.get("term")
        self.expect(f"{of_what}: {counts[0]} failed, {counts[1]} warnings" in table.stdout, name, table.stdout[-80:])
        worst = "fail" if counts[0] else "warn" if counts[1] else "pass"
        self.expect(found["verdict"] == worst, name, f"verdict {found['verdict']} of {counts}")
        self.expect(list(dict.fromkeys(finding["check"] for finding in found["findings"])) == checks, name, "checks")
        return found

    def every_model(self):
        plugins = json.loads(self.rhec("plugins", "--json").stdout)
        models = [plugin["name"] for plugin in plugins if plugin.get("kind") == "model"]
        self.expect("bicycle_slip" in models, "models", f"{models}")
        for model in models:
            found = self.check(model, model)
            self.expect(found["model"] == model, model, f"checks {found['model']}")
            self.expect([drive["name"] for drive in found["drives"]] == DRIVES, model, f"{found['drives']}")
            self.expect(all(times["values"]["median"] > 0 for times in found["time_ns"]), model, f"{found['time_ns']}")

    def every_term(self):
        """As they come; a term that needs options to have rows warns that it has none."""
        plugins = json.loads(self.rhec("plugins", "--json").stdout)
        terms = [plugin["name"] for plugin in plugins if plugin.get("kind") == "term"]
        models = [plugin["name"] for plugin in plugins if plugin.get("kind") == "model"]
        self.expect("corridor" in terms, "terms", f"{terms}")
        options = {"obstacles": ["most=2"], "keep_out": ["lines=[{x: 3, y: -1, direction: 0.4}]"], "effort": ["weights.u2=2", "delta=0.5"]}
        for term in terms:
            found = self.check(term, term, *assignments(*options.get(term, [])), checks=CHECKS_OF_TERM)
            self.expect(found["verdict"] == "pass" and found["term"] == term, term, f"{found}")
            suited = [each["vehicle"] for each in found["vehicles"]]
            self.expect(suited == (["bicycle_slip"] if term == "effort" else models), term, f"{suited}")
            self.expect(all(each["limits"] + each["costs"] > 0 and each["time_ns"]["jacobians"]["median"] > 0 for each in found["vehicles"]),
                        term, f"{found['vehicles']}")
        found = self.check("no rows", "obstacles", checks=CHECKS_OF_TERM)
        self.expect(found["verdict"] == "warn" and not found["vehicles"], "no rows", f"{found}")

    def term_of_equations(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "term.yaml"
            file.write_text("equations:\n  name: aside\n  meaning: stays away\n  options: {near: {default: 1, unit: m, meaning: from the line}}\n"
                            "  limits: {line: {lower: near, term: sqrt(position_y)}}\nsoft: {linear: 50}\n")
            found = self.check("term", file, "--vehicle", "bicycle_slip", code=NOT_SOLVED, checks=CHECKS_OF_TERM)
            failed = [finding for finding in found["findings"] if finding["verdict"] == "fail"]
            self.expect([finding["check"] for finding in failed] == ["numbers"], "term", f"{failed}")
            self.expect("y_pos in [" in failed[0]["where"] and "(line) = sqrt(y_pos)" in failed[0]["found"] and
                        "the square root of a negative number" in failed[0]["found"], "term", f"{failed}")
            self.expect([each["vehicle"] for each in found["vehicles"]] == ["bicycle_slip"], "term", f"{found['vehicles']}")
            trace = self.rhec("check", file, "--vehicle", "bicycle_slip", "--trace", "--at", "y_pos=-1")
            self.expect(trace.returncode == NOT_SOLVED and "first not finite: n" in trace.stdout and "sqrt(y_pos)" in trace.stdout and
                        trace.stdout.startswith("aside on bicycle_slip"), "trace", trace.stdout + trace.stderr)
            fine = self.rhec("check", file, "--vehicle", "bicycle_slip", "--trace", "--at", "y_pos=4")
            self.expect(fine.returncode == FINE and "sqrt(y_pos)  2" in fine.stdout, "trace", fine.stdout + fine.stderr)
            mended = assignments("equations.limits.line.term=sqrt(position_y^2 + 0.01)", "near=2")
            self.expect(self.check("mended", file, *mended, checks=CHECKS_OF_TERM)["verdict"] == "pass", "mended", "")

    def scenario(self):
        found = self.check("figure8", PAPER)
        self.expect(found["verdict"] == "pass", "figure8", f"{found['findings']}")
        self.expect("at 8 m/s" in found["drives"][0]["meaning"], "figure8", f"speed: {found['drives'][0]['meaning']}")
        # kappa in blocks of 2 with an overlap: more than one unknown of it; half the horizon: fewer.
        unknowns = found["drives"][0]["unknowns"]
        self.expect(unknowns > 4 + 2, "figure8", f"{unknowns} unknowns")
        shorter = self.check("shorter", PAPER, *assignments("estimator.horizon=7"))
        self.expect(shorter["drives"][0]["unknowns"] < unknowns, "estimator.horizon", f"{shorter['drives'][0]}")
        one = self.check("one block", FIGURE8, *assignments("blocking.kappa={name: full_horizon}"))
        self.expect(one["drives"][0]["unknowns"] == 4 + 2, "blocking", f"{one['drives'][0]}")
        sigma = [drive["parameter_sigma"]["kappa"] for drive in one["drives"]]
        noisy = self.check("noise", FIGURE8, *assignments("blocking.kappa={name: full_horizon}", "noise.outputs.x_gps=0.3",
                                                          "noise.outputs.y_gps=0.3"))
        louder = [drive["parameter_sigma"]["kappa"] for drive in noisy["drives"]]
        self.expect(louder[0] > 1.5 * sigma[0] and sigma[3] is None, "noise", f"{sigma} -> {louder}")
        self.check("a recorded drive's", cli.ROOT / "scenarios" / "victoria_park.yaml")

    def terms_of_a_scenario(self):
        obstacles = cli.ROOT / "scenarios" / "obstacles.yaml"
        found = self.check("obstacles", obstacles)
        # A path may leave less room than the corridor's margins.
        self.expect([term["verdict"] for term in found["terms"]] == ["warn", "pass", "pass"], "obstacles", f"{found['terms']}")
        self.expect([term["term"] for term in found["terms"]] == ["corridor", "obstacles", "lateral_acceleration"], "obstacles", f"{found['terms']}")
        self.expect(all([each["vehicle"] for each in term["vehicles"]] == ["bicycle_slip"] for term in found["terms"]), "obstacles", "vehicles")
        self.expect("TERM corridor\n" in self.rhec("check", obstacles).stdout, "obstacles", "the table has no terms")
        root = "controller.terms=[{equations: {name: mine, states: [y_pos], limits: {root: {term: sqrt(y_pos), upper: 3}}}}]"
        found = self.check("a root of what may be negative", obstacles, *assignments(root), code=NOT_SOLVED)
        self.expect(found["verdict"] != "fail" and found["terms"][0]["verdict"] == "fail", "root", f"{found['terms']}")

    def errors_of_sensors(self):
        """Biases and scale errors on every vehicle: what GPS and the start share is named, and what is seen has a sigma."""
        gyro = cli.ROOT / "scenarios" / "gyro.yaml"
        found = self.check("gyro", gyro)
        self.expect(found["verdict"] == "pass", "gyro", f"{found['findings']}")
        told = [finding["found"] for finding in found["findings"] if "yaw_rate_bias to" in finding["found"]]
        self.expect(len(told) == 1, "gyro", f"{found['findings']}")
        for vehicle, antenna, yaw, place in [("bicycle_slip", "x_gps", "yaw_rate", "x_pos"), ("skid_steer", "x_gps", "yaw_rate", "x"),
                                             ("unicycle_traction", "x_gps", "yaw_rate", "x"),
                                             ("bicycle_sideslip", "x_gps", "yaw_rate", "x"),
                                             ("tractor_trailer", "x_tractor_gps", "tractor_yaw_rate", None)]:
            scenario = "figure8" if vehicle == "bicycle_slip" else vehicle
            path = cli.ROOT / "scenarios" / f"{scenario}.yaml"
            errors = assignments("model.outputs=all", f"noise.biases={{{antenna}: {{sigma: 1}}, {yaw}: {{sigma: 0.05}}}}")
            result = self.rhec("check", path, *errors, "--json")
            findings = json.loads(result.stdout)["findings"]
            warned = {finding["where"]: finding["found"] for finding in findings
                      if finding["verdict"] == "warn" and finding["check"] == "observability"}
            seen = [finding["found"] for finding in findings if f"{yaw}_bias to" in finding["found"]]
            self.expect(len(seen) == 1, vehicle, f"{findings}")
            if place:
                self.expect(list(warned) == [f"{antenna}_bias"] and f"0.71 {place} - 0.71 {antenna}_bias" in warned[f"{antenna}_bias"],
                            vehicle, f"{warned}")
            else:  # two antennas: the other one tells this one's bias
                self.expect(not warned and f"{antenna}_bias to" in seen[0], vehicle, f"{warned} {seen}")
        both = self.rhec("check", cli.ROOT / "scenarios" / "tractor_trailer.yaml",
                         *assignments("model.outputs=all", "noise.biases={x_tractor_gps: {sigma: 1}, x_trailer_gps: {sigma: 1}}"), "--json")
        warned = {finding["where"]: finding["found"] for finding in json.loads(both.stdout)["findings"] if finding["verdict"] == "warn"}
        self.expect({"x_tractor_gps_bias", "x_trailer_gps_bias"} <= set(warned), "two antennas", f"{warned}")
        self.expect(all("x_tractor_gps_bias" in text and "x_trailer_gps_bias" in text for text in warned.values()),
                    "two antennas", f"{warned}")

    def separable(self):
        """Errors of sensors against slip and each other: what several drives tell together, what one tells, and what none does."""
        for scenario, outputs, biases, scales, told, hardly, never in SEPARABLE:
            name = f"{scenario}: biases of {biases}, scales of {scales}"
            settings = [f"model.outputs=[{outputs}]"] if outputs else []
            if biases:
                settings.append("noise.biases={%s}" % ", ".join(f"{sensor}: {{sigma: {sigma}}}" for sensor, sigma in biases.items()))
            if scales:
                settings.append("noise.scales={%s}" % ", ".join(f"{sensor}: {{sigma: {sigma}}}" for sensor, sigma in scales.items()))
            result = self.rhec("check", cli.ROOT / "scenarios" / f"{scenario}.yaml", *assignments(*settings), "--json")
            findings = [finding for finding in json.loads(result.stdout)["findings"] if finding["check"] == "observability"]
            warned = {finding["where"]: finding["found"] for finding in findings if finding["where"].endswith(("_bias", "_scale"))}
            passed = "; ".join(finding["found"] for finding in findings if finding["found"].startswith("errors of sensors"))
            self.expect({where for where, text in warned.items() if "no drive tells it" in text} == set(never), name, f"{findings}")
            self.expect({where for where, text in warned.items() if "hardly separate" in text} == set(hardly), name, f"{findings}")
            for error, how in told.items():
                self.expect(re.search(rf"{error} to [-\d.e]+{re.escape(how)}(;|$)", passed), name, f"'{error} ...{how}' in {passed}")

    def faults(self):
        found = self.check("bounds over a pole", FIGURE8, *assignments("bounds.delta=[-3, 3]"))
        warned = [finding for finding in found["findings"] if finding["verdict"] == "warn"]
        self.expect([finding["check"] for finding in warned] == ["numbers"] and "delta in [" in warned[0]["where"],
                    "bounds over a pole", f"{warned}")
        # Nothing moves a vehicle whose wheels turn in vain.
        found = self.check("no traction", cli.ROOT / "scenarios" / "unicycle_traction.yaml", *assignments("bounds.mu=[0, 0]"), code=NOT_SOLVED)
        told = next(finding for finding in found["findings"] if finding["check"] == "straight_motion")
        self.expect(told["verdict"] == "warn" and "no inputs give that speed at mu 0" in told["found"], "no traction", f"{told}")
        # The steering angle is not enough to find a vehicle by.
        found = self.check("nothing tells the slip", "bicycle_slip", *assignments("outputs=[delta]"), code=NOT_SOLVED)
        failed = [finding["where"] for finding in found["findings"] if finding["verdict"] == "fail"]
        self.expect(failed == ["parameter kappa", "parameter mu"], "nothing tells the slip", f"{failed}")

    def bad_input(self):
        for words, code, text in BAD:
            result = self.rhec(*words)
            name = " ".join(map(str, words))
            self.expect(result.returncode == code, name, f"exit code {result.returncode}: {result.stderr}")
            self.expect(not result.stdout and text in result.stderr, name, f"{result.stdout}{result.stderr}")
        with tempfile.TemporaryDirectory() as folder:
            table = pathlib.Path(folder) / "line.csv"
            table.write_text("x,y\n0,0\n9,0\n")
            result = self.rhec("check", table)
            self.expect(result.returncode == ERROR and not result.stdout and "expected a map" in result.stderr, "a table",
                        f"{result.stdout}{result.stderr}")

    def others(self):
        one, other = (self.check("seed", "bicycle_slip", "--seed", seed) for seed in (1, 2))
        errors = [found["findings"][CHECKS.index("symmetry")]["numbers"] for found in (one, other)]
        self.expect(errors[0] != errors[1], "--seed", f"{errors}")
        slow = self.check("speed", "bicycle_slip", "--speed", "0.5")
        self.expect("0.5 m/s" in slow["drives"][0]["meaning"], "--speed", slow["drives"][0]["meaning"])
        result = self.rhec("check", "--help")
        self.expect(result.returncode == FINE and "exit code is 3" in result.stdout, "--help", result.stdout)


def main():
    test = Test(Program(sys.argv[1]))
    for part in (test.every_model, test.every_term, test.term_of_equations, test.scenario, test.terms_of_a_scenario, test.errors_of_sensors, test.separable, test.faults,
                 test.bad_input, test.others):
        part()
    test.tell()


if __name__ == "__main__":
    main()
