"""A start that is made of the first fixes errs with their clock and lever arm, and P says so."""

import numpy as np
from installed import flown

import strapdown as sd
from strapdown.core.loop.contract import STATES
from strapdown.data.calibration_parameters import CLOCK, LEVER_ARM
from strapdown.engine.batch import begin
from strapdown.engine.installation import with_estimates
from strapdown.engine.options import run_options
from strapdown.geometry.geodesy import displacement
from strapdown.installation.model import apply_constants, constants

ESTIMATE = {"clock": 0.1, "lever-arm": 0.5}


def covariance(recording, start=None):
    return begin(recording, "closed-loop", run_options(estimate=ESTIMATE, start=start)).belief.P


def test_correlations_of_the_start_are_what_a_wrong_set_up_does_to_it():
    """V theta against the starts that the recording gives with its set-up changed by theta."""
    recording = flown(1001, 60.0)
    P, start = covariance(recording), sd.align(recording, sd.imu("tactical"))
    found = constants(recording.sources)
    for column, (of, axis, step) in enumerate(
        [(CLOCK, 0, 0.02), *((LEVER_ARM, axis, 0.1) for axis in range(3))]
    ):
        theta = np.array([step if (one.of, one.axis) == (of, axis) else 0.0 for one in found])
        other = sd.align(apply_constants(recording, found, theta), sd.imu("tactical"))
        if of is CLOCK:  # the moment of the start moves with the stamps: both at one time
            shift = (start.t - other.t) * np.asarray(other.v_n)
        else:
            shift = np.zeros(3)
        moved = displacement(np.array([other.lla]), np.array([start.lla]))[0] + shift
        state = STATES + column
        by = P[:3, state] / P[state, state]
        np.testing.assert_allclose(by, moved / step, atol=0.05 * max(1.0, np.abs(by).max()))


def test_only_a_start_of_fixes_is_correlated_and_only_with_what_is_estimated():
    recording = flown(1001, 60.0)
    start = sd.align(recording, sd.imu("tactical"))
    diagonal = covariance(recording, start._replace(motion=()))
    assert np.array_equal(diagonal, np.diag(np.diag(diagonal)))
    P = covariance(recording)
    np.testing.assert_array_equal(P, covariance(recording, start))
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(np.diag(P), np.diag(P)))).min() > 0
    assert np.all(np.diag(P) >= np.diag(diagonal))
    given = sd.InitialState(start.t, lla=start.lla, v_n=start.v_n)
    completed = covariance(recording, given)
    assert not completed[:STATES, STATES:].any()
    plain = begin(with_estimates(recording, {}), "closed-loop", run_options()).belief.P
    assert np.array_equal(plain, np.diag(np.array(start.std) ** 2))
