"""Fixes of one receiver by class: where the classes have one noise, nothing may change."""

from dataclasses import replace

import carrier_runs
import classed
import numpy as np
import pytest

import strapdown as sd
from strapdown.data.solution import Correlated
from strapdown.inspection.all import check
from strapdown.installation.model import constants
from strapdown.preprocessing.receiver_classes import join_classes
from strapdown.sensor_models.gnss import Gnss


@pytest.fixture(scope="module")
def drive():
    return sd.simulate("car", duration=120.0, seed=21)


@pytest.fixture(scope="module")
def by_class(drive):
    return classed.split(drive, classed.alternating(len(drive.sources[0].t)))


def same_rows(one, other):
    """Whether two solutions are the same bits."""
    return all(
        np.array_equal(getattr(one.trajectory, part), getattr(other.trajectory, part))
        for part in ("lla", "v_n", "q_nb", "std")
    )


def test_joined_classes_are_the_source_they_were_made_of(drive, by_class):
    joined = join_classes(by_class.sources)
    assert len(by_class.sources) == 4 and len(joined) == 2
    for one, other in zip(joined, drive.sources):
        assert np.array_equal(one.t, other.t) and np.array_equal(one.y, other.y)
        assert np.array_equal(one.std, other.std) and one.name == other.name


def test_two_receivers_are_not_joined(drive):
    (position, velocity) = drive.sources
    two = (replace(position, receiver="left"), replace(position, receiver="right"), velocity)
    assert len(join_classes(two)) == 3 and len(join_classes((position, position))) == 2


@pytest.mark.parametrize("filter", ["closed-loop", "ukf", "nlo"])
def test_classes_of_one_noise_change_no_bit(drive, by_class, filter):
    assert same_rows(sd.fuse(drive, filter), sd.fuse(by_class, filter))


def test_a_start_is_found_as_before_where_a_later_class_is_first(drive):
    """The first of the sources begins 60 s later than the receiver."""
    classes = np.where(np.arange(len(drive.sources[0].t)) < 300, "float", "fixed")
    late = classed.split(drive, classes)
    late = replace(late, sources=(late.sources[1], late.sources[0], late.sources[2]))
    grade = drive.meta["grade"]
    assert late.sources[0].t[0] > 59 and sd.align(late, grade) == sd.align(drive, grade)


def test_the_start_errs_as_the_class_that_it_is_made_of(drive):
    """Only float fixes have correlated errors, and only a start at one of them is less sure."""
    correlated = Correlated((0.5, 0.5, 1.0), 300.0)
    many = len(drive.sources[0].t)
    noise = {"float": {"correlated": correlated}}
    std = {}
    for first in ("fixed", "float"):
        other = {"fixed": "float", "float": "fixed"}[first]
        classes = np.where(np.arange(many) < many // 2, first, other)
        recording = classed.split(drive, classes, **noise)
        in_order = sorted(recording.sources, key=lambda a: a.name)  # fixed before float
        recording = replace(recording, sources=tuple(in_order))
        std[first] = sd.fuse(recording, "closed-loop").trajectory.std[0, 0]
    assert std["float"] ** 2 - std["fixed"] ** 2 > 0.5 * correlated.std[0] ** 2


def test_inspection_says_what_it_said(drive, by_class):
    one, other = check(drive), check(by_class)
    assert one.facts == other.facts and one.reasons == other.reasons
    assert one.inconclusive == other.inconclusive


def test_classes_share_their_clock_and_their_lever_arm(drive, by_class):
    names = [(each.of.name, len(each.sources)) for each in constants(by_class.sources)]
    assert names == [("clock", 3), ("clock", 1), *[("lever-arm", 4)] * 3]
    solution = sd.fuse(by_class, "closed-loop", estimate=["clock", "lever-arm"])
    told = solution.meta["installation"]["parameters"]
    assert [len(each["sources"]) for each in told] == [4] * 4


@pytest.mark.deep
def test_a_late_receiver_is_diagnosed_alike():
    late = sd.simulate("car", duration=180.0, seed=5, gnss=Gnss(interval=0.2, latency=0.15))
    classes = classed.split(late, classed.alternating(len(late.sources[0].t)))
    one, other = (str(sd.diagnose(each)).splitlines() for each in (late, classes))
    assert [line.partition(": ")[2] for line in one[:4]] == [
        line.partition(": ")[2] for line in other[:4]
    ]
    assert "-0.14" in one[0]


def test_a_stream_with_classes_equals_the_batch(by_class):
    correlated = {"correlated": Correlated((0.5, 0.5, 1.0), 300.0)}
    recording = replace(
        by_class,
        sources=tuple(
            replace(a, **correlated) if a.name.endswith("fixed") else a for a in by_class.sources
        ),
    ).between(0.0, 40.0)
    stream = sd.Stream(
        "closed-loop",
        imu=recording.meta["grade"],
        vehicle=recording.meta.get("vehicle"),
        sources=[a._where(np.zeros(len(a.t), bool)) for a in recording.sources],
    )
    events = [
        (float(t), 0, sd.Measurement(float(t), k, tuple(y), tuple(std)))
        for k, a in enumerate(recording.sources)
        for t, y, std in zip(a.t, a.y, a.std)
    ]
    events += [
        (float(t), 1, sd.Sample(float(t), float(dt), tuple(dtheta), tuple(dv)))
        for t, dt, dtheta, dv in zip(*recording.imu)
    ]
    for _, _, event in sorted(events, key=lambda each: each[:2]):
        stream.step(event)
    batch = sd.fuse(recording, "closed-loop", start=stream.start, covariance=True)
    assert stream.start.motion and np.array_equal(stream.finish().P, batch.covariance[-1])


def measure(seeds, off):
    """(share of float epochs within 3 std by axis, wrong fixes that were said, wrong fixes, share of
    doubtful rows before them) of car and walk together."""
    motions = ("car", carrier_runs.walk())
    runs = [carrier_runs.run(motion, seed, off) for motion in motions for seed in seeds]
    inside = np.concatenate([each.inside for each in runs]).mean(axis=0)
    said = [each for run in runs for each in run.said]
    return inside, sum(said), len(said), float(np.mean([run.doubtful for run in runs]))


@pytest.mark.parametrize(
    "seeds", [range(1, 3), pytest.param(range(1, 21), marks=pytest.mark.deep)], ids=["2", "20"]
)
def test_float_errors_are_inside_and_wrong_fixes_are_said(seeds):
    """Of 20 seeds of car and walk: 99.9 % of the errors of float epochs within 3 std, all of 80 fixes
    that are wrong by 0.5 m said within 10 s, and none where no fix is wrong."""
    inside, said, of, doubtful = measure(seeds, carrier_runs.OFF)
    assert (inside >= 0.95).all() and said >= 0.9 * of and doubtful < 0.01
    inside, said, _, doubtful = measure(seeds, 0.0)
    assert (inside >= 0.95).all() and said == 0 and doubtful < 0.01
