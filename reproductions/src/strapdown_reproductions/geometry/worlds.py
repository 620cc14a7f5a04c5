"""Flights, filters and starts of the study."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording
from strapdown.sensor_models.imu import imu
from strapdown.sim import motions
from strapdown.sim.synthesis import simulate
from strapdown.sim.trajectory import DEG, Motion
from strapdown.typing import Array

PUBLISHED = {"form": "published"}
FILTERS: dict[str, tuple[str, dict[str, Any]]] = {
    "closed-loop": ("closed-loop", {}),
    "ukf": ("ukf", {}),
    "xkf": ("xkf", {}),
    "iekf": ("iekf", {}),
    "iekf, published": ("iekf", PUBLISHED),
    "iekf, published, two frames": ("iekf", PUBLISHED | {"biases": "two-frame"}),
    "eqf": ("eqf", {}),
    "eqf, published": ("eqf", PUBLISHED),
}
"""{label: (filter, options)}."""
UNGATED = ("closed-loop", "iekf, published", "eqf, published")
"""Those that also run without a gate, from starts far off."""
NO_GATE = ", no gate"
RATE = 100.0
"""Hz of the IMU."""
HEADINGS, TILTS, SIDES = (60.0, 120.0, 170.0), (0.0, 30.0, 60.0), 3
"""deg that a start is off, and to how many sides."""
LITTLE = 5.0
"""deg: standard deviation of a tilt that is not off."""


class FarSetting(NamedTuple):
    """A motion with an IMU, and how long a filter has."""

    motion: str
    grade: str
    duration: float  # s


SETTINGS = (
    FarSetting("flight", "consumer", 240.0),
    FarSetting("flight", "industrial", 240.0),
    FarSetting("flight", "tactical", 120.0),
    FarSetting("road", "consumer", 240.0),
    FarSetting("road", "industrial", 240.0),
    FarSetting("road", "tactical", 120.0),
)


def weaving_flight() -> Motion:
    """45 m/s, turns of up to 50 deg of bank to both sides, a climb and a descent."""
    legs = (
        {"duration": 6.0},
        {
            "repeat": 8,
            "legs": (
                {"duration": 10.0, "turn": 130 * DEG},
                {"duration": 4.0, "climb": 2.0},
                {"duration": 13.0, "turn": -150 * DEG},
                {"duration": 5.0, "climb": -2.0},
            ),
        },
    )
    return motions.flight((59 * DEG, 10 * DEG, 700.0), 80 * DEG, 45.0, legs, name="weaving flight")


def town_drive() -> Motion:
    """12 m/s around corners to both sides, with stops of a few seconds."""
    legs = (
        {"duration": 2.0},
        {"duration": 5.0, "speed": 12.0},
        {
            "repeat": 8,
            "legs": (
                {"duration": 6.0},
                {"duration": 4.0, "turn": 90 * DEG},
                {"duration": 8.0},
                {"duration": 4.0, "turn": -90 * DEG},
                {"duration": 4.0, "speed": 5.0},
                {"duration": 4.0, "speed": 12.0},
            ),
        },
    )
    return motions.car((59 * DEG, 10 * DEG, 100.0), 20 * DEG, legs, name="town")


MOTIONS = {"flight": weaving_flight, "road": town_drive}


@lru_cache(maxsize=4)
def record(setting: FarSetting, seed: int) -> Recording:
    """The recording of a setting: fixes of 1 m and 0.1 m/s a second."""
    return simulate(MOTIONS[setting.motion](), setting.duration, setting.grade, seed, rate=RATE)


def true_attitude(recording: Recording) -> Rotation:
    """The attitude at its first instant, body to n."""
    assert recording.reference is not None
    return Rotation.from_quat(np.roll(recording.reference.q_nb[0], -1))


def begin(recording: Recording, grade: str, attitude: Rotation, spread: Array) -> InitialState:
    """Begun at the truth but for its attitude, whose standard deviations are `spread` (3,), rad; the biases
    are not known beyond what the grade says."""
    truth, (accel, gyro) = recording.reference, imu(grade).bias_std()
    assert truth is not None
    heading, pitch, roll = attitude.as_euler("ZYX")
    std = np.r_[[1.5] * 3, [0.2] * 3, spread, [accel] * 3, [gyro] * 3]
    return InitialState(
        float(truth.t[0]),
        tuple(truth.lla[0]),
        tuple(truth.v_n[0]),
        (roll, pitch, heading),
        (0.0,) * 3,
        (0.0,) * 3,
        tuple(std.tolist()),
    )


def starts(
    recording: Recording, grade: str, seed: int
) -> Iterator[tuple[float, float, InitialState]]:
    """(deg of heading, deg of tilt, start): every combination, to SIDES random sides each, with standard
    deviations as large as the errors."""
    true = true_attitude(recording)
    for heading, tilt, k in product(HEADINGS, TILTS, range(SIDES)):
        rng = np.random.default_rng([seed, int(heading), int(tilt), k])
        side, sign = rng.uniform(0, 2 * np.pi), rng.choice([-1, 1])
        tilted = Rotation.from_rotvec(tilt * DEG * np.array([np.cos(side), np.sin(side), 0.0]))
        off = Rotation.from_rotvec([0.0, 0.0, sign * heading * DEG]) * tilted
        spread = np.array([max(tilt, LITTLE)] * 2 + [heading]) * DEG
        yield heading, tilt, begin(recording, grade, off * true, spread)
