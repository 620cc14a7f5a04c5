"""The mounting of the IMU in the plane: horizontal specific force against the acceleration that the
fixes tell, in axes along and across the course.

The specific force is levelled in two ways, of which the better one is taken: by the mean vertical
of the body, which suits road vehicles, and in axes that the gyros hold still, by the mean over some
seconds, which suits what banks and rolls. What the second way takes away from slow accelerations is
taken away from those of the fixes too. The same is tried with the y axis of the IMU reversed: a
left-handed set then fits, since gyros and accelerometers of one turn against each other.
"""

from typing import NamedTuple

import numpy as np

from ..geodesy import wrap
from ..typing import Array
from ..vehicle import find as find_vehicle
from ..verdict import Reason
from .checked import Checked, label
from .motion import Felt, Moved, Subject, moved

HALF, LEVELLED = 0.5, 10.0
"""Half the window of an acceleration, and of the mean that is level, s."""
FAST = 3.0
"""Speed from which the vehicle points where it goes, m/s."""
LEAST_FIXES, BLOCKS = 30, 10
CLEAR, EVIDENCE = 0.6, 10.0
"""Correlation from which the force is that of the accelerations, and what is asked of the logarithm
of the likelihood of a left-handed set over that of the axes as they are."""
SURE, LEAST = 5.0, np.radians(20.0)
"""An angle is a reason from so many standard deviations and rad on: wind and current set a course
off the heading by up to that."""
RIGHT_ANGLE = np.radians(20.0)
"""What is this near to 90, 180 or 270 deg is called so."""


class Fit(NamedTuple):
    """Forces against accelerations."""

    angle: float  # rad, by which the accelerations must be turned (clockwise) to be the forces
    sd: float  # rad
    correlation: float
    independent: float  # how many accelerations count

    def likelier(self, other: "Fit") -> float:
        """Logarithm of the likelihood over that of another."""
        ratio = (1 - other.correlation**2) / max(1 - self.correlation**2, 1e-6)
        return float(self.independent / 2 * np.log(ratio))


def check(subject: Subject) -> Checked:
    """The mounting in the plane, by the first velocity."""
    source = next(iter(subject.sources("velocity")), None)
    what = "mounting of the IMU about the vertical"
    fixes = moved(source) if source is not None else None
    if source is None or find_vehicle(subject.recording.meta.get("vehicle")).by_thrust:
        return Checked.nothing()
    fit = in_plane(fixes, subject.felt) if fixes is not None else None
    if fixes is None or fit is None:
        return Checked.unknown(what, f"too few fixes of {label(source)} above {FAST:g} m/s")
    mirrored = in_plane(fixes, subject.mirrored)
    if mirrored and mirrored.correlation > CLEAR and mirrored.likelier(fit) > EVIDENCE:
        return Checked([], [_left_handed(mirrored, fit, label(source))], [])
    if fit.correlation < CLEAR or not SURE * fit.sd < np.radians(45):
        why = f"forces and accelerations of {label(source)} hardly agree ({fit.correlation:.2f})"
        return Checked.unknown(what, why)
    degrees, sd = np.degrees(fit.angle), np.degrees(fit.sd)
    fact = (
        f"{what}: forces point {degrees:+.0f} +- {sd:.0f} deg off the accelerations of "
        f"{label(source)} (correlation {fit.correlation:.2f})"
    )
    weight = abs(fit.angle) / max(SURE * fit.sd, LEAST)
    if weight <= 1:
        return Checked([fact], [], [])
    mounted = "imu_mounting" in subject.recording.meta
    return Checked([], [_reason(fit, label(source), weight, mounted)], [])


def in_plane(fixes: Moved, motion: Felt) -> Fit | None:
    """The Fit of what the IMU felt to a source of velocity; None where there are too few fixes."""
    fits = [
        fit
        for forces, accelerations in _levelled(fixes, motion)
        if (fit := _fit(forces, accelerations, fixes.interval)) is not None
    ]
    return max(fits, key=lambda fit: fit.correlation, default=None)


