"""What a file holds and what is probably wrong with it, in lines for people; works where reading
would refuse."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..aiding import find
from ..checks import DataError
from ..core.contract import Imu
from ..core.earth import A
from ..data import Aiding
from ..preprocessing import attitude_checks
from ..preprocessing.fixes import overlap_notes
from ..preprocessing.imu_samples import GAP_MEDIANS
from ..preprocessing.origin import counted
from ..preprocessing.plausible import doubts, mistakes
from ..preprocessing.stationary import at_rest, stretches
from ..typing import Array, File, Mask
from . import magnetic_record, netcdf
from .broad import read_broad
from .description.complaints import complaints, parse
from .description.draft import guess
from .description.read import (
    level_notes,
    read_aiding,
    read_field,
    read_imu,
    read_meta,
    read_reference,
)
from .description.schema_aiding import AidingPart
from .description.source_files import Files
from .locate import locate
from .psins import is_psins, unchecked

Found = TypeVar("Found")


class Inspection(NamedTuple):
    """`facts` and `problems` are lines; a problem names the field and the remedy."""

    path: str
    facts: tuple[str, ...]
    problems: tuple[str, ...]

    @property
    def lines(self) -> list[str]:
        """All lines, ready to print."""
        verdict = [f"problem: {text}" for text in self.problems] or ["no mistakes found"]
        return [str(self.path), *("  " + text for text in self.facts), *verdict]

    def __str__(self) -> str:
        return "\n".join(self.lines)


def inspect(path: File) -> Inspection:
    """The Inspection of a recording.toml, a recording.nc, a PSINS log, a BROAD trial or a bare CSV.

    Raises DataError only where the file itself cannot be read.
    """
    path = Path(path)
    look = (
        _psins
        if is_psins(path)
        else {".toml": _description, ".nc": _netcdf, ".npz": _broad}.get(
            path.suffix.lower(), _table
        )
    )
    facts: list[str] = []
    problems: list[str] = []
    look(path, facts, problems)
    return Inspection(str(path), tuple(facts), tuple(dict.fromkeys(problems)))


def _attempt(problems: list[str], function: Callable[..., Found], *arguments: Any) -> Found | None:
    """What the function returns; None where it raises a DataError, which then is a problem."""
    try:
        return function(*arguments)
    except DataError as error:
        problems.append(str(error))
        return None


def _description(path: Path, facts: list[str], problems: list[str]) -> None:
    description = complaints(path)
    if isinstance(description, list):
        problems += description
        part = parse(path).get("imu")
        file = part.get("file") if isinstance(part, dict) else None
        found = _attempt(problems, locate, file, path.parent) if isinstance(file, str) else None
        if found is not None:
            _attempt(problems, _table, found, facts, problems)
        return
    files = Files(path)
    aidings: list[Aiding] = []
    parts: list[tuple[AidingPart, int]] = []
    notes: list[str] = []
    imu, more = _attempt(problems, read_imu, description.imu, files) or (None, [])
    notes += more
    if imu is not None:
        imu_facts(imu, facts)
        problems += [
            f"{path}: [imu] {field}: {text}" for field, text in mistakes(imu, description.imu.kind)
        ]
        problems += [f"{path}: [imu] {text}" for text in doubts(imu)]
        for number, part in enumerate(description.aiding, 1):
            aiding, more = _attempt(
                problems, read_aiding, part, number, description.imu.lever_arm, imu, files
            ) or (None, [])
            aidings += [aiding] if aiding is not None else []
            parts += [(part, number)] if aiding is not None else []
            notes += more
        meta = _attempt(problems, read_meta, description, files) or {}
        notes += level_notes(aidings, meta)
        notes += _magnetometers(path, parts, aidings, imu, meta, facts, problems)
        if description.reference is not None:
            reference, more = _attempt(
                problems, read_reference, description.reference, imu, files
            ) or (None, [])
            facts += [f"reference: {reference!r}"] * (reference is not None)
            notes += more
        _aiding_facts(imu, aidings, facts, problems)
    facts += [f"note: {note}" for note in notes if note not in problems]


def _magnetometers(
    path: Path,
    parts: list[tuple[AidingPart, int]],
    aidings: list[Aiding],
    imu: Imu,
    meta: dict[str, Any],
    facts: list[str],
    problems: list[str],
) -> list[str]:
    """Notes; each magnetometer among the aidings, made of the (AidingPart, number) in `parts`,
    gets the Earth's field in place."""
    notes: list[str] = []
    for k, (part, number) in enumerate(parts):
        found, more = _attempt(
            problems, read_field, part, number, aidings[k], aidings, imu, meta, path
        ) or (None, [])
        if found is not None and part.sensor.parameters == "field":
            aidings[k] = found
            of_field, wrong = magnetic_record.facts_and_problems(
                found, imu, part.vector_matrix, part.field != "record", part.calibration is not None
            )
            facts += of_field
            problems += [f"{path}: [[aiding]] {number} {text}" for text in wrong]
            more = [note for note in more if note not in wrong]
        notes += more
    return notes


