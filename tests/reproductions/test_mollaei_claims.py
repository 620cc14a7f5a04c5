"""Verdicts on the claims of Mollaei et al. from made-up tables: of a world in which the paper is
right, one where it is wrong, one that is open, and of worlds that know what holds by algebra."""

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
    counts,
)
from strapdown_reproductions.common.verdicts import vote
from strapdown_reproductions.mollaei import claims, rules, runs
from strapdown_reproductions.mollaei.cells import (
    AT_TRIM,
    CASES,
    E0,
    E1,
    E2,
    EKF,
    EKFS,
    GUSTS,
    HELD,
    IMU,
    MODEL,
    NO_FILTER,
    ONCE,
    PKF,
    POINTS,
    SIX,
    UKF,
    wide,
)
from strapdown_reproductions.mollaei.metrics import MEASURES
from strapdown_reproductions.mollaei.rules import DEVIATIONS, MollaeiEvidence, enough

pytestmark = pytest.mark.short
SEEDS = 40
ALL = (NO_FILTER, *EKFS, UKF, PKF, POINTS)
RIGHT = {NO_FILTER: 40.0, **dict.fromkeys(EKFS, 10.0), UKF: 1.0, PKF: 0.5, POINTS: 0.5}
"""Sizes of all measures in a world in which the paper is right in all but what it has no number
of, where the model predicts."""
LINEAR = {NO_FILTER: 40.0, EKF: 1.0, AT_TRIM: 1.0, ONCE: 1.5, HELD: 1.5, UKF: 1.0, PKF: 1.0}
"""The same where the IMU does: one filter, but for the EKFs that err with the attitude."""
WRONG = {NO_FILTER: 0.1, **dict.fromkeys(EKFS, 1.0), UKF: 4.0, PKF: 5.0, POINTS: 5.0}
MIXED_UP = dict.fromkeys(ALL, 1.0)


