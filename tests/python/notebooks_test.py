"""Notebooks run from their first cell to the last, and have no results of somebody's machine in them."""
import importlib.util
import json
import re

import pytest
from shared import ROOT

NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_results(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert len(cells) > 5
    for cell in cells:
        assert cell["cell_type"] != "code" or (cell["outputs"] == [] and cell["execution_count"] is None)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(notebook, tmp_path, monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for needed in ("ipykernel", "matplotlib", "sympy"):
        pytest.importorskip(needed)
    monkeypatch.setenv("RHEC_SCENARIOS", str(ROOT / "scenarios"))
    made = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(made, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in made.cells if cell.cell_type == "code" for output in cell.outputs]
    shown = [output.data for output in outputs if output.output_type in ("execute_result", "display_data")]
    assert any("<svg" in data.get("text/html", "") for data in shown)  # a run is shown by its picture
    assert any("<progress" in data.get("text/html", "") or data.get("text/html") == "" for data in shown)  # and its bar
    assert not [output for output in outputs if output.output_type == "error"]
    text = "".join(output.text for output in outputs if output.output_type == "stream" and output.name == "stdout")
    if notebook.stem == "beside_casadi":  # both halves where CasADi is, and ours alone where it is not
        is_there = importlib.util.find_spec("casadi") is not None
        assert ("CasADi + IPOPT: Solve_Succeeded" in text) == is_there and ("CasADi is not installed" in text) != is_there
        differences = [float(each) for each in re.findall(r"objective beside gn_rti's (\S+)", text)]
        assert len(differences) == (4 if is_there else 3) and max(differences) < 1e-5
    warnings = [output.text for output in outputs if output.output_type == "stream" and output.name == "stderr" and "Warning" in output.text]
    assert not warnings  # such as the mean of nothing, which is drawn as nothing
