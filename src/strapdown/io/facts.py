"""Facts about samples and fixes as lines of text: rates, gaps, readings at rest, agreement of fixes
and gyro."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..aiding import find
from ..core.loop.contract import Imu
from ..data.recording import Recording, RecordingMeta
from ..data.solution import Source
from ..data.verdict import Reason
from ..inspection.all import check
from ..inspection.finding import Checked
from ..preprocessing.attitude_checks import facts_and_reasons as of_attitude
from ..preprocessing.fixes import little_overlap
from ..preprocessing.imu_samples import GAP_MEDIANS, MAX_SHORT_GAPS, SHORT_GAP
from ..preprocessing.plausible import doubts
from ..preprocessing.stationary import at_rest, stretches
from ..preprocessing.vehicle_rest import is_moving
from ..sensor_models.imu import imu as imu_spec
from ..typing import Array, Ints, Mask
from ..units.time_scales import span, utc
from ..units.wording import count_text
from .magnetic_record import facts_and_reasons as of_field
from .reader import Findings


def recording_facts(recording: Recording, *more: str) -> Findings:
    """Return the findings on a Recording: samples, fixes, magnetometers, the lines `more`,
    reference and notes."""
    imu, reference = recording.imu, recording.reference
    unusual = unusual_imu(recording, gyro_bias_std(recording.meta))
    found = Findings.of(clock_facts(imu, recording.meta.get("epoch")))
    found.add(imu_facts(imu), [f"imu: {each.line}" for each in unusual])
    found.add(temperature_facts(recording.meta))
    found.add(*source_facts(imu, recording.sources, recording.meta))
    for source in recording.sources:
        facts, reasons = _of_magnetometer(imu, source)
        found.add(facts, [each.line for each in reasons])
    found.add([*more, *([f"reference: {reference!r}"] if reference is not None else [])])
    found.add(f"note: {note}" for note in recording.meta.get("notes", []))
    return found


MIN_REST = 5.0
"""s of rest without contradicting fixes that a gyro bias needs where fixes contradict other rests:
a steady turn, or a roll at a constant rate for a second, looks like rest to the IMU."""


def unusual_imu(recording: Recording, gyro_bias_std: float) -> list[Reason]:
    """Return Reasons for unusual features of the IMU: `doubts`, without a gyro bias at times when
    fixes show motion, see `MIN_REST`."""
    imu = recording.imu
    found = doubts(imu, gyro_bias_std)
    if any(each.cause == "gyro" for each in found):
        rest = at_rest(imu)
        denied = rest & is_moving(recording.sources, imu.t)
        if denied.any() and imu.dt[rest & ~denied].sum() < MIN_REST:
            found = [each for each in found if each.cause != "gyro"]
    return found


def check_parts(recording: Recording) -> Checked:
    """Return the findings of `inspection` on a recording, without magnetometers whose dip already
    shows incorrect axes."""
    right = tuple(
        source
        for source in recording.sources
        if all(each.cause != "frame" for each in _of_magnetometer(recording.imu, source)[1])
    )
    return check(replace(recording, sources=right))


def own_reasons(recording: Recording, gyro_bias_std: float) -> Iterator[Reason]:
    """Yield a Reason for each problem of a sensor alone or compared with the IMU, except those of
    `inspection`. `gyro_bias_std` (rad/s) is the bias that the description of the IMU allows."""
    imu = recording.imu
    yield from unusual_imu(recording, gyro_bias_std)
    for source in recording.sources:
        yield from _of_fixes(imu, source)[1]
        yield from _of_magnetometer(imu, source)[1]


def gyro_bias_std(meta: RecordingMeta) -> float:
    """Return the std of the gyro bias of the recording's IMU grade, rad/s; 0 without one."""
    named = meta.get("grade")
    return 0.0 if named is None else imu_spec(named).bias_std()[1]


def clock_facts(imu: Imu, epoch: str | None) -> list[str]:
    """Return a line on the date and time, where the clock is absolute."""
    return [] if epoch is None else [f"clock: {span(utc(epoch, imu.t))}; t = 0 is {epoch}"]


def temperature_facts(meta: RecordingMeta) -> list[str]:
    """Return a line on the temperature of the IMU, where it was measured."""
    if "temperature" not in meta:
        return []
    degrees = meta["temperature"][:, 1]
    return [f"temperature of the IMU: {degrees.min():.1f} to {degrees.max():.1f} degC"]


