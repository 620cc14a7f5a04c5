"""The observer whose reference vector is the specific force by GNSS velocity: the attitude of a body that
accelerates for long, against the same observer with gravity alone."""

import numpy as np
import pytest
from recordings import flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import Noise
from strapdown.data.solution import Source
from strapdown.sim.trajectory import DEG, Motion, increments, sample
from strapdown_reproductions.fossen import cases, signals
from strapdown_reproductions.fossen.force_observer import FORCE_OBSERVER

QUIET = Noise(1e-4, 1e-3, 0.0, 0.0, 0.0, 0.0)
SPEED, RATE = 30.0, 0.2  # m/s, rad/s: a coordinated turn, banked by 31 deg


@pytest.fixture(scope="module")
def turning():
    """100 s of a coordinated turn with the velocity five times a second and the heading, exact."""
    bank = np.arctan(SPEED * RATE / 9.81)
    motion = Motion(
        "turning",
        (DEG * 47.0, DEG * 8.0, 500.0),
        lambda t: (SPEED * np.cos(RATE * t), SPEED * np.sin(RATE * t), 0 * t),
        lambda t: (bank + 0 * t, 0 * t, RATE * t),
    )
    t = np.arange(5001) / 50.0
    truth, at = sample(motion, t), np.arange(10, 5001, 10)
    velocity = Source("velocity", t[at], truth.v_n[at], np.full((len(at), 3), 0.01), gate=np.inf)
    heading = Source("heading", t[at], truth.rph[at, 2:], np.full((len(at), 1), 0.01), gate=np.inf)
    return sd.Recording(increments(motion, t), (velocity, heading), truth, {})


def tilt_error(recording, reference, off=(0.3, -0.2, 0.1)):
    """Angle off the truth at the end, deg, of a start that is turned by `off` (rad)."""
    begin = start(recording)
    turned = Rotation.from_rotvec(off).inv() * Rotation.from_euler("ZYX", begin.rph[::-1])
    begin = begin._replace(rph=tuple(turned.as_euler("ZYX")[::-1]))
    found = sd.fuse(
        recording,
        FORCE_OBSERVER,
        start=begin,
        noise=QUIET,
        options={"reference": reference, "ki": 0.0},
    )
    return np.degrees(np.linalg.norm(sd.errors(found, recording.reference).attitude[-1]))


def test_gnss_tells_the_force_of_a_turn_and_gravity_levels_it_away(turning):
    assert tilt_error(turning, "gnss") < 0.3
    assert tilt_error(turning, "gravity") > 10


def test_in_the_study_the_accelerations_are_left_out_of_the_tilt():
    """What the accelerometer biases tilt, 1.2 deg, both have."""
    found = {}
    for case in cases.CASES:
        if case.filter == "force-observer":
            recording = signals.recording("signal 2", 902, duration=150.0)
            run = cases.run(recording, case, cases.RIGHT, "signal 2", 902)
            late = run.error[run.t > 80.0]
            found[case.options["reference"]] = late[:, 6:8].std(axis=0).max()
            assert np.isnan(run.error[:, :6]).all() and not run.stopped
    assert found["gnss"] < 0.4 * found["gravity"]


def test_what_it_refuses(turning):
    filters.check(FORCE_OBSERVER)
    run = lambda recording, **options: sd.fuse(
        recording, FORCE_OBSERVER, start=start(recording), noise=QUIET, options=options
    )
    with pytest.raises(DataError, match="GNSS velocity has a lever arm; give the velocity of the"):
        run(flight())
    with pytest.raises(DataError, match="reference is 'moon'.*; it must be one of gravity, gnss"):
        run(turning, reference="moon")
    with pytest.raises(DataError, match="k1 is -1.0 1/s"):
        run(turning, k1=-1.0)
