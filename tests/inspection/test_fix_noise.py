"""Noise of fixes from one to the next, on fixes whose noise is known."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.inspection import fix_noise
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.gnss import Gnss


def drive(interval, seed=3000):
    return sd.simulate(
        "car", duration=120.0, imu="industrial", seed=seed, gnss=Gnss(interval=interval)
    )


def claimed(recording, factor, kind):
    changed = (replace(a, std=a.std * factor) if a.kind == kind else a for a in recording.sources)
    return replace(recording, sources=tuple(changed))


@pytest.mark.parametrize("interval", [0.1, 0.2, 1.0])
def test_right_claims_pass(interval):
    assert not fix_noise.check(InspectedRecording(drive(interval))).reasons


@pytest.mark.parametrize(
    ("interval", "kind"), [(0.2, "position"), (0.2, "velocity"), (1.0, "position")]
)
def test_claims_five_times_too_small_are_named_with_the_factor(interval, kind):
    (found,) = fix_noise.check(InspectedRecording(claimed(drive(interval), 0.2, kind))).reasons
    assert found.cause == "fix noise" and kind in found.source
    # the median of 100 and more differences, which overlap, scatters by a tenth
    ratio = float(found.seen.split("scatters ")[1].split()[0])
    assert ratio == pytest.approx(5, rel=0.25)


def test_nothing_is_said_of_few_fixes_and_of_missing_ones():
    recording = drive(1.0)
    assert not fix_noise.check(InspectedRecording(recording.between(stop=20.0))).reasons
    empty = replace(recording, sources=tuple(a.between(500, 600) for a in recording.sources))
    assert not fix_noise.check(InspectedRecording(empty)).reasons
    nothing = (replace(a, y=a.y * np.nan) for a in recording.sources)
    assert not fix_noise.check(
        InspectedRecording(replace(recording, sources=tuple(nothing)))
    ).reasons
