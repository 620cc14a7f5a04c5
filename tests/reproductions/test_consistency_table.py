"""The table of consistency: its rule on made-up numbers, the linear twin against chi-square theory
and against the library's own filter, and a small table run twice."""

import json
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES
from strapdown.evaluation.consistency import band, state_errors
from strapdown.evaluation.cramer_rao import cramer_rao
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.synthesis import Simulator
from strapdown_reproductions.common import write_docs
from strapdown_reproductions.common.gnss_alone import GRADES, SCENARIOS
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.consistency import figure, main, runs, summary, twin, verdicts
from strapdown_reproductions.consistency.refused import MAX_SHOWN, REFUSED
from strapdown_reproductions.consistency.verdicts import Shares
from strapdown_reproductions.consistency.worlds import (
    FED,
    FILTERS,
    WorldCell,
    check_filter,
    world,
)


@pytest.mark.short
def test_every_run_counts_to_its_end():
    low, high = band(STATES, 2)
    nees = np.array([[0.5 * low, 15.0, 2 * high, np.nan], [0.5 * low, 15.0, 15.0, 15.0]])
    assert verdicts.shares(nees, STATES) == (0.25, 0.25, 0.5)
    assert runs.anees(nees / STATES)[0] == np.inf
    mean, error = runs.anees(np.array([[1.0, 3.0], [1.0, 1.0]]))
    assert mean == 1.5 and error == pytest.approx(0.5)


@pytest.mark.short
@pytest.mark.parametrize(
    ("found", "survived", "p", "name"),
    [
        (Shares(0.03, 0.95, 0.02), 1.0, 0.5, "consistent"),
        (Shares(0.0, 0.90, 0.10), 59 / 60, 0.0, "consistent"),
        (Shares(0.0, 0.99, 0.01), 58 / 60, 0.9, "diverging"),
        (Shares(0.05, 0.85, 0.10), 1.0, 0.01, "by chance"),
        (Shares(0.05, 0.85, 0.10), 1.0, 0.009, "too sure"),
        (Shares(0.10, 0.85, 0.05), 1.0, 0.009, "too cautious"),
    ],
)
def test_the_verdict_is_the_rule(found, survived, p, name):
    assert verdicts.verdict(found, survived, p) == name
    assert name in verdicts.VERDICTS and name in figure.LOOKS


@pytest.mark.short
def test_chance_is_the_share_of_right_filters_that_do_no_better():
    right = np.array([0.80, 0.90, 0.95, 0.99])
    assert [verdicts.chance(x, right) for x in (0.7, 0.9, 1.0)] == [0.0, 0.5, 1.0]


@pytest.mark.short
def test_a_twin_without_memory_is_chi_square():
    """Independent epochs: their number inside the band is binomial, and the mean of all NEES has
    the variance of chi-square."""
    epochs, count, sets = 40, 5, 2000
    right = twin.draw_sets(
        np.zeros((epochs, STATES, STATES)), count, sets, np.random.default_rng(2)
    )
    inside = np.rint(right.inside * epochs)
    assert inside.mean() == pytest.approx(0.95 * epochs, abs=4 * np.sqrt(1.9 / sets))
    assert np.mean(inside <= 35) == pytest.approx(binom.cdf(35, epochs, 0.95), abs=0.02)
    spread = np.sqrt(2 / (STATES * count * epochs))
    assert right.anees.std() == pytest.approx(spread, rel=0.07)
    assert right.anees.mean() == pytest.approx(1, abs=4 * spread / np.sqrt(sets))


@pytest.mark.short
def test_a_twin_that_forgets_nothing_is_inside_always_or_never():
    right = twin.draw_sets(np.tile(np.eye(3), (30, 1, 1)), 4, 1000, np.random.default_rng(3))
    assert set(right.inside) == {0.0, 1.0}
    assert right.inside.mean() == pytest.approx(0.95, abs=0.03)


@pytest.mark.short
@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_steps_are_composed_in_their_order(count):
    rng = np.random.default_rng(4)
    Phi, Q = rng.standard_normal((count, 3, 3)), np.tile(np.eye(3), (count, 1, 1))
    P = whole = np.eye(3)
    for step, noise in zip(Phi, Q):
        P, whole = step @ P @ step.T + noise, step @ whole
    one, noise = twin.compose_steps(Phi, Q)
    np.testing.assert_allclose(one, whole)
    np.testing.assert_allclose(one @ one.T + noise, P)


