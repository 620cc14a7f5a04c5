"""What the reproductions share: rows of claims and their runner, seeds, threads, and the pages of
docs/."""

import inspect
from operator import itemgetter
from pathlib import Path

import pandas as pd
import pytest

from strapdown.checks import DataError
from strapdown_reproductions.common import kinds, markdown, runner, study, targets, write_docs
from strapdown_reproductions.common.claims import (
    MAX_LINE,
    Claim,
    JudgedClaim,
    findings,
    in_lines,
    judge,
    over,
    verdict_of,
)
from strapdown_reproductions.common.kinds import ALWAYS
from strapdown_reproductions.common.pages import (
    DEPENDS,
    NOT_REPRODUCED,
    PARTLY,
    REPRODUCED,
    TOO_FEW,
    UNDECIDED,
    counts,
)
from strapdown_reproductions.common.reproduction import Asked, reproduction
from strapdown_reproductions.common.verdicts import (
    Count,
    both,
    count_votes,
    decide,
    over_readings,
    tally,
    without_verdicts,
)

pytestmark = pytest.mark.short


def exceeds(values, level):
    """Cells are numbers: above the level supports."""
    votes = [int(value > level) - int(value < level) for value in values]
    return kinds.mostly(lambda confidence: votes)


CLAIM = Claim(
    "Both are large.",
    "4",
    "more than 1",
    {"a": over(itemgetter("a"), exceeds, 1), "b": over(itemgetter("b"), exceeds, level=1)},
    "a: {a}. b: {b}. Largest {most:.1f}",
    "table 1",
    {"most": over(itemgetter("a"), max)},
    lambda evidence: "needs a" if "a" not in evidence else "",
)


@pytest.mark.parametrize(
    ("a", "b", "verdict"),
    [
        ([2, 3], [2], REPRODUCED),
        ([2, 3], [0], PARTLY),
        ([0, 0.5], [0], NOT_REPRODUCED),
        ([1, 1], [1], UNDECIDED),
    ],
)
def test_all_parts_of_a_claim_must_hold(a, b, verdict):
    found = judge(CLAIM, {"a": a, "b": b})
    assert verdict_of(CLAIM, {"a": a, "b": b}) == verdict
    assert found["verdict"] == verdict and found["claim"] == "Both are large."
    assert found["measured"].endswith(f". Largest {max(a):.1f}") and "a: " in found["measured"]


def test_a_claim_that_the_evidence_cannot_decide_says_what_is_missing():
    found = findings([CLAIM, CLAIM._replace(parts={}, measured="nothing")], {"b": [2], "c": 0})
    assert [each["verdict"] for each in found] == [UNDECIDED] * 2
    assert found[0]["measured"] == "needs a" and found[0]["rule"] == "more than 1"
    free = CLAIM._replace(parts={}, shown={}, measured="nothing", lacks=None)
    assert judge(free, {})["verdict"] == UNDECIDED


def test_a_verdict_that_is_no_share_of_cells():
    judged = CLAIM._replace(parts={"x": lambda e: JudgedClaim(decide(True, False), "by eye")})
    found = judge(judged._replace(measured="{x}"), {"a": [0]})
    assert (found["verdict"], found["measured"]) == (REPRODUCED, "by eye")


def test_counts():
    assert count_votes([1, -1, 0, 1]) == Count(2, 1, 4)
    assert decide(False, True) == NOT_REPRODUCED and decide(False, False) == UNDECIDED


def test_seeds():
    assert Asked(seed=2).seeds(3, 1) == [2000, 2001, 2002]
    assert Asked(quick=True, seed=0).seeds(3, 1) == [0]
    assert Asked(quick=True, runs=2, seed=1).seeds(3, 1) == [1000, 1001]
    assert Asked(seed=4).seeds_from(3, 1) == range(4, 7)
    for runs, seed in ((0, 2), (1, -1), (1.5, 2)):
        with pytest.raises(DataError, match="must be a whole number"):
            Asked(runs=runs, seed=seed).seeds(3, 1)


