"""The contents of a logger as arrays that a fault may change: the samples, the fixes, and the order
in which they arrived."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.geometry.geodesy import displace_lla
from strapdown.typing import Array, Ints, Mask

BEGINS = 90.0
"""s at which a fault begins that does not last from the start."""


@dataclass
class RawFixes:
    """One source."""

    kind: str
    t: Array  # (m,) s
    y: Array  # (m, components)
    std: Array
    parameters: tuple[float, ...]
    name: str
    arrival: Array  # (m,) s: when each came, whatever its stamp says

    def from_fault(self, lasting: float = np.inf) -> Mask:
        """(m,) which of them fall into the fault's `lasting` seconds."""
        return (self.t >= BEGINS) & (self.t < BEGINS + lasting)

    def take(self, rows: Mask | Ints) -> None:
        """Keep these rows, in this order."""
        self.t, self.y, self.std, self.arrival = (
            column[rows] for column in (self.t, self.y, self.std, self.arrival)
        )

    def move(self, ned: Array | tuple[float, ...], rows: Mask | slice = slice(None)) -> None:
        """Displace these rows of a position by `ned` (3,) or (n, 3), m."""
        self.y[rows] = displace_lla(self.y[rows], np.asarray(ned, float) + 0 * self.y[rows])

    def source(self) -> Source:
        """As what a Recording holds."""
        return Source(self.kind, self.t, self.y, self.std, self.parameters, name=self.name)


@dataclass
class Raw:
    """A recording before anything has looked at it."""

    t: Array  # (n,) s
    gyro: Array  # (n, 3) rad/s
    accel: Array  # (n, 3) m/s^2
    sources: dict[str, RawFixes]
    arrival: Array  # (n,) s
    rng: np.random.Generator
    # what becomes of the start that a right recording has; None: it is found from the data
    start: Callable[[InitialState], InitialState] | None = None
    reference: Trajectory | None = field(default=None, repr=False)

    def from_fault(self, lasting: float = np.inf) -> Mask:
        """(n,) which samples fall into the fault's `lasting` seconds."""
        return (self.t >= BEGINS) & (self.t < BEGINS + lasting)

    def take(self, rows: Mask | Ints) -> None:
        """Keep these samples, in this order."""
        self.t, self.gyro, self.accel, self.arrival = (
            column[rows] for column in (self.t, self.gyro, self.accel, self.arrival)
        )

    def of(self, *kinds: str) -> list[RawFixes]:
        """The sources of these kinds that are there."""
        return [self.sources[kind] for kind in kinds if kind in self.sources]

    @property
    def gnss(self) -> list[RawFixes]:
        """Positions and velocities."""
        return self.of("position", "velocity")

    def recording(self, grade: str, **meta: object) -> Recording:
        """Return the Recording of these arrays. Raises DataError."""
        return Recording.from_arrays(
            self.t,
            self.gyro,
            self.accel,
            [source.source() for source in self.sources.values()],
            self.reference,
            grade=grade,
            **meta,
        )


def raw(recording: Recording, kinds: tuple[str, ...], seed: int, name: str) -> Raw:
    """The arrays of a simulated recording with the sources of these kinds; chance of its own for
    each seed and name of a fault."""
    imu = recording.imu
    sources = {
        a.kind: RawFixes(
            a.kind,
            a.t.copy(),
            a.y.copy(),
            np.broadcast_to(a.std, a.y.shape).copy(),
            a.parameters,
            a.name or a.kind,
            a.t.copy(),
        )
        for a in recording.sources
        if a.kind in kinds
    }
    return Raw(
        imu.t.copy(),
        imu.dtheta / imu.dt[:, None],
        imu.dv / imu.dt[:, None],
        sources,
        imu.t.copy(),
        np.random.default_rng([seed, crc32(name.encode())]),
        reference=recording.reference,
    )
