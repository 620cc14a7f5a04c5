"""Simulated recordings with an installation that is known, and what is done wrong to it."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.data.calibration_parameters import CLOCK
from strapdown.data.solution import Source
from strapdown.installation.iteration import receiver_clocks
from strapdown.installation.model import apply_constants, constants
from strapdown.sensor_models.gnss import Gnss

GNSS = Gnss(
    interval=0.2,
    position_std=(1.0, 1.0, 1.5),
    velocity_std=(0.1, 0.1, 0.1),
    lever_arm=(0.5, 0.2, -1.0),
)


@cache
def car(seed, seconds=200.0, imu="consumer", vehicle=True, gnss=GNSS):
    """A car with GNSS at 5 Hz and, of a vehicle, an odometer of 0.1 m/s and constraints at 10 Hz."""
    made = sd.simulate("car", seconds, imu, seed, gnss=gnss)
    if not vehicle:
        return made
    truth, t = made.reference, np.arange(0.05, seconds - 0.1, 0.1)
    forward = truth.rotation.inv().apply(truth.v_n.copy())[:, 0]
    noise = np.random.default_rng(seed).normal(0, 0.1, len(t))
    own = [
        Source(kind, t, y[:, None], np.full((len(t), 1), 0.1), (0.0, 0.0, 0.0))
        for kind, y in (
            ("speed", np.interp(t, truth.t, forward) + noise),
            ("zero-lateral-velocity", 0 * t),
            ("zero-vertical-velocity", 0 * t),
        )
    ]
    return replace(made, sources=(*made.sources, *own))


def turned_case(seed, seconds, angle):
    """A car whose IMU, with a magnetometer in its case, must be turned by `angle` about its z axis."""
    recording, turn = car(seed, seconds), Rotation.from_rotvec([0, 0, angle])
    t, C = (each[50::10] for each in (recording.reference.t, recording.reference.rotation))
    field, noise = np.array([2e-5, 0, 4e-5]), np.random.default_rng(1).normal(0, 2e-7, (len(t), 3))
    y = turn.inv().apply(C.inv().apply(field) + noise)
    magnetic = Source("magnetic-field", t, y, np.full_like(y, 2e-7), tuple(field), name="mag")
    imu = recording.imu
    imu = imu._replace(
        dtheta=turn.inv().apply(imu.dtheta.copy()), dv=turn.inv().apply(imu.dv.copy())
    )
    return replace(recording, imu=imu, sources=(*recording.sources, magnetic))


@cache
def flown(seed, seconds=300.0, imu="tactical"):
    """A flight with GNSS at 5 Hz."""
    return sd.simulate("demo", seconds, imu, seed, gnss=GNSS)


def wrong(recording, kind, value, axis=0, of=None):
    """The recording set up so that `kind` must be changed by `value` to be right; of clocks only
    that of the kind of source `of`, or those of the receiver."""
    found = constants(recording.sources)
    receiver = receiver_clocks(found)
    theta = np.array(
        [
            value
            if one.of.cause == kind
            and (one.of is CLOCK or one.axis == axis)
            and (of is not None or one.of is not CLOCK or j in receiver)
            and (of is None or recording.sources[one.sources[0]].kind == of)
            else 0.0
            for j, one in enumerate(found)
        ]
    )
    assert theta.any()
    return apply_constants(recording, found, -theta)
