"""The IMU of a u-blox receiver, ESF-RAW or ESF-MEAS, beside its GNSS: samples as they come, with the decoders,
intervals and axes of logs."""

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.loop.contract import Imu
from ...engine.stream import Measurement, Sample
from ...io.decoding.receivers.ubx_frames import UbxFrames, UbxMessage, find_frames
from ...io.decoding.receivers.ubx_imu import mounting_angles
from ...io.decoding.receivers.ubx_sensors import (
    ACCEL,
    ACCEL_SCALE,
    GYRO,
    GYRO_SCALE,
    TICKS,
    measurements,
    unwrap_tags,
)
from ...preprocessing.axes import (
    BODY_AXES,
    axes_matrix,
    permute_axes,
    rotate_rows,
    rotation_matrix,
)
from ...preprocessing.imu_samples import StreamIntervals
from ...preprocessing.joined_imu import MIN_COVERED, forces_over
from ...typing import Array
from ...units.conversion import DEG
from .input_formats import Decoder

IMU_MESSAGES = {each.title: each for each in (UbxMessage.ESF_RAW, UbxMessage.ESF_MEAS)}
"""{name: message} with samples of an IMU."""
SENSORS = 0x10
"""Class of the messages of sensors, ESF."""
BEGIN = bytes([0xB5, 0x62, SENSORS])
SURE = 1.0
"""s over which the rate of the sensor's clock is compared with arrival."""
FACTOR = 3.0
"""By which the rate may be off there; the two that are known differ by 26."""
MAX_OPEN = 16
"""Samples of which axes are missing, at most."""
MAX_WAITING = 1000
"""Samples of the gyro that wait for the accelerometer, at most."""
MAX_ACCEL = 256
"""Newest samples of the accelerometer that are kept."""
MAX_HELD = 50_000
"""Measurements that wait for the rate of the clock, at most."""
MIN_TURN = 1.0
"""deg between two mountings that are different."""


class ImuMounting(NamedTuple):
    """Axes and mounting of the IMU of a receiver."""

    matrix: Array  # (3, 3), from the axes of the module to the body
    angles: (
        tuple[float, float, float] | None
    )  # roll, pitch and heading, rad; None without a mounting

    @classmethod
    def of_axes(cls, axes: str, angles: tuple[float, float, float] | None) -> "ImuMounting":
        """Return that of an [imu] with these keys. Raises DataError for axes that are none."""
        matrix = axes_matrix(axes, BODY_AXES)
        return cls(matrix if angles is None else rotation_matrix(*angles) @ matrix, angles)

    def in_body(self, vector: Array) -> tuple[float, float, float]:
        """Return a vector (3,) in body axes, by the same operations as a log."""
        turn = permute_axes if self.angles is None else rotate_rows
        x, y, z = turn(vector[None], self.matrix)[0].tolist()
        return x, y, z


class _Increment(NamedTuple):
    t: float  # s of the sensor's clock
    dt: float  # s
    value: Array  # (3,), in the axes of the module


class _Triad:
    """Increments of a gyro or an accelerometer from measurements of its axes."""

    def __init__(self, kinds: tuple[int, ...], scale: float) -> None:
        self._kinds, self._scale, self._intervals = kinds, scale, StreamIntervals()
        self._open: dict[int, dict[int, int]] = {}  # {tag: {kind: count}}
        self._last = -math.inf
        self.late = 0  # axes, or samples, that came late or whose others did not come

    def begin(self) -> int:
        """Take tags of a clock that began anew, and return the number of samples that stay without axes."""
        waited, self._open, self._last = len(self._open), {}, -math.inf
        return waited

    def take(self, tag: int, kind: int, count: int, tick: float) -> _Increment | None:
        """Take a measurement, and return the increment that it completes."""
        if tag <= self._last:
            self.late += 1
            return None
        axes = self._open.setdefault(tag, {})
        axes[kind] = count
        if len(axes) < len(self._kinds):
            if len(self._open) > MAX_OPEN:
                del self._open[min(self._open)]
                self.late += 1
            return None
        self.late += sum(each < tag for each in self._open)
        self._open = {each: some for each, some in self._open.items() if each > tag}
        self._last = tag
        t = tag * (1e6 * tick) * 1e-6  # as a log, which counts us
        dt = self._intervals.interval(t)
        if dt is None:
            return None
        return _Increment(t, dt, np.array([axes[each] for each in self._kinds]) * self._scale * dt)


