"""What a run says of itself, on solutions whose statistics are known because they are made up."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown.core.loop.contract import DOUBTFUL as CONTRADICTED, Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Innovations, Solution, Source, Trajectory
from strapdown.data.verdict import DOUBTFUL, NOT_TO_BE_TRUSTED, Reason, Untested, Verdict
from strapdown.evaluation.fix_statistics import MEDIANS
from strapdown.verdict import evidence

pytestmark = pytest.mark.short
COUNT = 1000


def made_up(nis_factor=1.0, seed=0, lasting=0.0, **meta):
    """A straight run north at 10 m/s, with `COUNT` position fixes whose innovations are white, or
    `lasting` (correlation of neighbours), and of that size."""
    rng = np.random.default_rng(seed)
    e = rng.normal(size=(COUNT, 3))
    for k in range(1, COUNT):
        e[k] = lasting * e[k - 1] + np.sqrt(1 - lasting**2) * e[k]
    e *= np.sqrt(nis_factor)
    t = np.arange(COUNT) * 0.2
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1))
    std = np.full((COUNT, 15), 0.1)
    return Solution(
        Trajectory(t, np.zeros((COUNT, 3)), np.tile([10.0, 0.0, 0.0], (COUNT, 1)), quaternion, std),
        np.zeros((COUNT, 3)),
        np.zeros((COUNT, 3)),
        np.zeros(COUNT, np.int8),
        Innovations(
            t,
            np.zeros(COUNT, int),
            e,
            (e**2).sum(axis=1),
            np.ones(COUNT, bool),
            ("GNSS",),
            (16.3,),
            whitened=e,
        ),
        meta={"start": {"t": 0.0}, "bias_std": [0.02, 1e-4], "imu": "mems", **meta},
        recording=Recording(
            Imu(t, np.full(COUNT, 0.2), np.zeros((COUNT, 3)), np.zeros((COUNT, 3))),
            (Source("position", t, np.zeros((COUNT, 3)), np.ones((COUNT, 3)), name="GNSS"),),
        ),
    )


def source(solution):
    (found,) = evidence.by_source(solution)
    return found


def test_white_innovations_of_the_claimed_size_have_a_median_ratio_of_one():
    # 1000 values: the median of their ratio scatters by 0.04, so 0.15 is missed once in 5000
    assert abs(np.median(source(made_up()).ratio) - 1) < 0.15


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_medians_are_those_of_chi_square(rows):
    from scipy.stats import chi2

    assert MEDIANS[rows] == pytest.approx(chi2.median(rows), abs=1e-4)


def test_right_statistics_give_no_reason():
    solution = made_up()
    own = source(solution)
    found = [
        *evidence.check_divergence(solution),
        *evidence.biases(solution),
        *evidence.noise(own),
        *evidence.rejections(own),
        *evidence.course(solution, solution.t),
        *evidence.smoother(solution),
        *evidence.doubts(solution),
    ]
    assert not found


def test_innovations_four_times_too_large_are_named_with_their_factor():
    (found,) = evidence.noise(source(made_up(16.0)))
    assert found.cause == "fix noise" and found.source == "GNSS"
    assert "4 times" in found.seen and found.weight == pytest.approx(8, rel=0.15)


def test_large_innovations_that_last_are_told_from_large_noise():
    (found,) = evidence.noise(source(made_up(16.0, lasting=0.9)))
    assert found.cause == "lasting errors"


def test_claims_five_times_too_large_are_doubtful_and_no_more():
    (found,) = evidence.noise(source(made_up(0.04)))
    assert found.cause == "fix noise" and "5 times smaller" in found.seen
    assert Verdict.of([found]).word == DOUBTFUL
    assert not list(evidence.noise(source(made_up(0.1))))


@pytest.mark.parametrize("seed", range(3))
def test_no_smaller_claim_is_advised_where_innovations_last(seed):
    (found,) = evidence.noise(source(made_up(0.02, seed, lasting=0.9)))
    assert found.cause == "lasting errors" and found.weight == 1
    assert "divide" not in found.remedy and "keep its std" in found.remedy


@pytest.mark.parametrize(
    "claimed, lasting, named", [(0.5, 0.9, 0), (0.1, 0.9, 1), (0.1, 0.0, 0), (0.5, 0.0, 0)]
)
def test_innovations_that_last_and_exceed_the_claim_are_named(claimed, lasting, named):
    """Differences of 0.5 of the variance that the filter expects, of which its prediction brings
    `claimed`: 0.45 of it lasts. The correlation of 1000 white ones comes to 0.3 once in 10^20."""
    solution = made_up(0.5, lasting=lasting)
    root = np.tile([1.0, 0, 1, 0, 0, 1], (COUNT, 1))
    (own,) = solution.recording.sources
    stated = replace(own, t=solution.t, std=np.full((COUNT, 3), np.sqrt(1 - claimed)))
    solution = replace(
        solution,
        innovations=replace(solution.innovations, root=root),
        recording=replace(solution.recording, sources=(stated,)),
    )
    found = list(evidence.noise(source(solution)))
    assert [reason.cause for reason in found] == ["lasting errors"] * named
    assert all("receiver states" in reason.remedy for reason in found)


def test_a_bad_part_of_a_run_is_named_with_its_times():
    solution = made_up()
    nis = solution.innovations.nis.copy()
    nis[500:700] *= 9
    worse = replace(solution, innovations=replace(solution.innovations, nis=nis))
    (found,) = evidence.noise(source(worse))
    assert "between 100 and 140 s" in found.seen


def test_rejections_count_by_share_and_by_length():
    solution = made_up()
    accepted = np.ones(COUNT, bool)
    accepted[::5] = False
    often = replace(solution, innovations=replace(solution.innovations, accepted=accepted))
    (found,) = evidence.rejections(source(often))
    assert "20 %" in found.seen and found.weight == pytest.approx(0.2 / evidence.REJECTED)
    accepted = np.ones(COUNT, bool)
    accepted[500:580] = False
    long = replace(solution, innovations=replace(solution.innovations, accepted=accepted))
    (found,) = evidence.rejections(source(long))
    assert "from 100 s on" in found.seen and "for 16 s" in found.seen


def test_fixes_for_which_the_gate_was_lifted_count():
    solution = made_up()
    nis = solution.innovations.nis.copy()
    nis[::20] = 100.0
    lifted = replace(solution, innovations=replace(solution.innovations, nis=nis))
    (found,) = evidence.rejections(source(lifted))
    assert "5 % of the fixes passed only because" in found.seen


def test_a_pause_of_the_fixes_is_no_rejection():
    solution = made_up()
    keep = (solution.t < 100) | (solution.t > 150)
    every = solution.innovations
    paused = replace(
        solution,
        innovations=Innovations(
            every.t[keep],
            every.source[keep],
            every.innovation[keep],
            every.nis[keep],
            every.accepted[keep],
            every.names,
            every.gates,
        ),
    )
    assert not list(evidence.rejections(source(paused)))


def test_a_bias_beyond_the_description_is_named_with_axis_and_times():
    solution = made_up()
    b_a = np.tile([0.0, -0.5, 0.0], (COUNT, 1))
    (found,) = evidence.biases(replace(solution, b_a=b_a))
    assert found.weight == pytest.approx(0.5 / 0.02 / evidence.BIAS)
    assert found.cause == "accelerometer" and "accelerometer y" in found.seen
    assert "-0.5 m/s^2" in found.seen


@pytest.mark.parametrize(
    ("turned", "cause", "seen"),
    [
        (90, "axes", "90 deg to the left"),
        (-90, "axes", "90 deg to the right"),
        (180, "axes", "180 deg"),
        (50, "mounting", "50 deg to the left"),
    ],
)
def test_a_course_beside_the_heading_is_axes_or_mounting(turned, cause, seen):
    solution = made_up()
    half = np.radians(turned) / 2
    q = np.tile([np.cos(half), 0.0, 0.0, np.sin(half)], (COUNT, 1))
    beside = replace(solution, trajectory=replace(solution.trajectory, q_nb=q))
    (found,) = evidence.course(beside, solution.t)
    assert found.cause == cause and seen in found.seen


@pytest.mark.parametrize(
    ("speed", "speed_std", "heading_std", "degrees", "named"),
    [
        (1.0, 0.03, 0.02, 90, True),  # walking speed, known to 3 cm/s
        (1.0, 0.03, 0.02, 40, False),  # a side wind or a current of 0.8 m/s
        (1.0, 0.3, 0.02, 90, False),  # no faster than the noise
        (1.0, 0.03, 0.6, 90, False),  # a heading that is not known either
        (0.4, 0.01, 0.02, 90, False),  # hardly moves
    ],
)
def test_a_course_at_walking_speed(speed, speed_std, heading_std, degrees, named):
    solution = made_up()
    half, std = np.radians(degrees) / 2, np.full((COUNT, 15), 0.01)
    std[:, 3:6], std[:, 8] = speed_std, heading_std
    made = replace(
        solution.trajectory,
        v_n=np.tile([speed, 0.0, 0.0], (COUNT, 1)),
        q_nb=np.tile([np.cos(half), 0.0, 0.0, np.sin(half)], (COUNT, 1)),
        std=std,
    )
    assert bool(list(evidence.course(replace(solution, trajectory=made), solution.t))) == named


def test_missing_samples_are_a_reason_and_end_what_the_course_says():
    solution = made_up()
    imu = solution.recording.imu
    keep = (imu.t <= 100) | (imu.t > 140)
    holed = replace(solution.recording, imu=Imu(*(column[keep] for column in imu)))
    (found,) = evidence.gaps(replace(solution, recording=holed))
    assert found.cause == "samples" and "40 s" in found.seen and "at 100 s" in found.seen
    half = np.radians(60) / 2
    q = solution.trajectory.q_nb.copy()
    q[solution.t > 100] = [np.cos(half), 0.0, 0.0, np.sin(half)]
    turned = replace(solution, trajectory=replace(solution.trajectory, q_nb=q), recording=holed)
    assert not list(evidence.course(turned, solution.t))


@pytest.mark.parametrize(
    ("said", "cause", "source"),
    [
        ("GNSS: gate opened after 5 or more rejections", "outliers", "GNSS"),
        ("GNSS north: fixes are 2 standard deviations off", "outliers", "GNSS"),
        ("gyro x is stuck at 0 deg/s", "gyro", ""),
        ("accelerometer z reads 1e+06 m/s^2, which is out of range", "accelerometer", ""),
        ("the filter's speed of 2000 m/s is beyond", "unknown", ""),
    ],
)
def test_doubtful_rows_count_by_their_share_with_what_was_said_first(said, cause, source):
    """170 s of the 200 s come after the start and the doubt that began in it; the seconds are all
    that the status has, as everywhere."""
    solution = made_up()
    events = ((20.0, "earlier"), (99.9, said), (99.95, "IMU gap of 3 s"), (101.0, "later"))
    status = np.where((solution.t >= 100) & (solution.t < 180), CONTRADICTED, 0)
    status[:150] = CONTRADICTED  # of the start
    doubted = replace(solution, status=status, events=events)
    (found,) = evidence.doubts(doubted)
    assert (found.cause, found.source) == (cause, source)
    assert found.seen.startswith(
        f"{doubted.seconds(CONTRADICTED):.0f} s of the result are doubtful, 47 % of the time after the start"
    )
    assert found.seen.endswith(f"first at 100 s: {said}")
    assert found.weight == pytest.approx(80 / 170 / evidence.DOUBTED, rel=0.01)
    assert Verdict.of([found]).word == DOUBTFUL
    few = np.where(solution.t > 180, CONTRADICTED, 0)
    assert Verdict.of(evidence.doubts(replace(doubted, status=few))).trusted


def test_doubtful_rows_of_the_start_are_no_reason():
    solution = made_up()
    status = np.where(solution.t < 39, CONTRADICTED, 0)
    assert not list(evidence.doubts(replace(solution, status=status)))


def test_a_filter_that_stopped_is_not_to_be_trusted():
    reasons = evidence.check_divergence(made_up(stopped="stopped at 3 s: diverged"))
    assert Verdict.of(reasons).word == NOT_TO_BE_TRUSTED


def test_verdicts_rank_their_reasons_and_come_back_from_a_file():
    light, heavy = Reason("clock", "a", "b", "GNSS", 1.2), Reason("axes", "c", "d", weight=1.5)
    verdict = Verdict.of([light, heavy], [Untested("heading", "no turn")])
    assert verdict.word == DOUBTFUL and verdict.reasons[0] == heavy and not verdict.trusted
    assert Verdict.from_dict(verdict.as_dict()) == verdict
    assert verdict.line == "doubtful: axes of the IMU: c; d"


@pytest.mark.parametrize(
    "lat, field, seen",
    [
        (0.0, (21e-6, 1.6e-6, 43.9e-6), None),
        (0.0, (2.2e-6, 0.8e-6, 56.7e-6), "a field dip of 87.6 deg"),
        (88.9, (21e-6, 1.6e-6, 43.9e-6), "latitude 88.9 deg"),
    ],
)
def test_attitude_alone_near_a_pole_is_doubted(lat, field, seen):
    solution = made_up()
    t = np.arange(10.0)
    compass = Source("magnetic-field", t, np.tile(field, (10, 1)), np.full((10, 3), 1e-6), field)
    nowhere = replace(solution.trajectory, lla=np.full_like(solution.trajectory.lla, np.nan))
    start = {"lla": (np.radians(lat), 0.1, 0.0)}
    recording = Recording(Imu(t, t, np.zeros((10, 3)), np.zeros((10, 3))), (compass,))
    alone = replace(
        solution, trajectory=nowhere, recording=recording, meta=solution.meta | {"start": start}
    )
    reasons = list(evidence.near_pole(alone))
    assert bool(reasons) == (seen is not None)
    assert not reasons or seen in reasons[0].seen
    assert not list(evidence.near_pole(replace(alone, trajectory=solution.trajectory)))
