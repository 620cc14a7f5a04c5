"""The recordings on which `strapdown reproduce recordings` tries every filter: what each is aided
with, what it is scored by, and when.

thor75 with magnetometer and barometer, drive0708 with GNSS alone, the BROAD trials with thinned and
noised optical positions, and the ring-laser record of a parked vehicle with what is known of one
that stands still.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown import io
from strapdown.alignment.static_attitude import body_to_navigation, gyrocompass
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.io.locate import data_folder
from strapdown.io.readers.broad import with_positions
from strapdown.typing import Array, Mask

from ..common.example_recordings import FLIGHT, in_motion, inside, windows_of

LASER = ("lasergyro", "lasergyro.imu.xz")
"""The ring-laser record in the data folder."""
POSITION_STD = 0.1
"""m per axis of the BROAD positions."""
PARKED_RATE, PARKED_STD, PARKED_SETTLED, PARKED_IMU = 1.0, 0.05, 60.0, "navigation"
"""Figures of the parked vehicle: Hz of its fixes, m/s of its zero velocity (it rocks and vibrates), s
after which it is scored, the grade of its IMU."""


class RecordingCase(NamedTuple):
    """A recording and the seconds of it that are scored."""

    group: str  # heading of its column, which the cases of one group share
    name: str
    recording: Recording
    windows: tuple[tuple[float, float], ...]  # ((start, stop), ...) in s, both included
    # in a hand: attitude as inclination and heading, which no pitch makes singular, and scored
    # where the reference has a row
    held: bool = False

    def inside(self, t: Array) -> Mask:
        """(n,) bool: which of the times `t` are scored."""
        within = inside(t, self.windows)
        return within & np.isin(t, self.recording.reference.t) if self.held else within


def cases(folder: Path) -> list[RecordingCase]:
    """The Cases of the descriptions in `folder` and of the data folder. Raises DataError."""
    flight, drive = io.read(folder / "thor75-full.toml"), io.read(folder / "drive0708.toml")
    found = [
        RecordingCase("thor75", "thor75", flight, (FLIGHT,)),
        RecordingCase("drive0708", "drive0708", drive, ((windows_of(drive)[0][0], drive.span[1]),)),
    ]
    data = data_folder(folder)
    trials = [with_optics(path) for path in sorted((data / "broad").glob("*.npz"))]
    found += [held_by_hand("BROAD, as read", trial) for trial in trials]
    found += [held_by_hand("BROAD, errors of motion", in_motion(trial)) for trial in trials]
    laser = data.joinpath(*LASER)
    return found + ([parked_case(io.read(laser))] if laser.exists() else [])


def with_optics(path: Path) -> Recording:
    """The Recording of a BROAD trial with the optical positions of one row a second, noised."""
    return with_positions(io.read(path), rate=1.0, std=POSITION_STD)


def held_by_hand(group: str, recording: Recording) -> RecordingCase:
    """The Case of a BROAD trial, scored while it moves."""
    return RecordingCase(
        group,
        recording.meta["name"],
        recording,
        tuple(map(tuple, recording.meta["movement"])),
        held=True,
    )


def parked_case(recording: Recording) -> RecordingCase:
    """The RecordingCase of a parked ring-laser IMU: the header's position and zero velocity as fixes, and as
    reference with the attitude that gravity and the Earth's rate have in the mean of the whole
    record.

    The position has the standard deviation that reading it gave the header, at every fix.
    """
    imu, header = recording.imu, next(a for a in recording.sources if a.kind == "position")
    t = np.arange(recording.span[0] + 1 / PARKED_RATE, imu.t[-1], 1 / PARKED_RATE)
    still = lambda kind, values, std: Source(
        kind, t, np.tile(values, (len(t), 1)), np.full((len(t), 3), std), name=f"parked {kind}"
    )
    fixes = (
        still("position", header.y[0], header.std[0]),
        still("zero-velocity", np.zeros(3), PARKED_STD),
    )
    reference = standing_trajectory(imu, header.y[0])
    made = replace(
        recording,
        sources=(*recording.sources, *fixes),
        reference=reference,
        meta=recording.meta | {"grade": PARKED_IMU},
    )
    return RecordingCase(
        "ring laser",
        recording.meta["name"],
        made,
        ((recording.span[0] + PARKED_SETTLED, recording.span[1]),),
    )


def standing_trajectory(imu: Imu, lla: Array) -> Trajectory:
    """Trajectory of a body that stands at `lla` (rad, rad, m), with the attitude of the mean
    rate and specific force of an Imu."""
    seconds, ends = imu.dt.sum(), np.arange(imu.t[0] - imu.dt[0], imu.t[-1] + 1.0, 1.0)
    rph = gyrocompass(imu.dtheta.sum(axis=0) / seconds, imu.dv.sum(axis=0) / seconds).rph
    x, y, z, w = Rotation.from_matrix(body_to_navigation(*rph)).as_quat()
    rows = lambda values: np.tile(values, (len(ends), 1))
    return Trajectory(ends, rows(lla), rows(np.zeros(3)), rows((w, x, y, z)))