class ReceiverImu:
    """Samples from the messages of sensors of one kind. `bad` counts measurements and samples that cannot
    be used, and `why` says it of the first. Times are those of the sensor's own clock."""

    def __init__(self, message: str, mounting: ImuMounting) -> None:
        self._key, self._mounting = IMU_MESSAGES[message], mounting
        self.bad, self.why = 0, ""
        self._tick = TICKS[0] if self._key == UbxMessage.ESF_MEAS else 0.0  # s; 0: not yet known
        self._newest: tuple[int, int] | None = None  # (tag as sent, tag without overflow)
        self._first: tuple[int, float] | None = None  # (tag, s of arrival), to compare the rate
        self._held: list[tuple[int, int, int]] = []
        self._gyro, self._accel = _Triad(GYRO, GYRO_SCALE * DEG), _Triad(ACCEL, ACCEL_SCALE)
        self._turns: deque[_Increment] = deque()  # of the gyro, until the accelerometer has come
        self._forces: deque[_Increment] = deque(maxlen=MAX_ACCEL)
        self._is_going = False

    def take(self, frames: UbxFrames, arrived: float) -> list[Sample]:
        """Return the samples that messages complete, which arrived at a time of time.monotonic, s."""
        found = measurements(frames, self._key)
        rows = list(zip(found.tag.tolist(), found.kind.tolist(), found.value.tolist()))
        self._held += [row for row in rows if row[1] in (*GYRO, *ACCEL)]
        if not self._held or not self._tick and not self._compare(self._held[-1][0], arrived):
            return []
        held, self._held = self._held, []
        samples: list[Sample] = []
        for tag, kind, count in held:
            self._measure(self._whole_tag(tag), kind, count)
            if self._turns and self._forces:
                samples += self._join()
        return samples

    def _compare(self, tag: int, arrived: float) -> bool:
        """Set the rate of the clock to the known one that fits the times of arrival; False while it is
        unknown."""
        if self._first is None:
            self._first = tag, arrived
        ticks, seconds = (tag - self._first[0]) % 2**32, arrived - self._first[1]
        if seconds < SURE and len(self._held) < MAX_HELD:
            return False
        rate = ticks / max(seconds, 1e-9)
        tick = min(TICKS, key=lambda each: abs(math.log(max(rate, 1e-9) * each)))
        if not 1 / FACTOR < rate * tick < FACTOR:
            self.why = self.why or f"the sensor's clock has {rate:.4g} ticks per s of arrival"
            self.bad += len(self._held)
            self._held, self._first = [], None
            return False
        self._tick = tick
        return True

    def _whole_tag(self, tag: int) -> int:
        """Return a tag without overflow; a clock that began anew begins with its own."""
        if self._newest is None:
            self._newest = tag, tag
        if tag == self._newest[0]:
            return self._newest[1]
        tags, pieces = unwrap_tags(np.array([self._newest[0], tag]))
        whole = self._newest[1] + int(tags[1] - tags[0])
        if pieces[-1]:
            whole = tag
            self.leave()
        self._newest = tag, whole
        return whole

    def leave(self) -> None:
        """Count what waits in vain, where the clock began anew or nothing more comes."""
        waited = len(self._held) + len(self._turns) + self._gyro.begin() + self._accel.begin()
        self._held.clear()
        self._turns.clear()
        self._forces.clear()
        self.bad += waited
        if waited:
            self.why = self.why or "what belongs to it did not come any more"

    def _measure(self, tag: int, kind: int, count: int) -> None:
        of_gyro = kind in GYRO
        triad = self._gyro if of_gyro else self._accel
        late = triad.late
        increment = triad.take(tag, kind, count, self._tick)
        self.bad += triad.late - late
        if increment is not None:
            (self._turns if of_gyro else self._forces).append(increment)
        if len(self._turns) > MAX_WAITING:
            self._turns.popleft()
            self._drop("the gyro has no accelerometer beside it")

    def _join(self) -> list[Sample]:
        """Return the samples of the gyro whose intervals the accelerometer has covered."""
        samples: list[Sample] = []
        while self._turns and self._forces[-1].t >= self._turns[0].t:
            t, dt, turn = self._turns.popleft()
            force = self._force(t, dt)
            if force is None:
                if self._is_going:
                    self._drop("the accelerometer has gaps")
                continue
            self._is_going = True
            in_body = self._mounting.in_body
            samples.append(Sample(t, dt, in_body(turn), in_body(force)))
        return samples

    def _force(self, t: float, dt: float) -> Array | None:
        """Return the increment of the accelerometer over an interval; None where it has a gap."""
        for other in reversed(self._forces):
            if (other.t, other.dt) == (t, dt):
                return other.value
        times, lengths, sums = (np.array(each) for each in zip(*self._forces))
        found, covered = forces_over(Imu(times, lengths, sums, sums), np.array([t]), np.array([dt]))
        return found[0] / covered[0] if covered[0] >= MIN_COVERED else None

    def _drop(self, why: str) -> None:
        self.bad += 1
        self.why = self.why or why


