#!/usr/bin/env python3
"""A vehicle is its folder and its scenario, and nothing else: vehicles.py <source root>

No source, build file or script of the product names a vehicle, but for the one that a robot has by default, and examples
of commands. Each folder of models/ has a page that says where its equations were published and links to a scenario.
"""
import pathlib
import re
import sys

import house

DEFAULT = "bicycle_slip"
FOLDERS = ("core", "plugins/kit", "plugins/host", "plugins/yaml", "plugins/robot", "sim", "apps", "solvers", "blocking", "priors",
           "cmake")
LINK = re.compile(r"\]\((\.\./\.\./scenarios/[^)]+\.yaml)\)")


def main():
    root = pathlib.Path(sys.argv[1])
    folders = sorted(path.parent for path in (root / "models").glob("*/CMakeLists.txt"))
    vehicles = [folder.name for folder in folders]
    violations = []
    files = house.files(root, FOLDERS, house.TEXT) + [root / "CMakeLists.txt", root / "models" / "CMakeLists.txt"]
    named = re.compile(r"\b(" + "|".join(name for name in vehicles if name != DEFAULT) + r")\b")
    for file in files:
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            if found := named.search(line):
                violations.append(f"{file.relative_to(root)}:{number}: names the vehicle {found[1]}")
    for folder in folders:
        page = folder / "README.md"
        text = page.read_text(encoding="utf-8") if page.is_file() else ""
        if "\nSource" not in text:
            violations.append(f"{page.relative_to(root)}: does not say where the equations were published ('Source: ...')")
        if not any((folder / link).is_file() for link in LINK.findall(text)):
            violations.append(f"{page.relative_to(root)}: links to no scenario")
    house.tell("vehicles", violations, len(files) if len(vehicles) > 1 else 0)


if __name__ == "__main__":
    main()
