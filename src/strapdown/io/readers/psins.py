"""Inertial logs of the PSINS toolbox (Gongmin Yan): text with a header and six counts a row, plain
or compressed.

Blank lines and lines that begin with % are comments. The header has three lines of six numbers:
attitude and velocity at the start (pitch, roll, yaw in deg, yaw counter-clockwise from north; VE,
VN, VU in m/s); latitude, longitude (deg), height (m), time of the start (s), sampling interval
(ms), gravity (m/s^2); and the size of a count, three gyros in arcsec and three accelerometers in
ug*s. There g is the gravity of the header, in PSINS that of the equator, 9.780327 m/s^2: with it
the specific force of a parked vehicle equals the gravity at its place; with 9.80665 it is 0.27 %
too large. Each row after them is one sample: counts of the rotation and of the velocity increment
over the interval that ends with it. The axes right, forward, up become forward, right, down.
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...checks import DataError
from ...data.recording import Recording, RecordingMeta
from ...data.solution import Source
from ...preprocessing.axes import BODY_AXES, axes_matrix
from ...preprocessing.imu_samples import increments
from ...preprocessing.plausible import mistakes, refuse_mistakes
from ...typing import Array, File
from ..facts import recording_facts
from ..reader import Findings, Reader
from ..tables.table_file import is_number, open_text, packed_suffixes, reading_file

ARCSEC = np.pi / 180 / 3600
"""rad"""
POSITION_STD, VELOCITY_STD = 10.0, 1.0
"""Assumed std of the header's position (m) and velocity (m/s); the format states none."""


class Header(NamedTuple):
    """The three header lines, SI, in NED and FRD; the author of the format calls the first one
    possibly inaccurate."""

    rph: tuple[float, ...]  # roll, pitch, heading, rad
    v_n: tuple[float, ...]  # m/s, NED
    lla: tuple[float, ...]  # rad, rad, m
    t: float  # s
    dt: float  # s
    gravity: float  # m/s^2
    gyro_count: tuple[float, ...]  # rad per count, about the file's x (right), y (forward), z (up)
    accel_count: tuple[float, ...]  # m/s per count


def read_psins(path: File) -> Recording:
    """Return the Recording of a PSINS log: IMU samples in FRD; the header in meta ("position",
    "attitude", "velocity" and "gravity", SI, NED).

    The header's position and velocity become one fix each at the start, with `POSITION_STD` and
    `VELOCITY_STD`, from which a filter can start. Such a file has no other fixes and no reference.
    Raises a one-line DataError.
    """
    recording = read_unchecked(path)
    refuse_mistakes(recording.imu, path, "increment")
    return recording


def read_unchecked(path: File) -> Recording:
    """Read a log as `read_psins`, without a check of the samples. Raises DataError where the file
    is not a PSINS log."""
    path = Path(path)
    header, counts = parse(path)
    t = header.t + header.dt * np.arange(1, len(counts) + 1)
    C = axes_matrix("RFU", BODY_AXES)
    gyro, accel = (
        (counts[:, :3] * header.gyro_count) @ C.T,
        (counts[:, 3:] * header.accel_count) @ C.T,
    )
    imu, notes = increments(t, gyro, accel, "increment")
    meta: RecordingMeta = {
        "name": path.name.partition(".")[0],
        "position": list(header.lla),
        "attitude": list(header.rph),
        "velocity": list(header.v_n),
        "gravity": header.gravity,
        "notes": notes,
    }

    def at_start(kind: str, values: tuple[float, ...], std: float) -> Source:
        t = imu.t[:1] - imu.dt[:1]
        return Source(kind, t, np.array([values]), np.full((1, 3), std), name=f"header {kind}")

    return Recording(
        imu,
        (
            at_start("position", header.lla, POSITION_STD),
            at_start("velocity", header.v_n, VELOCITY_STD),
        ),
        meta=meta,
    )


