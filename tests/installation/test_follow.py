"""Advice that is followed only where the data decide."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd


@pytest.fixture(scope="module")
def drive():
    return sd.simulate("car", 200.0, "industrial", seed=1)


def late(recording, seconds, from_=0.0):
    changed = (
        replace(a, t=np.where(a.t >= from_, a.t + seconds, a.t)) if a.kind == "velocity" else a
        for a in recording.sources
    )
    return replace(recording, sources=tuple(changed))


def test_a_clock_that_is_found_is_applied_and_its_effect_said(drive):
    found = sd.follow(late(drive, 0.25))
    assert not found.stopped and len(found.applied) == 1 and "offset" in found.applied[0]
    assert not found.before.verdict.trusted and found.after.verdict.trusted
    rms = [
        each.errors(drive.reference).rms().position[:2].max()
        for each in (found.before, found.after)
    ]
    assert rms[1] < 0.7 * rms[0]
    assert "verdict before: not to be trusted; now: trusted" in str(found)


def test_a_right_set_up_is_left_as_it_is(drive):
    found = sd.follow(drive)
    assert found.stopped == "the diagnosis found nothing wrong with the installation"
    assert found.after is found.before and found.applied == ()


def test_halves_that_disagree_stop_it(drive, monkeypatch):
    """A clock that is found by one half and not by the other is not applied."""
    found = sd.diagnose(late(drive, 0.25))
    (clock,) = found.found
    split = replace(clock, halves=((-0.25, 0.01), (0.05, 0.01)))
    told = replace(found, parameters=tuple(split if p is clock else p for p in found.parameters))
    monkeypatch.setattr("strapdown.installation.follow.diagnose", lambda *_, **__: told)
    followed = sd.follow(late(drive, 0.25))
    assert followed.after is followed.before
    assert (
        "halves of the recording disagree on clock of GNSS velocity: -0.25 and +0.05 s"
        in followed.stopped
    )


def test_what_cannot_be_diagnosed_is_told_with_what_is_left(drive):
    fast = (replace(a, y=a.y * 3.6) if a.kind == "velocity" else a for a in drive.sources)
    found = sd.follow(replace(drive, sources=tuple(fast)))
    assert found.diagnosis is None and "3.6" in found.stopped
    assert any(line.startswith("left to you: ") for line in found.lines)
