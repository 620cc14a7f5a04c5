"""The IMU of a u-blox receiver: ESF-RAW and ESF-MEAS.

Each measurement is a word of 32 bits: a signed number of 24, and its type. Gyros count 2^-12 deg/s,
accelerometers 2^-10 m/s^2 (u-blox M8 interface description, "ESF measurement data"). The time of a
sample is a tag of the sensor's own clock, which is converted to GPS time from the order of the
messages in a file.
"""

from functools import partial, reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....typing import Array, Ints
from ..record_walk import side_by_side
from .cyclic_times import in_order
from .ubx_frames import UbxFrames, UbxMessage

GYRO, ACCEL = (14, 13, 5), (16, 17, 18)
"""Types of the data, x, y, z."""
GYRO_SCALE, ACCEL_SCALE = 2.0**-12, 2.0**-10
"""deg/s and m/s^2 per count."""
MAX_PIECES = 50
"""Largest number of restarts of a sensor's clock used in one file; those with the most epochs
count."""


# ---- the clock of the sensors

RESTART = 10_000
"""Ticks: a tag that goes back by more marks a restart of the clock."""
LONG = 60.0
"""s: in a shorter file the nominal rate of the sensor's clock is used."""
TICKS = (1e-3, 1 / 25600)
"""s per tick: of ESF-MEAS (u-blox F9R integration manual) and, as found in files, of the ESF-RAW of
an M8U."""
PPM = 500e-6
"""Largest relative error of the rate of a clock."""


class Line(NamedTuple):
    """GPS time = tick * (tag - tag0) + gps0, s."""

    tick: float
    tag0: float
    gps0: float
    scatter: float  # s, median distance of the epochs from the line

    def gps(self, tag: Ints) -> Array:
        """s"""
        return np.asarray(self.tick * (tag - self.tag0) + self.gps0, float)


def unwrap_tags(tag: Ints) -> tuple[Ints, Ints]:
    """(tags without 32-bit overflow (n,), number of the piece of each (n,)); a restart of the clock
    begins a new piece."""
    step = np.diff(tag, prepend=tag[:1])
    step = (step + 2**31) % 2**32 - 2**31
    anew = (step < -RESTART) | (step > 2**30)
    return tag[0] + np.cumsum(np.where(anew, 0, step)), np.cumsum(anew)


def fit(tag: Array, gps: Array, ticks: tuple[float, ...] = TICKS) -> Line | None:
    """Return the line through epochs (n,): the tag, interpolated between samples, at the arrival of
    each epoch. None where they fit none of the `ticks`.

    The offset is a median, and so is the rate over a long file, so that late messages affect
    neither. A line keeps the stability of the sensor's own clock.
    """
    if not len(tag):
        return None
    tick = ticks[0] if len(ticks) == 1 else _tick(tag, gps, ticks)
    if tick is None:
        return None
    span = np.ptp(gps)
    if span > LONG:
        third = len(tag) // 3
        early, late = slice(None, third + 1), slice(-third - 1, None)
        rest = gps - tick * tag
        run = np.median(gps[late]) - np.median(gps[early])
        drift = (np.median(rest[late]) - np.median(rest[early])) / run if run > 0 else 0.0
        tick *= 1 + float(np.clip(drift, -PPM, PPM))
    middle = float(np.median(tag))
    rest = gps - tick * (tag - middle)
    offset = float(np.median(rest))
    return Line(tick, middle, offset, float(np.median(np.abs(rest - offset))))


def _tick(tag: Array, gps: Array, ticks: tuple[float, ...]) -> float | None:
    """Return the tick that the epochs fit within a fifth."""
    steps, dt = np.diff(tag), np.diff(gps)
    fair = (steps > 0) & (dt > 0)
    if not fair.any():
        return None
    rate = float(np.median(dt[fair] / steps[fair]))
    near = min(ticks, key=lambda each: abs(rate / each - 1))
    return near if abs(rate / near - 1) < 0.2 else None


# ---- samples


class Samples(NamedTuple):
    """Samples of a gyro or accelerometer from one kind of message, in order of time."""

    t: NDArray[np.int64]  # us of GPS time since its zero, or of the sensor's own clock (n,)
    values: dict[int, NDArray[np.int64]]  # counts by type (n,)


class UbxSensors(NamedTuple):
    """The IMU of one kind of message."""

    name: str
    gyro: Samples
    accel: Samples
    absolute: bool  # GPS time, else the sensor's own
    scatter: float  # s, of the epochs about the line that sets the sensor's clock
    lost: int  # samples whose time no epoch gives


class SensorMeasurements(NamedTuple):
    """Measurements of the sensors (n,), in the order of the file."""

    place: Ints  # of the message in the file
    tag: Ints
    kind: Ints
    value: Ints


