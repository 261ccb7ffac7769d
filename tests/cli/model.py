#!/usr/bin/env python3
"""rhec model: a summary, a plugin's folder in C++, and what a stranger does wrong in a vehicle's file: each mistake is told
with its place, what was found or expected, and what to do.

    model.py <rhec>
"""
import pathlib
import re
import shutil
import sys
import tempfile

import cli
from cli import ERROR, FINE, USAGE, Program, assignments

VEHICLES = cli.ROOT / "examples" / "vehicles"
BICYCLE = VEHICLES / "bicycle.yaml"
DEEP = 100000
# What is replaced in the bicycle's file, by what, where the mistake is told (of the line with the replacement, and that many
# lines on), and a part of the message.
EQUATION = "delta' = u2"
MISTAKES = [
    ("mu * delta", "mu * detla", 0, "'detla' is not known; did you mean 'delta'?"),
    ("speed / wheelbase", "speed / L", 0, "'L' is not known; expected a state, an input, a parameter, an option"),
    (EQUATION, "delta' = u2 * t", 0, "equations do not depend on time"),
    (EQUATION, "delta' = nan", 0, "expected a finite number"),
    (EQUATION, "delta' = 1e400", 0, "found '1e400', which is no number in range"),
    (EQUATION, "delta' = u2 / (1 - 1)", 0, "this divides by 0"),
    (EQUATION, "delta' = u2 * sqrt(-1)", 0, "whatever the values: it is undefined"),
    (EQUATION, "delta' = min(u2, 1)", 0, "use smooth_min(a, b, width)"),
    (EQUATION, "delta' = max(u2, 1)", 0, "use smooth_max(a, b, width)"),
    (EQUATION, "delta' = abs(u2)", 0, "use smooth_abs(x, width)"),
    (EQUATION, "delta' = u2 if u1 else 0", 0, "there are no cases"),
    (EQUATION, "delta' = fmod(u2, 2 * pi)", 0, "angles never wrap in equations; give the variable 'angle: true'"),
    ("heading = beta", "heading = atan2(sin(beta), cos(beta))", 0, "this wraps an angle"),
    (EQUATION, "delta = u2", 0, "expected an equation for the derivative of a state (delta' = ..., if it is one)"),
    (EQUATION, "u1 = u2", 0, "the value of 'u1' is given"),
    (EQUATION, "u2' = 3", 0, "'u2' is no state; states are x_pos"),
    (EQUATION, "delta'' = u2", 0, "a second derivative is the first one of another state"),
    (EQUATION, "delta' = u2\n  speed = 3", 1, "there is an equation for 'speed' in line"),
    (EQUATION, "a = b\n  b = a\n  delta' = u2", 1, "needs itself: a -> b -> a"),
    (EQUATION, "delta' = " + DEEP * "(" + "u2" + DEEP * ")", 0, "nested deeper than 100 levels; give its parts names"),
    (EQUATION, "delta' = u2" + "".join(f" + sin({k} * u2)" for k in range(20000)), None, "expected at most 10000"),
    ("tan(mu * delta)", "tan(mu * delta", 0, "is not closed"),
    ("tan(mu * delta)", "tan(mu * delta))", 0, "there is no '(' for it"),
    ("mu * delta", "\u03bc * delta", 0, "found '\u03bc', which means nothing here; names have the letters a to z"),
    ("kappa * u1", "kappa \u00b7 u1", 0, "a product is written with '*'"),
    ("kappa * u1", "kappa u1", 0, "a product is written with '*'"),
    ("kappa * u1", "kappa * u1;", 0, "an equation ends with its line"),
    ("equations: |", "equations: >", 0, "write 'equations: |', with one equation on each line below it"),
    ("  mu: {", "  u1: {", None, "'u1' is a variable or an option already; choose another name"),
    ("  mu: {", "  x_pos: {}\n  x_pos: {", 1, "the key is written twice"),
    ("  mu: {", "  sin: {", 0, "'sin' is a function or a constant; choose another name"),
    ("  mu: {", "  \u00b5: {", 0, "is no name; expected letters, digits and underscores"),
    ("  mu: {", "\tmu: {", 0, "indent with blanks, not with tabs"),
    ("  delta: {unit: rad, typical: 0.3, bounds", " delta: {unit: rad, typical: 0.3, bounds", 0, "as far from the left as the keys"),
    ("role: heading, meaning: heading}", "role: heading, meaning: heading", 1, "a '{' is not closed"),
    ("beta: {unit: rad,", "beta: {unit rad,", 0, "no option 'unit rad'"),
    ("default: 1.4", "default: .nan", 0, "found '.nan', expected a finite number"),
    ("default: 1.4", "default: hypot(1, 1)", 0, "write a term that has a comma in quotes"),
    ("bounds: [0, 1], role", "bounds: [1, 0], role", 0, "expected lower <= upper"),
    ("bounds: [0, 1], role", "bounds: [0, mu], role", 0, "'mu' is not known; expected a number, pi, or an option"),
    ("role: speed_factor", "role: sped_factor", 0, "did you mean 'speed_factor'?"),
    ("typical: 5,", "typical: 0,", 0, "expected a typical magnitude, greater than 0"),
]


