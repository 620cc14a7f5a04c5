"""The notebooks of the tutorials: without stored outputs, with links that lead somewhere, and executed
by this very Python."""

import json
import re
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "tutorials"
NOTEBOOKS = [FOLDER / "first-recording.ipynb", FOLDER / "which-filter.ipynb"]
KERNEL = "this-python"


def ids(path):
    return path.stem


@pytest.mark.short
def test_all_notebooks_are_known():
    assert sorted(FOLDER.parent.rglob("*.ipynb")) == NOTEBOOKS


@pytest.mark.short
@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_a_notebook_is_stored_without_outputs_and_its_links_lead_somewhere(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code and all(not cell["outputs"] and cell["execution_count"] is None for cell in code)
    said = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    links = re.findall(r"\]\(([^)#]+)", said)
    assert links and [link for link in links if not (path.parent / link).exists()] == []


@pytest.mark.deep
@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_a_notebook_runs_and_every_cell_of_a_figure_shows_one(path, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs nbclient and ipykernel")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    spec = tmp_path / "kernels" / KERNEL / "kernel.json"
    spec.parent.mkdir(parents=True)
    argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    spec.write_text(json.dumps({"argv": argv, "display_name": KERNEL, "language": "python"}))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, kernel_name=KERNEL, resources=where).execute()
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        shown = [output.data for output in cell.outputs if "data" in output]
        assert not [output for output in cell.outputs if output.get("name") == "stderr"]
        if ".plot(" in cell.source and "except" not in cell.source:
            assert any("application/vnd.plotly.v1+json" in data for data in shown), cell.source
        if cell.source.splitlines()[-1] in ("recording", "solution", "comparison", "campaign"):
            assert "strapdown-card" in shown[-1]["text/html"]
