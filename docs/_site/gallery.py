"""The pages of the gallery, made by the commands that docs/tutorials/gallery.md shows, and their
pictures where a Chromium is there."""

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from doc_pages import DOCS, ROOT
from screenshot import take_picture

from strapdown import DataError
from strapdown.io.locate import data_folder

PAGE = DOCS / "tutorials" / "gallery.md"
SECTION = re.compile(
    r"^```text(?P<data> needs-data)?\n(?P<commands>(?:strapdown .*\n)+)```\n+<!-- page: (?P<page>\S+) -->$",
    re.MULTILINE,
)
SIZE = (1280, 800)


class Shown(NamedTuple):
    """A page of the gallery: its file, and the commands that make it."""

    page: str
    commands: tuple[str, ...]
    needs_data: bool


def shown() -> list[Shown]:
    """The pages that gallery.md names, in its order."""
    return [
        Shown(m["page"], tuple(m["commands"].splitlines()), bool(m["data"]))
        for m in SECTION.finditer(PAGE.read_text(encoding="utf-8"))
    ]


def made_by(commands: tuple[str, ...]) -> str:
    """Digest of commands and of the source that runs them."""
    digest = hashlib.sha256("\n".join(commands).encode())
    for folder in (ROOT / "src", ROOT / "reproductions" / "src"):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".js", ".css", ".html", ".toml"):
                digest.update(path.read_bytes())
    return digest.hexdigest()


def make(folder: Path) -> Path:
    """All pages in `folder`, with NAME.png beside NAME.html. Those of before stay where neither
    commands nor source have changed. Raises RuntimeError where a command fails."""
    found = [each for each in shown() if not each.needs_data or _has_data()]
    stamp, kept = folder / "made-by.txt", folder / "pages"
    commands = tuple(command for each in found for command in each.commands)
    wanted = made_by(commands)
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return kept
    shutil.rmtree(folder, ignore_errors=True)
    kept.mkdir(parents=True)
    (folder / "examples").symlink_to(ROOT / "examples")
    environment = os.environ | ({"STRAPDOWN_DATA": str(_has_data())} if _has_data() else {})
    for command in commands:
        run = [sys.executable, "-m", *shlex.split(command)]
        done = subprocess.run(run, cwd=folder, env=environment, capture_output=True, text=True)
        if done.returncode:
            said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise RuntimeError(f"{PAGE.relative_to(ROOT)}: `{command}` fails: {said}")
    for each in found:
        place = kept / each.page
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / each.page, place)
        for link in linked(place.read_text(encoding="utf-8")):
            if (there := (folder / each.page).parent / link).is_file():
                shutil.copy(there, place.parent / link)
        take_picture(place, place.with_suffix(".png"), SIZE, 0.75)
    stamp.write_text(wanted, encoding="utf-8")
    return kept


def linked(html: str) -> set[str]:
    """Names of the files beside it that a page leads to."""
    return set(re.findall(r"(?:href|src)=[\"']?([\w.-]+\.(?:csv|svg|json|nc|toml))\b", html))


def _has_data() -> Path | None:
    try:
        return data_folder(__file__)
    except DataError:
        return None


def with_pictures(text: str, folder: Path) -> str:
    """gallery.md with a picture, or a line, that leads to each page that is in `folder`."""

    def instead(match: re.Match[str]) -> str:
        page = match["page"]
        if not (folder / page).exists():
            return match[0] + "\n\nNot made here: its recording is not there."
        place = f"../gallery/{page}"
        picture = Path(page).with_suffix(".png")
        shown = "Open the page"
        if (folder / picture).exists():
            alt = f"The top of the page that {match['commands'].splitlines()[-1]} makes"
            shown = f'<img src="../gallery/{picture}" alt="{alt}" loading="lazy">'
        link = f'<a class="gallery" href="{place}">{shown}</a>'
        return f"{match[0].partition('<!-- page')[0]}\n{link}"

    return SECTION.sub(instead, text)
