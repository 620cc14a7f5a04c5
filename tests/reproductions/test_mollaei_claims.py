"""Verdicts on the claims of Mollaei et al. from made-up tables: of a world in which the paper is
right, one where it is wrong, one that is open."""

import numpy as np
import pandas as pd
import pytest

from strapdown_reproductions.common.claims import judge
from strapdown_reproductions.common.pages import (
    COLOURS,
    DEPENDS,
    NOT_REPRODUCED,
    PARTLY,
    REPRODUCED,
    UNDECIDED,
)
from strapdown_reproductions.common.verdicts import share_of_runs
from strapdown_reproductions.mollaei import claims
from strapdown_reproductions.mollaei.cells import (
    CASES,
    E0,
    E1,
    E2,
    EKF,
    IMU,
    MODES,
    NO_FILTER,
    PKF,
    SIX,
    UKF,
    wide,
)
from strapdown_reproductions.mollaei.metrics import MEASURES
from strapdown_reproductions.mollaei.rules import DEVIATIONS, NEARLY_ALL, Evidence, enough

pytestmark = pytest.mark.short
SEEDS = 40
RIGHT = {NO_FILTER: 40.0, EKF: 10.0, UKF: 1.0, PKF: 0.5}
"""Sizes of all measures in a world in which the paper is right in all but what it has no number
of."""
WRONG = {NO_FILTER: 0.1, EKF: 1.0, UKF: 4.0, PKF: 5.0}
MIXED_UP = dict.fromkeys(MODES, 1.0)


def scores(level, spread=0.02, seeds=SEEDS, **special):
    """Scores about `level` {mode: size}; special: {measure: {mode: size} or one size}, also
    `fixed` sizes of errors with fixes."""
    rng, rows = np.random.default_rng(3), []
    for case in CASES:
        if case.form != SIX:
            continue
        for seed in range(seeds):
            for mode in MODES:
                row = {
                    name: level[mode] * np.exp(spread * rng.standard_normal()) for name in MEASURES
                }
                row |= {
                    name: (size[mode] if isinstance(size, dict) else size)
                    * np.exp(spread * rng.standard_normal())
                    for name, size in special.items()
                }
                rows.append({**case._asdict(), "mode": mode, "seed": seed, "said": "", **row})
    return pd.DataFrame(rows)


def apart(ukf, seeds=SEEDS):
    return pd.DataFrame(
        [
            {"seed": seed, "mode": mode, "apart_m": size}
            for seed in range(seeds)
            for mode, size in ((UKF, ukf), (PKF, 0.05))
        ]
    )


def far(ekf, others, none=600.0):
    """What diverges: largest errors and distances, m."""
    sizes = {NO_FILTER: none, EKF: ekf, UKF: others, PKF: others}
    return {"worst_m": sizes, "off_max_m": sizes}


STILL = {"fy_n": 1e-6, "gy_n": 1e-6, "fixed_horizontal_rmse_m": RIGHT}
GOOD = Evidence(
    wide(scores(RIGHT, **far(2000.0, 30.0), **STILL)),
    apart(1e-9),
    {(UKF, IMU): 900.0, (PKF, IMU): 5400.0},
)
BAD = Evidence(
    wide(scores(WRONG, **far(50.0, 3000.0, 40.0), fixed_horizontal_rmse_m=0.1)),
    apart(0.5),
    {(UKF, IMU): 0.3, (PKF, IMU): 8.0},
)
LOUD = Evidence(
    wide(scores(MIXED_UP, spread=4.0, seeds=3, worst_m=500.0, off_max_m=500.0)), apart(1e-9)[:0], {}
)


def verdicts(evidence):
    return {claim["claim"]: claim["verdict"] for claim in claims.claims(evidence)}


def found_on(name, evidence):
    return judge(claims.CLAIMS[name], evidence)


def verdict(name, evidence):
    return found_on(name, evidence)["verdict"]


def test_a_world_in_which_the_paper_is_right():
    found = verdicts(GOOD)
    assert len(found) == 22 and [
        text[:12] for text, each in found.items() if each == UNDECIDED
    ] == ["Tested in a "]
    assert sum(each == REPRODUCED for each in found.values()) == 21, {
        text: each for text, each in found.items() if each != REPRODUCED
    }


def test_a_world_in_which_it_is_wrong():
    found = verdicts(BAD)
    assert sum(each == NOT_REPRODUCED for each in found.values()) == 21, {
        text: each for text, each in found.items() if each != NOT_REPRODUCED
    }


def test_a_world_in_which_nothing_can_be_told():
    found = verdicts(LOUD)
    sure = {text[:11] for text, each in found.items() if each != UNDECIDED}
    # no zero in any flight; none of three near, Wilson's interval up to 56 %
    assert sure <= {
        "Fy and Gy d",
        "Nonlinear f",
        "In five min",
    }
    assert set(verdicts(Evidence({}, apart(1.0)[:0], {})).values()) == {UNDECIDED}


def test_findings_are_complete():
    for claim in claims.claims(GOOD):
        assert (
            claim["rule"]
            and claim["measured"]
            and claim["source"]
            and claim["decided_by"]
            and claim["verdict"] in COLOURS
        )
        assert "nan" not in claim["measured"], claim