@pytest.fixture(scope="module")
def moved():
    """(Simulator, IMU, Memory of its twin) of the first 20 s in the hand."""
    own, imu = world("hand-held", False).replace(duration=20.0), imu_spec("tactical")
    own = own.replace(gnss=own.gnss._replace(lever_arm=(0.5, 0.2, -0.3)))
    made, at = Simulator(own), twin.epoch_samples(own)
    P = np.diag(own.start_deviations(imu) ** 2)
    return (
        made,
        imu,
        twin.make_memory(made.ideal_recording(), P, imu.noise(), own.gnss.lever_arm, at),
    )


def test_the_twin_is_as_sure_as_the_closed_loop_at_the_truth(moved):
    made, imu, memory = moved
    bound = cramer_rao(made.ideal_recording(), made.exact_start(imu), imu.noise(), every=100)
    stated = np.sqrt(np.diagonal(memory.covariance[1:], axis1=1, axis2=2))
    np.testing.assert_allclose(stated, bound.std, rtol=0.03)


def test_the_twin_forgets_an_error_as_the_closed_loop_does(moved):
    """A small error at the start, in the library's filter on ideal data, against the product of
    the twin's transitions."""
    made, imu, memory = moved
    begin, recording = made.exact_start(imu), made.ideal_recording()
    scale = [np.sqrt(np.diag(P)) for P in memory.covariance[[0, 8]]]
    left = np.eye(STATES)
    for transition in memory.transition[:8]:
        left = transition @ left

    def error(shift):
        start = shifted(begin, shift)
        found = sd.fuse(recording, "closed-loop", start=start, noise=imu.noise(), every=100)
        return state_errors(found, recording)[7] / scale[1]

    for state in (4, 7, 8, 11, 13):
        shift = np.where(np.arange(STATES) == state, 0.05 * scale[0], 0.0)
        expected = left @ shift / scale[1]
        got = 0.5 * (error(shift) - error(-shift))
        room = 0.03 * np.abs(expected).max() + 3e-4  # of the second order
        np.testing.assert_allclose(got, expected, rtol=0, atol=room)


