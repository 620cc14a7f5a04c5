"""The concordance of a paper: its references must lead somewhere."""

import pytest

from strapdown_reproductions.common.concordance import (
    FROM_PAGE,
    ConcordanceEntry,
    concordance,
    missing_references,
    of_claims,
)

pytestmark = pytest.mark.short
ENTRY = ConcordanceEntry(
    "(15)", "update | gain", "src/a.py::correct", "tests/test_a.py::test_b", "as printed"
)


@pytest.fixture
def root(tmp_path):
    for name, text in {
        "src/a.py": "def correct():\n",
        "tests/test_a.py": "def test_b():\n",
    }.items():
        path = tmp_path / name
        path.parent.mkdir()
        path.write_text(text)
    return tmp_path


def test_references_that_lead_somewhere(root):
    nowhere = ENTRY._replace(where="", test="", verdict="not published")
    assert missing_references([ENTRY, ENTRY._replace(where="src/a.py"), nowhere], root) == []


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("where", "src/b.py::correct", "(15): src/b.py::correct"),
        ("where", "src/a.py::correc", "(15): src/a.py::correc"),
        ("test", "tests/test_a.py::test_c", "(15): tests/test_a.py::test_c"),
        ("test", "tests", "(15): tests"),
        ("verdict", "", "(15): no verdict, or a test without a file"),
        ("where", "", "(15): no verdict, or a test without a file"),
    ],
)
def test_a_reference_that_leads_nowhere_is_named(root, field, value, said):
    assert missing_references([ENTRY, ENTRY._replace(**{field: value})], root) == [said]


def test_the_table_links_files_and_tests():
    text = concordance([ENTRY, ENTRY._replace(where="src/a.py", test="")])
    head, _, first, second = text.splitlines()
    assert head == "| printed | what | where | test | verdict |"
    link = f"[correct]({FROM_PAGE}/src/a.py) | [test_b]({FROM_PAGE}/tests/test_a.py)"
    assert first == f"| (15) | update / gain | {link} | as printed |"
    assert f"[a.py]({FROM_PAGE}/src/a.py) | – |" in second


def test_claims_are_numbered_as_on_their_page():
    claims = [{"claim": "It is so.", "source": "V", "verdict": "partly"}]
    found = of_claims(claims, ["so"], "src/claims.py", "tests/test_a.py")
    assert found == [
        ConcordanceEntry(
            "claim 1, V", "It is so.", "src/claims.py::so", "tests/test_a.py", "partly"
        )
    ]
    with pytest.raises(ValueError):
        of_claims(claims, ["so", "else"], "src/claims.py", "")