def test_one_filter_where_the_imu_drives_is_half_of_a_claim():
    """Equal in the IMU-driven readings, better in the others: half of the cells of E1."""
    table = scores(RIGHT, **far(2000.0, 30.0), **STILL)
    linear = (table["prediction"] == IMU) & (table["experiment"] != E0)
    names = list(MEASURES)
    for mode in (UKF, PKF):
        table.loc[linear & (table["mode"] == mode), names] = table.loc[
            linear & (table["mode"] == EKF), names
        ].to_numpy()
    e = GOOD._replace(tables=wide(table))
    assert verdict("position_in_outage", e) == PARTLY
    found = found_on("nonlinearity", e)
    assert (
        found["verdict"] == PARTLY
        or "where the system is linear: 0 of 14 cells for it, 14 against" in found["measured"]
    )


def test_readings_that_disagree_decide():
    """Smaller about the own final value, larger about that of the reference flight."""
    level = {f"{name}_ref": WRONG for name in DEVIATIONS}
    e = GOOD._replace(tables=wide(scores(RIGHT, **level)))
    assert verdict("deviations_in_outage", e) == DEPENDS
    assert (
        verdict(
            "overshoots",
            GOOD._replace(tables=wide(scores(RIGHT, step_x_pct=WRONG, step_z_pct=WRONG))),
        )
        == DEPENDS
    )


@pytest.mark.parametrize(
    ("away", "expected"), [(0, REPRODUCED), (4, UNDECIDED), (20, NOT_REPRODUCED)]
)
def test_a_few_flights_that_diverge_leave_it_open(away, expected):
    table = scores(RIGHT, **far(2000.0, 30.0))
    table.loc[table["mode"].isin((UKF, PKF)) & (table["seed"] < away), "off_max_m"] = 501.0
    assert verdict("prevents_divergence", GOOD._replace(tables=wide(table))) == expected


def test_one_flight_of_fifty_leaves_a_reading_open_and_its_rule_says_so():
    """Wilson's lower end with all of n successes is n / (n + z^2)."""
    table = scores(RIGHT, seeds=50, **far(2000.0, 30.0))
    assert share_of_runs([(50, 50)], NEARLY_ALL).supports == 1
    assert share_of_runs([(49, 50)], NEARLY_ALL) == (0, 0, 1)
    rule = found_on("much_less", GOOD)["rule"]
    assert (
        f"of 50 flights 50 are enough (the interval begins at {50 / (50 + 1.959964**2):.3f}), 49 are not (0.895)"
        in rule
    )
    assert enough(200).startswith("of 200 flights 189 are enough")
    for lost, expected in ((0, REPRODUCED), (1, UNDECIDED)):
        table.loc[table["mode"].isin((UKF, PKF)) & (table["seed"] < lost), "off_max_m"] = 101.0
        assert verdict("much_less", GOOD._replace(tables=wide(table))) == expected


@pytest.mark.parametrize("short", [1, 2])
def test_one_seed_decides_nothing_that_rests_on_an_interval(short):
    """As with --quick: `short` seeds of the short flights, one of the long ones. No warning
    either, since warnings are errors."""
    table = scores(RIGHT, seeds=short, **far(2000.0, 30.0), **STILL)
    table = table[(table["seed"] == 0) | table["experiment"].isin((E0, E1))]
    evidence = GOOD._replace(tables=wide(table))
    assert all("nan" not in claim["measured"] for claim in claims.claims(evidence))
    if short == 1:
        decided = {
            text[:11]: each for text, each in verdicts(evidence).items() if each != UNDECIDED
        }
        # these rest on no interval
        assert decided == dict.fromkeys(("Fy and Gy d", "The 315 s w", "(Not said:)"), REPRODUCED)
    assert verdict("long_outage", evidence) == verdict("much_less", evidence) == UNDECIDED


def test_without_a_filter_the_estimate_does_not_count():
    """Its position is zero by construction: only the aircraft can diverge."""
    table = scores(RIGHT, **far(2000.0, 30.0))
    table.loc[table["mode"] == NO_FILTER, "off_max_m"] = 20.0
    found = found_on("long_outage", GOOD._replace(tables=wide(table)))
    assert (
        found["verdict"] == PARTLY
        and "no filter: 0 of 2 cells for it, 2 against" in found["measured"]
    )


def test_stays_near_needs_estimate_and_aircraft():
    for name in ("worst_m", "off_max_m"):
        table = scores(RIGHT, **far(2000.0, 30.0))
        table.loc[table["experiment"] == E2, name] = 101.0
        assert verdict("much_less", GOOD._replace(tables=wide(table))) == NOT_REPRODUCED


def test_some_flights_with_lateral_forces_are_partly_symmetric():
    table = scores(RIGHT, **STILL)
    table.loc[(table["mode"] == EKF), "gy_n"] = 0.01
    found = found_on("symmetric", GOOD._replace(tables=wide(table)))
    assert found["verdict"] == PARTLY and found["measured"].startswith(
        f"{2 * 3 * SEEDS} of {2 * 4 * SEEDS} flights"
    )


@pytest.mark.parametrize(("size", "expected"), [(1e-9, REPRODUCED), (1e-3, NOT_REPRODUCED)])
def test_one_filter_is_one_to_a_micrometre(size, expected):
    assert verdict("one_filter", GOOD._replace(apart=apart(size))) == expected


def test_negligible_is_less_than_twice_the_error_with_fixes():
    for factor, expected in ((1.5, REPRODUCED), (3.0, NOT_REPRODUCED)):
        table = scores(RIGHT)
        table["outage_horizontal_rmse_m"] = factor * table["fixed_horizontal_rmse_m"]
        assert verdict("negligible", GOOD._replace(tables=wide(table))) == expected