def shifted(start, error):
    """An InitialState whose estimate has this error, true - estimate."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", start.rph[::-1])
    heading, pitch, roll = (Rotation.from_rotvec(-error[6:9]) * rotation).as_euler("ZYX")
    return start._replace(
        v_n=tuple(np.array(start.v_n) - error[3:6]),
        rph=(roll, pitch, heading),
        b_a=tuple(np.array(start.b_a) - error[9:12]),
        b_g=tuple(np.array(start.b_g) - error[12:15]),
    )


@pytest.mark.short
def test_what_is_refused_is_in_the_table_with_its_reason():
    for cell, reason in REFUSED.items():
        assert cell.filter in FILTERS and cell.scenario in SCENARIOS and cell.grade in GRADES
        assert any(letter.isdigit() for letter in reason)
    counts = pd.Series([cell.filter for cell in REFUSED], dtype=object).value_counts()
    assert (counts <= MAX_SHOWN).all()


@pytest.mark.short
def test_only_fed_filters_get_an_ahrs_and_a_hand_gets_positions():
    assert set(FED) < set(FILTERS)
    for name in SCENARIOS:
        assert world(name, True).attitude and not world(name, False).attitude
        assert world(name, False).magnetometer is None
        assert world(name, False).gnss.position_std is not None


@pytest.mark.short
def test_a_filter_that_does_not_state_all_is_refused_by_name():
    with pytest.raises(DataError, match="'fixed-gain' does not state how well it knows all 15"):
        check_filter("fixed-gain")
    with pytest.raises(DataError, match="scenario"):
        main.reproduce("nowhere", scenario=["boat"])


def made_up(**changes):
    """A row of the table."""
    row = dict(
        **WorldCell("ekf", "car", "tactical")._asdict(), runs=60, verdict="consistent", refused=""
    )
    row |= {"inside_%": 95.0, "above_%": 3.0, "below_%": 2.0, "survived_%": 100.0, "p": 0.4}
    row |= {"right_median_%": 97.0, "right_1_in_100_%": 80.0, "anees": 1.0, "anees_error": 0.02}
    return row | {"anees_median": 0.98} | changes


@pytest.mark.short
def test_refused_cells_count_for_no_target():
    rows = pd.DataFrame(
        [
            made_up(),
            made_up(grade="dmu10", verdict="by chance", **{"inside_%": 88.0}),
            made_up(grade="consumer", verdict="diverging", refused="heading unknown: 40 deg"),
        ]
    )
    found = summary.figures(StudyTables(cells=rows))
    assert found == {"inside": 88, "survived": 100, "refused": 1, "missed": 1, "wrong": 0}
    rows.loc[2, "refused"] = ""
    assert summary.figures(StudyTables(cells=rows))["wrong"] == 1
    assert [c["holds"] for c in summary.STUDY.claims(StudyTables(cells=rows))] == [
        False,
        True,
        True,
        False,
        False,
    ]


@pytest.mark.short
def test_where_a_filter_holds_is_said_in_few_words():
    bad = {"car": "too sure", "ship": "diverging", "demo": "too cautious"}
    rows = [
        made_up(
            scenario=name,
            grade=grade,
            verdict=bad.get(name, "by chance") if grade else "consistent",
        )
        for grade in ("", "tactical")
        for name in SCENARIOS
    ]
    rows += [made_up(grade="industrial", scenario=name, refused="why") for name in SCENARIOS[:2]]
    rows += [made_up(grade="dmu10", scenario=name) for name in SCENARIOS[1:]]
    rows += [made_up(grade="dmu10", verdict="diverging", scenario="demo")]
    told = summary.list_holding(pd.DataFrame(rows)).iloc[0]
    assert told[""] == "all" and told["tactical"] == "not demo, car, ship"
    assert told["industrial"] == "none" and told["dmu10"] == "not demo"


@pytest.mark.short
def test_the_figure_tells_without_colours():
    rows = pd.DataFrame(
        [
            made_up(scenario=name, verdict=verdict, refused="" if k else "why")
            for k, (name, verdict) in enumerate(zip(SCENARIOS, verdicts.VERDICTS))
        ]
    )
    texts = [
        element.text
        for element in ElementTree.fromstring(figure.draw_cells(rows)).iter()
        if element.tag.endswith("text")
    ]
    for name in (*verdicts.VERDICTS[1:], "refused"):
        sign = figure.LOOKS[name][0]
        assert sum(text.split()[0] == sign for text in texts) == 2  # in its cell and the legend


def test_a_table_is_made_in_parts_and_twice_the_same(tmp_path, monkeypatch):
    grades = ("consumer", "tactical")
    monkeypatch.setattr(main, "SETS", 20)
    monkeypatch.setattr(main, "GRADES", grades)
    given = {"runs": 2, "filter": ["closed-loop"], "scenario": ["hand-held"]}
    claims = main.reproduce(tmp_path, **given)
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    cells = (tmp_path / "cells.csv").read_text()
    chunks = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nc")}
    assert len(chunks) == len(grades)
    main.reproduce(tmp_path, **given)
    assert (tmp_path / "cells.csv").read_text() == cells
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nc")} == chunks
    table = pd.read_csv(tmp_path / "cells.csv")
    assert list(table["grade"]) == list(grades) and (table["runs"] == 2).all()
    for file in ("table.md", "each.md", "consistency.svg", "index.html"):
        assert (tmp_path / file).stat().st_size > 0


@pytest.mark.short
def test_the_picture_of_the_docs_is_of_the_run(tmp_path, monkeypatch):
    for file, page in (write_docs.PAGES["consistency"], write_docs.MORE["consistency"]):
        (tmp_path / page).write_text(
            f"<!-- begin: {file} of strapdown reproduce consistency -->\n<!-- end -->\n"
        )
        (tmp_path / file).write_text(f"what {file} says\n")
    (tmp_path / "run").mkdir()
    picture = write_docs.PICTURES["consistency"]
    for file in ("table.md", "each.md"):
        (tmp_path / file).rename(tmp_path / "run" / file)
    (tmp_path / "run" / picture).write_text("<svg/>")
    monkeypatch.setattr(write_docs, "DOCS", tmp_path)
    write_docs.main("consistency", str(tmp_path / "run"))
    assert (tmp_path / picture).read_text() == "<svg/>"
    assert "what each.md says" in (tmp_path / "consistency-each.md").read_text()