def scores(level, linear=None, spread=0.02, seeds=SEEDS, **special):
    """Scores about `level` {mode: size}, where the IMU predicts about `linear` if it is given;
    special: {measure: {mode: size} or one size}, also `fixed` sizes of errors with fixes."""
    rng, rows = np.random.default_rng(3), []
    for case in CASES:
        if case.form != SIX:
            continue
        sizes = linear if linear and case.linear else level
        for seed in range(seeds):
            for mode in runs.modes(case, 0):
                draw = lambda: np.exp(spread * rng.standard_normal())
                row = {name: sizes[mode] * draw() for name in MEASURES}
                row |= {
                    name: (size[mode] if isinstance(size, dict) else size) * draw()
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
    sizes = dict.fromkeys(EKFS, ekf) | {NO_FILTER: none, UKF: others, PKF: others, POINTS: others}
    return {"worst_m": sizes, "off_max_m": sizes}


STILL = {"fy_n": 1e-6, "gy_n": 1e-6, "fixed_horizontal_rmse_m": 1.0}


def right(**special):
    """Scores of the world in which the paper is right."""
    return scores(RIGHT, LINEAR, **far(2000.0, 30.0), **{**STILL, **special})


def world(table):
    return MollaeiEvidence(wide(table), apart(1e-9))


GOOD = world(right())
BAD = MollaeiEvidence(
    wide(scores(WRONG, **far(50.0, 3000.0, 40.0), fixed_horizontal_rmse_m=0.1)), apart(0.5)
)
LOUD = MollaeiEvidence(
    wide(scores(MIXED_UP, spread=4.0, seeds=3, worst_m=500.0, off_max_m=500.0)), apart(1e-9)[:0]
)


def verdicts(evidence):
    return {claim["claim"]: claim["verdict"] for claim in claims.claims(evidence)}


def found_on(name, evidence):
    return judge(claims.CLAIMS[name], evidence)


def verdict(name, evidence):
    return found_on(name, evidence)["verdict"]


def test_a_world_in_which_the_paper_is_right():
    found = verdicts(GOOD)
    assert len(found) == 20
    assert sum(each == REPRODUCED for each in found.values()) == 20, {
        text: each for text, each in found.items() if each != REPRODUCED
    }


def test_a_world_in_which_it_is_wrong():
    found = verdicts(BAD)
    assert sum(each == NOT_REPRODUCED for each in found.values()) == 20, {
        text: each for text, each in found.items() if each != NOT_REPRODUCED
    }


def test_a_world_in_which_nothing_can_be_told():
    found = verdicts(LOUD)
    sure = {text[:11] for text, each in found.items() if each != UNDECIDED}
    # a flight is or is not symmetric, and Wilson's interval of none of three near goes up to 56 %
    assert sure <= {"Fy and Gy d", "In five min", "Nonlinear f"}
    assert set(verdicts(MollaeiEvidence({}, apart(1.0)[:0])).values()) == {UNDECIDED}


def test_findings_are_complete():
    for name, row in claims.CLAIMS.items():
        claim = found_on(name, GOOD)
        assert claim["rule"] and claim["measured"] and claim["source"] and claim["decided_by"]
        assert claim["answer"].endswith(".") and claim["verdict"] in COLOURS
        assert claim["kind"]
        assert "nan" not in claim["measured"] + claim["answer"], (claim, row)


def test_cells_that_are_identities_do_not_vote():
    """Whatever the numbers of EKF, UKF and PKF are where the IMU predicts: they are noise of the
    last digit, and no verdict on which is better rests on them."""
    table = right()
    linear = (table["prediction"] == IMU) & table["mode"].isin((UKF, PKF))
    table.loc[linear, list(MEASURES)] *= 0.01
    for name in ("accurate_estimates", "deviations_in_outage"):
        mine, before = (
            found_on(name, each)["measured"].split(". EKF once, IMU-driven: ")[0]
            for each in (world(table), GOOD)
        )
        assert mine == before and "cells more are identities" in found_on(name, GOOD)["measured"]


def test_a_world_in_which_only_the_imu_predicts_is_decided_by_algebra_and_counted_apart():
    """No cell is evidence; verdicts on which filter is better are called identities."""
    table = right()
    table = table[(table["prediction"] == IMU) & ~table["mode"].isin((ONCE, HELD))]
    found = claims.claims(world(table))
    same = {claim["claim"][:20] for claim in found if claim["identity"]}
    names = ("accurate_estimates", "ekf_deviates", "overshoots", "engine_and_alpha", "convergence")
    names += ("position_in_outage", "deviations_in_outage", "pkf_over_ukf", "fastest", "one_filter")
    assert same == {claims.CLAIMS[name].text[:20] for name in names}
    for name in names[:-1]:
        assert verdict(name, world(table)) == NOT_REPRODUCED
    assert f"{len(same)} decided by algebra alone" in counts(found)
    assert [each["claim"][:11] for each in claims.claims(GOOD) if each["identity"]] == [
        "(Not said:)"
    ]


@pytest.mark.parametrize("mode", [AT_TRIM, ONCE, HELD])
def test_a_claim_that_turns_with_the_reading_of_the_ekf_says_so(mode):
    """One filter as equation (22) has it, and worse in one of the other readings."""
    level = dict.fromkeys(ALL, 1.0) | {mode: 20.0}
    e = world(scores(level))
    found = found_on("position_in_outage", e)
    assert found["verdict"] == DEPENDS
    assert f"turns with another reading: {mode}, model-driven (UKF / {mode} 0.05" in found["answer"]
    assert "Equation (22) linearises at the estimate" in found["answer"]
    assert verdict("position_in_outage", world(scores(MIXED_UP))) == NOT_REPRODUCED


def test_a_claim_that_turns_with_who_predicts_says_so():
    """Better than no filter where the model predicts, worse where the IMU does."""
    table = scores(MIXED_UP | {NO_FILTER: 3.0})
    table.loc[(table["mode"] == NO_FILTER) & (table["prediction"] == IMU), list(MEASURES)] = 0.3
    found = found_on("better_than_none", world(table))
    assert found["verdict"] == DEPENDS
    assert (
        "turns with another reading: as printed, IMU-driven (UKF / no filter 3" in found["answer"]
    )
    assert "one filter" not in found["answer"]


def test_a_condition_and_the_sigma_points_turn_it_too():
    table = scores(MIXED_UP)
    gusts = (table["condition"] == GUSTS) & table["mode"].isin((UKF, PKF))
    table.loc[gusts, "horizontal_end_m"] *= 0.1
    table.loc[gusts, "vertical_end_m"] *= 0.1
    table.loc[gusts, "outage_horizontal_rmse_m"] *= 0.1
    found = found_on("position_in_outage", world(table))
    assert (
        found["verdict"] == DEPENDS
        and f"{GUSTS}, model-driven (UKF / EKF 0.0998," in found["answer"]
    )
    assert "Equation (22)" not in found["answer"]
    found = found_on("pkf_over_ukf", world(scores(MIXED_UP | {POINTS: 0.5})))
    assert found["verdict"] == DEPENDS and "PKF by points / UKF 0.5" in found["answer"]


@pytest.mark.parametrize(
    ("model", "imu", "expected"),
    [(3.0, 1.0, REPRODUCED), (1.0, 1.0, NOT_REPRODUCED), (3.0, 3.0, NOT_REPRODUCED)],
)
def test_a_cause_has_its_effect_where_it_is_and_not_where_it_is_not(model, imu, expected):
    """The EKFs that err with the attitude also err where the system is linear: then it is not the
    nonlinearity. Those that are one filter there cannot."""
    level = {mode: model if mode in EKFS else 1.0 for mode in ALL}
    linear = level | {EKF: 1.0, AT_TRIM: 1.0, ONCE: imu, HELD: imu}
    e = world(scores(level, linear))
    whole = found_on("nonlinearity", e)
    assert whole["verdict"] == (DEPENDS if imu > 1 else expected)
    of_held = whole["measured"].split(f"{HELD}: ")[1]
    assert (
        of_held.startswith(expected)
        and f"{EKF}: {expected if imu == 1 else REPRODUCED}" in (whole["measured"])
    )


def test_readings_that_disagree_decide():
    """Smaller about the own final value, larger about that of the reference flight."""
    level = {f"{name}_ref": WRONG for name in DEVIATIONS}
    assert verdict("deviations_in_outage", world(right(**level))) == DEPENDS
    e = world(right(step_x_pct=WRONG, step_z_pct=WRONG))
    assert verdict("overshoots", e) == DEPENDS


def test_better_than_one_of_two_is_partly():
    level = RIGHT | {PKF: 10.0, POINTS: 10.0}
    assert verdict("position_in_outage", world(scores(level, LINEAR))) == PARTLY


@pytest.mark.parametrize(("share", "expected"), [(0.75, REPRODUCED), (0.25, NOT_REPRODUCED)])
def test_usually_is_more_than_half_of_the_cells(share, expected):
    names = list(DEVIATIONS) + ["over_x_pct", "over_z_pct"]
    names += [f"{name}_ref" for name in DEVIATIONS] + ["step_x_pct", "step_z_pct"]
    worse = {PKF: 2.0, POINTS: 2.0}
    special = {name: MIXED_UP | worse for k, name in enumerate(names) if k % 4 >= 4 * share}
    e = world(scores(MIXED_UP | {PKF: 0.5, POINTS: 0.5}, **special))
    assert verdict("pkf_over_ukf", e) == expected


@pytest.mark.parametrize(
    ("away", "expected"), [(0, REPRODUCED), (4, UNDECIDED), (20, NOT_REPRODUCED)]
)
def test_a_few_flights_that_diverge_leave_it_open(away, expected):
    table = right()
    table.loc[table["mode"].isin((UKF, PKF)) & (table["seed"] < away), "off_max_m"] = 501.0
    assert verdict("prevents_divergence", world(table)) == expected


def test_who_predicts_decides_what_diverges():
    table = right()
    lost = (table["experiment"] == E2) & (table["prediction"] == IMU)
    table.loc[lost, "worst_m"] = 2000.0
    for name in ("prevents_divergence", "much_less"):
        found = found_on(name, world(table))
        assert found["verdict"] == DEPENDS and "model-driven: reproduced" in found["measured"]
    table = right()
    held = (table["experiment"] == E2) & (table["prediction"] == MODEL)
    table.loc[held & table["mode"].isin(EKFS), ["worst_m", "off_max_m"]] = 30.0
    assert verdict("long_outage", world(table)) == DEPENDS
    assert found_on("long_outage", world(table))["measured"].count(": not reproduced") == 4


def test_one_flight_of_fifty_leaves_a_reading_open_and_its_rule_says_so():
    """Wilson's lower end with all of n successes is n / (n + z^2)."""
    table = scores(RIGHT, LINEAR, seeds=50, **far(2000.0, 30.0))
    rule = found_on("much_less", GOOD)["rule"]
    begins = 50 / (50 + 1.959964**2)
    assert vote(begins, 1.0, rules.NEARLY_ALL) == 1
    assert (
        f"of 50 flights 50 are enough (the interval begins at {begins:.3f}), 49 are not (0.895)"
        in rule
    )
    assert enough(200).startswith("of 200 flights 189 are enough")
    for lost, expected in ((0, REPRODUCED), (1, UNDECIDED)):
        table.loc[table["mode"].isin((UKF, PKF)) & (table["seed"] < lost), "off_max_m"] = 101.0
        assert verdict("much_less", world(table)) == expected


@pytest.mark.parametrize("short", [1, 2])
def test_one_seed_decides_nothing_that_rests_on_an_interval(short):
    """As with --quick: `short` seeds of the short flights, one of the long ones. No warning
    either, since warnings are errors."""
    table = scores(RIGHT, LINEAR, seeds=short, **far(2000.0, 30.0), **STILL)
    table = table[(table["seed"] == 0) | table["experiment"].isin((E0, E1))]
    evidence = world(table)
    assert all("nan" not in claim["measured"] for claim in claims.claims(evidence))
    if short == 1:
        decided = {
            text[:11]: each for text, each in verdicts(evidence).items() if each != UNDECIDED
        }
        # these rest on no interval
        assert decided == dict.fromkeys(("Fy and Gy d", "(Not said:)"), REPRODUCED)
    assert verdict("long_outage", evidence) == verdict("much_less", evidence) == UNDECIDED


def test_without_a_filter_the_estimate_does_not_count():
    """Its position is zero by construction: only the aircraft can diverge."""
    table = right()
    table.loc[table["mode"] == NO_FILTER, "off_max_m"] = 20.0
    found = found_on("long_outage", world(table))
    assert found["verdict"] == PARTLY
    assert "no filter, E2, IMU-driven: not reproduced, 0 of 40" in found["measured"]


def test_stays_near_needs_estimate_and_aircraft():
    for name in ("worst_m", "off_max_m"):
        table = right()
        table.loc[table["experiment"] == E2, name] = 101.0
        assert verdict("much_less", world(table)) == NOT_REPRODUCED


def test_one_flight_with_lateral_forces_is_a_counter_example():
    table = right()
    one = (table["mode"] == EKF) & (table["seed"] == 3) & (table["prediction"] == IMU)
    table.loc[one & (table["tuning"] == "sensors"), "gy_n"] = 0.01
    found = found_on("symmetric", world(table))
    flights = 4 * 4 * SEEDS  # cases of E0, modes of the paper
    assert found["verdict"] == NOT_REPRODUCED
    assert found["measured"].startswith(f"{flights - 1} of {flights} flights")


@pytest.mark.parametrize(
    ("ratio", "expected"), [(2.2, REPRODUCED), (1.8, NOT_REPRODUCED), (2.0, UNDECIDED)]
)
def test_always_so_many_times_falls_with_one_cell(ratio, expected):
    """Fx with printed Q and R against the PKF alone."""
    table = right()
    one = (table["mode"] == PKF) & (table["tuning"] == "printed") & (table["prediction"] == IMU)
    table.loc[one, "fx_n"] = 40.0 / ratio
    none = table["mode"] == NO_FILTER
    table.loc[none, "fx_n"] = 40.0 * np.exp(
        0.02 * np.random.default_rng(8).standard_normal(none.sum())
    )
    assert verdict("no_filter_diverges", world(table)) == expected
    assert verdict("no_filter_diverges", GOOD) == REPRODUCED


@pytest.mark.parametrize(("size", "expected"), [(1e-9, REPRODUCED), (1e-3, NOT_REPRODUCED)])
def test_one_filter_is_one_to_a_micrometre(size, expected):
    assert verdict("one_filter", GOOD._replace(apart=apart(size))) == expected


def test_negligible_is_less_than_twice_the_error_with_fixes():
    for factor, expected in ((1.5, REPRODUCED), (3.0, NOT_REPRODUCED)):
        table = scores(RIGHT)
        table["outage_horizontal_rmse_m"] = factor * table["fixed_horizontal_rmse_m"]
        assert verdict("negligible", world(table)) == expected


def test_the_table_of_readings_calls_an_identity_that():
    found = rules.readings(GOOD.tables).set_index(["reading", "case", "ratio"])
    printed = found.loc[("as printed", "E1, IMU-driven", "UKF / EKF")]
    assert set(printed) == {"identity"}
    held = found.loc[(HELD, "E1, model-driven", f"UKF / {HELD}"), "Fx"]
    assert held.startswith("0.1 (0.09") and len(found) == len(set(found.index))
    assert {name for name, _, _ in found.index} == {each.name for each in rules.READINGS}
