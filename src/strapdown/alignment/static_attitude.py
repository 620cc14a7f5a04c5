"""Attitude of a body at rest: roll and pitch from specific force, heading from the magnetic field
or from the Earth's rate.

Body axes FRD, navigation frame NED, SI and radians; every function takes one triple or rows of
them. Source: Fossen (2021) section 14.1, extended to all quadrants and with the sign of heading
that NED requires; Groves (2013) section 5.6.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..checks import check_array
from ..core.mathematics.earth import GRAVITY_EQUATOR, RATE
from ..core.mathematics.rotation import euler_terms
from ..typing import Array, ArrayLike

PARALLEL = 1e-6
"""Sine of the angle to the vertical below which a direction has no azimuth."""
Angle: TypeAlias = Any
"""rad: a number for one triple, (n,) for n rows of them; the type does not distinguish the two."""


def static_attitude(
    f: ArrayLike, m: ArrayLike | None = None, declination: ArrayLike = 0.0
) -> Array:
    """Return roll, pitch and heading of a body that does not accelerate.

        roll = atan2(-f_y, -f_z)    pitch = atan2(f_x, hypot(f_y, f_z))
        heading = atan2(-m_y', m_x') + declination, in [0, 2 pi)

    with m' the field rotated by pitch and roll into the horizontal. At a pitch of +-90 deg roll and
    heading cannot be separated: roll is 0 there. A horizontal acceleration a tilts the result by
    atan(a/g).

    Parameters
    ----------
    f : array_like, shape (3,) or (n, 3)
        Specific force, m/s^2, body FRD, calibrated.
    m : array_like, shape (3,) or (n, 3), optional
        Magnetic field in any unit, body FRD, calibrated.
    declination : float or array_like, shape (n,)
        rad, east positive, added to the magnetic heading.

    Returns
    -------
    ndarray, shape (3,) or (n, 3)
        rad. Unknown angles are NaN: all of them if f is 0 or not finite; the heading without m or
        if m is vertical, 0 or not finite.

    References
    ----------
    Fossen (2021), section 14.1; Groves (2013), section 5.6.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.static_attitude([0.0, 0.0, -9.81], [0.2, 0.0, 0.4]).round(3) + 0.0
    array([0., 0., 0.])
    """
    f = _vectors(f, "f")
    m = None if m is None else _vectors(m, "m")
    size = np.linalg.norm(f, axis=-1)
    level_known = np.isfinite(size) & (size > 0)
    with np.errstate(invalid="ignore"):
        steep = np.hypot(f[..., 1], f[..., 2]) <= PARALLEL * size
        roll, pitch = level(np.where(level_known[..., None], f, [0.0, 0.0, -1.0]))
        pitch = np.where(steep, np.copysign(np.pi / 2, f[..., 0]), pitch)
    roll = np.where(steep, 0.0, roll)
    heading = (
        np.full(np.shape(roll), np.nan)
        if m is None
        else _azimuth(level_vector(m, roll, pitch), declination)
    )
    roll, pitch, heading = np.broadcast_arrays(roll, pitch, heading)
    return np.where(level_known[..., None], np.stack([roll, pitch, heading], axis=-1), np.nan)


def _vectors(value: ArrayLike, name: str) -> Array:
    """Return vectors as an array. Raises DataError."""
    return check_array(value, name, (3,) if np.ndim(value) == 1 else (None, 3), finite=False)


def _azimuth(vector: Array, declination: ArrayLike = 0.0) -> Array:
    """Heading (rad) in [0, 2 pi) of a body that measures this vector (..., 3) in its levelled axes;
    the vector points north plus the declination."""
    horizontal, size = np.hypot(vector[..., 0], vector[..., 1]), np.linalg.norm(vector, axis=-1)
    with np.errstate(invalid="ignore"):
        known = np.isfinite(size) & (horizontal > PARALLEL * size)
        heading = (np.arctan2(-vector[..., 1], vector[..., 0]) + np.asarray(declination, float)) % (
            2 * np.pi
        )
    return np.where(known, np.where(heading == 2 * np.pi, 0.0, heading), np.nan)


def level_vector(vector: ArrayLike, roll: ArrayLike, pitch: ArrayLike) -> Array:
    """Ry(pitch) Rx(roll) vector: a body vector (..., 3) in level axes with the body's heading;
    angles in rad."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    across = sr * y + cr * z
    return np.stack(
        np.broadcast_arrays(cp * x + sp * across, cr * y - sr * z, cp * across - sp * x), axis=-1
    )


