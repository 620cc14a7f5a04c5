"""Verdicts on simulated runs with right and wrong set-ups, and on what cannot be tested."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import DOUBTFUL, Correlated
from strapdown.data.verdict import NOT_JUDGED, NOT_TO_BE_TRUSTED, Reason
from strapdown.geometry.geodesy import displace_lla
from strapdown.io.facts import recording_facts
from strapdown.sensor_models.gnss import Gnss
from strapdown.verdict import accelerating_fixes, evidence

SEED = 2000


@pytest.fixture(scope="module")
def drive():
    gnss = Gnss(interval=0.2, velocity_std=(0.1, 0.1, 0.1), lever_arm=(0.5, 0.2, -1.0))
    return sd.simulate("car", duration=150.0, imu="industrial", seed=SEED, gnss=gnss)


def with_fixes(recording, change, *kinds):
    changed = (change(a) if a.kind in kinds else a for a in recording.sources)
    return replace(recording, sources=tuple(changed))


def test_a_right_set_up_is_trusted(drive):
    verdict = sd.fuse(drive).verdict
    assert verdict.trusted, str(verdict)


@pytest.mark.parametrize("seconds", [-1.0, 1.0])
def test_a_clock_off_by_a_second_is_not_to_be_trusted(drive, seconds):
    def late(source):
        return replace(source, t=source.t + seconds).between(*drive.span)

    verdict = sd.fuse(with_fixes(drive, late, "position", "velocity")).verdict
    assert verdict.word == NOT_TO_BE_TRUSTED, str(verdict)


def test_axes_turned_by_a_quarter_are_named(drive):
    imu = drive.imu
    turned = replace(
        drive,
        imu=imu._replace(
            dtheta=imu.dtheta[:, [1, 0, 2]] * [-1, 1, 1], dv=imu.dv[:, [1, 0, 2]] * [-1, 1, 1]
        ),
    )
    verdict = sd.fuse(turned).verdict
    assert any(reason.cause == "axes" for reason in verdict.reasons), str(verdict)


def test_standard_deviations_five_times_too_small_are_doubted(drive):
    small = with_fixes(drive, lambda a: replace(a, std=a.std / 5), "position", "velocity")
    assert not sd.fuse(small).verdict.trusted


def with_imu(recording, change):
    """Samples whose rates and forces (n, 6) are `change` of them."""
    imu = recording.imu
    values = change(np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]) * imu.dt[:, None]
    return replace(
        recording, imu=imu._replace(dtheta=values[:, :3].copy(), dv=values[:, 3:].copy())
    )


INSPECTED = {  # problems that leave the innovations as they are, and one that does not
    "height": lambda r: replace(r, meta={**r.meta, "height_columns": {"hMSL": r.sources[0].name}}),
    "each sample twice": lambda r: with_imu(r, lambda x: x[np.arange(len(x)) // 2 * 2]),
    "column": lambda r: with_imu(r, lambda x: x * [1, 1, 1, 1, 0, 1]),
    "gyro bias": lambda r: with_imu(r, lambda x: x + np.radians([3.0, 0, 0, 0, 0, 0])),
}


@pytest.mark.parametrize("what", INSPECTED)
def test_every_problem_of_inspect_is_a_reason(drive, what):
    recording = INSPECTED[what](drive)
    problems, verdict = recording_facts(recording).problems, sd.fuse(recording).verdict
    assert problems and not verdict.trusted
    for problem in problems:
        assert any(reason.seen in problem for reason in verdict.reasons), (problem, str(verdict))


def smoothed_fixes(scenario, interval, lasts, seed):
    """A recording whose receiver smooths: errors of 2 m that last for so many s, with a stated
    standard deviation of 15 m."""
    right = sd.simulate(
        scenario, duration=200.0, imu="industrial", seed=seed, gnss=Gnss(interval=interval)
    )
    rng, kept = np.random.default_rng(seed), np.exp(-interval / lasts)

    def smoothed(a):
        e = rng.normal(0, 2.0, a.y.shape)
        for k in range(1, len(e)):
            e[k] = kept * e[k - 1] + np.sqrt(1 - kept**2) * e[k]
        truth = [np.interp(a.t, right.reference.t, column) for column in right.reference.lla.T]
        y = displace_lla(np.stack(truth, axis=1), e * [1, 1, -1])
        return replace(a, y=y, std=np.full_like(a.y, 15.0), parameters=(0.0, 0.0, 0.0))

    return with_fixes(right, smoothed, "position")


@pytest.mark.parametrize(
    "scenario, interval, lasts, seed",
    [("car", 1.0, 30.0, 1), ("car", 0.2, 200.0, 2), ("demo", 1.0, 100.0, 3)],
)
def test_the_std_of_a_receiver_that_smooths_is_not_to_be_divided(scenario, interval, lasts, seed):
    """Neither advised nor, where it is done, trusted: most errors of the positions exceed three
    claimed standard deviations then."""
    stated = smoothed_fixes(scenario, interval, lasts, seed)
    solution = sd.fuse(stated)
    assert "lasting errors" in {reason.cause for reason in solution.verdict.reasons}
    assert not any("divide" in reason.remedy for reason in solution.verdict.reasons)
    times = np.sqrt(np.median(evidence.by_source(solution)[0].ratio))
    divided = with_fixes(stated, lambda a: replace(a, std=a.std * times), "position")
    solution = sd.fuse(divided)
    errors = sd.errors(solution, divided.reference)
    assert np.median((np.abs(errors.position) / errors.std[:, :3]).max(axis=1)) > 3
    assert not solution.verdict.trusted, str(solution.verdict)


def test_held_fixes_are_never_trusted(drive):
    def held(a):
        t = np.arange(a.t[0], a.t[-1], 0.01)
        row = np.searchsorted(a.t, t + 1e-9) - 1
        return replace(a, t=t, y=a.y[row], std=a.std[row])

    verdict = sd.fuse(with_fixes(drive.between(0, 60.0), held, "position", "velocity")).verdict
    assert not verdict.trusted
    assert verdict.reasons[0].cause == "repeated", str(verdict)


def test_a_smoothed_solution_is_judged_against_its_filter(drive):
    far = with_fixes(
        drive, lambda a: replace(a, parameters=(3.5, 0.2, -1.0)), "position", "velocity"
    )
    right, wrong = (sd.smooth(each) for each in (drive, far))
    assert max(right.meta["filter_against_smoother"].values()) < 1.6
    assert right.verdict.trusted
    assert any("smoother" in reason.seen for reason in wrong.verdict.reasons)


def test_doubtful_rows_are_a_reason_where_nothing_else_says_why(drive):
    """A gyro that is stuck for most of the run; one whose bias steps shows in its bias."""
    imu = drive.imu
    stuck, stepped = imu.dtheta.copy(), imu.dtheta.copy()
    late = imu.t > 60
    stuck[late & (imu.t < 145), 1] = stuck[np.argmax(late), 1]
    stepped[late, 2] += np.radians(3.0) * imu.dt[late]
    found = []
    for dtheta in (stuck, stepped):
        solution = sd.fuse(replace(drive, imu=imu._replace(dtheta=dtheta)))
        assert (solution.status == DOUBTFUL).mean() > 0.5
        found.append([r for r in solution.verdict.reasons if "of the result" in r.seen])
        assert not solution.verdict.trusted
    ((reason,), none) = found
    assert reason.cause == "gyro" and "gyro y is stuck" in reason.seen and not none


def test_what_cannot_be_tested_is_said(drive):
    brief = sd.fuse(drive.between(stop=20.0)).verdict
    assert any("lasts 20 s" in str(each) for each in brief.untested)
    blind = sd.fuse(replace(drive, sources=drive.sources[:1])).verdict
    assert any("velocity" in str(each) for each in blind.untested)
    alone = sd.fuse(replace(drive, sources=()), "attitude-mekf").verdict
    assert any("no GNSS" in str(each) for each in alone.untested)


@pytest.mark.parametrize("seconds, every", [(20.0, 1), (60.0, 20)])
def test_a_run_with_too_little_to_test_is_not_judged(drive, seconds, every):
    """Too short, or with few fixes."""
    few = with_fixes(
        drive.between(stop=seconds),
        lambda a: replace(a, t=a.t[::every], y=a.y[::every], std=a.std[::every]),
        "position",
        "velocity",
    )
    verdict = sd.fuse(few).verdict
    assert verdict.word == NOT_JUDGED and not verdict.trusted, str(verdict)
    assert verdict.line.startswith("not judged; not tested: ")


def test_what_speaks_against_a_short_run_is_said(drive):
    short = drive.between(stop=25.0)
    late = with_fixes(short, lambda a: replace(a, y=a.y + 5.0 * a.t[:, None] % 30), "velocity")
    verdict = sd.fuse(late).verdict
    assert verdict.word not in (NOT_JUDGED, "trusted") and verdict.reasons


def test_a_verdict_is_found_when_asked_for_and_once(drive):
    solution = sd.fuse(drive)
    assert solution.verdict is solution.verdict
    assert np.isfinite(solution.meta["bias_std"]).all()


def test_a_check_that_fails_is_said_and_costs_no_result(drive, monkeypatch):
    def broken(solution):
        raise IndexError("index 5 is out of bounds")

    monkeypatch.setattr("strapdown.installation.screening.look", broken)
    verdict = sd.fuse(drive).verdict
    assert verdict.trusted
    assert any("index 5 is out of bounds" in str(each) for each in verdict.untested)


@pytest.mark.parametrize("weight, asked", [(0.3, 1), (1.2, 0)])
def test_checks_that_cost_a_run_go_on_until_one_is_against_the_solution(
    drive, monkeypatch, weight, asked
):
    light = Reason("outliers of GNSS velocity", "4 s are doubtful", "look", weight=weight)
    heavy, calls = Reason("outliers", "fixes accelerate", "leave them out", weight=2.0), []
    monkeypatch.setattr("strapdown.verdict.judge._second", lambda solution: [light])
    monkeypatch.setattr(accelerating_fixes, "check", lambda _: calls.append(1) or [heavy])
    verdict = sd.fuse(drive).verdict
    assert len(calls) == asked and not verdict.trusted
    assert light.cause in {reason.cause for reason in verdict.reasons}


def test_positions_that_wander_beside_good_velocities_are_doubted():
    """By 1 m within a minute, stated as white: no two fixes tell it, the mean of eight does."""
    wander = Correlated((1.0, 1.0, 1.5), 60.0)
    gnss = Gnss(0.2, (1.0, 1.0, 1.5), (0.1, 0.1, 0.1), position_correlated=wander, stated=False)
    for seed in (SEED, SEED + 1):
        verdict = sd.fuse(sd.simulate("car", 240.0, "industrial", seed=seed, gnss=gnss)).verdict
        assert not verdict.trusted and verdict.reasons[0].cause == "lasting errors", str(verdict)
