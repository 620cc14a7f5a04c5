"""The rules that turn numbers into verdicts: in made-up worlds where the paper is right, where
it is wrong, and where nothing can be told."""

import numpy as np
import pandas as pd
import pytest

from strapdown_reproductions.common.claims import judge
from strapdown_reproductions.common.pages import (
    DEPENDS,
    NOT_REPRODUCED,
    PARTLY,
    REPRODUCED,
    UNDECIDED,
)
from strapdown_reproductions.common.verdicts import (
    CLOSED,
    NONE,
    OPEN,
    UNKNOWN,
    Count,
    apart,
    better,
    both,
    factors,
    over_readings,
    share,
)
from strapdown_reproductions.hager_bryne import claims

pytestmark = pytest.mark.short
MINUTES = dict(zip([f"{i:02d}" for i in range(1, 12)], (5, 8, 10, 14, 18, 24, 30, 40, 60, 90, 95)))
CENSORED = {"06": 10.0, "07": 5.0, "08": 12.0, "09": 20.0, "10": 8.0, "11": 30.0}


def around(name, value, width=0.02):
    return {
        name: value,
        f"{name}_low": value * (1 - width) - 1e-6,
        f"{name}_high": value * (1 + width) + 1e-6,
    }


def row(grade, flight, right, offset):
    """A cell of a world in which the paper is right, or of one in which it is wrong."""
    good = grade == "navigation" or (grade == "tactical" and flight <= "06")
    inverse = 1 if right else -1
    censored = CENSORED.get(flight, 1.0)
    if not right and flight in ("08", "11"):
        censored = 1.0
    if not right and flight in ("06", "09"):
        censored = 0.5
    stays = 1.0 if right else 0.0
    onset = (20.0 if flight == "07" else 60.0) if offset else 250.0
    if not right:
        onset = (200.0 if flight == "07" else 150.0) if offset else 50.0
    resolved = (200.0 if flight == "07" else 20.0) if right else (20.0 if flight == "07" else 200.0)
    numbers = {
        "position": (0.8 if good else 5.0) ** inverse,
        "position_500": (0.8 if good else 5.0) ** inverse,
        "tilt": 1.5**inverse,
        "heading": (0.8 if grade == "navigation" else 1.2) ** inverse,
        "accel_bias": 0.8**inverse,
        "gyro_bias": 0.8**inverse,
        "open_early": 1 - (grade != "consumer") if right else 0.0,
        "open_diverged": stays,
        "closed_diverged": 1 - stays,
        "closed_anees": 1.5 if right else 1.0,
        "open_anees": 2.0,
        "open_censored_500_m": censored,
        "open_onset_s": onset,
        "closed_resolved_s": resolved,
        "closed_end_accel_bias_m_s2": 0.003 if right or not offset else 0.1,
    }
    for name in ("survived", "survived_500", "survived_500_in_model"):
        numbers |= {f"open_{name}": 1 - stays, f"closed_{name}": stays}
    return {
        "flight": flight,
        "grade": grade,
        "minutes": MINUTES[flight],
        "open_lasted_median_s": 100.0,
    } | {
        key: found for name, value in numbers.items() for key, found in around(name, value).items()
    }


def world(right, wide=False):
    """Evidence of a made-up world."""
    cells = [
        pd.DataFrame(
            [
                row(grade, flight, right, offset)
                for flight in MINUTES
                if flight <= last
                for grade in ("consumer", "tactical", "navigation")
            ]
        )
        for offset, last in ((False, "11"), (True, "07"))
    ]
    rng = np.random.default_rng(1)
    correlation = (0.8 if right else 0.1) + 0.05 * rng.standard_normal(30)
    small = np.exp(np.log(1.0 if right else 3.0) + 0.01 * rng.standard_normal(30))
    resets = pd.DataFrame(
        [
            {
                "minutes": 90,
                "interval_s": 60.0,
                **around("survived", 1.0 if right else 0.0),
                **around("position", 0.95 if right else 5.0),
            }
        ]
    )
    if wide:
        for frame in (*cells, resets):
            (
                frame[[name for name in frame if name.endswith("_low")]],
                frame[[name for name in frame if name.endswith("_high")]],
            ) = 0.0, np.inf
        correlation, small = np.array([0.0, 1.0]), np.array([0.1, 10.0])
    return claims.Evidence(
        *cells,
        pd.DataFrame({"grade": "tactical", "correlation": correlation, "small_ratio": small}),
        resets=resets,
    )


def found_on(name, evidence):
    return judge(claims.CLAIMS[name], evidence)


@pytest.mark.parametrize(
    ("evidence", "verdict"),
    [
        (world(True), REPRODUCED),
        (world(False), NOT_REPRODUCED),
        (world(True, wide=True), UNDECIDED),
    ],
)
def test_every_verdict_is_reached_by_every_claim(evidence, verdict):
    found = claims.claims(evidence)
    assert len(found) == 19 and len({f["claim"] for f in found}) == 19
    wrong = [f for f in found if f["verdict"] != verdict]
    assert not wrong, wrong
    assert all(f["rule"] and f["measured"] and f["source"] and f["decided_by"] for f in found)


