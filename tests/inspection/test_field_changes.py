"""Clock, mounting, scale and iron that change during a recording."""

from dataclasses import replace

import numpy as np
import pytest
from test_field_fit import COMPASS, turned

import strapdown as sd
from strapdown.inspection import field_turns
from strapdown.inspection.field_changes import EDGE, UNKNOWNS, _Blocks, _changes
from strapdown.inspection.field_fit import PRIOR
from strapdown.inspection.motion import InspectedRecording
from strapdown.sensor_models.magnetometer import Magnetometer


@pytest.fixture(scope="module")
def held():
    return sd.simulate("hand-held", 225.0, "consumer", seed=18, magnetometer=COMPASS)


def reasons(recording):
    return field_turns.check(InspectedRecording(recording)).reasons


def slipped(recording):
    after = recording.imu.t > 100.0
    other, imu = turned(recording.imu, 8.0), recording.imu
    change = lambda a, b: np.where(after[:, None], a, b)
    return replace(
        recording,
        imu=imu._replace(dtheta=change(other.dtheta, imu.dtheta), dv=change(other.dv, imu.dv)),
    )


def with_iron(recording):
    (field,) = [a for a in recording.sources if a.kind == "magnetic-field"]
    y = field.y + np.where(field.t > 100.0, 9e-6, 0.0)[:, None] * [0.0, 1.0, 0.0]
    return replace(recording, sources=(replace(field, y=y),))


def with_bias(recording):
    imu = recording.imu
    drift = 0.02 * imu.t[:, None] / imu.t[-1] * [1.0, 0.0, 0.0]
    return replace(recording, imu=imu._replace(dtheta=imu.dtheta + drift * imu.dt[:, None]))


def with_clock(recording, t):
    return replace(recording, imu=recording.imu._replace(t=t))


@pytest.mark.parametrize(
    "change, cause, seen",
    [
        (slipped, "mounting", "the angle about z between the axes of the IMU and those of"),
        (with_iron, "calibration", "the hard iron along y of magnetometer steps by +9"),
        (
            lambda r: with_clock(r, r.imu.t + np.where(r.imu.t > 100.0, 0.1, 0.0)),
            "clock",
            "later than magnetometer steps by +0.1 ",
        ),
        (lambda r: with_clock(r, 1.0008 * r.imu.t), "clock", "drifts by +0.1"),
        (with_bias, "gyro", "the bias of gyro x against magnetometer drifts by"),
    ],
)
def test_each_change_is_a_reason(held, change, cause, seen):
    (reason,) = reasons(change(held))
    assert reason.cause == cause and seen in reason.seen and reason.weight >= 1


def test_what_does_not_change_is_no_reason(held):
    assert reasons(held) == []
    compass = Magnetometer(rate=10.0, field=COMPASS.field, hard_iron=(5e-6, -3e-6, 2e-6))
    assert reasons(sd.simulate("demo", 225.0, seed=19, magnetometer=compass)) == []


def test_a_step_is_least_squares_by_hand():
    """Of one unknown that is read directly: the difference of two means."""
    n, k = 16, len(PRIOR)
    y = np.r_[np.zeros(9), np.ones(7)] + 0.01 * np.random.default_rng(3).standard_normal(n)
    normal, right = np.tile(1e-9 * np.eye(k), (n, 1, 1)), np.zeros((n, k))
    normal[:, 3, 3], right[:, 3] = 1.0, y - y.mean()
    blocks = _Blocks(np.arange(n), normal, right, (y - y.mean()) ** 2, np.ones(n, int))
    shape = (np.arange(n) >= 9).astype(float)
    found = list(_changes(blocks, shape, 1e-4, 9.0))
    assert len(found) == len(UNKNOWNS) and EDGE > 0
    # the prior on a change holds it back a little
    assert found[3].value / PRIOR[3] == pytest.approx(y[9:].mean() - y[:9].mean(), rel=0.1)
