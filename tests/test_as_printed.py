"""The commands of README, tutorials and help run as they are printed: by a shell that finds the
installed `strapdown`, in a folder with nothing but the user's own files that they name."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import given_files
import pytest
from test_docs import ROOT, blocks

import strapdown
from strapdown.cli import help

INSTALLED = shutil.which(
    "strapdown", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
EXAMPLES = {name: [line for _, line in about.examples] for name, about in help.ABOUT.items()}


def lines_of(block):
    """The lines of a block that call strapdown."""
    return [line for line in block.text.splitlines() if line.startswith("strapdown ")]


def words_of(line):
    return shlex.split(line, comments=True)


def named(line):
    """The names of files in a command line, and in its list of them."""
    return re.findall(r"[\w./-]+\.\w+", line)


def give(lines, folder):
    """Write the files of one's own that lines name and none of them makes."""
    words = [words_of(line) for line in lines]
    made = {
        after for each in words for word, after in pairwise(each) if word in ("--write", "--out")
    }
    for each, line in zip(words, lines):
        for name in named(line):
            special = " ".join(each[1:3]) if each[2:3] == [name] else name
            write = given_files.GIVEN.get(special, given_files.GIVEN.get(name))
            if write and name not in made and not (folder / name).exists():
                write(folder / name)


def in_shell(text, folder):
    """Run it as a terminal with `strapdown` on its path does; it must end well."""
    source = str(Path(strapdown.__file__).parents[1])
    path = f"{Path(INSTALLED).parent}{os.pathsep}{os.environ['PATH']}"
    more = os.environ.get("PYTHONPATH", "")
    done = subprocess.run(
        ["sh", "-e", "-c", text],
        cwd=folder,
        env={**os.environ, "PATH": path, "PYTHONPATH": f"{source}{os.pathsep}{more}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{text}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    assert "Traceback" not in done.stderr
    return done.stdout


def run_lines(lines, folder):
    """Each line, with the files that they need."""
    give(lines, folder)
    for line in lines:
        in_shell(line, folder)


QUICK = ("README.md", "your-log.md")
"""Pages that show the way from a log to a verdict."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=() if page.name in QUICK else pytest.mark.deep, id=page.name)
        for page in PAGES
        if any(map(lines_of, blocks(page)))
    ],
)
def test_a_page_runs_as_it_is_printed(page, tmp_path):
    """Its commands; test_docs.py runs its Python, and the gallery what needs recorded data."""
    found = [block for block in blocks(page) if not block.needs_data]
    run_lines([line for block in found for line in lines_of(block)], tmp_path)


SWIFT = ("inspect", "fuse", "simulate", "filters", "imus", "receivers", "plugins")
"""Commands whose examples take five seconds each at most; the others run in `make deep`."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in SWIFT else pytest.mark.deep) for name in EXAMPLES],
)
def test_the_examples_of_help_run_as_they_are_printed(name, tmp_path):
    run_lines(EXAMPLES[name], tmp_path)


def checkout(folder):
    """A copy of what git has of this checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def fresh(script, folder, home):
    """Run it in a new shell that knows no environment."""
    keep = {"PATH": f"{sys.base_prefix}/bin{os.pathsep}{os.defpath}", "HOME": str(home)}
    keep |= {key: value for key, value in os.environ.items() if key.lower().endswith("_proxy")}
    keep |= {key: value for key, value in os.environ.items() if key.startswith("PIP_")}
    done = subprocess.run(
        ["sh", "-e", "-c", script], cwd=folder, env=keep, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


@pytest.mark.deep
@pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", ROOT / "docs" / "how-to" / "install.md"],
    ids=lambda page: page.name,
)
def test_it_installs_as_it_is_printed(page, tmp_path):
    """All shell lines of a page, from a copy of the checkout and a new environment; what needs
    files of one's own in an empty folder. `make test` is what runs this."""
    copy, empty = tmp_path / "copy", tmp_path / "empty"
    copy.mkdir()
    empty.mkdir()
    checkout(copy)
    script = []
    for block in blocks(page):
        lines = [
            line for line in block.text.splitlines() if block.language in ("sh", "text") and line
        ]
        if any(map(named, lines_of(block))):
            script.append(f"cd {empty}")
        give(lines, empty)
        script += [line for line in lines if not line.startswith("make test")]
    fresh("\n".join(script), copy, tmp_path)
