"""Runs of rejections of two sources at the same time: which of them keep their own cause."""

import numpy as np

from strapdown.engine.rejections import causes
from strapdown.engine.rejections.causes import CauseFound
from strapdown.engine.rejections.contradictions import RejectedRun, assign_blame


def run(source, shape, number, gain=0.0):
    return RejectedRun(
        source,
        100.0,
        150.0,
        number,
        2 * number,
        6.0,
        CauseFound(shape, np.zeros(3), 100.0, np.inf, 2.0, gain),
    )


def found(*runs):
    """[(cause, sources that were also rejected)]"""
    return [(each.found.shape, each.others) for each in assign_blame(list(runs))]


def test_noise_is_too_small_of_each_source_by_itself():
    few, many = run(0, causes.NOISE, 40), run(1, causes.NOISE, 60)
    assert found(few, many) == [(causes.NOISE, (1,)), (causes.NOISE, (0,))]
    assert found(run(0, causes.UNKNOWN, 70), many) == [
        (causes.DISAGREE, (1,)),
        (causes.NOISE, (0,)),
    ]


def test_noise_that_a_larger_shape_explains_is_none():
    assert found(run(0, causes.NOISE, 40), run(1, causes.OFFSET, 60, 90.0)) == [
        (causes.DISAGREE, (1,)),
        (causes.OFFSET, (0,)),  # which says of whom fixes were also rejected
    ]


def test_classes_of_a_receiver_contradict_nothing():
    """They have no fix at the same time: each keeps its own cause, beside another source neither."""
    shapes = run(0, causes.NOISE, 40), run(1, causes.OFFSET, 60, 90.0)
    classes = [each._replace(receiver="GNSS") for each in shapes]
    assert found(*classes) == [(causes.NOISE, ()), (causes.OFFSET, ())]
    third = run(2, causes.UNKNOWN, 5)
    assert (causes.DISAGREE, (1, 2)) in found(*classes, third)
