#!/usr/bin/env python3
"""What `rhec plugins --doctor` says of files that are plugins, and of many that are not.

    doctor.py <rhec> <fixtures of tests/plugins>
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import cli
from cli import CLEAN, ERROR, FINE, NOT_SOLVED, USAGE, Program

ACCEPTED, NOT_USED, REFUSED = "accepted", "not used", "refused"
# A library of the fixtures, and what is said of it: verdict, name, and words of reason (or trial) and remedy.
PLUGINS = {
    "good_too/also_toy": (ACCEPTED, "toy", ["made"]),
    "good/toy": (NOT_USED, "toy", ["good_too_also_toy.so is blocking 'toy' 2.0 too and was found first, since its file name sorts before",
                                   "remove one of the two files, or give one of the plugins another name"]),
    "throws_exception/bad": (ACCEPTED, "failing", ["failed", "blocking 'failing' failed: out of tea"]),
    "other_revision/bad": (REFUSED, "wrong", ["blocking 'wrong' implements revision 77 of the interfaces, this rhec has ",
                                              "build it again with the headers of rhec "]),
    "other_alignment/toy": (REFUSED, "toy", ["blocking 'toy' 3.0 was built with Eigen alignment 32 ", "rhec with Eigen alignment ", "-march"]),
    "other_static_alignment/toy": (REFUSED, "toy", ["blocking 'toy' 4.0 was built with Eigen alignment ", "(static 0), rhec with ",
                                                    "EIGEN_DONT_ALIGN"]),
    "other_fingerprint/bad": (REFUSED, "wrong", ["'rhec 0.0.1, gcc 4, somewhere else', rhec with 'rhec ", "build both alike"]),
    "missing_dependency/bad": (REFUSED, None, ["needs the library librhec_test_gone.so",
                                               "install the package that provides librhec_test_gone.so", "LD_LIBRARY_PATH"]),
    "undefined_symbol/bad": (REFUSED, None, ["undefined symbol: ", " defines rhec_test_gone", "link it to the library"]),
    "other_strings/toy": (REFUSED, None, ["undefined symbol: ", " defines rhec::", "build it again with the headers of rhec "]),
    "no_manifest/bad": (REFUSED, None, ["exports no data symbol rhec_plugin_manifest", "RHEC_PLUGIN"]),
    "ends_after_head/bad": (REFUSED, None, ["its manifest has 16 bytes, expected ", "build it again"]),
    "ends_before_head/bad": (REFUSED, None, ["its symbol rhec_plugin_manifest has 4 bytes, expected 16 at least", "RHEC_PLUGIN"]),
    "old_abi/bad": (REFUSED, None, ["ABI 0, this rhec reads 1: the plugin is older", "build it again"]),
    "new_abi/bad": (REFUSED, None, ["ABI 99, this rhec reads 1: the plugin is newer", "build it again"]),
    "wrong_magic/bad": (REFUSED, None, ["does not start like one of rhec", "RHEC_PLUGIN"]),
    "unknown_kind/bad": (REFUSED, "wrong", ["its kind 9 is unknown", "build it again"]),
    "null_text/bad": (REFUSED, "wrong", ["null text", "RHEC_PLUGIN"]),
    "null_factory/bad": (REFUSED, "wrong", ["lacks a function", "RHEC_PLUGIN"]),
}


class Test(cli.Findings):
    def __init__(self, rhec, fixtures, work):
        super().__init__("doctor")
        self.rhec, self.fixtures, self.work = rhec, fixtures, work
        self.expected = {}  # file name -> as in PLUGINS

    def fill(self, folder):
        """All fixtures in one folder, and files that are no library."""
        folder.mkdir()
        for source, expected in PLUGINS.items():
            name = source.replace("/", "_") + ".so"
            shutil.copy(self.fixtures / f"{source}.so", folder / name)
            self.expected[name] = expected

        def add(name, *texts):
            self.expected[name] = (REFUSED, None, list(texts))
            return folder / name

        whole = (self.fixtures / "good" / "toy.so").read_bytes()
        section_table = int.from_bytes(whole[40:48], sys.byteorder)
        for name, kept in {"byte": len(whole) - 1, "half": len(whole) // 2, "quarter": len(whole) // 4,
                           "sections": section_table + 100, "headers": 100}.items():
            add(f"cut_{name}.so", f"the file is truncated: it has {kept} bytes, expected {len(whole)} at least",
                "copy or build it again").write_bytes(whole[:kept])
        add("cut_in_header.so", "the file is truncated: it has 30 bytes, expected 64 at least").write_bytes(whole[:30])
        add("empty.so", "the file is empty", "copy or build it again").touch()
        add("text.so", "not an ELF file", "in its place").write_text("GROUP ( libm.so.6 )\n")
        add("folder.so", "it is a directory, not a library").mkdir()
        add("broken_link.so", "a symbolic link to gone.so, where nothing is").symlink_to("gone.so")
        shutil.copy(self.rhec.path, add("program.so", "a program, not a shared library", "rhec_add_plugin"))
        add("other_machine.so", "for another kind of machine (ELF machine 22, 64 bits, ", "expected ",
            "build it for this one").write_bytes(whole[:18] + (22).to_bytes(2, sys.byteorder) + whole[20:])
        (folder / "notes.txt").write_text("no candidate")

    def check(self, candidate, expected):
        name, (verdict, plugin, texts) = candidate["file"], expected
        self.expect(candidate["verdict"] == verdict, name, f"{candidate}")
        self.expect(candidate.get("name") == plugin, name, f"the plugin: {candidate.get('name')}")
        if "trial" in candidate:
            said = f"{candidate['trial']['outcome']}\n{candidate['trial']['text']}"
        else:
            self.expect(candidate.get("reason") and candidate.get("remedy"), name, f"{candidate}")
            said = f"{candidate.get('reason')}\n{candidate.get('remedy')}"
        for text in texts:
            self.expect(text in said, name, f"it does not say {text!r} but {said!r}")
        return said

    def everything(self):
        folder = self.work / "all"
        self.fill(folder)
        result = self.rhec("plugins", "--doctor", "--json", "--plugin-path", folder)
        self.expect(result.returncode == NOT_SOLVED and not result.stderr, "exit code", f"{result.returncode}: {result.stderr}")
        told = json.loads(result.stdout)
        place, installed = told["places"][0], told["places"][-1]
        self.expect((place["directory"], place["origin"], place["searched"]) == (str(folder), "--plugin-path", True), "place", f"{place}")
        self.expect(installed["origin"] == "beside the library", "installed", f"{installed['origin']}")
        candidates = {candidate["file"]: candidate for candidate in place["candidates"]}
        self.expect(sorted(candidates) == sorted(self.expected), "files", f"{sorted(candidates)}")
        said = {name: self.check(candidate, self.expected[name]) for name, candidate in candidates.items()}
        self.expect(candidates["good_toy.so"].get("used_instead") == str(folder / "good_too_also_toy.so"), "used_instead")
        everyone = [candidate for each in told["places"] for candidate in each["candidates"]]
        counts = {verdict: sum(each["verdict"] == verdict for each in everyone) for verdict in (ACCEPTED, NOT_USED, REFUSED)}
        self.expect((told["accepted"], told["not_used"], told["refused"], told["failed"])
                    == (counts[ACCEPTED], counts[NOT_USED], counts[REFUSED], 1), "counts", f"{counts}")

        text = self.rhec("plugins", "--doctor", "--plugin-path", folder)
        self.expect(text.returncode == NOT_SOLVED and not text.stderr, "text", f"{text.returncode}: {text.stderr}")
        lines = text.stdout.splitlines()
        self.expect(lines[0] == f"{folder} (--plugin-path)", "text", lines[0])
        self.expect(lines[-1] == f"{counts[ACCEPTED]} accepted, {counts[NOT_USED]} not used, {counts[REFUSED]} refused; "
                    "1 accepted plugin fails", "text", lines[-1])
        self.expect("notes.txt" not in text.stdout, "text", "a file that is no candidate is told")
        flat = re.sub(r"\n +", "\n", text.stdout)
        for name, (verdict, plugin, _) in self.expected.items():
            start = re.search(rf"^{verdict} +{re.escape(name)}(: [\w ]+ '{plugin}'.*)?$", flat, re.MULTILINE)
            self.expect(start and bool(start.group(1)) == bool(plugin), name, "its line is missing or of another kind")
            if verdict != ACCEPTED:
                reason, remedy = said[name].split("\n")
                self.expect(f"\n{reason}\nwhat to do: {remedy}\n" in flat, name, "the text lacks reason and remedy")

        plain = self.rhec("plugins", "--plugin-path", folder)
        self.expect(plain.returncode == FINE and "\nNot used:\n" in plain.stdout and str(folder / "empty.so") in plain.stdout,
                    "rhec plugins", f"{plain.returncode}: {plain.stderr}")

    def unreadable(self):
        folder = self.work / "unreadable"
        folder.mkdir()
        shutil.copy(self.fixtures / "good" / "toy.so", folder / "toy.so")
        (folder / "toy.so").chmod(0)
        # Whoever may read everything would read this, too.
        unable = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-dac_override,-dac_read_search"]
        command = unable if os.geteuid() == 0 else []
        if command and subprocess.run([*command, "true"], capture_output=True).returncode:
            print("unreadable: not tested, since this user may read everything and cannot give that up")
            return
        result = subprocess.run([*command, self.rhec.path, "plugins", "--doctor", "toy", "--plugin-path", folder],
                                capture_output=True, text=True, timeout=60 * cli.PATIENCE, env=CLEAN)
        self.expect(result.returncode == NOT_SOLVED, "unreadable", f"{result.returncode}: {result.stderr}")
        self.expect("the file cannot be read: Permission denied" in result.stdout and "chmod" in result.stdout, "unreadable",
                    result.stdout)

    def places(self):
        """Two of one name in two directories, and entries of the search path that are none."""
        good, other, file, gone = self.fixtures / "good", self.fixtures / "good_too", self.work / "file", self.work / "gone"
        file.write_text("")
        path = ":".join(map(str, [other, gone, file, "relative", good]))
        words = [self.rhec.path, "plugins", "--doctor", "--plugin-path", good]
        result = subprocess.run(words, capture_output=True, text=True, timeout=60 * cli.PATIENCE, env={**CLEAN, "RHEC_PLUGIN_PATH": path})
        self.expect(result.returncode == NOT_SOLVED, "places", f"{result.returncode}: {result.stderr}")
        lines = result.stdout.splitlines()
        for line in (f"{good} (--plugin-path)", f"{other} (RHEC_PLUGIN_PATH)",
                     f"{gone} (RHEC_PLUGIN_PATH): not searched: no such directory",
                     f"{file} (RHEC_PLUGIN_PATH): not searched: a file, not a directory",
                     f"{good} (RHEC_PLUGIN_PATH): not searched: searched already"):
            self.expect(line in lines, "places", f"{line!r} is not in {result.stdout}")
        self.expect("relative (RHEC_PLUGIN_PATH): not searched: a relative entry" in result.stdout, "places", result.stdout)
        for text in (f"shadowed: {good}/toy.so is blocking 'toy' 1.0 too and was found first, since its directory is searched before",
                     "have the other directory searched first (--plugin-path)"):
            self.expect(text in result.stdout, "places", f"{text!r} is not in {result.stdout}")
        wrong = self.rhec("plugins", "--doctor", "--plugin-path", file)
        self.expect(wrong.returncode == ERROR and f"--plugin-path {file}: found a file, not a directory" in wrong.stderr, "a file",
                    wrong.stderr)

    def well(self):
        """Nothing is wrong with what is installed; an option without a default is no failure."""
        result = self.rhec("plugins", "--doctor")
        self.expect(result.returncode == FINE and not result.stderr, "installed", f"{result.returncode}: {result.stdout}")
        self.expect(re.fullmatch(r"\d+ accepted, 0 not used, 0 refused", result.stdout.splitlines()[-1]), "installed", result.stdout)
        self.expect("4 states, 2 inputs, 2 parameters, 3 outputs" in result.stdout, "installed", result.stdout)
        pattern = self.rhec("plugins", "--doctor", "pattern")
        self.expect(pattern.returncode == FINE and "needs an option that has no default: blocking 'pattern': lengths: " in pattern.stdout
                    and pattern.stdout.endswith("\n1 accepted, 0 not used, 0 refused\n"), "pattern", pattern.stdout)
        with_good = self.rhec("plugins", "--doctor", "--plugin-path", self.fixtures / "good")
        self.expect(with_good.returncode == FINE, "a good one", f"{with_good.returncode}: {with_good.stdout}")

    def named(self):
        """One file or plugin alone: by the name of the plugin, and of the file with and without its ending."""
        folder = self.work / "all"
        for name, files in {"failing": ["throws_exception_bad.so"], "empty.so": ["empty.so"], "cut_half": ["cut_half.so"],
                            "toy": ["good_too_also_toy.so", "good_toy.so", "other_alignment_toy.so", "other_static_alignment_toy.so"],
                            }.items():
            result = self.rhec("plugins", "--doctor", name, "--json", "--plugin-path", folder)
            self.expect(result.returncode == NOT_SOLVED, name, f"{result.returncode}: {result.stderr}")
            found = [each["file"] for place in json.loads(result.stdout)["places"] for each in place["candidates"]]
            self.expect(found == files, name, f"{found}")
        result = self.rhec("plugins", "--doctor", "emty", "--plugin-path", folder)
        self.expect(result.returncode == ERROR and not result.stdout
                    and result.stderr.startswith("rhec: error: no plugin and no file is called 'emty'; did you mean 'empty'?\n"), "emty",
                    result.stderr)
        result = self.rhec("plugins", "--doctor", "one", "two")
        self.expect(result.returncode == USAGE, "two names", result.stderr)


def main():
    with tempfile.TemporaryDirectory(prefix="rhec-cli-") as work:
        test = Test(Program(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), pathlib.Path(work).resolve())
        for part in (test.everything, test.unreadable, test.places, test.well, test.named):
            part()
        test.tell()


if __name__ == "__main__":
    main()
