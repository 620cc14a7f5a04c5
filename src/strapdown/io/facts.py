"""What can be said of samples and fixes, in lines for people: rates, gaps, what the sensors read at
rest, how fixes and gyro agree."""

from collections.abc import Callable, Iterable

import numpy as np

from ..aiding import find
from ..core.contract import Imu
from ..core.earth import A
from ..data import Aiding
from ..preprocessing.attitude_checks import facts_and_problems as of_attitude
from ..preprocessing.fixes import overlap_notes
from ..preprocessing.imu_samples import GAP_MEDIANS
from ..preprocessing.origin import counted
from ..preprocessing.plausible import doubts
from ..preprocessing.stationary import at_rest, stretches
from ..recording import Recording
from ..typing import Array, Mask
from .contract import Findings
from .magnetic_record import facts_and_problems as of_field


def recording_facts(recording: Recording, *more: str) -> Findings:
    """Findings on a Recording: samples, fixes, magnetometers, then the lines `more`, reference and
    notes."""
    imu, reference = recording.imu, recording.reference
    found = Findings(imu_facts(imu), [f"imu: {text}" for text in doubts(imu)])
    found.add(*aiding_facts(imu, recording.aidings))
    for aiding in recording.aidings:
        if find(aiding.kind).parameters == "field":
            found.add(*of_field(aiding, imu))
    found.add([*more, *([f"reference: {reference!r}"] if reference is not None else [])])
    found.add(f"note: {note}" for note in recording.meta.get("notes", []))
    return found


def imu_facts(imu: Imu) -> list[str]:
    """Lines on rate, gaps, repeated samples and what the sensors read, over all and at rest."""
    steps, median = np.diff(imu.t), float(np.median(np.diff(imu.t)))
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    gaps = np.flatnonzero(missing > 1e-6 * median + 1e-9 * np.abs(imu.t[1:]))
    longest = gaps[np.argmax(missing[gaps])] if len(gaps) else None
    rate, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    same = (np.abs(np.diff(rate, axis=0)) < 1e-9) & (np.abs(np.diff(force, axis=0)) < 1e-7)
    held = int(same.all(axis=1).sum())
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    rms = np.degrees(np.sqrt((rate**2).sum(axis=1).mean()))
    repeated = (
        f"repeated values: {counted(held, 'sample')} ({100 * held / len(steps):.1f} %) read the "
        f"same as the one before"
    )
    return [
        f"imu: {len(imu.t)} samples, {imu.t[0]:.3f} to {imu.t[-1]:.3f} s "
        f"({imu.t[-1] - imu.t[0]:.1f} s), {1 / median:.6g} Hz, "
        f"intervals {steps.min() * 1e3:.3f} to {steps.max() * 1e3:.3f} ms, median "
        f"{median * 1e3:.3f}",
        f"gaps: {len(gaps)}, the longest {missing[longest]:.3f} s after {imu.t[longest]:.3f} s"
        if len(gaps)
        else f"gaps: none (no interval beyond {GAP_MEDIANS} medians)",
        *([repeated] if held else []),
        f"specific force: median magnitude {magnitude:.3f} m/s^2; angular rate: rms {rms:.3g} deg/s",
        *_rest_facts(imu, np.degrees(rate), force),
    ]


def _rest_facts(imu: Imu, rate: Array, force: Array) -> list[str]:
    """What the sensors read at rest, deg/s and m/s^2."""
    rest = at_rest(imu)
    if not rest.any():
        return ["at rest: never for a whole second"]
    part = _longest(rest)
    f, w = force[part].mean(axis=0), rate[part].mean(axis=0)
    sign = (
        "z is negative, as it must be"
        if f[2] < -0.7 * np.linalg.norm(f)
        else "z must read near -9.8 when level: forward-right-down"
    )
    return [
        f"at rest for {imu.dt[rest].sum():.1f} s, the longest from {imu.t[part.start]:.1f} to "
        f"{imu.t[part.stop - 1]:.1f} s:",
        f"  specific force {_triple(f)} m/s^2 ({sign}), scatter "
        f"{_triple(force[part].std(axis=0), 3)}",
        f"  angular rate {_triple(w, 3)} deg/s, scatter {_triple(rate[part].std(axis=0), 3)}",
    ]


def _longest(mask: Mask) -> slice:
    """Slice of the longest run of True."""
    return slice(*max(stretches(mask), key=np.ptp))


def _triple(values: Iterable[float], digits: int = 2) -> str:
    return "[" + " ".join(f"{value:.{digits}f}" for value in values) + "]"


def aiding_facts(imu: Imu, aidings: Iterable[Aiding]) -> Findings:
    """Findings on fixes: their times, what is held, attitudes and turns against those of the gyro."""
    found, aidings = Findings([], []), list(aidings)
    for aiding in aidings:
        found.add([_span(imu, aiding)])
        if find(aiding.kind).recorded:
            found.add(problems=overlap_notes(imu, aiding) + _held(aiding))
    for aiding in aidings:
        if aiding.kind == "attitude":
            found.add(*of_attitude(aiding, imu))
        if (
            aiding.kind == "position"
            and len(aiding.t)
            and np.nanmax(np.abs(aiding.y[:, :2])) < 0.03
        ):
            found.problems.append(
                f"{aiding.name}: latitude and longitude within 1.8 deg of zero: are they in rad, or "
                f"is a scale wrong?"
            )
    long = [
        a for kind in ("velocity", "position") for a in aidings if a.kind == kind and len(a.t) > 20
    ]
    if long:
        found.add(*course_facts(imu, long[0]))
    return found


