"""The rules that turn runs into verdicts: in made-up worlds where the chapter is right, where it
is wrong, and where nothing can be told."""

from functools import cache
from itertools import product

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
from strapdown_reproductions.fossen import claims, readings, runs, statements
from strapdown_reproductions.fossen.cases import CASES, CHAPTER, FADING, FAST, RIGHT, TUNINGS
from strapdown_reproductions.fossen.signals import EXCITATIONS, MOVED

pytestmark = pytest.mark.short
SEEDS = 100  # from some 80 on none in all means seldom


def run(case, excitation, right):
    """A run of a world in which the chapter is right, or of one in which it is wrong."""
    attitude_known = "ahrs" in case
    moves = excitation in MOVED or attitude_known
    converges = moves if right else not attitude_known and excitation not in MOVED
    lost = excitation == "steep" and (
        case.startswith("euler-direct") if right else not case.startswith("euler-direct")
    )
    good = not lost if right else excitation == "steep" and not lost
    return {
        "stopped": lost,
        "accel_s": 80.0 if converges else np.inf,
        "accel_first_s": 20.0,
        "angle_std_rad": 30.0 if lost else 0.1,
        "gyro_s": 5.0 if converges else np.inf,
        "position_m": 0.03 if good else 50.0,
        "velocity_m_s": 0.01 if good else 1.0,
        "attitude_rad": 0.001 if good else 0.5,
        "ins_m": 1e4 if right else 5.0,
        "growth": 1.0 if right else 2.6,
        "ins_growth": 2.6 if right else 1.0,
        "accel_m_s2": 0.01,
        **{f"accel_left_{axis}": 0.1 for axis in "xyz"},
        **{f"gyro_left_{axis}": 0.1 for axis in "xyz"},
    }


def dropout(right):
    return {
        "accel_before": 0.1,
        "accel_after": 0.05 if right else 0.2,
        "accel_left": 0.8 if right else 1.0,
        "accel_model": 0.8,
        "position_after_m": 300.0,
    }


def intro(form, right):
    return {
        "position_m": 0.1 if right else 50.0,
        "ins_m": 1e4 if right else 3.0,
        "bias_before": 0.1,
        "bias_after": 0.05 if right else 0.2,
        "bias_left": 0.8 if right else 1.0,
        "bias_model": 0.8,
    }


def beside(truth):
    """The tables of statements; truth: of a seed, whether the chapter is right with it."""
    moving = {"at rest": 0.0, "coordinated turn": 6.0}
    tilt = {
        True: {"at rest": 0.1, "coordinated turn": 30.0},
        False: {"at rest": 5.0, "coordinated turn": 0.5},
    }
    seeds, frame = range(SEEDS), pd.DataFrame
    doubted = truth(0) != truth(1)
    # what has no chance in it is without rows where nothing can be told
    static = [(name, a, tilt[truth(0)][name]) for name, a in moving.items() if not doubted]
    cost = [
        (k, 5.0 if truth(k) else 1e3, 2.5 if truth(k) else 2e3, "all") for k in half(seeds, doubted)
    ]
    return {
        statements.STATIC: frame(static, columns=["motion", "acceleration_m_s2", "tilt_deg"]),
        statements.STABILITY: frame(
            [
                (field, start, k, 0.1 if truth(k) else 90.0)
                for field, start, k in product(
                    statements.FIELDS, statements.STARTS, half(seeds, doubted)
                )
            ],
            columns=["field", "start_deg", "seed", "off_deg"],
        ),
        statements.GAINS: frame(
            [
                (
                    k,
                    hurwitz,
                    (1e-3 if hurwitz else 1e9) if truth(k) else (1.0 if hurwitz else 0.1),
                    0.1,
                )
                for hurwitz, k in product((True, False), half(seeds, doubted))
            ],
            columns=["seed", "hurwitz", "left", "turning_1_s"],
        ),
        statements.QUATERNION: frame(
            [
                (k, 1e-16 if truth(k) else 0.5, 1e-3 if truth(k) else 0.0, "all")
                for k in half(seeds, doubted)
            ],
            columns=["seed", "smallest", "length", "all"],
        ),
        statements.COST: frame(cost, columns=["repeat", "mekf_us", "observer_us", "all"]),
        statements.FLIGHT: frame(
            [(k, k, 3.0 if truth(k) else 12.0, 12.0 if truth(k) else 3.0) for k in seeds],
            columns=["second", "block", "gnss_deg", "gravity_deg"],
        ),
    }


