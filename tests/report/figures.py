#!/usr/bin/env python3
"""`rhec report --svg`: each figure of each kind is a whole SVG with its title, its labels as text and its data: figures.py <rhec>"""
import pathlib
import re
import sys
import tempfile
import xml.etree.ElementTree as xml

import material

SVG = "{http://www.w3.org/2000/svg}"
LEAST = {"run": 12, "log": 8, "sweep": 8, "comparison": 5}


def look_at(file, complaints):
    text = file.read_text(encoding="utf-8")
    try:
        root = xml.fromstring(text)
    except xml.ParseError as error:
        complaints.append(f"{file.name}: no XML: {error}")
        return
    if root.tag != f"{SVG}svg" or not root.get("viewBox"):
        complaints.append(f"{file.name}: the root is {root.tag} with the view box {root.get('viewBox')}")
    title = root.findtext(f"{SVG}title") or ""
    labels = ["".join(label.itertext()) for label in root.iter(f"{SVG}text")]
    if len(title) < 6 or title not in labels:
        complaints.append(f"{file.name}: the title '{title}' is not drawn")
    if len(labels) < 4:
        complaints.append(f"{file.name}: {len(labels)} labels")
    bad = re.search(r"NaN|undefined|null|\[object", text)
    if bad:
        complaints.append(f"{file.name}: has '{bad.group(0)}'")
    kinds = {(shape.get("fill"), shape.get("stroke")) for name in ("path", "image", "polygon", "circle") for shape in root.iter(SVG + name)}
    if len(kinds) < 4:
        complaints.append(f"{file.name}: {len(kinds)} kinds of shapes: no data")
    if re.search(r"""(?:href|src)=["'](?!data:|#)""", text):
        complaints.append(f"{file.name}: refers to another file")


def main():
    rhec, complaints, count = pathlib.Path(sys.argv[1]).resolve(), [], 0
    with tempfile.TemporaryDirectory(prefix="rhec-figures-") as name:
        for kind in material.KINDS:
            folder = pathlib.Path(name) / kind
            folder.mkdir()
            material.call(rhec, "report", material.make(kind, rhec, folder), "-o", folder / "report.html", "--svg", folder / "svg")
            files = sorted((folder / "svg").iterdir())
            if len(files) < LEAST[kind]:
                complaints.append(f"{kind}: {len(files)} figures, expected {LEAST[kind]} at least")
            for file in files:
                count += 1
                look_at(file, complaints)
    for complaint in complaints:
        print(complaint)
    print(f"figures: {count} looked at, {len(complaints)} complaints")
    sys.exit(1 if complaints or not count else 0)


if __name__ == "__main__":
    main()
