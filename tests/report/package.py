#!/usr/bin/env python3
"""What the page is built of: package.py <apps/report> <its build folder>

The lock file names contents (integrity), not hosts; what is in the page has its licence in it and beside it.
"""
import json
import pathlib
import sys


def main():
    source, build = map(pathlib.Path, sys.argv[1:])
    complaints = []
    lock_text = (source / "package-lock.json").read_text()
    lock, package = json.loads(lock_text), json.loads((source / "package.json").read_text())
    for name, entry in lock["packages"].items():
        if name and not entry.get("integrity", "").startswith("sha512-"):
            complaints.append(f"package-lock.json: {name} has no integrity")
        if "resolved" in entry:
            complaints.append(f"package-lock.json: {name} names where it came from: {entry['resolved']}")
    for name, version in {**package["dependencies"], **package["devDependencies"]}.items():
        if not version[:1].isdigit():
            complaints.append(f"package.json: {name} is '{version}', expected one exact version")
        elif lock["packages"][f"node_modules/{name}"]["version"] != version:
            complaints.append(f"package-lock.json: {name} is not {version}")
    licences, page = (build / "licences.txt").read_text(), (build / "page.html").read_text()
    for words in ("Apache License", "echarts", "zrender", "Redistribution and use in source and binary forms", "tslib"):
        for what, text in (("licences.txt", licences), ("page.html", page)):
            if words not in text:
                complaints.append(f"{what}: has no '{words}'")
    if page.count("{{document}}") != 1:
        complaints.append(f"page.html: {page.count('{{document}}')} places for the document, expected one")
    for complaint in complaints:
        print(complaint)
    print(f"package: {len(lock['packages'])} packages, {len(complaints)} complaints")
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