def half(seeds, doubted):
    """All seeds, or where nothing can be told two, one of each world, which decide nothing at 90 %."""
    return list(seeds)[:2] if doubted else list(seeds)


@cache
def world(right, doubtful=False):
    """Evidence of a made-up world; `doubtful`: every second seed is of the other one."""
    truth = lambda seed: right != (doubtful and seed % 2 == 1)
    rows = [
        {
            "case": case.name,
            "excitation": excitation,
            "tuning": tuning,
            "seed": seed,
            **run(case.name, excitation, truth(seed)),
        }
        for case, excitation, tuning, seed in product(
            CASES + FAST, EXCITATIONS, TUNINGS, range(SEEDS)
        )
    ]
    dropped = [
        {
            "case": case,
            "excitation": signal,
            "tuning": tuning,
            "seed": seed,
            **dropout(truth(seed)),
        }
        for case, signal, tuning, seed in product(
            runs.DROPPED, MOVED, (CHAPTER, FADING), range(SEEDS)
        )
    ]
    short = [
        {"seed": seed, "biases": biases, "outage": outage, "form": form, **intro(form, truth(seed))}
        for seed, biases, outage, form in product(
            range(SEEDS), ("constant", "decaying"), (0, 1), ("feedforward", "feedback", "direct")
        )
    ]
    return claims.FossenEvidence(
        pd.DataFrame(rows), pd.DataFrame(dropped), pd.DataFrame(short), beside(truth)
    )


@pytest.mark.parametrize(
    ("evidence", "verdict"),
    [
        (world(True), REPRODUCED),
        (world(False), NOT_REPRODUCED),
        (world(True, doubtful=True), UNDECIDED),
    ],
)
def test_every_verdict_is_reached_by_every_claim(evidence, verdict):
    found = claims.claims(evidence)
    assert len(found) == 21 and len({f["claim"] for f in found}) == 21
    wrong = [(f["claim"], f["verdict"], f["measured"]) for f in found if f["verdict"] != verdict]
    if verdict == UNDECIDED:  # what happens in every second run is possible
        (sometimes,) = wrong
        assert sometimes[0].startswith("Covariance blow-up") and sometimes[1] == PARTLY
    else:
        assert not wrong, wrong
    told = [f for f in found if not f["measured"].startswith("needs")]
    assert all(f["answer"] for f in told) and all(f["kind"] for f in found)
    assert all(f["rule"] and f["measured"] and f["source"] and f["decided_by"] for f in found)


def test_no_rule_is_longer_than_a_reader_takes_in():
    """Of its own; that of its kind stands once on the page of all claims."""
    long = {name: len(claim.rule) for name, claim in claims.CLAIMS.items() if len(claim.rule) > 300}
    assert not long


def at(evidence, column, value, **wanted):
    """The evidence with another value in those rows of the runs whose columns have the `wanted`."""
    own = np.logical_and.reduce([evidence.runs[name].isin(each) for name, each in wanted.items()])
    changed = evidence.runs[column].where(~own, value)
    return evidence._replace(runs=evidence.runs.assign(**{column: changed}))


VARYING = {"excitation": ["signal 2"], "tuning": [CHAPTER]}


@pytest.mark.parametrize("name", ["accel_minutes", "states_converge", "excitation"])
def test_biases_of_signal_2_are_a_reading_with_a_vote(name):
    """Where only varying biases speak against the MEKF, the claim depends on the reading; where constant
    ones do too, a claim that asks for all cells falls."""
    evidence = world(True)
    for column, bad in (("accel_s", np.inf), ("position_m", 50.0)):
        evidence = at(evidence, column, bad, **VARYING)
    finding = judge(claims.CLAIMS[name], evidence)
    assert finding["verdict"] == DEPENDS, finding
    rows = claims.by_reading(evidence)
    rows = rows[rows["claim"] == 1 + list(claims.CLAIMS).index(name)]
    against = rows[rows["verdict"] == NOT_REPRODUCED]
    assert set(against["reading"]) == {
        f"{filter}, chapter's weights, varying biases" for filter in ("as printed", "library")
    }
    assert len(rows) == 2 * 3 * 2 and set(against["word"]) == {readings.SPIRIT}
    letter = rows[rows["word"] == readings.LETTER]
    assert list(letter["reading"]) == ["as printed, chapter's weights, constant biases"]
    assert list(letter["verdict"]) == [REPRODUCED]