def level(
    f_b: ArrayLike, a_n: ArrayLike = (0.0, 0.0, 0.0), heading: ArrayLike = 0.0
) -> tuple[Angle, Angle]:
    """Return roll and pitch (rad, upright branch) from the specific force f_b (m/s^2) of a body
    with acceleration a_n (m/s^2, NED) at a known heading.

    Solves Ry(pitch) Rx(roll) f_b = Rz(heading)' (a_n - g); without acceleration roll = atan2(-f_y,
    -f_z), pitch = atan2(f_x, hypot(f_y, f_z)). f_b, a_n: (3,) or (n, 3). A force along x does not
    determine the roll; the returned value is then arbitrary.
    """
    f_b, a_n = np.asarray(f_b, float), np.asarray(a_n, float)
    size = np.linalg.norm(f_b, axis=-1)
    g = np.where(a_n.any(axis=-1), GRAVITY_EQUATOR, size)
    c, s = np.cos(heading), np.sin(heading)
    h = np.stack(
        np.broadcast_arrays(
            c * a_n[..., 0] + s * a_n[..., 1], c * a_n[..., 1] - s * a_n[..., 0], a_n[..., 2] - g
        ),
        axis=-1,
    )
    h = h * (size / np.linalg.norm(h, axis=-1))[..., None]
    across = np.hypot(f_b[..., 1], f_b[..., 2])
    roll = -np.arccos(np.clip(h[..., 1] / np.maximum(across, 1e-9), -1, 1)) - np.arctan2(
        f_b[..., 2], f_b[..., 1]
    )
    roll = (roll + np.pi) % (2 * np.pi) - np.pi
    w = f_b[..., 1] * np.sin(roll) + f_b[..., 2] * np.cos(roll)
    return roll, np.arctan2(
        h[..., 0] * w - h[..., 2] * f_b[..., 0], h[..., 0] * f_b[..., 0] + h[..., 2] * w
    )


def body_to_navigation(roll: float, pitch: float, heading: float) -> Array:
    """C_nb (3, 3) of Euler angles, rad."""
    return np.reshape(euler_terms(roll, pitch, heading), (3, 3))


class Gyrocompass(NamedTuple):
    """The attitude of a body at rest by the Earth's rate; rad and rad/s."""

    rph: tuple[float, float, float]  # roll, pitch, heading
    heading_std: float
    horizontal: float  # the Earth's rate as measured, north component
    vertical: float  # and upward component, negative south of the equator
    # latitude at which the Earth's rate has this vertical component; NaN where none does
    latitude: float

    @property
    def total(self) -> float:
        """Size of the measured rate, rad/s; the Earth's is 7.292115e-5."""
        return float(np.hypot(self.horizontal, self.vertical))


def gyrocompass(
    rate: Sequence[float] | Array,
    f: Sequence[float] | Array,
    rate_std: float = 0.0,
    level_std: float = 0.0,
) -> Gyrocompass:
    """Heading of a body at rest from the Earth's rate, as a Gyrocompass.

    rate: mean angular rate (3,), rad/s; f: mean specific force (3,), m/s^2, body FRD. Levelled by
    f, the rate's horizontal part points north. rate_std: rad/s, of the mean rate's horizontal part,
    its bias and noise; level_std: rad, of roll and pitch. With w the Earth's rate

        heading_std = hypot(rate_std / (w cos(latitude)), tan(latitude) level_std)

    since a gyro bias towards east rotates the horizontal rate, and a tilt about north projects the
    vertical rate onto it. Cosine and tangent come from the measured rate. If you know the place,
    compare its latitude with the one returned. Raises ValueError where f is 0 or an input is not
    finite.
    """
    roll, pitch = np.asarray(static_attitude(f))[:2]
    seen = level_vector(rate, roll, pitch)
    if not np.isfinite([*seen, rate_std, level_std]).all():
        raise ValueError(
            f"gyrocompass: rate {rate} and specific force {f} must be finite, and the force not 0"
        )
    horizontal, vertical = float(np.hypot(seen[0], seen[1])), float(-seen[2])
    heading = float(_azimuth(seen)) if horizontal else np.nan
    std = np.hypot(rate_std, vertical * level_std) / horizontal if horizontal else np.inf
    latitude = np.arcsin(vertical / RATE) if abs(vertical) <= RATE else np.nan
    return Gyrocompass(
        (float(roll), float(pitch), heading), float(std), horizontal, vertical, float(latitude)
    )
