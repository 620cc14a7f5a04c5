"""What an InitialState leaves open is found as align finds it."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import at_rest, flight, start

import strapdown as sd
from strapdown.core.loop.contract import InitialState

pytestmark = pytest.mark.short


def test_what_is_left_open_is_found_as_by_align():
    recording, spec = flight(), sd.imu("tactical")
    truth = start(recording, 5.0)
    found = sd.align(recording, spec, heading=truth.rph[2], at=truth.t)
    solution = sd.fuse(recording, start=InitialState(truth.t, rph=(np.nan, np.nan, truth.rph[2])))
    begin = InitialState(**solution.meta["start"])
    assert begin[:7] == found[:7] and begin.note.startswith("time given; ")
    given = sd.fuse(recording, start=InitialState(truth.t, lla=truth.lla, rph=truth.rph))
    begin = InitialState(**given.meta["start"])
    assert begin.lla == truth.lla and begin.rph == truth.rph and begin.v_n == found.v_n
    assert begin.std[:3] == (10.0,) * 3 and np.degrees(begin.std[6:9]) == pytest.approx([2.0] * 3)
    assert begin.std[9:] == found.std[9:] and begin.note.startswith("lla, rph given; ")
    assert np.abs(given.trajectory.v_n[-1] - recording.reference.v_n[-1]).max() < 1.0


def test_at_rest_without_fixes_the_velocity_is_zero():
    recording = replace(at_rest(), sources=())
    solution = sd.fuse(
        recording, start=InitialState(1.0, lla=(0.8, 0.2, 300.0), rph=(0.0, 0.0, 1.0))
    )
    begin = InitialState(**solution.meta["start"])
    assert begin.v_n == (0.0,) * 3 and begin.std[3:6] == (0.1,) * 3
    assert begin.lla == (0.8, 0.2, 300.0)
