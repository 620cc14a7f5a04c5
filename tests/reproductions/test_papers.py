"""The table of all claims of the four papers, and what another seed does to it."""

import csv
import json
import re
from pathlib import Path

import pytest

from strapdown_reproductions.common.claims import ClaimKind
from strapdown_reproductions.common.kinds import ALWAYS
from strapdown_reproductions.common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED, Finding
from strapdown_reproductions.common.write_docs import DOCS, PAGES
from strapdown_reproductions.papers import main as papers
from strapdown_reproductions.papers.renew import with_section

pytestmark = pytest.mark.short


def found(verdict, identity=""):
    claim = Finding(
        "It is | so.", "4", "always", "a rule", "1 of 2", "1 < 2", verdict, "figure 1", identity
    )._asdict()
    return {"hager-bryne": [claim, claim], "alam": [claim]}


def test_all_claims_stand_in_one_table(tmp_path):
    claims = papers.write(tmp_path, found(REPRODUCED))
    assert [claim["paper"] for claim in claims] == ["hager-bryne"] * 2 + ["alam"]
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    text = (tmp_path / "claims.md").read_text()
    assert text.count("| It is / so. | always | **reproduced** | 1 of 2 |") == 3
    assert "2 claims: 2 reproduced. [Its page](open-or-closed-loop.md)." in text
    assert f"| always | {ALWAYS.rule} |" in text
    page = (tmp_path / "index.html").read_text()
    assert "href='alam/index.html'" in page and "Hager &amp; Bryne" in page


def test_every_kind_is_explained_once():
    assert all(isinstance(kind, ClaimKind) and kind.rule for kind in papers.KINDS)
    assert len({kind.name for kind in papers.KINDS}) == len(papers.KINDS) >= 7


def test_verdicts_that_change_with_the_seed(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, verdict in ((one, REPRODUCED), (other, NOT_REPRODUCED)):
        folder.mkdir()
        papers.write(folder, found(verdict) | {"fossen": found(UNDECIDED)["alam"]})
    papers.main(str(one), str(other))
    text = (one / "seeds.md").read_text()
    assert text.startswith("Of 4 verdicts 3 change with the seed alone.")
    assert "| Alam et al. | It is / so. | reproduced | not reproduced |" in text
    papers.main(str(one), str(one))
    assert (one / "seeds.md").read_text() == "Of 4 verdicts 0 change with the seed alone.\n"


def test_each_paper_runs_with_its_own_options(tmp_path, monkeypatch):
    """Every study gets the seed, a folder and its part of the progress; ablations are no part of a
    quick run."""
    told, steps = {}, []
    for name, module in (
        ("hager-bryne", papers.hager_bryne),
        ("fossen", papers.fossen),
        ("alam", papers.alam),
        ("mollaei", papers.mollaei),
    ):

        def reproduce(out, quick, name=name, progress=None, **options):
            told[name] = (out.name, quick, options)
            progress(1.0)
            return found(REPRODUCED)["alam"]

        monkeypatch.setattr(module, "reproduce", reproduce)
    claims = papers.reproduce(tmp_path, True, 5, progress=steps.append)
    assert [told[name][:2] for name in told] == [(name, True) for name in papers.PAPERS]
    assert {options["seed"] for _, _, options in told.values()} == {5}
    assert told["hager-bryne"][2]["ablations"] is False and len(claims) == 4
    assert steps[-1] == pytest.approx(1.0) and steps == sorted(steps)


VERDICT = re.compile(r"^\| (\d+) \| .*? \| \*\*(.+?)\*\* \|", re.MULTILINE)


def claimed():
    """{(authors, number): verdict} of the table of all claims in docs/."""
    parts = (DOCS / "claims.md").read_text(encoding="utf-8").split("\n## ")
    return {
        (paper.authors, number): verdict
        for paper in papers.PAPERS.values()
        for part in parts
        if part.startswith(paper.authors + "\n")
        for number, verdict in VERDICT.findall(part)
    }


def test_a_verdict_that_changes_is_explained():
    """Beginning with the verdicts of 2026-11-24, each change has its row with a reason in the page."""
    with (Path(__file__).parent / "verdicts_before.csv").open(newline="") as file:
        verdicts = {(row["paper"], row["claim"]): row["verdict"] for row in csv.DictReader(file)}
    text = (DOCS / "claims.md").read_text(encoding="utf-8")
    listed = text.partition("## Verdicts that changed\n")[2].partition("\n## ")[0]
    changes = re.findall(r"^\| \d{4}-\d\d-\d\d \| (.+) \|$", listed, re.MULTILINE)
    assert changes
    for change in changes:
        authors, claim, before, now, why = change.split(" | ")
        assert verdicts.get((authors, claim), "none") == before != now and len(why) > 40, change
        verdicts[authors, claim] = now
    moved = {key for key in verdicts | claimed() if verdicts.get(key) != claimed().get(key)}
    assert not moved, f"explain under 'Verdicts that changed' in claims.md: {sorted(moved)}"


@pytest.mark.parametrize("name", papers.PAPERS)
def test_the_page_of_a_paper_has_the_verdicts_of_the_table(name):
    page = (DOCS / PAGES[name][1]).read_text(encoding="utf-8").partition("<!-- begin: findings.md")
    authors = papers.PAPERS[name].authors
    of_page = {(authors, number): verdict for number, verdict in VERDICT.findall(page[2])}
    assert of_page == {key: verdict for key, verdict in claimed().items() if key[0] == authors}


def test_one_study_run_again_renews_its_section():
    both = found(REPRODUCED)
    text = papers.markdown_of(both)
    again = {name: found(UNDECIDED)[name] for name in both}
    for name in both:
        text = with_section(text, name, again[name])
    assert text == papers.markdown_of(again)


def test_the_numbers_that_decide_between_architectures_stand_in_the_evidence():
    """Each bold one, in what a command wrote into the page that its row links to."""
    page = DOCS.parents[1] / "explanation" / "four-papers.md"
    rows = re.findall(r"^\| .*\.md\) \|$", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) == 12
    for row in rows:
        (command,) = re.findall(r"\| `([\w-]+)` \|", row)
        (linked,) = re.findall(r"\]\(\.\./reference/evidence/([\w-]+\.md)\) \|$", row)
        assert PAGES[command][1] == linked
        text = (DOCS / linked).read_text(encoding="utf-8").replace("\xa0", " ")
        written = "".join(re.findall(r"<!-- begin.*?<!-- end", text, re.DOTALL))
        numbers = re.findall(r"\*\*(.+?)\*\*", row)
        assert numbers and all(number in written for number in numbers), row
