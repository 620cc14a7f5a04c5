"""Which pages the documentation has, and which page leads to which: the lists of links on index
pages are the table of contents, on a forge and on the site alike."""

import os
import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
LINK = re.compile(r"(\[([^\]]*)\]\()([^)\s]+)(\))")
FENCE = re.compile(r"^(```|:::).*?^\1", re.MULTILINE | re.DOTALL)


def target(page: Path, link: str) -> Path | None:
    """The file or folder that a link of `page` leads to, None for one that leaves the project."""
    path = link.partition("#")[0]
    if not path or re.match(r"\w+:", path):
        return None
    return Path(os.path.normpath(page.parent / path))


def links(page: Path) -> dict[Path, str]:
    """{file that a page leads to: words of the first link}, in its order."""
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    found: dict[Path, str] = {}
    for match in LINK.finditer(prose):
        path = target(page, match[3])
        if path:
            found.setdefault(path, match[2].strip("`*"))
    return found


def children(page: Path) -> dict[Path, str]:
    """{page that stands below `page` in the table of contents: words of the link}: of an index.md those of its folder,
    the indexes of the folders in it and what it names outside docs/; of NAME.md those of the
    folder NAME beside it."""
    if page.suffix != ".md":
        return {}
    own = page.parent if page.name == "index.md" else page.with_suffix("")
    found = links(page).items()
    return {path: words for path, words in found if path != page and _below(path, own, page)}


def _below(path: Path, own: Path, page: Path) -> bool:
    if path.suffix not in (".md", ".ipynb"):
        return False
    index = page.name == "index.md"
    if index and path.name == "index.md":
        return path.parent.parent == own
    return path.parent == own or (index and own != DOCS and not path.is_relative_to(DOCS))


def reached(page: Path = DOCS / "index.md") -> list[Path]:
    """`page` and all that stand below it."""
    return [page, *(each for child in children(page) for each in reached(child))]


def every() -> list[Path]:
    """All pages and notebooks of docs/."""
    return sorted(
        path
        for path in DOCS.rglob("*")
        if path.suffix in (".md", ".ipynb")
        and not any(part.startswith((".", "_")) for part in path.relative_to(DOCS).parts)
    )