def _netcdf(path: Path, facts: list[str], problems: list[str]) -> None:
    meta, imu, aidings, reference = netcdf.parts(path)
    imu_facts(imu, facts)
    _attempt(problems, netcdf.read_recording, path)
    problems += [f"imu: {text}" for text in doubts(imu)]
    _aiding_facts(imu, aidings, facts, problems)
    for aiding in aidings:
        if find(aiding.kind).parameters == "field":
            of_field, wrong = magnetic_record.facts_and_problems(aiding, imu)
            facts += of_field
            problems += wrong
    facts += [f"reference: {reference!r}"] * (reference is not None) + [
        f"note: {note}" for note in meta.get("notes", [])
    ]


def _psins(path: Path, facts: list[str], problems: list[str]) -> None:
    recording = unchecked(path)
    imu_facts(recording.imu, facts)
    problems += [
        f"imu: {text}"
        for text in [text for _, text in mistakes(recording.imu, "increment")]
        + doubts(recording.imu)
    ]
    latitude, longitude, height = np.degrees(recording.meta["position"][:2]).tolist() + [
        recording.meta["position"][2]
    ]
    heading = np.degrees(recording.meta["attitude"][2])
    facts.append(
        f"header: {latitude:.6f} deg north, {longitude:.6f} deg east, {height:.1f} m, heading "
        f"{heading:.1f} deg"
    )
    facts += [f"note: {note}" for note in recording.meta["notes"]]


def _broad(path: Path, facts: list[str], problems: list[str]) -> None:
    recording = _attempt(problems, read_broad, path)
    if recording is not None:
        imu_facts(recording.imu, facts)
        problems += [f"imu: {text}" for text in doubts(recording.imu)]
        _aiding_facts(recording.imu, recording.aidings, facts, problems)
        facts += [
            f"movement: {start:.2f} to {stop:.2f} s" for start, stop in recording.meta["movement"]
        ]
        facts += [f"reference: {recording.reference!r}"] * (recording.reference is not None) + [
            f"note: {note}" for note in recording.meta["notes"]
        ]


def _table(path: Path, facts: list[str], problems: list[str]) -> None:
    guessed = guess(path)
    facts += guessed.facts
    problems += guessed.problems
    if guessed.imu is not None:
        imu_facts(guessed.imu, facts)
        problems += [text for _, text in mistakes(guessed.imu, "rate")] + doubts(guessed.imu)
    if guessed.text:
        facts.append(
            f"a table does not say its units and axes: `strapdown inspect {path} --write "
            f"recording.toml` drafts a description"
        )


def imu_facts(imu: Imu, facts: list[str]) -> None:
    """Append lines on rate, gaps, repeated samples and what the sensors read, over all and at
    rest."""
    steps, median = np.diff(imu.t), float(np.median(np.diff(imu.t)))
    facts.append(
        f"imu: {len(imu.t)} samples, {imu.t[0]:.3f} to {imu.t[-1]:.3f} s "
        f"({imu.t[-1] - imu.t[0]:.1f} s), {1 / median:.6g} Hz, "
        f"intervals {steps.min() * 1e3:.3f} to {steps.max() * 1e3:.3f} ms, median "
        f"{median * 1e3:.3f}"
    )
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    gaps = np.flatnonzero(missing > 1e-6 * median + 1e-9 * np.abs(imu.t[1:]))
    longest = gaps[np.argmax(missing[gaps])] if len(gaps) else None
    facts.append(
        f"gaps: {len(gaps)}, the longest {missing[longest]:.3f} s after {imu.t[longest]:.3f} s"
        if len(gaps)
        else f"gaps: none (no interval beyond {GAP_MEDIANS} medians)"
    )
    rate, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    held = int(
        (
            (np.abs(np.diff(rate, axis=0)) < 1e-9).all(axis=1)
            & (np.abs(np.diff(force, axis=0)) < 1e-7).all(axis=1)
        ).sum()
    )
    if held:
        facts.append(
            f"repeated values: {counted(held, 'sample')} ({100 * held / len(steps):.1f} %) read the "
            f"same as the one before"
        )
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    rms = np.degrees(np.sqrt((rate**2).sum(axis=1).mean()))
    facts.append(
        f"specific force: median magnitude {magnitude:.3f} m/s^2; angular rate: rms {rms:.3g} deg/s"
    )
    rest = at_rest(imu)
    if not rest.any():
        facts.append("at rest: never for a whole second")
        return
    part = _longest(rest)
    f, w = force[part].mean(axis=0), np.degrees(rate[part].mean(axis=0))
    sign = (
        "z is negative, as it must be"
        if f[2] < -0.7 * np.linalg.norm(f)
        else "z must read near -9.8 when level: forward-right-down"
    )
    facts.append(
        f"at rest for {imu.dt[rest].sum():.1f} s, the longest from {imu.t[part.start]:.1f} to "
        f"{imu.t[part.stop - 1]:.1f} s:"
    )
    facts.append(
        f"  specific force {_triple(f)} m/s^2 ({sign}), scatter "
        f"{_triple(force[part].std(axis=0), 3)}"
    )
    facts.append(
        f"  angular rate {_triple(w, 3)} deg/s, scatter "
        f"{_triple(np.degrees(rate[part].std(axis=0)), 3)}"
    )