def sensors(frames: UbxFrames, key: UbxMessage, place: Ints, gps: Array) -> UbxSensors | None:
    """Return the IMU from the messages of one kind; `place` and `gps` (s) are the epochs of the
    file that set its clock. None without a gyro and an accelerometer, or without a time."""
    found = measurements(frames, key)
    ours = np.isin(found.kind, (*GYRO, *ACCEL))
    found = SensorMeasurements(*(each[ours] for each in found))
    if not all((found.kind == kind).any() for kind in (*GYRO, *ACCEL)):
        return None
    tag, piece = unwrap_tags(found.tag)
    tag = tag + piece * 2**40  # tags of different pieces are never the same
    lines = _lines(frames, key, found.place, tag, piece, place, gps)
    gyro, accel = (_together(found, tag, types) for types in (GYRO, ACCEL))
    if not lines:
        if key != UbxMessage.ESF_MEAS or len(place):
            return None
        us = int(1e6 * TICKS[0])
        gyro, accel = (Samples(each.t % 2**40 * us, each.values) for each in (gyro, accel))
        return UbxSensors(key.title, gyro, accel, False, 0.0, 0)
    timed = [_time_samples(each, lines) for each in (gyro, accel)]
    lost = len(gyro.t) - len(timed[0].t)
    scatter = max(line.scatter for line in lines.values())
    return UbxSensors(key.title, timed[0], timed[1], True, scatter, lost)


def measurements(frames: UbxFrames, key: UbxMessage) -> SensorMeasurements:
    """Return all measurements of the messages of one kind."""
    ours = frames.key == key
    parts = []
    for length in np.unique(frames.length[ours]):
        start = frames.start[ours & (frames.length == length)]
        size = int(length) // 4 * 4
        if size < 8:
            continue
        words = side_by_side(frames.content, start, size).view("<u4").astype(np.int64)
        if key == UbxMessage.ESF_RAW:
            data, tag = words[:, 1:-1:2], words[:, 2::2]
            some = np.ones(data.shape, bool)
        else:
            data = words[:, 2:]
            many = words[:, 1] >> 11 & 31
            many = np.where(many == 0, data.shape[1] - (words[:, 1] >> 3 & 1), many)
            tag = np.broadcast_to(words[:, :1], data.shape)
            some = np.arange(data.shape[1]) < many[:, None]
        place = np.broadcast_to(start[:, None], data.shape)
        parts.append((place[some], tag[some], data[some] >> 24 & 63, data[some] & 0xFFFFFF))
    if not parts:
        return SensorMeasurements(*(np.zeros(0, np.int64) for _ in range(4)))
    place, tag, kind, value = (np.concatenate(each) for each in zip(*parts))
    value = (value ^ 0x800000) - 0x800000
    if len(parts) > 1:  # frames of one length are in file order
        order = np.argsort(place, kind="stable")
        place, tag, kind, value = (each[order] for each in (place, tag, kind, value))
    return SensorMeasurements(place, tag, kind, value)


def _together(found: SensorMeasurements, tag: Ints, types: tuple[int, ...]) -> Samples:
    """Return the samples at the tags, in order, with all three axes."""
    each = {}
    for kind in types:
        rows = np.flatnonzero(found.kind == kind)
        rows = rows[in_order(tag[rows])[0]]
        each[kind] = (tag[rows], found.value[rows])
    every = [tags for tags, _ in each.values()]
    if all(np.array_equal(every[0], tags) for tags in every):
        return Samples(every[0], {kind: value for kind, (_, value) in each.items()})
    common = reduce(partial(np.intersect1d, assume_unique=True), every)
    values = {kind: value[np.searchsorted(tags, common)] for kind, (tags, value) in each.items()}
    return Samples(common, values)


def _lines(
    frames: UbxFrames,
    key: UbxMessage,
    sample_place: Ints,
    tag: Ints,
    piece: Ints,
    place: Ints,
    gps: Array,
) -> dict[int, Line]:
    """{piece: Line} of the sensor's clock. An epoch arrives between two messages of the sensor; its
    tag is taken midway between their last tags."""
    last = np.flatnonzero(np.diff(sample_place, append=-1) != 0)  # last measurement of a message
    before = np.searchsorted(sample_place[last], place) - 1
    inside = (before >= 0) & (before + 1 < len(last))
    a, b = last[before[inside]], last[before[inside] + 1]
    same = piece[a] == piece[b]
    a, b, moment = a[same], b[same], gps[inside][same]
    middle = (tag[a] + tag[b]) / 2
    ticks = (TICKS[0],) if key == UbxMessage.ESF_MEAS else TICKS
    numbers, many = np.unique(piece[a], return_counts=True)
    lines = {}
    for number in numbers[np.argsort(-many, kind="stable")][:MAX_PIECES]:
        rows = piece[a] == number
        line = fit(middle[rows], moment[rows], ticks)
        if line is not None:
            lines[int(number)] = line
    return lines


def _time_samples(samples: Samples, lines: dict[int, Line]) -> Samples:
    """The samples of the pieces that have a line, with GPS time, in its order."""
    piece = (samples.t + 2**39) >> 40
    t = np.full(len(piece), -1, np.int64)
    for number, line in lines.items():
        rows = piece == number
        t[rows] = np.round(1e6 * line.gps(samples.t[rows])).astype(np.int64)
    kept = np.flatnonzero(t >= 0)
    order = kept[np.argsort(t[kept], kind="stable")]
    return Samples(t[order], {kind: value[order] for kind, value in samples.values.items()})
