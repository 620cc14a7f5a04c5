"""The mounting of the IMU in the plane: horizontal specific force against the acceleration that the
fixes tell, in axes along and across the course.

The specific force is levelled in two ways, of which the better one is taken: by the mean vertical
of the body, which suits road vehicles, and in axes that the gyros hold still, by the mean over some
seconds, which suits what banks and rolls. What the second way takes away from slow accelerations is
taken away from those of the fixes too. The same is tried with the y axis of the IMU reversed: a
left-handed set then fits, since gyros and accelerometers of one turn against each other.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..data.solution import Source
from ..data.vehicle import find as find_vehicle
from ..data.verdict import Reason
from ..geometry.geodesy import wrap
from ..preprocessing.axes import BODY_AXES, axes_matrix, named_permutation
from ..typing import Array
from .finding import MIN_FIXES, Checked, label
from .motion import Felt, InspectedRecording, Moved, source_velocity

HALF, LEVELLED = 0.5, 10.0
"""Half the window of an acceleration, and of the mean that is level, s."""
BLOCKS = 10
"""Independent accelerations that are needed."""
CLEAR, NOISIEST, EVIDENCE = 0.6, 0.8, 10.0
"""Correlation, freed of the claimed noise of the fixes up to a share of it, from which the force is that of the accelerations, and what is asked of the logarithm
of the likelihood of a left-handed set over that of the axes as they are."""
SURE, MIN_TURN = 5.0, np.radians(20.0)
"""Standard deviations and rad from which an angle is a reason: wind and current set a course off
the heading by up to that."""
RIGHT_ANGLE = np.radians(20.0)
"""Angle from 90, 180 or 270 deg within which a turn is called so."""
MOUNTING = "mounting of the IMU about the vertical"
TURNS = {90: "-y +x +z", 180: "-x -y +z", -90: "+y -x +z", -180: "-x -y +z"}
"""{deg: axes of an IMU rotated by that, in terms of the correct ones, forward-right-down}."""


class PlaneFit(NamedTuple):
    """Forces against accelerations."""

    angle: float  # rad, by which the accelerations must be turned (clockwise) to be the forces
    std: float  # rad
    correlation: float
    independent: float  # how many accelerations count
    noise: float = (
        0.0  # share of the squared accelerations that the claimed noise of the fixes makes
    )

    @property
    def agreement(self) -> float:
        """The correlation that it would have without that noise (Spearman's attenuation)."""
        return self.correlation / float(np.sqrt(1 - min(self.noise, NOISIEST)))

    def likelier(self, other: "PlaneFit") -> float:
        """Logarithm of the likelihood over that of another."""
        ratio = (1 - other.correlation**2) / max(1 - self.correlation**2, 1e-6)
        return float(self.independent / 2 * np.log(ratio))


def check(subject: InspectedRecording) -> Checked:
    """The mounting in the plane, by the first of the velocities and positions that shows it."""
    meta, unclear = subject.recording.meta, Checked.empty()
    ahead = find_vehicle(meta.get("vehicle")).points_ahead
    for source in subject.sources("velocity", "position") if ahead else ():
        found = _by_source(subject, source)
        if found.facts or found.reasons:
            return found
        unclear.inconclusive.extend(found.inconclusive)
    if axes := meta.get("guessed_axes"):
        unclear.inconclusive.append(
            f'axes of the IMU: "{axes}" is a guess that the motion does not confirm; '
            f"{confirm(axes)}"
        )
    return unclear


def confirm(axes: str) -> str:
    """Return the instruction to confirm guessed axes."""
    return (
        "look up in the data sheet of the IMU where x, y and z point, then confirm the axes with "
        f'this line in [imu] of recording.toml: axes = "{axes}"'
    )


def _by_source(subject: InspectedRecording, source: Source) -> Checked:
    """The mounting in the plane, by one source of fixes."""
    fixes = source_velocity(source)
    fit = in_plane(fixes, subject.felt) if fixes is not None else None
    if fixes is None:
        return Checked.with_unknown(MOUNTING, f"fewer than {MIN_FIXES} fixes of {label(source)}")
    if fit is None or fit.independent < BLOCKS:
        why = f"too few fixes of {label(source)} above {fixes.fast:.2g} m/s"
        return Checked.with_unknown(MOUNTING, why)
    mirrored = in_plane(fixes, subject.mirrored)
    if mirrored and mirrored.correlation > CLEAR and mirrored.likelier(fit) > EVIDENCE:
        return Checked([], [_left_handed(mirrored, fit, source)], [])
    if fit.agreement < CLEAR or not SURE * fit.std < np.radians(45):
        why = (
            f"specific force and the accelerations of {label(source)} hardly agree (correlation "
            f"{fit.correlation:.2f})"
        )
        return Checked.with_unknown(MOUNTING, why)
    degrees, std = np.degrees(fit.angle), np.degrees(fit.std)
    fact = (
        f"{MOUNTING}: the specific force points {degrees:+.0f} +- {std:.0f} deg from the "
        f"accelerations of {label(source)} (correlation {fit.correlation:.2f})"
    )
    weight = abs(fit.angle) / max(SURE * fit.std, MIN_TURN)
    if weight <= 1:
        return Checked([fact], [], [])
    return Checked([], [_reason(fit, label(source), weight, subject.recording.meta)], [])


def in_plane(fixes: Moved, motion: Felt) -> PlaneFit | None:
    """The PlaneFit of what the IMU felt to a source of velocity; None where there are too few fixes."""
    half = max(HALF, fixes.interval, fixes.span / 2)
    noise = 2 * fixes.acceleration_noise(half)
    fits = [
        fit
        for forces, accelerations in _level_forces(fixes, motion, half)
        if (fit := _fit(forces, accelerations, fixes.interval, noise)) is not None
    ]
    return max(fits, key=lambda fit: fit.correlation, default=None)


def _level_forces(fixes: Moved, motion: Felt, half: float) -> list[tuple[Array, Array]]:
    """[(forces, accelerations)] over +- `half` s, complex (n,), by the mean vertical of the body and by axes that
    the gyros hold still; NaN where they are not known."""
    t = fixes.t
    first, last = fixes.at(t - half), fixes.at(t + half)
    slow = (fixes.at(t + LEVELLED) - fixes.at(t - LEVELLED)) / (2 * LEVELLED)
    with np.errstate(invalid="ignore"):
        fast = np.minimum(*(np.hypot(v[:, 0], v[:, 1]) for v in (first, last))) > fixes.fast
    along = np.exp(-1j * np.angle(_plane((first + last) / 2)))
    a = np.where(fast, (last - first)[:, :2].T / (2 * half), np.nan).T
    by_body = motion.mean(motion.body_v, t, half)
    known = fast & np.isfinite(by_body).all(axis=1)
    if known.sum() < MIN_FIXES:
        return []
    down = _unit(-by_body[known].mean(axis=0))
    f = motion.mean(motion.at_antenna(fixes.arm), t, half)
    up = _unit(motion.mean(motion.v, t, LEVELLED))
    k = np.clip(np.searchsorted(motion.t, t), 0, len(motion.t) - 1)
    ahead = motion.attitude[k][..., 0]
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


def _fit(forces: Array, accelerations: Array, interval: float, noise: float) -> PlaneFit | None:
    """The PlaneFit of complex (n,) forces to accelerations with so much noise (m^2/s^4); its std by leaving out one tenth of the record after the
    other (jackknife)."""
    use = np.isfinite(forces) & np.isfinite(accelerations)
    if use.sum() < MIN_FIXES:
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
    std = float(np.sqrt((BLOCKS - 1) * np.mean(off**2)))
    return PlaneFit(
        float(np.angle(total)),
        std,
        float(abs(total) / size),
        float(use.sum() * interval / 2),
        float(noise / np.mean(np.abs(a) ** 2)),
    )


def _reason(fit: PlaneFit, source: str, weight: float, meta: Mapping[str, Any]) -> Reason:
    """The Reason of an IMU that is turned; in a mounting of its description, the `meta` of the
    recording, it turns after `axes` act."""
    turn = float(wrap(-fit.angle))
    near = np.round(turn / (np.pi / 2)) * np.pi / 2
    right = bool(near) and abs(turn - near) < RIGHT_ANGLE
    degrees = float(np.degrees(near if right else turn))
    seen = (
        f"the specific force points {np.degrees(fit.angle):+.0f} +- {np.degrees(fit.std):.0f} deg "
        f"from the accelerations of {source} (correlation {fit.correlation:.2f})"
    )
    if right:
        seen += f": the IMU is rotated by {-degrees % 360:.0f} deg about the vertical"
    remedy = f"add {degrees:+.0f} deg to `heading` of `mounting` of [imu]"
    if right and "imu_mounting" not in meta:
        remedy = _turned_axes(round(degrees), meta.get("guessed_axes"))
    return Reason("axes" if right else "mounting", seen, remedy, weight=weight)


def _turned_axes(degrees: int, guess: str | None) -> str:
    """Return the instruction to rotate the axes by `degrees` about down: the whole line where they
    were a guess, since axes that a user stated are not known here."""
    if guess is None:
        return f'rotate `axes` of [imu] by {degrees:+d} deg (FRD becomes "{TURNS[degrees]}")'
    C = axes_matrix(TURNS[degrees], BODY_AXES) @ axes_matrix(guess, BODY_AXES)
    axes = named_permutation(C)
    name = next((name for name, signed in BODY_AXES.items() if signed == axes), axes)
    return f'replace the guess "{guess}" with this line in [imu] of recording.toml: axes = "{name}"'


def _left_handed(mirrored: PlaneFit, fit: PlaneFit, source: Source) -> Reason:
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
        f"only a left-handed set of axes explains the accelerations of {label(source)} "
        f"(correlation {mirrored.correlation:.2f}, with the axes as given {fit.correlation:.2f}): "
        f"{what}",
        "correct `axes` or the columns of [imu], for both gyro and accel"
        + ", or exchange latitude and longitude" * (source.kind == "position"),
        weight=10.0,
    )