def parse(path: File) -> tuple[Header, Array]:
    """(Header, (n, 6) counts) of a PSINS log. Raises DataError."""
    lines = _lines(Path(path))
    if len(lines) < 5:
        raise DataError(
            f"{path}: {len(lines)} lines of numbers; a PSINS log has three header lines and then at "
            f"least two samples"
        )
    rows = [_numbers(path, *line) for line in lines[:3]]
    try:
        counts = np.loadtxt([text for _, text in lines[3:]], ndmin=2, comments=None)
    except ValueError:
        counts = np.empty((0, 0))
    if counts.shape[1] != 6:  # line by line, slower, to find the faulty line
        counts = np.array([_numbers(path, *line) for line in lines[3:]])
    if not np.isfinite(counts).all():
        raise DataError(
            f"{path}, line {lines[3 + int(np.argmin(np.isfinite(counts).all(axis=1)))][0]}: a count "
            f"is not a finite number; remove the row"
        )
    return _header(path, lines, *rows), counts


def _lines(path: Path) -> list[tuple[int, str]]:
    """[(line number, text)] without comments and blank lines."""
    with reading_file(path), open_text(path) as file:
        return [
            (number, line)
            for number, line in enumerate(file, 1)
            if line.strip() and not line.startswith("%")
        ]


def _numbers(path: File, number: int, text: str) -> tuple[float, ...]:
    """The six numbers of one line."""
    values: tuple[float, ...]
    try:
        values = tuple(map(float, text.replace("_", "no number").split()))  # Python takes 1_0
    except ValueError:
        values = ()
    if len(values) != 6:
        cells = text.split()
        is_row = 2 * sum(map(is_number, cells)) > len(cells)  # other text is not quoted
        raise DataError(
            f"{path}, line {number}: {repr(text.strip()[:40]) if is_row else 'it'} is not six numbers; correct "
            f"or remove the line"
        )
    return values


def _header(
    path: File,
    lines: list[tuple[int, str]],
    attitude: tuple[float, ...],
    place: tuple[float, ...],
    scale: tuple[float, ...],
) -> Header:
    rad = np.pi / 180
    pitch, roll, yaw, east, north, up = attitude
    latitude, longitude, height, t, milliseconds, gravity = place
    if not (
        abs(latitude) <= 90
        and abs(longitude) <= 360
        and 0 < milliseconds < 1e4
        and 9 < gravity < 11
    ):
        raise DataError(
            f"{path}, line {lines[1][0]}: latitude, longitude, height, time, interval in ms and "
            f"gravity are expected, "
            f"not {lines[1][1].strip()!r}"
        )
    if not all(0 < value < np.inf for value in scale):
        raise DataError(
            f"{path}, line {lines[2][0]}: the size of a count must be larger than 0 for all six, "
            f"not {lines[2][1].strip()!r}"
        )
    return Header(
        (roll * rad, pitch * rad, -yaw * rad % (2 * np.pi)),
        (north, east, -up),
        (latitude * rad, longitude * rad, height),
        t,
        milliseconds / 1e3,
        gravity,
        tuple(value * ARCSEC for value in scale[:3]),
        tuple(value * 1e-6 * gravity for value in scale[3:]),
    )


def inspect(path: Path) -> Findings:
    """Return the findings on the samples and the header, also for impossible samples. Raises
    DataError where the file is not a PSINS log."""
    recording = read_unchecked(path)
    latitude, longitude, height = recording.meta["position"]
    found = recording_facts(
        replace(recording, sources=()),
        f"header: {np.degrees(latitude):.6f} deg north, {np.degrees(longitude):.6f} deg east, "
        f"{height:.1f} m, heading {np.degrees(recording.meta['attitude'][2]):.1f} deg",
    )
    wrong = [f"imu: {text}" for _, text in mistakes(recording.imu, "increment")]
    found.problems[:0] = wrong
    return found


READER = Reader("psins", packed_suffixes(".imu"), "log of the PSINS toolbox", read_psins, inspect)
