"""The rules that turn runs into verdicts: in made-up worlds where the chapter is right, where it
is wrong, and where nothing can be told."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from strapdown_reproductions.common.claims import judge
from strapdown_reproductions.common.pages import NOT_REPRODUCED, PARTLY, REPRODUCED, UNDECIDED
from strapdown_reproductions.fossen import claims, runs
from strapdown_reproductions.fossen.cases import CASES, CHAPTER, FADING, RIGHT, TUNINGS
from strapdown_reproductions.fossen.signals import SIGNALS

pytestmark = pytest.mark.short
EXCITATIONS = (*SIGNALS, "at rest", "steady", "turning", "steep")
SEEDS = 100  # from some 80 on none in all means seldom


def run(case, excitation, right):
    """A run of a world in which the chapter is right, or of one in which it is wrong."""
    attitude_known = "ahrs" in case
    moves = excitation in SIGNALS or attitude_known
    converges = moves if right else not attitude_known and excitation not in SIGNALS
    lost = excitation == "steep" and (
        case.startswith("euler-direct") if right else not case.startswith("euler-direct")
    )
    good = not lost if right else excitation == "steep" and not lost
    return {
        "stopped": lost,
        "accel_s": 80.0 if converges else np.inf,
        "accel_first_s": 20.0,
        "angle_sd_rad": 30.0 if lost else 0.1,
        "gyro_s": 5.0 if converges else np.inf,
        "position_m": 0.03 if good else 50.0,
        "velocity_m_s": 0.01 if good else 1.0,
        "attitude_rad": 0.001 if good else 0.5,
        "ins_m": 1e4 if right else 5.0,
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
    }


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
        for case, excitation, tuning, seed in product(CASES, EXCITATIONS, TUNINGS, range(SEEDS))
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
            runs.DROPPED, SIGNALS, (CHAPTER, FADING), range(SEEDS)
        )
    ]
    short = [
        {"seed": seed, "biases": biases, "outage": outage, "form": form, **intro(form, truth(seed))}
        for seed, biases, outage, form in product(
            range(SEEDS), ("constant", "decaying"), (0, 1), ("feedforward", "feedback", "direct")
        )
    ]
    return claims.FossenEvidence(pd.DataFrame(rows), pd.DataFrame(dropped), pd.DataFrame(short))


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
    assert len(found) == 14 and len({f["claim"] for f in found}) == 14
    wrong = [(f["claim"], f["verdict"], f["measured"]) for f in found if f["verdict"] != verdict]
    if verdict == UNDECIDED:  # what happens in every second run is possible
        (sometimes,) = wrong
        assert sometimes[0].startswith("Covariance blow-up") and sometimes[1] == PARTLY
    else:
        assert not wrong, wrong
    assert all(f["answer"] and f["kind"] for f in found)
    assert all(f["rule"] and f["measured"] and f["source"] and f["decided_by"] for f in found)


def test_a_claim_that_one_tuning_supports_is_partly_reproduced():
    right, wrong = world(True), world(False)
    mixed = right._replace(runs=right.runs.where(right.runs["tuning"] == RIGHT, wrong.runs))
    assert (
        judge(claims.CLAIMS["accel_minutes"], mixed)["verdict"]
        == judge(claims.CLAIMS["gyro_seconds"], mixed)["verdict"]
        == PARTLY
    )


def test_a_possible_blow_up_takes_some_runs_and_not_most():
    evidence = world(False)
    steep = (evidence.runs["case"] == claims.PRINTED) & (evidence.runs["excitation"] == "steep")
    sound = evidence.runs.assign(stopped=False, position_m=0.1)
    for share, verdict in ((0.0, NOT_REPRODUCED), (0.05, UNDECIDED), (0.2, REPRODUCED)):
        blown = steep & (evidence.runs["seed"] < share * SEEDS)
        own = evidence._replace(runs=sound.assign(angle_sd_rad=np.where(blown, 4.0, 0.1)))
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
    assert judge(claims.CLAIMS["decay"], held)["verdict"] == PARTLY
    assert (
        judge(claims.CLAIMS["decay"], evidence._replace(dropouts=pd.DataFrame()))["verdict"]
        == UNDECIDED
    )


def test_few_runs_decide_nothing():
    few = world(True)
    few = few._replace(runs=few.runs[few.runs["seed"] < 3])
    assert (
        judge(claims.CLAIMS["gyro_seconds"], few)["verdict"] == UNDECIDED
        and "0 of 12 cells for it, 0 against, 12 open"
        in judge(claims.CLAIMS["gyro_seconds"], few)["measured"]
    )


def test_never_stays_never_in_quantiles():
    assert (
        runs.quantiles([5.0] * 8 + [np.inf] * 2) == (5.0, 5.0, np.inf)
        and runs.seconds(np.inf) == "never"
    )
    assert (runs.seconds(4.25), runs.seconds(119.6), runs.seconds(np.nan)) == ("4.2", "120", "–")
