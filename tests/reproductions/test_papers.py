"""The table of all claims of the four papers, and what another seed does to it."""

import json

import pytest

from strapdown_reproductions.common.claims import Kind
from strapdown_reproductions.common.kinds import ALWAYS
from strapdown_reproductions.common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED, finding
from strapdown_reproductions.papers import main as papers

pytestmark = pytest.mark.short


def found(verdict, identity=""):
    claim = finding(
        "It is | so.", "4", "a rule", "1 < 2", verdict, "figure 1", "always", "1 of 2", identity
    )
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
    assert all(isinstance(kind, Kind) and kind.rule for kind in papers.KINDS)
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
