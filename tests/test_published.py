"""What a package index and a reader of the repository get: one version, a citation, a changelog, a
README whose links lead somewhere there too."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import strapdown

ROOT = Path(__file__).resolve().parents[1]
VERSION = strapdown.__version__
pytestmark = pytest.mark.short


def toml(path):
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


def index_readme(tmp_path, urls=""):
    """The README as setup.py makes it, of a checkout whose pyproject.toml names these addresses."""
    tree = ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))
    names = ("readme",)
    wanted = [each for each in tree.body if getattr(each, "name", "") in names]
    for name in ("README.md", "pyproject.toml"):
        (tmp_path / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    with (tmp_path / "pyproject.toml").open("a", encoding="utf-8") as file:
        file.write(urls)
    space = {"HERE": tmp_path, "re": re, "tomllib": tomllib}
    exec(compile(ast.Module(wanted, []), "setup.py", "exec"), space)
    return space["readme"]()


def test_the_version_stands_in_one_place():
    project = toml("pyproject.toml")
    assert "version" not in project["project"] and "version" in project["project"]["dynamic"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "strapdown.__version__"}


def test_what_repeats_the_version_agrees():
    second = toml("reproductions/pyproject.toml")["project"]
    assert second["version"] == VERSION and f"strapdown=={VERSION}" in second["dependencies"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == VERSION
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## \[(.+?)\]", changes, re.MULTILINE)
    assert headings[0] == "Unreleased" and headings[1] == VERSION


def test_the_citation_has_what_the_format_asks_for():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["cff-version"] == "1.2.0" and cited["type"] == "software"
    assert cited["message"] and cited["title"] and cited["license"] == "MIT"
    assert all(
        author.keys() <= {"name", "family-names", "given-names"} for author in cited["authors"]
    )
    assert cited["authors"]


def test_changes_stand_under_the_headings_of_the_format():
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    kinds = set(re.findall(r"^### (.+)$", changes, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_the_readme_of_an_index_has_no_link_into_the_checkout(tmp_path):
    text = index_readme(tmp_path)
    assert re.findall(r"\]\((?!https?:|#)", text) == [] and "![" not in text
    assert "which filter?" in text.lower() and "```sh\nmake demo" in text


def test_the_readme_of_an_index_leads_to_the_repository_where_one_is_named(tmp_path):
    text = index_readme(
        tmp_path, '\n[project.urls]\nRepository = "https://example.org/strapdown"\n'
    )
    assert "](https://example.org/strapdown/blob/HEAD/docs/how-to/logs.md)" in text
    assert "](https://example.org/strapdown/raw/HEAD/docs/pictures/outage.svg)" in text
    assert re.findall(r"\]\((?!https?:|#)", text) == []


def test_the_readme_is_short_and_has_its_picture():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    picture = ROOT / re.search(r"!\[.+?\]\((.+?)\)", text)[1]
    assert len(text.split()) <= 900 and 5e3 < picture.stat().st_size < 2e5


def test_the_picture_of_the_readme_is_the_one_that_comes_out():
    script = ROOT / "benchmarks" / "picture.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