def test_a_claim_with_two_halves_of_which_one_holds_is_partly_reproduced():
    right, wrong = world(True), world(False)
    mixed = right.flights.where(right.flights["flight"] >= "07", wrong.flights)
    assert found_on("crossover", right._replace(flights=mixed))["verdict"] == PARTLY


def test_opposite_readings_of_the_abort_rule_decide():
    flights = world(True).flights
    for end in ("", "_low", "_high"):
        flights[f"position_500{end}"] = 1.5
    found = found_on("smooth_fusion", world(True)._replace(flights=flights))
    assert (
        found["verdict"] == DEPENDS
        and "6 of 6 cells for it" in found["measured"]
        and "0 of 6 cells for it" in found["measured"]
    )


def test_resets_need_the_ablations():
    assert found_on("resets", world(True)._replace(resets=None))["verdict"] == UNDECIDED


def test_resets_that_make_the_position_worse_do_not_count():
    resets = world(True).resets.assign(position=1.2, position_low=1.1, position_high=1.3)
    assert found_on("resets", world(True)._replace(resets=resets))["verdict"] == NOT_REPRODUCED


def test_a_flight_that_ends_before_its_bias_is_resolved_says_nothing():
    offset = world(True).offset
    cut = offset["flight"] == "01"
    for end in ("", "_low", "_high"):
        offset.loc[cut, f"closed_resolved_s{end}"] = 300.0
        offset.loc[offset["flight"] == "07", f"closed_resolved_s{end}"] = 1000.0
    assert found_on("straight_is_slow", world(True)._replace(offset=offset))["measured"].startswith(
        "15 of 18 cells for it, 0 against, 3 open"
    )


@pytest.mark.parametrize(
    ("low", "high", "side"),
    [
        (0.5, 0.98, OPEN),
        (0.5, 0.995, UNKNOWN),
        (1.005, 1.5, UNKNOWN),
        (1.02, 1.5, CLOSED),
        (0.995, 1.005, NONE),
        (np.nan, np.nan, UNKNOWN),
    ],
)
def test_better_needs_sign_and_size(low, high, side):
    assert better({"x_low": low, "x_high": high}, "x") == side


@pytest.mark.parametrize(
    ("count", "verdict"),
    [
        ((9, 0, 12), REPRODUCED),
        ((8, 0, 12), PARTLY),
        ((4, 8, 12), PARTLY),
        ((3, 9, 12), NOT_REPRODUCED),
        ((0, 9, 12), NOT_REPRODUCED),
        ((3, 8, 12), UNDECIDED),
        ((0, 0, 12), UNDECIDED),
        ((0, 0, 0), UNDECIDED),
    ],
)
def test_shares_of_cells_decide(count, verdict):
    assert Count(*count).verdict == verdict


def test_combinations():
    assert (
        both(REPRODUCED, REPRODUCED) == REPRODUCED
        and both(REPRODUCED, NOT_REPRODUCED) == PARTLY
        and both(UNDECIDED, NOT_REPRODUCED) == NOT_REPRODUCED
    )
    assert (
        over_readings(REPRODUCED, NOT_REPRODUCED) == DEPENDS
        and over_readings(REPRODUCED, PARTLY) == PARTLY
        and over_readings(PARTLY, NOT_REPRODUCED) == NOT_REPRODUCED
    )


def test_intervals_apart_and_shares():
    a, b = {"x_low": 1, "x_high": 2}, {"x_low": 3, "x_high": 4}
    assert (apart(a, b, "x"), apart(b, a, "x"), apart(a, {"x_low": 1.5, "x_high": 4}, "x")) == (
        -1,
        1,
        0,
    )
    rows = pd.DataFrame({"s_low": [0.6, 0.0, 0.4], "s_high": [0.9, 0.3, 0.6]})
    assert share(rows, "s") == (1, 1, 3) and share(rows, "s", more=False) == (1, 1, 3)


def test_ratios_are_told_in_per_cent_where_they_are_near_one():
    assert factors([1.015, 0.98, 1.00004]) == ["+1.5 %", "-2 %", "+0.00 %"] and factors(
        [1.01, 20.0]
    ) == ["x1.01", "x20"]


@pytest.mark.short
def test_the_two_readings_of_the_offset_decide_together():
    """Opposite verdicts on claims about the offset mean that what the paper leaves open decides;
    both texts are shown."""
    right, wrong = world(True), world(False)
    about = [
        i
        for i, (a, b) in enumerate(
            zip(claims.claims(right), claims.claims(right._replace(offset=wrong.offset)))
        )
        if a["verdict"] != b["verdict"]
    ]
    assert len(about) == 4, (
        "all five but the one on the time until 10 m, which this wrong world does not tell apart"
    )
    mixed = claims.claims(right._replace(initial=wrong.offset))
    same = claims.claims(right._replace(initial=right.offset))
    for i in about:
        assert mixed[i]["verdict"] == DEPENDS and same[i]["verdict"] == REPRODUCED
        assert (
            "Constant (reproduced): " in mixed[i]["measured"]
            and "Initial value (not reproduced): " in mixed[i]["measured"]
        )
