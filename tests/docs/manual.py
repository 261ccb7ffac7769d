#!/usr/bin/env python3
"""The manual is built without a warning, has every page, and refers to nothing outside of itself: manual.py <build tree>

Leaves out the pages of C++ headers and the results of notebooks, which take longest; with --whole it has them.
"""
import html.parser
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SKIPPED = 77
FETCHED = {"link": "href", "script": "src", "img": "src", "iframe": "src"}


class References(html.parser.HTMLParser):
    """What a browser fetches to show a page, where its links lead, and what can be linked to."""

    def __init__(self):
        super().__init__()
        self.fetched, self.links, self.anchors = [], [], set()

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if attributes.get("id"):
            self.anchors.add(attributes["id"])
        if tag in FETCHED and attributes.get(FETCHED[tag]) and attributes.get("rel") not in ("canonical",):
            self.fetched.append(attributes[FETCHED[tag]])
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])


def read(file):
    references = References()
    references.feed(file.read_text(encoding="utf-8"))
    return references


def complaints_of(html_folder):
    found = {file.resolve(): read(file) for file in html_folder.rglob("*.html")}
    for file, references in found.items():
        name = file.relative_to(html_folder.resolve())
        for target in references.fetched:
            if re.match(r"(https?:)?//", target):
                yield f"{name}: fetches {target}"
            elif not target.startswith(("data:", "#")) and not (file.parent / target.split("?")[0].split("#")[0]).exists():
                yield f"{name}: shows {target}, which is not there"
        for target in references.links:
            if re.match(r"[a-z]+:", target):
                continue
            path, _, anchor = target.partition("#")
            other = (file.parent / path.split("?")[0]).resolve() if path else file
            if not other.exists():
                yield f"{name}: leads to {target}, which is not there"
            elif anchor and other in found and anchor not in found[other].anchors:
                yield f"{name}: leads to {target}, which has no such place"


def main():
    build, more = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    with tempfile.TemporaryDirectory(prefix="rhec-manual-") as work:
        command = [sys.executable, ROOT / "scripts" / "docs", "--build", build, "--out", work]
        command += [] if "--whole" in more else ["--without-cpp", "--without-results"]
        result = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if result.returncode and "apt-get install" in result.stderr:
            print(result.stderr)
            sys.exit(SKIPPED)
        if result.returncode:
            sys.exit(f"manual: scripts/docs ended with {result.returncode}:\n{result.stdout}{result.stderr}")
        folder = pathlib.Path(work) / "html"
        complaints = list(complaints_of(folder))
        pages = {file.relative_to(folder).with_suffix("").as_posix() for file in folder.rglob("*.html")}
        expected = {file.relative_to(ROOT / "docs").with_suffix("").as_posix() for file in (ROOT / "docs").rglob("*.md")}
        expected |= {file.relative_to(ROOT).with_suffix("").as_posix() for file in (ROOT / "models").rglob("README.md")}
        expected |= {f"notebooks/{file.stem}" for file in (ROOT / "examples" / "notebooks").glob("*.ipynb")}
        complaints += [f"{page} is no page of the manual" for page in sorted(expected - pages)]
        index = (folder / "searchindex.js").read_text(encoding="utf-8")
        complaints += [f"a search does not find '{word}'" for word in ("completion", "tractor", "docnames") if word not in index]
    for complaint in complaints:
        print(complaint)
    print(f"manual: {len(pages)} pages, {len(complaints)} complaints")
    sys.exit(1 if complaints or len(pages) < 40 else 0)


if __name__ == "__main__":
    main()
