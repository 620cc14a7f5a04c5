"""MeasurementModel equation of a magnetometer: the Earth's field in body axes, bent by soft iron,
shifted by hard iron, with noise and a full scale.

    m_imu = D S (C_nb' (m_n + d_n) + d_b) + b_mag + w,   clipped at the full scale

m_n: the Earth's field in n; d: disturbances, fixed to the surroundings (n) or to the body (b); S:
soft iron; D = diag(1 + scale); b_mag: hard iron and the sensor's own offset; w: white noise. Fossen
(2021), Handbook of Marine Craft, section 14.1; distortions as in Renaudin et al. (2010), Journal of
Sensors 967245.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_array, check_choice, check_number, is_number
from ..data.solution import Source, Trajectory, attitude_of
from ..geometry.rotations import Rotation, RotationPath
from ..typing import Array, ArrayLike
from .sampling import as_triple, sample_times
from .streams import RandomStream, SeedLike

UNIFORM = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Soft iron that changes nothing."""
STRONGEST_MAGNET = 0.1  # T: beside a magnet; a larger number is a mistaken unit
STRONGEST_EARTH = 100e-6  # T: no field of the Earth is as strong
MIN_LEFT = 1e-3  # of its largest value: the least singular value that soft iron may leave


class Disturbance(NamedTuple):
    """A field that adds to the Earth's from `start` to `stop` (s, the stop itself outside), T,
    in `frame` "n" (a magnet at rest) or "b"."""

    start: float
    stop: float
    field: tuple[float, ...]
    frame: str = "n"


@dataclass(frozen=True)
class Magnetometer:
    """A three-axis magnetometer, in SI. One number for `std` or `scale` stands for three. Raises
    DataError on what none can be."""

    rate: float | None = None  # samples per second; None: one with every IMU sample
    std: tuple[float, ...] | float = (0.3e-6, 0.3e-6, 0.3e-6)  # T, white noise of each sample
    hard_iron: tuple[float, ...] = (0.0, 0.0, 0.0)  # T, body: what it reads too much
    soft_iron: tuple[tuple[float, ...], ...] = UNIFORM  # (3, 3), body
    scale: tuple[float, ...] | float = (0.0, 0.0, 0.0)  # relative error of each axis's scale
    saturation: float = 0.0  # T, full scale of each axis; 0: none
    # T, NED: the Earth's field; None: the geomagnetic model's, at date and place
    field: tuple[float, ...] | None = None
    disturbances: tuple[Disturbance, ...] = ()

    def __post_init__(self) -> None:
        if self.rate is not None:
            check_number(self.rate, "magnetometer: rate", "Hz", above=0)
        check_number(self.saturation, "magnetometer: saturation", "T", least=0)
        if not isinstance(self.disturbances, (tuple, list)):
            raise DataError(
                f"magnetometer: disturbances is {_one_line(self.disturbances)}; it must be a list of "
                f"them"
            )
        strongest: dict[str, Any] = {"least": -STRONGEST_MAGNET, "most": STRONGEST_MAGNET}
        for name, value in {
            "std": _three(as_triple(self.std), "std", above=0, most=STRONGEST_MAGNET),
            "hard_iron": _three(self.hard_iron, "hard_iron", **strongest),
            "scale": _three(as_triple(self.scale), "scale", "", above=-1, most=1),
            "soft_iron": _soft_iron(self.soft_iron),
            "field": None if self.field is None else reference_field(self.field),
            "disturbances": tuple(_disturbance(each) for each in self.disturbances),
        }.items():
            object.__setattr__(self, name, value)

    def measure(
        self,
        truth: Trajectory,
        seed: SeedLike,
        field: Sequence[float] | Array | None = None,
    ) -> Source:
        """Source "magnetic-field" of a flight, its parameters the reference field: `field` (3,) T
        NED, by default this sensor's own.

        truth: data.Trajectory with attitude; `seed` as of `ImuSpec.corrupt`. Raises DataError.
        """
        return self.plan(truth, field).fixes(seed)

    def plan(
        self,
        truth: Trajectory,
        field: Sequence[float] | Array | None = None,
        gate: float | None = None,
    ) -> "MagnetometerPlan":
        """Return the MagnetometerPlan that all runs over one trajectory share; arguments as of
        `measure`, `gate` that of its source. Raises DataError."""
        if field is None and self.field is None:
            raise DataError(
                "magnetometer: it has no field of its own; give the reference field north, east, "
                "down, T"
            )
        field = np.array(self.field if field is None else reference_field(field))
        if truth.q_nb is None:
            raise DataError("magnetometer: the trajectory has no attitude")
        t = sample_times(truth, self.rate)
        outside, inside = self._disturbance(t, "n"), self._disturbance(t, "b")
        turn = rotation_at(truth, t)
        ideal = turn.inv().apply(field)
        felt = (turn.inv().apply(field + outside) if outside.any() else ideal) + inside
        distorted = (
            felt @ (np.diag(1 + np.array(self.scale)) @ np.array(self.soft_iron)).T + self.hard_iron
        )
        source = Source(
            "magnetic-field",
            t,
            np.empty((0, 3)),
            np.tile(self.std, (len(t), 1)),
            tuple(map(float, field)),
            gate,
            "magnetometer",
        )
        return MagnetometerPlan(source, ideal, distorted, np.array(self.std), self.saturation)

    def _disturbance(self, t: Array, frame: str) -> Array:
        """(n, 3) T: the sum of the disturbances of that frame at times t."""
        total = np.zeros((len(t), 3))
        for each in self.disturbances:
            if each.frame == frame:
                total[(t >= each.start) & (t < each.stop)] += each.field
        return total