def _held(aiding: Aiding) -> list[str]:
    """A problem where most of the fixes repeat the one before."""
    y = np.nan_to_num(aiding.y)
    same = (y[1:] == y[:-1]).all(axis=1)
    if len(y) <= 10 or same.mean() <= 0.5 or np.ptp(y, axis=0).max() <= 0:
        return []
    return [
        f"{aiding.name}: {100 * same.mean():.0f} % of the fixes repeat the one before: "
        f"held values counted as new ones "
        "make a filter too sure; keep only the rows where a fix arrived"
    ]


def _span(imu: Imu, aiding: Aiding) -> str:
    if not len(aiding.t):
        return f"{aiding.name}: no rows"
    start, stop = max(aiding.t[0], imu.t[0]), min(aiding.t[-1], imu.t[-1])
    steps = np.diff(aiding.t)
    pace = (
        f", every {np.median(steps):.6g} s, longest pause {steps.max():.3f} s" if len(steps) else ""
    )
    return (
        f"{aiding.name}: {len(aiding.t)} fixes, {aiding.t[0]:.3f} to {aiding.t[-1]:.3f} s{pace}, "
        f"{max(0.0, stop - start):.1f} s of it with the IMU"
    )


def course_facts(imu: Imu, aiding: Aiding) -> Findings:
    """Findings on turns of the gyro about body z against turns of the course over ground: unit, sign
    and clock of one against the other."""
    fit = _course_fit(imu, aiding)
    correlation, ratio, count = fit(0.0)
    if count < 20 or not np.isfinite(correlation):
        return Findings([], [])
    found = Findings(
        [
            f"turns of gyro z against the course of {aiding.name}: correlation {correlation:.3f}, "
            f"gyro / course {ratio:.3g} ({count} intervals)"
        ],
        [],
    )
    shifts = np.arange(-3.0, 3.01, 0.05)
    others = np.array([fit(shift)[0] for shift in shifts])
    best = int(np.nanargmax(np.abs(others)))
    sure, shift, ratio = others[best], shifts[best], fit(shifts[best])[1]
    if abs(sure) > 0.9 and 1 - abs(sure) < 0.5 * (1 - abs(correlation)) and abs(shift) > 0.2:
        found.problems.append(
            f"{aiding.name}: it fits the gyro best with {-shift:+.2f} s added to its time, "
            f"or {shift:+.2f} s to that of the IMU: check `offset`"
        )
    if sure <= -0.7:
        found.problems.append(
            "[imu] axes: the gyro turns left where the course turns right: check the sign of gyro "
            "z, or axes"
        )
    if abs(sure) >= 0.7 and not 0.4 < ratio < 2.5:
        likely = "a wrong unit or scale"
        if 0.5 < max(ratio, 1 / ratio) * np.radians(1) < 2:
            likely = "deg/s read as rad/s" if ratio > 1 else "rad/s read as deg/s"
        found.problems.append(
            f"[imu] gyro.unit: gyro z turns {ratio:.3g} times as much as the course: {likely}?"
        )
    return found


def _course_fit(imu: Imu, aiding: Aiding) -> Callable[[float], tuple[float, float, int]]:
    """Function of a shift of the IMU time (s): correlation and ratio of turns over about a
    second of motion above 2 m/s, and their count."""
    v = aiding.y if aiding.kind == "velocity" else _velocity(aiding.t, aiding.y)
    step = max(1, round(1.0 / float(np.median(np.diff(aiding.t)))))
    first, last = slice(None, -step), slice(step, None)
    fast = np.hypot(v[:, 0], v[:, 1]) > 2.0
    use = fast[first] & fast[last] & (aiding.t[last] - aiding.t[first] < 2.5)
    use &= (aiding.t[first] > imu.t[0] + 3.0) & (aiding.t[last] < imu.t[-1] - 3.0)
    course, heading = np.arctan2(v[:, 1], v[:, 0]), np.cumsum(imu.dtheta[:, 2])
    turn = ((course[last] - course[first] + np.pi) % (2 * np.pi) - np.pi)[use]

    def fit(shift: float) -> tuple[float, float, int]:
        psi = np.interp(aiding.t - shift, imu.t, heading)
        claimed = (psi[last] - psi[first])[use]
        if len(turn) < 3 or turn.std() < 0.02 or not claimed.std() > 0:
            return np.nan, np.nan, 0
        return np.corrcoef(turn, claimed)[0, 1], claimed.std() / turn.std(), len(turn)

    return fit


def _velocity(t: Array, lla: Array) -> Array:
    """North and east velocity by differences of positions, m/s."""
    north = np.gradient(lla[:, 0], t) * A
    return np.c_[north, np.gradient(np.unwrap(lla[:, 1]), t) * A * np.cos(lla[:, 0])]