class Test(cli.Findings):
    def __init__(self, rhec, work):
        super().__init__("model")
        self.rhec, self.work = rhec, work

    def refused(self, title, file, expected, place=""):
        result = self.rhec("model", file)
        told = result.returncode == ERROR and expected in result.stderr and f"{file}{place}" in result.stderr
        self.expect(told and not result.stdout and self.shows_the_place(file, result.stderr), title, result.stdout + result.stderr[:400])

    @staticmethod
    def shows_the_place(file, text):
        """One line, or two more with the file's line and a caret under the place."""
        lines = text.split("\n")
        if len(lines) == 2:
            return True
        place = re.search(r":(\d+):(\d+): ", lines[0])
        if len(lines) != 4 or lines[2].strip() != "^":
            return False
        if not place:  # lines that YAML has joined are none of the file's
            return "YAML has joined lines" in lines[0]
        number, column = int(place[1]), int(place[2])
        rest, shown = file.read_text(encoding="utf-8").splitlines()[number - 1][column - 1:], lines[1][lines[2].index("^"):]
        # What is shown may end before the line does, as a value of a map, and a long line is cut.
        return rest.startswith(shown.removesuffix("...")) and shown != ""

    def mistakes(self):
        file = self.work / "wrong.yaml"
        good = BICYCLE.read_text(encoding="utf-8")
        for part, other, lines, expected in MISTAKES:
            text = good.replace(part, other, 1)
            self.expect(text != good, f"{part} is in the file")
            file.write_text(text, encoding="utf-8")
            line = text[:text.index(other)].count("\n") + 1
            self.refused(other[:60], file, expected, "" if lines is None else f":{line + lines}:")
        for title, text, expected in (("an empty file", "", "there is nothing in it; expected keys and values"),
                                      ("a list", "- a\n- b\n", "expected a vehicle: a map with the keys states"),
                                      ("a deep list", "states: " + DEEP * "[" + DEEP * "]", "it is nested too deep"),
                                      ("two vehicles", good + "---\n" + good, "remove the lines '---'")):
            file.write_text(text, encoding="utf-8")
            self.refused(title, file, expected)
        self.refused("no file", self.work / "none.yaml", "no such file")
        self.refused("a plugin", "bicycle_slip", "is no file with a vehicle's equations")
        # A long comment does no harm.
        file.write_text(good + "# " + 2000000 * "x" + "\n", encoding="utf-8")
        self.expect(self.rhec("model", file).returncode == FINE, "a long file")

    def summary(self):
        result = self.rhec("model", BICYCLE)
        for part in ("the vehicle 'bicycle' is valid", "wheelbase = 1.4", "x_pos [m]", "10 of f, 6 of h"):
            self.expect(result.returncode == FINE and part in result.stdout, f"summary: {part}", result.stdout + result.stderr)

    def folder(self):
        """A folder is written whole, and not over another one."""
        out = self.work / "plugin"
        result = self.rhec("model", BICYCLE, "--cpp", out)
        names = ["CMakeLists.txt", "README.md", "bicycle.cpp", "bicycle.hpp"]
        self.expect(result.returncode == FINE and sorted(file.name for file in out.iterdir()) == names, "--cpp", result.stderr)
        first = {file.name: file.read_text(encoding="utf-8") for file in out.iterdir()}
        self.expect("const Scalar speed = named(kappa * u1, \"speed\");" in first["bicycle.hpp"], "the header", first["bicycle.hpp"])
        (out / "bicycle.hpp").write_text("mine\n", encoding="utf-8")
        result = self.rhec("model", BICYCLE, "--cpp", out)
        self.expect(result.returncode == ERROR and "is there already; name another folder, or replace it with --force" in result.stderr,
                    "a folder that is there", result.stderr)
        self.expect((out / "bicycle.hpp").read_text(encoding="utf-8") == "mine\n", "nothing is replaced")
        result = self.rhec("model", BICYCLE, "--cpp", out, "--force")
        second = {file.name: file.read_text(encoding="utf-8") for file in out.iterdir()}
        self.expect(result.returncode == FINE and first == second, "--force: the same text", result.stderr)
        # Beside the user, under the vehicle's name.
        shutil.copy(VEHICLES / "skid_steer.yaml", self.work / "mine.yaml")
        result = self.rhec("model", "mine.yaml", "--cpp", cwd=self.work)
        self.expect(result.returncode == FINE and (self.work / "skid_steer" / "skid_steer.hpp").is_file(), "--cpp alone", result.stderr)
        # Nothing is written of a vehicle that is wrong.
        (self.work / "wrong.yaml").write_text("states: {x: {}}\n", encoding="utf-8")
        result = self.rhec("model", self.work / "wrong.yaml", "--cpp", self.work / "none")
        self.expect(result.returncode == ERROR and not (self.work / "none").exists(), "a wrong vehicle", result.stderr)
        result = self.rhec("model", BICYCLE, "--force")
        self.expect(result.returncode == USAGE and "--cpp" in result.stderr, "--force alone", result.stderr)

    def options(self):
        """An option without a default has to be told."""
        file = self.work / "needy.yaml"
        file.write_text(BICYCLE.read_text(encoding="utf-8").replace("default: 1.4, ", "", 1), encoding="utf-8")
        self.refused("an option without a default", file, "wheelbase: the vehicle has no default for it")
        result = self.rhec("model", file, *assignments("wheelbase=2"))
        self.expect(result.returncode == FINE and "wheelbase = 2" in result.stdout, "--set", result.stderr)


def main():
    with tempfile.TemporaryDirectory() as folder:
        test = Test(Program(sys.argv[1]), pathlib.Path(folder))
        test.summary()
        test.folder()
        test.options()
        test.mistakes()
        test.tell()


if __name__ == "__main__":
    main()