def test_a_reproduction_takes_the_options_that_it_names():
    made = reproduction("quick", "runs", usual=Asked(runs=4))(lambda out, asked: [(out, asked)])
    taken = inspect.signature(made).parameters
    assert {name: each.default for name, each in taken.items()} == {
        "out": inspect.Parameter.empty,
        "quick": False,
        "runs": 4,
    }
    assert made("x", True) == [(Path("x"), Asked(quick=True, runs=4))]
    with pytest.raises(TypeError, match="unexpected keyword argument 'seed'"):
        made("x", seed=3)


def test_threads_keep_the_order_and_tell_how_far_they_are():
    told = []
    part = runner.part_of(told.append, 0.2, 1.0)
    assert list(runner.on_threads(lambda x: x * x, [3, 1, 2], 2, part)) == [9, 1, 4]
    assert told == pytest.approx([0.2 + 0.8 / 3, 0.2 + 1.6 / 3, 1.0])
    assert runner.part_of(None, 0.0, 1.0) is None


def in_a_table(first, count):
    return pd.DataFrame(numbered(first, count))


def numbered(first, count):
    return [{"seed": first + k} for k in range(count)]


def several(count):
    return {"one": pd.DataFrame(numbered(0, count)), "other": pd.DataFrame(numbered(9, 1))}


@pytest.mark.parametrize("workers", [1, 2])
def test_tasks_fill_their_tables_in_order(workers):
    told = []
    tasks = [
        runner.Task("one", numbered, (5, 2)),
        runner.Task("", several, (1,)),
        runner.Task("one", in_a_table, (3, 1)),
    ]
    found = runner.collect_tables(tasks, workers, told.append)
    assert found["one"]["seed"].tolist() == [5, 6, 0, 3] and found["other"]["seed"].tolist() == [9]
    assert found["one"].index.tolist() == [0, 1, 2, 3] and found["nothing"].empty
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_figures_against_targets():
    wanted = {
        "low": targets.Target("small", "<=", 1.0, "m"),
        "high": targets.Target("large", ">=", 2),
        "open": targets.Target("not known", "<=", 1.0),
    }
    held, missed = targets.judge_targets(
        {"low": 0.98765, "high": 1.5, "open": float("nan")}, wanted
    )
    assert (held["figure"], held["target"], held["holds"]) == ("0.988 m", "<= 1 m", True)
    assert (missed["figure"], missed["target"], missed["holds"]) == ("1.5", ">= 2", False)
    assert targets.judge_targets({"low": 0.98765}, wanted, 4)[0]["figure"] == "0.9877 m"
    text = targets.in_docs(
        [held], {"a": ("Some", pd.DataFrame({"x": [1234.5678]})), "b": ("No", pd.DataFrame())}
    )
    assert "| small | <= 1 m | 0.988 m | holds |" in text
    assert "### Some" in text and "| 1.23e+03 |" in text and "### No" not in text


def test_what_a_run_has_written_goes_into_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(write_docs, "DOCS", tmp_path)
    page, out = tmp_path / "alam.md", tmp_path / "out"
    page.write_text(f"before\n{write_docs.mark('alam')}\nold\n{markdown.END}\nafter\n")
    out.mkdir()
    (out / "findings.md").write_text("new\n")
    write_docs.main("alam", str(out))
    end = markdown.end("new\n")
    assert page.read_text() == f"before\n{write_docs.mark('alam')}\nnew\n{end}\nafter\n"
    assert not markdown.edited_texts(page.read_text())
    assert markdown.edited_texts(page.read_text().replace("new", "newer")) == [
        "findings.md of strapdown reproduce alam"
    ]
    write_docs.main("alam", str(out))
    assert page.read_text().count("<!-- end") == 1


@pytest.mark.parametrize("name", write_docs.PAGES)
def test_every_page_has_its_marks(name):
    page = write_docs.DOCS / write_docs.PAGES[name][1]
    assert page.read_text(encoding="utf-8").count(write_docs.mark(name)) == 1


