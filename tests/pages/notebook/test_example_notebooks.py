"""The notebooks of the tutorials: with the outputs of their code and pictures of their figures, with
links that lead somewhere, and executed by this very Python."""

import json
import re
from base64 import b64decode

import notebooks
import pytest

FOLDER = notebooks.FOLDER
NOTEBOOKS = [FOLDER / "first-recording.ipynb", FOLDER / "which-filter.ipynb"]
MAX_BYTES = 1e6
"""Of a notebook with its outputs."""


def ids(path):
    return path.stem


def is_figure(code):
    return ".plot(" in code and "except" not in code


def text(cell):
    return "".join(cell["source"])


@pytest.mark.short
def test_all_notebooks_are_known():
    assert sorted(FOLDER.parent.rglob("*.ipynb")) == notebooks.notebooks() == NOTEBOOKS


@pytest.mark.short
@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_a_notebook_shows_its_outputs_without_running_and_its_links_lead_somewhere(path):
    assert path.stat().st_size < MAX_BYTES
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == [*range(1, len(code) + 1)]
    for cell in code:
        shown = [output["data"] for output in cell["outputs"] if "data" in output]
        assert not [output for output in cell["outputs"] if output.get("name") == "stderr"]
        if is_figure(text(cell)):
            (data,) = shown
            assert b64decode(data["image/png"]).startswith(b"\x89PNG")
            assert "text/html" not in data  # which an export would take instead of the picture
    said = "".join(text(cell) for cell in cells if cell["cell_type"] == "markdown")
    links = re.findall(r"\]\(([^)#]+)", said)
    assert links and [link for link in links if not (path.parent / link).exists()] == []


@pytest.mark.short
def test_a_notebook_whose_code_has_changed_since_is_named(tmp_path, monkeypatch):
    assert notebooks.stale() == []
    notebook = json.loads(NOTEBOOKS[0].read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    code[0]["source"] = ["recording = None"]
    changed = tmp_path / "changed.ipynb"
    changed.write_text(json.dumps(notebook), encoding="utf-8")
    monkeypatch.setattr(notebooks, "FOLDER", tmp_path)
    monkeypatch.setattr(notebooks, "ROOT", tmp_path)
    (line,) = notebooks.stale()
    assert line.startswith(
        "changed.ipynb: its outputs are not of its code; run `python docs/_site/"
    )


@pytest.mark.deep
@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_a_notebook_runs_and_gives_the_outputs_that_are_stored(path, tmp_path, monkeypatch):
    pytest.importorskip("nbclient", reason="needs nbclient and ipykernel")
    pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    stored = json.loads(path.read_text(encoding="utf-8"))
    executed = notebooks.execute(path, tmp_path)
    for cell, before in zip(executed.cells, stored["cells"], strict=True):
        if cell.cell_type != "code":
            continue
        shown = [output.data for output in cell.outputs if "data" in output]
        assert not [output for output in cell.outputs if output.get("name") == "stderr"]
        if is_figure(cell.source):
            assert any(notebooks.FIGURE in data for data in shown), cell.source
        if cell.source.splitlines()[-1] in ("recording", "solution", "comparison", "campaign"):
            assert "strapdown-card" in shown[-1]["text/html"]
            (kept,) = [output["data"] for output in before["outputs"]]
            assert shown[-1]["text/plain"] == "".join(kept["text/plain"])
