#!/usr/bin/env python3
"""`rhec report --svg`: each figure of each kind is a whole SVG with its title, its labels as text and its data: figures.py <rhec>"""
import pathlib
import re
import sys
import tempfile
import xml.etree.ElementTree as xml

import material

SVG = "{http://www.w3.org/2000/svg}"
LEAST = {"run": 12, "log": 8, "sweep": 8, "comparison": 5, "faults": 5}


AXES = {"#666666", "#dddddd", "none", None}


def span(path):
    """How many pixels a path reaches, in width or height; steps that are relative count by themselves."""
    numbers = [float(number) for number in re.findall(r"-?[\d.]+(?:e-?\d+)?", path)]
    steps = [abs(float(number)) for run in re.findall(r"[lhv]([^A-Za-z]*)", path) for number in re.findall(r"-?[\d.]+", run)]
    if steps:
        return max(steps)
    return max((max(axis) - min(axis) for axis in (numbers[::2], numbers[1::2]) if axis), default=0.0)


def has_data(root):
    """Shapes that have not the colours of axes: one that is larger than those of a legend, or many, or a picture."""
    shapes = [shape for name in ("path", "polygon", "circle") for shape in root.iter(SVG + name)
              if shape.get("fill") not in AXES or shape.get("stroke") not in AXES]
    return any(span(shape.get("d") or shape.get("points") or "") > 40 for shape in shapes) or len(shapes) >= 12 or next(root.iter(f"{SVG}image"), None) is not None


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
    if not has_data(root):
        complaints.append(f"{file.name}: shows no data")
    if re.search(r"""(?:href|src)=["'](?!data:|#)""", text):
        complaints.append(f"{file.name}: refers to another file")


NAMES = """\
name: names
scenario: {scenario}
set: {{path.laps: 1, path.radius: 12, speed: 10, path.legs: 1, path.leg_length: 40}}
grid:
  - estimator.name: [ekf, truth]
    path.name: [figure8, zigzag]
"""


def labels_of(file):
    return ["".join(label.itertext()) for label in xml.parse(file).getroot().iter(f"{SVG}text")]


def marks(rhec, folder, complaints):
    """What is to be expected, and bounds that are touched, are lines of their own; between names there is no surface."""
    run, names = folder / "bounded", folder / "names"
    figure8 = material.ROOT / "scenarios" / "figure8.yaml"
    material.call(rhec, "run", figure8, "--set", "path.laps=1", "--set", "bounds.kappa=[0.6, 0.7]", "--set", "estimator.initial.parameters.kappa=0.65",
                  "--out", run, fine=(0, 3))
    material.call(rhec, "report", run, "--svg", run / "svg")
    expected = {"error-nees": {"expected"}, "parameter-kappa": {"lower bound", "upper bound"}}
    for name, words in expected.items():
        missing = words - set(labels_of(run / "svg" / f"{name}.svg"))
        if missing:
            complaints.append(f"{name}.svg: has no {missing}")
    if "upper bound" in labels_of(run / "svg" / "state-beta.svg"):
        complaints.append("state-beta.svg: a bound that does not exist is drawn")
    (folder / "names.yaml").write_text(NAMES.format(scenario=figure8))
    material.call(rhec, "sweep", folder / "names.yaml", "--out", names.with_suffix(".sqlite"), fine=(0, 3))
    material.call(rhec, "report", names.with_suffix(".sqlite"), "--svg", names)
    drawn = {file.stem for file in names.iterdir()}
    if [name for name in drawn if "surface" in name] or not [name for name in drawn if name.startswith("heat")]:
        complaints.append(f"a sweep over names: {sorted(drawn)}")


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
    with tempfile.TemporaryDirectory(prefix="rhec-figures-") as name:
        marks(rhec, pathlib.Path(name), complaints)
    for complaint in complaints:
        print(complaint)
    print(f"figures: {count} looked at, {len(complaints)} complaints")
    sys.exit(1 if complaints or not count else 0)


if __name__ == "__main__":
    main()