def test_a_page_of_few_runs_has_no_verdicts(tmp_path):
    claims = findings([CLAIM._replace(answer="{most:.0f} is most")], {"a": [2, 3], "b": [2]})
    work = study.StudyWork("A study", ["About it."])
    outcome = study.Outcome("Small.", claims, pd.DataFrame({"x": ["y"]}), {}, ())
    few, enough = (
        study.write_study(tmp_path / str(runs), work, outcome._replace(runs=runs))
        for runs in (runner.ENOUGH - 1, runner.ENOUGH)
    )
    assert [few[0]["verdict"], enough[0]["verdict"]] == [TOO_FEW, REPRODUCED]
    page = (tmp_path / "9" / "index.html").read_text()
    assert "A quick run, 9 of each" in page and "1 claims: 1 too few runs" in page
    text = (tmp_path / "10" / "findings.md").read_text()
    assert "**reproduced** | 3 is most |" in text
    assert "1. No kind.\n    - A: 2 of 2 cells" in text and "\n    - Rule: more than 1.\n" in text
    assert "quick" not in (tmp_path / "10" / "index.html").read_text()


def test_a_page_of_few_runs_has_no_word_of_a_verdict(tmp_path):
    told = CLAIM._replace(
        kind=ALWAYS, answer="Most is {most:.0f}. By the reading a: not reproduced.", rule="as it is"
    )
    votes = {"votes": "By the letter reproduced."}
    claims = [claim | votes for claim in findings([told], {"a": [2, 3], "b": [2]})]
    work = study.StudyWork("A study", ["Not reproduced means something. It has cells."])
    outcome = study.Outcome("Small.", claims, pd.DataFrame({"x": ["y"]}), {}, ())
    texts = lambda claims: {"more.md": claims[0]["verdict"]}
    for runs, expected in ((runner.ENOUGH - 1, False), (runner.ENOUGH, True)):
        study.write_study(tmp_path, work, outcome._replace(runs=runs, texts=texts))
        for name in ("index.html", "findings.md", "more.md"):
            text = (tmp_path / name).read_text(encoding="utf-8")
            assert ("reproduced" in text) == expected, (name, text)
        page = (tmp_path / "index.html").read_text(encoding="utf-8")
        assert "Most is 3." in page and "It has cells." in page
        assert ("every cell supports it" in page) == ("By the letter" in page) == expected


def test_lines_are_cut_behind_sentences():
    text = "; ".join(["a rule of forty characters, which it has"] * 20) + "\nanother"
    lines = in_lines(text).splitlines()
    assert max(map(len, lines)) <= MAX_LINE and lines[-1] == "another"
    assert all(line.endswith((";", "has")) for line in lines[:-1])
    assert " ".join(lines[:-1]) + "\nanother" == text
    assert max(map(len, in_lines("word " * 200).splitlines())) <= MAX_LINE


def test_verdicts_are_tallied_and_left_out():
    assert tally([NOT_REPRODUCED, REPRODUCED, REPRODUCED]) == "2 reproduced, 1 not reproduced"
    assert (
        without_verdicts("It is 3 m. Not reproduced by a: 2.\nPartly; or not")
        == "It is 3 m. 2.\nor not"
    )


def test_what_holds_by_algebra_is_counted_apart():
    same = CLAIM._replace(identity=lambda e: "a is b" if e["a"] == e["b"] else "", kind=ALWAYS)
    found = findings([same], {"a": [2], "b": [2]}) + findings([same], {"a": [2], "b": [3]})
    assert [each["identity"] for each in found] == ["a is b", ""]
    assert counts(found) == "2 claims: 1 reproduced, 1 decided by algebra alone"
    assert found[0]["kind"] == "always" and ALWAYS.rule not in found[0]["rule"]


def test_readings_that_decide_are_no_lack_of_data():
    assert over_readings(REPRODUCED, NOT_REPRODUCED) == DEPENDS
    assert over_readings(REPRODUCED, PARTLY) == PARTLY
    assert over_readings(PARTLY, NOT_REPRODUCED) == NOT_REPRODUCED
    assert both(DEPENDS, REPRODUCED) == DEPENDS and both(DEPENDS, NOT_REPRODUCED) == PARTLY