def imu_facts(imu: Imu) -> list[str]:
    """Return lines on rate, gaps, repeated samples and the readings, overall and at rest."""
    steps, median = np.diff(imu.t), float(np.median(np.diff(imu.t)))
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    gaps = np.flatnonzero(missing > 1e-6 * median + 1e-9 * np.abs(imu.t[1:]))
    rate, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    same = (np.abs(np.diff(rate, axis=0)) < 1e-9) & (np.abs(np.diff(force, axis=0)) < 1e-7)
    held = int(same.all(axis=1).sum())
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    rms = np.degrees(np.sqrt((rate**2).sum(axis=1).mean()))
    repeated = (
        f"repeated values: {count_text(held, 'sample')} ({100 * held / len(steps):.1f} %) equal "
        f"the one before"
    )
    return [
        f"imu: {len(imu.t)} samples, {imu.t[0]:.3f} to {imu.t[-1]:.3f} s "
        f"({imu.t[-1] - imu.t[0]:.1f} s), {1 / median:.6g} Hz, "
        f"intervals {steps.min() * 1e3:.3f} to {steps.max() * 1e3:.3f} ms, median "
        f"{median * 1e3:.3f}",
        *_gaps(imu, missing, gaps, median),
        *([repeated] if held else []),
        f"specific force: median magnitude {magnitude:.3f} m/s^2; angular rate: rms {rms:.3g} deg/s",
        *_rest_facts(imu, np.degrees(rate), force),
    ]


def _gaps(imu: Imu, missing: Array, gaps: Ints, median: float) -> list[str]:
    """Return lines on gaps; those of one or two samples are separate, because many are time stamp
    jitter."""
    if not len(gaps):
        return [f"gaps: none (no interval beyond {GAP_MEDIANS} medians)"]
    short = gaps[missing[gaps] <= SHORT_GAP * median]
    lines = []
    if len(short) > MAX_SHORT_GAPS:
        gaps = gaps[missing[gaps] > SHORT_GAP * median]
        scatter = 1e3 * float(np.diff(imu.t).std())
        lines = [
            f"time stamps: {len(short)} intervals are longer than the median by "
            f"{1e3 * missing[short].min():.3g} to {1e3 * missing[short].max():.3g} ms: single lost "
            f"samples or jitter (scatter of all intervals {scatter:.2g} ms)"
        ]
    if not len(gaps):
        return ["gaps: none of several samples", *lines]
    longest = gaps[np.argmax(missing[gaps])]
    return [
        f"gaps: {len(gaps)}, the longest {missing[longest]:.3f} s after {imu.t[longest]:.3f} s",
        *lines,
    ]


def _rest_facts(imu: Imu, rate: Array, force: Array) -> list[str]:
    """Return lines on the readings at rest, deg/s and m/s^2."""
    rest = at_rest(imu)
    if not rest.any():
        return ["seems at rest: never for a whole second"]
    part = _longest(rest)
    f, w = force[part].mean(axis=0), rate[part].mean(axis=0)
    sign = (
        "z is negative, as required"
        if f[2] < -0.7 * np.linalg.norm(f)
        else "z must read near -9.8 when level: forward-right-down"
    )
    return [
        f"seems at rest, by the IMU alone, for {imu.dt[rest].sum():.1f} s, the longest from {imu.t[part.start]:.1f} to "
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


def source_facts(imu: Imu, sources: Iterable[Source], meta: RecordingMeta) -> Findings:
    """Return the findings on fixes: their times, attitudes compared with the gyro, and the mutual
    checks of the parts of the recording, whose metadata is `meta`."""
    found, sources = Findings.of(), list(sources)
    for source in sources:
        found.add([_span(imu, source)])
    for source in sources:
        facts, reasons = _of_fixes(imu, source)
        found.add(facts, [each.line for each in reasons])
    checked = check_parts(Recording(imu, tuple(sources), None, meta))
    found.take(checked.facts, checked.reasons, checked.inconclusive)
    return found


def _of_fixes(imu: Imu, source: Source) -> tuple[list[str], list[Reason]]:
    """(lines, Reasons) on fixes compared with the IMU samples."""
    facts, reasons = of_attitude(source, imu) if source.kind == "attitude" else ([], [])
    if find(source.kind).recorded:
        reasons = [*little_overlap(imu, source), *reasons]
    if source.kind == "position" and len(source.t) and np.nanmax(np.abs(source.y[:, :2])) < 0.03:
        seen = "latitude and longitude within 1.8 deg of zero"
        remedy = "check whether they are in rad, and their scale"
        reasons.append(Reason("unit", seen, remedy, source.name or source.kind))
    return facts, reasons


def _of_magnetometer(imu: Imu, source: Source) -> tuple[list[str], list[Reason]]:
    """(lines, Reasons) on a magnetometer with a known Earth's field."""
    known = find(source.kind).parameters == "field" and source.parameters
    return of_field(source, imu) if known else ([], [])


def _span(imu: Imu, source: Source) -> str:
    if not len(source.t):
        return f"{source.name}: no rows"
    start, stop = max(source.t[0], imu.t[0]), min(source.t[-1], imu.t[-1])
    steps = np.diff(source.t)
    pace = (
        f", every {np.median(steps):.6g} s, longest pause {steps.max():.3f} s" if len(steps) else ""
    )
    return (
        f"{source.name}: {len(source.t)} fixes, {source.t[0]:.3f} to {source.t[-1]:.3f} s{pace}, "
        f"{max(0.0, stop - start):.1f} s of them within the IMU record"
    )