class MagnetometerPlan(NamedTuple):
    """Noise-free measurements of a magnetometer; each run adds its own noise."""

    source: Source  # all but its y
    ideal: Array  # (n, 3) T: C_nb' m_n
    distorted: Array  # (n, 3) T: with everything but noise and full scale
    std: Array  # (3,) T
    saturation: float  # T; 0: none

    def fixes(self, seed: SeedLike) -> Source:
        """The source of one run."""
        y = RandomStream.of(seed).standard_normal(self.distorted.shape)
        y *= self.std
        y += self.distorted
        return self._with(np.clip(y, -self.saturation, self.saturation) if self.saturation else y)

    def exact(self) -> Source:
        """The source of a magnetometer without errors, which states the noise of the one with
        them."""
        return self._with(self.ideal.copy())

    def notes(self, source: Source) -> list[str]:
        """Sentences for the notes of a recording: samples at full scale, or no sample at all;
        none where nothing is to be said."""
        if not len(source.t):
            return ["magnetometer: not one sample falls into the recording; its rate is too low"]
        full = (
            int((np.abs(source.y) >= self.saturation).any(axis=1).sum()) if self.saturation else 0
        )
        return (
            [
                f"magnetometer: {full} of {len(source.t)} samples saturated at "
                f"{self.saturation * 1e6:.4g} uT"
            ]
            if full
            else []
        )

    def _with(self, y: Array) -> Source:
        return replace(self.source, y=y)


def reference_field(field: Sequence[float] | Array) -> tuple[float, ...]:
    """The Earth's field north, east, down, T, as three floats. Raises DataError where it is no
    field of the Earth."""
    field = _three(field, "field", least=-STRONGEST_EARTH, most=STRONGEST_EARTH)
    if not any(field):
        raise DataError("magnetometer: field is 0; give the Earth's, north, east, down, in T")
    return field


def rotation_at(truth: Trajectory, t: Array) -> Rotation:
    """Attitude, body to navigation, at times t (n,) s: the trajectory's rows
    where these are its times, else turned at a constant rate between them."""
    assert truth.q_nb is not None  # who asks has seen to it
    row = np.searchsorted(truth.t, t)
    if np.array_equal(truth.t[np.minimum(row, len(truth.t) - 1)], t):
        return Rotation.from_wxyz(truth.q_nb[row])
    return RotationPath(truth.t, attitude_of(truth))(t)


def _three(values: Any, name: str, unit: str = " in tesla", **bounds: Any) -> tuple[float, ...]:
    """Three floats. Raises DataError."""
    return tuple(
        check_array(values, f"magnetometer: {name}", (3,), what=f"numbers{unit}", **bounds).tolist()
    )


def _soft_iron(matrix: ArrayLike) -> tuple[tuple[float, ...], ...]:
    """The matrix as a tuple of rows. Raises DataError where it is none, mirrors the field or
    leaves too little of it in some direction."""
    rows = check_array(matrix, "magnetometer: soft_iron", (3, 3))
    values = np.linalg.svd(rows, compute_uv=False)
    if np.linalg.det(rows) <= 0 or values[2] < MIN_LEFT * values[0]:
        raise DataError(
            "magnetometer: soft_iron mirrors the field or leaves nothing of it in a direction; its "
            "determinant must be above 0"
        )
    return tuple(tuple(map(float, row)) for row in rows)


def _disturbance(values: Iterable[Any]) -> Disturbance:
    """A Disturbance that is possible. Raises DataError."""
    try:
        made = Disturbance(*values)
    except TypeError:
        raise DataError(
            f"magnetometer: disturbance {_one_line(values)}: give start and stop in s, field in T, and "
            f"frame"
        ) from None
    if not all(map(is_number, made[:2])) or not made.start < made.stop:
        raise DataError(
            f"magnetometer: disturbance from {made.start!r} to {made.stop!r} s; its start must come "
            f"before its stop"
        )
    # "n" is fixed to the surroundings, "b" to the body
    check_choice(made.frame, "magnetometer: disturbance: frame", ("n", "b"))
    return made._replace(
        field=_three(
            made.field, "field of a disturbance", least=-STRONGEST_MAGNET, most=STRONGEST_MAGNET
        )
    )


def _one_line(value: object) -> str:
    """Its repr in one line."""
    return " ".join(repr(value).split())
