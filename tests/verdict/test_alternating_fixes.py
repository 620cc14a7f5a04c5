"""Two antennas or receivers in one source."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.geometry.geodesy import displace_lla
from strapdown.verdict import alternating_fixes, evidence


@pytest.fixture(scope="module")
def flight():
    return sd.simulate("demo", 210.0, seed=12)


def alternated(recording, body):
    """Every other position 1.2 m north, or 1.2 m along the body."""
    p, *others = recording.sources
    yaw = np.interp(p.t, recording.reference.t, np.unwrap(recording.reference.rph[:, 2]))
    side = np.c_[np.cos(yaw), np.sin(yaw), 0 * yaw] if body else [1.0, 0.0, 0.0]
    off = 1.2 * (np.arange(len(p.t)) % 2)[:, None] * side
    return replace(recording, sources=(replace(p, y=displace_lla(p.y, off)), *others))


def reasons(recording, way=sd.fuse):
    solution = way(recording)
    return [
        reason
        for source in evidence.by_source(solution)
        for reason in alternating_fixes.check(solution, source)
    ]


@pytest.mark.parametrize(
    "body, words", [(False, " m off the others north"), (True, "along the body")]
)
def test_an_offset_of_every_other_fix_is_said(flight, body, words):
    (reason,) = reasons(alternated(flight, body))
    assert reason.source == "GNSS position" and words in reason.seen and reason.weight >= 1


def test_a_smoothed_result_is_doubted_too(flight):
    assert not sd.smooth(alternated(flight, False)).verdict.trusted


def test_right_fixes_do_not_alternate(flight):
    assert reasons(flight) == []
