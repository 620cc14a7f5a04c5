"""The documentation as a site that needs no network: `make docs`, or

    python docs/_site/make_site.py OUT

Checks what commands have written into the pages, makes the pages of the gallery, stages the pages
in build/docs and runs Sphinx. What is stale or leads nowhere ends it with a line that names it.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import api_pages
import doc_blocks as blocks
import gallery
from doc_pages import DOCS, LINK, ROOT, children, every, reached, target

HERE = Path(__file__).resolve().parent
WORK = ROOT / "build" / "docs"
OUTSIDE = "project"
"""Folder of the site for files of the project that stand outside docs/."""


def staged(path: Path) -> Path:
    """Where a file of the project stands below the folder that Sphinx reads."""
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS)
    return Path(OUTSIDE) / path.relative_to(ROOT)


def stage(source: Path, shown: Path) -> None:
    """All pages, and the files that they lead to, into the folder `source`; `shown` has the
    pages of the gallery. What did not change is not written, so that Sphinx reads what did."""
    todo, done, listed = every(), set(), set(reached())
    while todo:
        page = todo.pop()
        if page in done:
            continue
        done.add(page)
        place = source / staged(page)
        if page.suffix != ".md":
            _write(place, page.read_bytes())
            continue
        text = page.read_text(encoding="utf-8")
        text = LINK.sub(lambda link: _led(page, link, todo), text)
        text = gallery.with_pictures(text, shown) if page == gallery.PAGE else text
        text = api_pages.linked(text) if page == api_pages.PAGE else text
        orphan = "---\norphan: true\n---\n\n" * (page not in listed)
        _write(place, (orphan + text + _contents(page)).encode())
    keep = {source / staged(page) for page in done}
    for name, text in api_pages.pages().items():
        place = source / "reference" / name
        _write(place, text.encode())
        keep.add(place)
    for path in source.rglob("*"):
        if path.is_file() and path not in keep:
            path.unlink()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_bytes() != content:
        path.write_bytes(content)


def _led(page: Path, link: re.Match[str], todo: list[Path]) -> str:
    """A link as it stands in the staged page; what it leads to is staged too."""
    path = target(page, link[3])
    if path is None or not path.is_relative_to(ROOT) or not path.exists():
        return link[0]  # Sphinx says so where it is none
    if path.is_dir():
        path = path / "README.md"
        if not path.exists():
            return f"{link[2]}"
    todo.append(path)
    anchor = "#" + link[3].partition("#")[2] if "#" in link[3] else ""
    place = os.path.relpath(staged(path), staged(page).parent)
    return link[1] + Path(place).as_posix() + anchor + link[4]


def _contents(page: Path) -> str:
    """The hidden table of contents of an index page; nothing for others."""
    below = children(page) if page.is_relative_to(DOCS) else {}
    base = staged(page).parent
    lines = []
    for path, title in below.items():
        place = Path(os.path.relpath(staged(path), base)).with_suffix("").as_posix()
        lines.append(f"{title} <{place}>")
    return "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(lines) + "\n```\n" if lines else ""


FROM_THE_NETWORK = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["'](?:https?:)?//[^"']+"""
    r"""|<link\b[^>]*\brel=["'](?:stylesheet|preload|preconnect|icon)["'][^>]*\bhref=["'](?:https?:)?//[^"']+"""
    r"""|@import\s+(?:url\()?["']?(?:https?:)?//\S+|url\(["']?(?:https?:)?//[^)]+""",
    re.IGNORECASE,
)


def from_the_network(site: Path) -> list[str]:
    """Lines that name what a page or style sheet of the site loads from elsewhere."""
    files = [path for path in site.rglob("*") if path.suffix in (".html", ".css")]
    return [
        f"{path.relative_to(site)}: loads {found[0][:120]!r} from the network"
        for path in files
        for found in FROM_THE_NETWORK.finditer(path.read_text(encoding="utf-8"))
    ]


def sphinx(source: Path, site: Path, work: Path) -> subprocess.CompletedProcess[str]:
    """Build the pages of `source` into `site`; a warning fails, and stands in `stderr`."""
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-c", str(HERE), "-d"]
    command += [str(work / "doctrees"), "-a", "-W", "--keep-going", "-q", "-j", "auto"]
    environment = os.environ | {"STRAPDOWN_NOTEBOOKS": str(work / "notebooks")}
    run = [*command, str(source), str(site)]
    return subprocess.run(run, env=environment, capture_output=True, text=True)


def main(out: str) -> int:
    """Build into the folder `out`; the exit status."""
    began = time.monotonic()
    stale = [*blocks.stale(), *blocks.picture()]
    if stale:
        print(*stale, sep="\n", file=sys.stderr)
        return 1
    try:
        pages = gallery.make(WORK / "gallery")
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return 1
    source, site = WORK / "source", Path(out)
    stage(source, pages)
    done = sphinx(source, site, WORK)
    if done.returncode:
        print(done.stderr, file=sys.stderr, end="")
        return done.returncode
    shutil.copytree(pages, site / "gallery", dirs_exist_ok=True)
    found = from_the_network(site)
    print(*found, sep="\n", file=sys.stderr, end="\n" * bool(found))
    print(f"{site / 'index.html'}: {time.monotonic() - began:.0f} s")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
