"""What the site of the documentation is made of: every page is in a table of contents, and what
commands have written into the pages is what they would write now."""

import re

import api_pages
import doc_blocks as blocks
import doc_lists as lists
import doc_pages as pages
import docstrings
import filter_pages
import gallery
import make_site
import pytest

ROOT = pages.ROOT


@pytest.mark.short
def test_every_page_is_in_a_table_of_contents():
    reached = pages.reached()
    assert len(reached) == len(set(reached)), "a page is in two"
    missing = set(pages.every()) - set(reached)
    assert not missing, f"no index names {sorted(path.name for path in missing)}"


@pytest.mark.short
def test_the_ways_of_a_newcomer_are_short():
    index = pages.links(pages.DOCS / "index.md")
    assert pages.DOCS / "tutorials" / "your-log.md" in index
    which = pages.DOCS / "how-to" / "which-filter.md"
    assert which in index and pages.DOCS / "reference" / "filters.md" in pages.links(which)


SOUGHT = {
    "install": "install.md",
    "GPU": "install.md",
    "Windows": "install.md",
    "platforms": "install.md",
    "antenna": "lever-arm.md",
    "lever arm": "lever-arm.md",
    "mounting": "lever-arm.md",
    "axes": "lever-arm.md",
    "covariance": "covariance.md",
    "uncertainty": "covariance.md",
    "real time": "stream.md",
    "live": "stream.md",
    "latency": "stream.md",
    "custom sensor": "plugins.md",
    "your own log": "your-log.md",
}
"""Everyday words, and the page of the index that answers them."""


@pytest.mark.short
@pytest.mark.parametrize("words", SOUGHT)
def test_everyday_words_stand_in_a_heading_of_a_page_that_the_index_names(words):
    (page,) = [path for path in pages.links(pages.DOCS / "index.md") if path.name == SOUGHT[words]]
    text = page.read_text(encoding="utf-8")
    headings = " ".join(re.findall(r"^#+ (.*)$", pages.FENCE.sub("", text), re.MULTILINE))
    assert words.lower() in headings.lower()