def test_growth_is_tested_as_growth():
    """A large error that stands still has not grown, a small one that doubles has."""
    right = world(True)
    large = right._replace(runs=right.runs.assign(position_m=50.0))
    assert judge(claims.CLAIMS["feedback_bounds"], large)["verdict"] == REPRODUCED
    small = right._replace(runs=right.runs.assign(growth=2.0))
    assert judge(claims.CLAIMS["feedback_bounds"], small)["verdict"] == PARTLY
    still = right._replace(runs=right.runs.assign(ins_growth=1.0))
    assert judge(claims.CLAIMS["feedback_bounds"], still)["verdict"] == PARTLY


def test_a_statement_without_its_table_says_what_it_needs():
    finding = judge(claims.CLAIMS["demonstration"], world(True)._replace(beside={}))
    assert finding["verdict"] == UNDECIDED and finding["measured"] == "needs the table flight"


def test_a_claim_that_one_tuning_supports_depends_on_the_reading():
    right, wrong = world(True), world(False)
    mixed = right._replace(runs=right.runs.where(right.runs["tuning"] == RIGHT, wrong.runs))
    for name in ("accel_minutes", "gyro_seconds"):
        assert judge(claims.CLAIMS[name], mixed)["verdict"] == DEPENDS


def test_a_possible_blow_up_takes_some_runs_and_not_most():
    evidence = world(False)
    steep = (evidence.runs["case"] == claims.PRINTED) & (evidence.runs["excitation"] == "steep")
    sound = evidence.runs.assign(stopped=False, position_m=0.1)
    for share, verdict in ((0.0, NOT_REPRODUCED), (0.05, UNDECIDED), (0.2, REPRODUCED)):
        blown = steep & (evidence.runs["seed"] < share * SEEDS)
        own = evidence._replace(runs=sound.assign(angle_std_rad=np.where(blown, 4.0, 0.1)))
        part = claims.CLAIMS["euler_blows_up"].parts["printed"](own)
        assert part.verdict == verdict, (share, str(part))


def test_sooner_counts_for_one_to_two_minutes_and_later_does_not():
    evidence = world(True)
    for seconds, verdict in ((20.0, REPRODUCED), (119.0, REPRODUCED), (121.0, NOT_REPRODUCED)):
        assert (
            judge(
                claims.CLAIMS["accel_minutes"],
                evidence._replace(runs=evidence.runs.assign(accel_s=seconds)),
            )["verdict"]
            == verdict
        )
    for seconds, verdict in ((9.9, REPRODUCED), (10.0, NOT_REPRODUCED)):
        assert (
            judge(
                claims.CLAIMS["gyro_seconds"],
                evidence._replace(runs=evidence.runs.assign(gyro_s=seconds)),
            )["verdict"]
            == verdict
        )


def test_decaying_estimates_alone_make_no_error_smaller():
    evidence = world(True)
    held = evidence._replace(dropouts=evidence.dropouts.assign(accel_after=0.2))
    assert judge(claims.CLAIMS["decay"], held)["verdict"] == DEPENDS
    assert (
        judge(claims.CLAIMS["decay"], evidence._replace(dropouts=pd.DataFrame()))["verdict"]
        == UNDECIDED
    )


def test_few_runs_decide_nothing():
    few = world(True)
    few = few._replace(runs=few.runs[few.runs["seed"] < 3])
    rows = claims.by_reading(few)
    of_gyros = rows[rows["claim"] == 1 + list(claims.CLAIMS).index("gyro_seconds")]
    assert judge(claims.CLAIMS["gyro_seconds"], few)["verdict"] == UNDECIDED
    assert set(of_gyros["verdict"]) == {UNDECIDED}
    assert set(of_gyros["cells"]) == {
        f"0 of {n} cells for it, 0 against, {n} open" for n in (4, 12)
    }


def test_never_stays_never_in_quantiles():
    assert (
        runs.quantiles([5.0] * 8 + [np.inf] * 2) == (5.0, 5.0, np.inf)
        and runs.seconds(np.inf) == "never"
    )
    assert (runs.seconds(4.25), runs.seconds(119.6), runs.seconds(np.nan)) == ("4.2", "120", "–")
