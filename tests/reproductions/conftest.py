"""Tests of reproductions that take more than a few thousand filter steps are deep: they run whole
studies, and go red where a test of the library does."""

import pytest

from strapdown_reproductions.common import markdown, write_docs

QUICK = (
    "test_alam.py",
    "test_consistency_table.py",
    "test_faults.py",
    "test_fossen_intro.py",
    "test_errata_fossen.py",
)
"""Files whose tests take a second or two where they do not say themselves that they are deep: `make
test` runs one whole reproduction, and the faults in their reduced form."""


def pytest_collection_modifyitems(items):
    """What is not marked short is deep, and what needs the kernels of a reproduction."""
    for item in items:
        if "reproductions" in item.path.parts and item.path.name not in QUICK:
            own_kernels = item.path.name.startswith("test_mollaei_six")
            if own_kernels or not item.get_closest_marker("short"):
                item.add_marker(pytest.mark.deep)


@pytest.fixture
def goes_into_its_page(tmp_path):
    """A check that the text which a reproduction has written goes between the marks of a page, in
    place of what stood there, and again the same."""

    def check(name, text):
        page, mark = tmp_path / "page.md", write_docs.mark(name)
        page.write_text(f"before\n{mark}\nold\n{markdown.END}\nafter\n", encoding="utf-8")
        for _ in range(2):
            write_docs.insert(page, name, text)
            found = page.read_text(encoding="utf-8")
            assert found == f"before\n{mark}\n{text}{markdown.end(text)}\nafter\n"

    return check