def _levelled(fixes: Moved, motion: Felt) -> list[tuple[Array, Array]]:
    """[(forces, accelerations)], complex (n,), by the mean vertical of the body and by axes that
    the gyros hold still; NaN where they are not known."""
    t, half = fixes.t, max(HALF, fixes.interval)
    first, last = fixes.at(t - half), fixes.at(t + half)
    slow = (fixes.at(t + LEVELLED) - fixes.at(t - LEVELLED)) / (2 * LEVELLED)
    with np.errstate(invalid="ignore"):
        fast = np.minimum(*(np.hypot(v[:, 0], v[:, 1]) for v in (first, last))) > FAST
    along = np.exp(-1j * np.angle(_plane((first + last) / 2)))
    a = np.where(fast, (last - first)[:, :2].T / (2 * half), np.nan).T
    by_body = motion.mean(motion.body_v, t, half)
    known = fast & np.isfinite(by_body).all(axis=1)
    if known.sum() < LEAST_FIXES:
        return []
    down = _unit(-by_body[known].mean(axis=0))
    f = motion.mean(motion.at_antenna(fixes.arm), t, half)
    up = _unit(motion.mean(motion.v, t, LEVELLED))
    k = np.clip(np.searchsorted(motion.t, t), 0, len(motion.t) - 1)
    ahead = motion.attitude[k].apply([1.0, 0.0, 0.0])
    ahead = _unit(ahead - (ahead * up).sum(axis=1)[:, None] * up)
    forward = _unit(np.array([1.0, 0.0, 0.0]) - down[0] * down)
    return [
        (by_body @ forward + 1j * (by_body @ np.cross(down, forward)), _plane(a) * along),
        (
            (f * ahead).sum(axis=1) + 1j * (f * np.cross(-up, ahead)).sum(axis=1),
            _plane(a - slow[:, :2]) * along,
        ),
    ]


def _plane(v: Array) -> Array:
    """North and east, or forward and right, as complex numbers."""
    return np.asarray(v[:, 0] + 1j * v[:, 1])


def _unit(v: Array) -> Array:
    """Vectors of length 1; zero ones stay."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9))


def _fit(forces: Array, accelerations: Array, interval: float) -> Fit | None:
    """The Fit of complex (n,) forces; its sd by leaving out one tenth of the record after the
    other (jackknife)."""
    use = np.isfinite(forces) & np.isfinite(accelerations)
    if use.sum() < LEAST_FIXES:
        return None
    h, a = forces[use] - forces[use].mean(), accelerations[use] - accelerations[use].mean()
    block = np.arange(len(h)) * BLOCKS // len(h)
    products = a.conj() * h
    parts = np.bincount(block, products.real) + 1j * np.bincount(block, products.imag)
    size = np.sqrt((np.abs(h) ** 2).sum() * (np.abs(a) ** 2).sum())
    if not size > 0:
        return None
    total = parts.sum()
    off = wrap(np.angle(total - parts) - np.angle(total))
    sd = float(np.sqrt((BLOCKS - 1) * np.mean(off**2)))
    return Fit(
        float(np.angle(total)),
        sd,
        float(abs(total) / size),
        float(use.sum() * interval / 2),
    )


def _reason(fit: Fit, source: str, weight: float, mounted: bool) -> Reason:
    """The Reason of an IMU that is turned; `mounted` is whether its description has a mounting,
    before which `axes` act."""
    turn = float(wrap(-fit.angle))
    near = np.round(turn / (np.pi / 2)) * np.pi / 2
    right = bool(near) and abs(turn - near) < RIGHT_ANGLE
    degrees = float(np.degrees(near if right else turn))
    axes = {90: "-y +x +z", 180: "-x -y +z", -90: "+y -x +z", -180: "-x -y +z"}
    seen = (
        f"forces point {np.degrees(fit.angle):+.0f} +- {np.degrees(fit.sd):.0f} deg off the "
        f"accelerations of {source} (correlation {fit.correlation:.2f})"
    )
    if right:
        seen += f": the IMU is turned by {-degrees % 360:.0f} deg about the vertical"
    remedy = f"add {degrees:+.0f} deg to `heading` of `mounting` of [imu]"
    if right and not mounted:
        remedy = (
            f'turn `axes` of [imu] by {degrees:+.0f} deg (of FRD that is "{axes[round(degrees)]}")'
        )
    return Reason("axes" if right else "mounting", seen, remedy, weight=weight)


def _left_handed(mirrored: Fit, fit: Fit, source: str) -> Reason:
    """The Reason of axes that are mirrored."""
    quarter = round(mirrored.angle / (np.pi / 2)) % 4
    what = (
        "y has the wrong sign",
        "x and y are exchanged and have the wrong sign",
        "x has the wrong sign",
        "x and y are exchanged",
    )[quarter]
    return Reason(
        "axes",
        f"only a left-handed set of axes explains the accelerations of {source} (correlation "
        f"{mirrored.correlation:.2f}, as they are {fit.correlation:.2f}): {what}",
        "correct `axes` or the columns of [imu], of gyro and accel alike",
        weight=10.0,
    )