def _longest(mask: Mask) -> slice:
    """Slice of the longest run of True."""
    return slice(*max(stretches(mask), key=np.ptp))


def _triple(values: Iterable[float], digits: int = 2) -> str:
    return "[" + " ".join(f"{value:.{digits}f}" for value in values) + "]"


def _aiding_facts(
    imu: Imu, aidings: Iterable[Aiding], facts: list[str], problems: list[str]
) -> None:
    for aiding in aidings:
        facts.append(_span(imu, aiding))
        problems += overlap_notes(imu, aiding) if find(aiding.kind).recorded else []
        if find(aiding.kind).recorded and len(aiding.t) > 10:
            y = np.nan_to_num(aiding.y)
            same = (y[1:] == y[:-1]).all(axis=1)
            if same.mean() > 0.5 and np.ptp(y, axis=0).max() > 0:
                problems.append(
                    f"{aiding.name}: {100 * same.mean():.0f} % of the fixes repeat the one before: "
                    f"held values counted as new ones "
                    "make a filter too sure; keep only the rows where a fix arrived"
                )
    for aiding in aidings:
        if aiding.kind == "attitude":
            of_attitude, wrong = attitude_checks.facts_and_problems(aiding, imu)
            facts += of_attitude
            problems += wrong
        if (
            aiding.kind == "position"
            and len(aiding.t)
            and np.nanmax(np.abs(aiding.y[:, :2])) < 0.03
        ):
            problems.append(
                f"{aiding.name}: latitude and longitude within 1.8 deg of zero: are they in rad, or "
                f"is a scale wrong?"
            )
    moving = next(
        (
            a
            for kind in ("velocity", "position")
            for a in aidings
            if a.kind == kind and len(a.t) > 20
        ),
        None,
    )
    if moving is not None:
        course_facts(imu, moving, facts, problems)


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


def course_facts(imu: Imu, aiding: Aiding, facts: list[str], problems: list[str]) -> None:
    """Append lines on turns of the gyro about body z against turns of the course over ground: unit,
    sign and clock of one against the other."""
    fit = _course_fit(imu, aiding)
    correlation, ratio, count = fit(0.0)
    if count < 20 or not np.isfinite(correlation):
        return
    facts.append(
        f"turns of gyro z against the course of {aiding.name}: correlation {correlation:.3f}, "
        f"gyro / course {ratio:.3g} ({count} intervals)"
    )
    shifts = np.arange(-3.0, 3.01, 0.05)
    others = np.array([fit(shift)[0] for shift in shifts])
    best = int(np.nanargmax(np.abs(others)))
    if (
        abs(others[best]) > 0.9
        and 1 - abs(others[best]) < 0.5 * (1 - abs(correlation))
        and abs(shifts[best]) > 0.2
    ):
        problems.append(
            f"{aiding.name}: it fits the gyro best with {-shifts[best]:+.2f} s added to its time, "
            f"or {shifts[best]:+.2f} s to that of the IMU: check `offset`"
        )
    sure = others[best]
    if abs(sure) < 0.7:
        return
    ratio = fit(shifts[best])[1]
    if sure < 0:
        problems.append(
            "[imu] axes: the gyro turns left where the course turns right: check the sign of gyro "
            "z, or axes"
        )
    if not 0.4 < ratio < 2.5:
        likely = "a wrong unit or scale"
        if 0.5 < max(ratio, 1 / ratio) * np.radians(1) < 2:
            likely = "deg/s read as rad/s" if ratio > 1 else "rad/s read as deg/s"
        problems.append(
            f"[imu] gyro.unit: gyro z turns {ratio:.3g} times as much as the course: {likely}?"
        )


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
