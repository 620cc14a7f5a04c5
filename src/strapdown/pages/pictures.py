"""Figures of a page as SVG files, drawn by a browser without a window: the same pictures as the buttons
of the page save."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from ..checks import DataError
from ..fileio.file_access import json_of
from ..fileio.files import make_folder, replacing, together
from ..typing import File

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
"""Names of browsers that draw without a window."""
FLAGS = (
    "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1300,900 --virtual-time-budget=120000 --dump-dom"
).split()
TIMEOUT = 300.0
"""s that a browser may take for a page."""
SCRIPT = """<script>(async () => {
  while (!document.body.dataset.drawn) await new Promise(done => setTimeout(done, 50));
  const found = [];
  for (const plot of drawnPlots()) found.push([pictureName(plot), await picture(plot, "svg").catch(() => null)]);
  const said = document.createElement("script");
  said.type = "application/json";
  said.id = "pictures";
  said.textContent = JSON.stringify(found).replace(/</g, "\\\\u003c");
  document.body.append(said);
})();</script>"""
"""Added to a copy of the page: it leaves the pictures in the document."""
FOUND = re.compile(r'<script type="application/json" id="pictures">(.*?)</script>', re.DOTALL)

_folder: ContextVar[Path | None] = ContextVar("folder of the pictures", default=None)


@contextmanager
def saving_pictures(folder: File) -> Iterator[None]:
    """Save the figures of each page that is saved inside the context into a folder, too. Raises DataError
    where no browser is found."""
    _browser()
    token = _folder.set(Path(folder))
    try:
        yield
    finally:
        _folder.reset(token)


def save_asked(html: str) -> None:
    """Save the figures of a page where `saving_pictures` asks for it. Raises DataError."""
    if (folder := _folder.get()) is not None:
        save_pictures(html, folder)


def save_pictures(html: str, folder: File) -> list[Path]:
    """Write the figures of a page of that HTML into a folder, NAME.svg by their headings, all or none;
    the paths. Raises DataError where no browser is found, or where it does not draw."""
    folder, written = Path(folder), []
    drawn = _draw_figures(html)
    make_folder(folder)
    with together():
        for name, svg in drawn:
            path, count = folder / f"{name}.svg", 1
            while path in written:
                count += 1
                path = folder / f"{name}-{count}.svg"
            with replacing(path) as part:
                part.write_text(svg, encoding="utf-8")
            written.append(path)
    return written


def _browser() -> str:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise DataError(
            f"figures: no browser draws them (none of {', '.join(BROWSERS)} is found); install Chromium, or "
            f"open the page and press SVG below a figure"
        )
    return found


def _draw_figures(html: str) -> list[tuple[str, str]]:
    """[(name, SVG)] of the figures of a page, as a browser draws them."""
    with tempfile.TemporaryDirectory(prefix="strapdown-", ignore_cleanup_errors=True) as place:
        page = Path(place, "page.html")
        page.write_text(html + SCRIPT, encoding="utf-8")
        command = [_browser(), *FLAGS, f"--user-data-dir={place}/profile", page.as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise DataError(f"figures: the browser {command[0]} does not end ({error})") from None
    found = FOUND.search(done.stdout.decode(errors="replace"))
    if found is None:
        raise DataError(
            f"figures: the browser {command[0]} did not draw the page (exit code {done.returncode}); open the "
            f"page and press SVG below a figure"
        )
    drawn: list[tuple[str, str | None]] = json_of(found[1], page)
    if lost := [name for name, svg in drawn if svg is None]:
        raise DataError(f"figures: {lost[0]} cannot be saved as a picture; leave out --figures")
    return [(name, svg) for name, svg in drawn if svg is not None]
