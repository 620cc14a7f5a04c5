"""The notebooks of the tutorials with the outputs that a reader sees without running them:

    python docs/_site/notebooks.py

executes them by this Python and stores what their cells show, each figure as a picture too. Needs
nbclient, ipykernel and a Chromium. A digest of the code in the notebook says which code the outputs
are of."""

import hashlib
import json
import sys
import tempfile
from base64 import b64encode
from pathlib import Path
from typing import Any

import plotly
from doc_pages import DOCS, ROOT
from screenshot import browser, take_picture

FOLDER = DOCS / "tutorials"
FIGURE = "application/vnd.plotly.v1+json"
PICTURE = "image/png"
KERNEL = "this-python"
WIDTH, HEIGHT = 900, 450
"""px of a figure that has no size of its own."""
MAX_FIGURE = 100_000
"""Characters of a figure that a notebook keeps beside its picture; larger ones are drawn by running it."""
CODE = "code of the outputs"
"""Key of the digest in the metadata of a notebook."""


def notebooks() -> list[Path]:
    """All notebooks of the documentation."""
    return sorted(FOLDER.glob("*.ipynb"))


def digest(notebook: dict[str, Any]) -> str:
    """Digest of the code of a notebook."""
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return hashlib.sha256("\0".join(code).encode()).hexdigest()[:16]


def stale() -> list[str]:
    """A line for each notebook whose outputs are of other code."""
    read = {path: json.loads(path.read_text(encoding="utf-8")) for path in notebooks()}
    return [
        f"{path.relative_to(ROOT)}: its outputs are not of its code; run "
        f"`python docs/_site/notebooks.py`"
        for path, notebook in read.items()
        if notebook["metadata"].get(CODE) != digest(notebook)
    ]


def execute(path: Path, folder: Path) -> Any:
    """A notebook as it is after this Python has run it in an empty folder."""
    import nbclient
    import nbformat
    from jupyter_client.kernelspec import KernelSpec
    from jupyter_client.manager import AsyncKernelManager

    class OfThisPython(AsyncKernelManager):
        kernel_spec = KernelSpec(
            argv=[sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
            display_name=KERNEL,
            language="python",
        )

    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=300,
        kernel_manager_class=OfThisPython,
        resources={"metadata": {"path": str(folder)}},
    )
    client.execute()
    return notebook


def as_picture(figure: dict[str, Any], folder: Path) -> str:
    """A plotly figure as a PNG in base64. Raises RuntimeError where the browser draws none."""
    layout = figure.get("layout", {})
    size = int(layout.get("width") or WIDTH), int(layout.get("height") or HEIGHT)
    script = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
    page, picture = folder / "figure.html", folder / "figure.png"
    figure = figure | {"layout": layout | {"width": size[0], "height": size[1]}}
    page.write_text(
        f'<body style="margin:0"><script src="{script.as_uri()}"></script><div id="f"></div>'
        f"<script>Plotly.newPlot('f', {json.dumps(figure)}, {{staticPlot: true, displayModeBar: false}})</script>",
        encoding="utf-8",
    )
    picture.unlink(missing_ok=True)
    take_picture(page, picture, size)
    if not picture.exists():
        raise RuntimeError(
            "no Chromium drew the figure (chromium, chromium-browser, google-chrome)"
        )
    return b64encode(picture.read_bytes()).decode()


def settle(notebook: Any, folder: Path) -> None:
    """Give each figure a picture, and take out what another run would change for nothing."""
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type != "code":
            continue
        cell.outputs = [each for each in cell.outputs if not _is_empty(each)]
        for output in cell.outputs:
            data = output.get("data", {})
            if FIGURE in data:
                data[PICTURE] = as_picture(data[FIGURE], folder)
                if len(json.dumps(data[FIGURE])) > MAX_FIGURE:
                    del data[FIGURE]
    notebook.metadata[CODE] = digest(notebook)


def _is_empty(output: Any) -> bool:
    """True of what a progress bar leaves."""
    return output.get("data", {}).get("text/html") == ""


def main() -> int:
    """Execute and store all; the exit status."""
    import nbformat

    if browser() is None:
        print("no Chromium (chromium, chromium-browser or google-chrome)", file=sys.stderr)
        return 1
    for path in notebooks():
        with tempfile.TemporaryDirectory() as folder:
            notebook = execute(path, Path(folder))
            settle(notebook, Path(folder))
        nbformat.write(notebook, path)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