@pytest.mark.short
def test_children_of_an_index_and_of_a_page_beside_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(pages, "DOCS", tmp_path)
    for name, text in {
        "index.md": "[a](sub/index.md) [b](sub/one.md) [c](https://x.org/d.md) [d](#a)",
        "sub/index.md": "[one](one.md#x) [again](one.md) [up](../index.md) [out](../../out.md)",
        "sub/one.md": "[in](one/deep.md) [two](two.md)\n```text\n[no](one/no.md)\n```\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = {name: list(pages.children(tmp_path / name)) for name in ("index.md", "sub/one.md")}
    assert found == {
        "index.md": [tmp_path / "sub" / "index.md"],
        "sub/one.md": [tmp_path / "sub" / "one" / "deep.md"],
    }
    below = pages.children(tmp_path / "sub" / "index.md")
    assert below == {tmp_path / "sub" / "one.md": "one", tmp_path.parent / "out.md": "out"}


def test_nothing_in_the_pages_is_stale():
    assert not blocks.stale()


def test_a_stale_page_of_a_filter_is_named(tmp_path, monkeypatch):
    name = "closed-loop"
    monkeypatch.setattr(
        filter_pages, "EXPLAINED", filter_pages.EXPLAINED | {name: "explanation/lanes.md"}
    )
    assert filter_pages.stale() == [
        "docs/reference/filters/closed-loop.md: is not what "
        "`python docs/_site/filter_pages.py` writes; run it"
    ]


def test_a_stale_list_is_named(monkeypatch):
    monkeypatch.setattr(lists, "output", lambda command: "another grade")
    assert lists.stale() == [
        "docs/reference/lists.md: its lists are not what the commands print; run "
        "`python docs/_site/doc_lists.py`"
    ]


def test_a_study_text_edited_by_hand_is_named(tmp_path, monkeypatch):
    page = pages.DOCS / "reference" / "evidence" / "noise.md"
    copy = tmp_path / "noise.md"
    text = page.read_text(encoding="utf-8")
    begin = text.index("<!-- begin")
    copy.write_text(text[:begin] + text[begin:].replace("|", "!", 1), encoding="utf-8")
    monkeypatch.setattr(blocks, "every", lambda: [copy])
    monkeypatch.setattr(blocks, "ROOT", tmp_path)
    (line,) = blocks.edited()
    assert line.startswith("noise.md: table.md of strapdown reproduce noise was edited by hand")


@pytest.mark.short
def test_what_a_page_loads_from_the_network_is_named(tmp_path):
    (tmp_path / "page.html").write_text(
        '<a href="https://x.org/"></a><script src="https://cdn.x.org/a.js"></script>'
        '<link rel="stylesheet" href="own.css">',
        encoding="utf-8",
    )
    (tmp_path / "own.css").write_text("@import url(//fonts.x.org/a.css);", encoding="utf-8")
    assert [line.partition(":")[0] for line in make_site.from_the_network(tmp_path)] == [
        "own.css",
        "page.html",
    ]


@pytest.mark.short
def test_a_docstring_lists_its_parameters():
    text = "Do `it` at *once*. imu: grade (default: `x`); start, stop: s. Raises DataError."
    assert docstrings.rst(text, ["imu", "start", "stop"]) == (
        "Do ``it`` at \\*once\\*.\n\n- ``imu``: grade (default: ``x``)\n- ``start, stop``: s\n\n"
        "Raises DataError."
    )
    assert docstrings.rst("See docs/how-to/imu.md and `docs/index.md`; not `a.md`.", []) == (
        "See :doc:`/how-to/imu` and :doc:`/index`; not ``a.md``."
    )
    assert docstrings.meanings("Gains: k1 of f, k2. low_pass: s.", ["k1", "low_pass"]) == {
        "low_pass": "s"
    }


@pytest.mark.deep
def test_a_broken_link_fails_the_build_and_is_named(tmp_path):
    for package in ("sphinx", "myst_nb", "furo", "sphinx_copybutton"):
        pytest.importorskip(package)
    (tmp_path / "index.md").write_text("# Site\n\n[away](nowhere.md)\n", encoding="utf-8")
    done = make_site.sphinx(tmp_path, tmp_path / "out", tmp_path / "work")
    assert done.returncode and "index.md:3" in done.stderr and "nowhere.md" in done.stderr


def test_every_public_name_has_a_page_and_what_examples_import_stands_on_one():
    found = api_pages.pages()
    assert {f"api/{name}.md" for name in api_pages.public()} == set(found) - {"api/modules.md"}
    modules = found["api/modules.md"]
    assert ".. currentmodule:: strapdown.sensor_models.gnss\n\n.. autoclass:: Gnss\n" in modules
    assert "fuse\n" not in modules
    text = api_pages.linked("| `fuse`, `__version__` | `fuse` runs |\n")
    assert text.startswith("| [`fuse`](api/fuse.md), `__version__` | `fuse` runs |\n")


@pytest.mark.short
def test_files_beside_a_page_are_found_and_no_others():
    html = "<a href='table.csv'>CSV</a><img src=\"a-b.svg\"><a href=../c.csv><a href='https://d/e.csv'>"
    assert gallery.linked(html) == {"table.csv", "a-b.svg"}


@pytest.mark.short
def test_the_gallery_shows_what_is_there_and_says_what_is_not(tmp_path):
    (tmp_path / "demo.html").write_text("", encoding="utf-8")
    text = gallery.with_pictures(gallery.PAGE.read_text(encoding="utf-8"), tmp_path)
    assert text.count('<a class="gallery"') == 1 and "../gallery/demo.html" in text
    assert text.count("Not made here") == len(gallery.shown()) - 1 >= 7
    (tmp_path / "demo.png").write_bytes(b"")
    text = gallery.with_pictures(gallery.PAGE.read_text(encoding="utf-8"), tmp_path)
    assert '<img src="../gallery/demo.png" alt="The top of the page that strapdown demo' in text