class ReceiverWithImu(Decoder):
    """UBX of a receiver with its IMU: messages of sensors become samples at once, and the rest goes to
    the decoder of its GNSS."""

    def __init__(self, gnss: Decoder, message: str, mounting: ImuMounting) -> None:
        super().__init__()
        self._gnss, self._imu, self._rest = gnss, ReceiverImu(message, mounting), b""
        self._mounting, self._told = mounting, False

    @property
    def unused(self) -> int:
        """As of Decoder: a message that is not whole. Epochs of the GNSS before it are not read again."""
        return len(self._rest)

    @property
    def memory(self) -> Any:
        """As of Decoder."""
        return self._gnss.memory

    def resume(self, memory: Any) -> None:
        """As of Decoder."""
        self._gnss.resume(memory)

    def feed(self, piece: bytes) -> list[Sample | Measurement]:
        """As of Decoder."""
        data = self._rest + piece
        frames = find_frames(data)
        ours = np.flatnonzero(frames.key >> 8 == SENSORS)
        spans = [
            (int(frames.start[k]) - 6, int(frames.start[k] + frames.length[k]) + 2) for k in ours
        ]
        end = _whole_until(
            data, int(frames.start[-1] + frames.length[-1]) + 2 if len(frames.start) else 0
        )
        self._rest = data[end:]
        found: list[Sample | Measurement] = [*self._imu.take(frames, time.monotonic())]
        self._look_at_mounting(frames)
        if others := _without(data[:end], spans):
            found += self._gnss.feed(others)
        self._count()
        return found

    def idle(self) -> list[Sample | Measurement]:
        """As of Decoder."""
        found = self._gnss.idle()
        self._count()
        return found

    def end(self) -> list[Sample | Measurement]:
        """As of Decoder."""
        found = self._gnss.end()
        self._count()
        return found

    def leave(self) -> None:
        """Count what waits in vain, where nothing more comes."""
        self._imu.leave()
        self._count()

    def _count(self) -> None:
        for each in (self._gnss, self._imu):
            self.bad, each.bad = self.bad + each.bad, 0
        self.why, self.last = self.why or self._imu.why, self._gnss.last

    def _look_at_mounting(self, frames: UbxFrames) -> None:
        """Tell once where the receiver has another mounting than the configuration."""
        found, origin = mounting_angles(frames)
        if not found or self._told:
            return
        angles = [found[name] for name in ("roll", "pitch", "heading")]
        apart = (
            np.array(angles) - np.degrees(self._mounting.angles or (0.0, 0.0, 0.0)) + 180.0
        ) % 360.0 - 180.0
        if np.abs(apart).max() > MIN_TURN:
            self._told = True
            roll, pitch, heading = angles
            self.news.append(
                f'mounting = {{ roll = {roll:g}, pitch = {pitch:g}, heading = {heading:g}, unit = "deg" }} '
                f"{origin}; this input has another one"
            )


def _whole_until(data: bytes, at: int) -> int:
    """Return where, from a place on, a message of sensors begins that is not whole; else the end."""
    begin = data.find(BEGIN, at)
    while begin >= 0:
        size = int.from_bytes(data[begin + 4 : begin + 6], "little") + 8
        if len(data) < begin + max(size, 8):
            return begin
        begin = data.find(BEGIN, begin + 1)
    few = max(k for k in range(len(BEGIN)) if data[at:].endswith(BEGIN[:k]))
    return len(data) - few


def _without(data: bytes, spans: Sequence[tuple[int, int]]) -> bytes:
    """Return the bytes outside of spans."""
    edges = [0, *(at for span in spans for at in span), len(data)]
    return b"".join(data[a:b] for a, b in zip(edges[::2], edges[1::2]))
