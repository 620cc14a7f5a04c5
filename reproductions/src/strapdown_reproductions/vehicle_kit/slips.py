"""Shares of spin and lock of the wheels that the slip test leaves out, of correct speeds that it leaves
out for nothing, and its worth in scale and in outages."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.preprocessing.stationary import stretches
from strapdown.preprocessing.wheel_slip import is_slipping as found, without_slip
from strapdown.sensor_models.gnss import Gnss

from .drives import Slip, add_slips, drive, wheel_of

SIZES = (0.05, 0.1, 0.2, 0.5, 1.0)
"""Shares of the speed by which wheels spin or lock."""
SCALE = 0.02  # by which the wheel speed reads too much
GNSS = ("position", "velocity")
SLIP, ALARMS, SCALES, WORTH = "slip", "false-alarms", "scale", "worth"
"""The tables of the Evidence."""
OUTAGES = [(start, start + 30.0) for start in (210.0, 330.0, 450.0, 550.0)]
"""s without GNSS, in a drive of 600 s."""


def rates(seeds: Sequence[int]) -> dict[str, pd.DataFrame]:
    """{table: DataFrame} of `detection` and of `quiet` on the drives of the seeds."""
    drives = [drive(seed) for seed in seeds]
    rough = [drive(seed, roughness=3.0, engine=0.45) for seed in seeds]
    return {SLIP: detection(drives, seeds), ALARMS: quiet(drives, rough)}


def detection(drives: Sequence[Recording], seeds: Sequence[int]) -> pd.DataFrame:
    """By size of the slip: episodes, how many of them are noticed, and the share of their fixes that
    is left out, beside what is left out around them."""
    rows = []
    for size in SIZES:
        noticed, left_out, beside = [], [], 0
        for seed, clean in zip(seeds, drives):
            recording, slips = add_slips(clean, seed, size)
            wheel = wheel_of(recording)
            out, during = found(wheel, recording.imu), np.zeros(len(wheel.t), bool)
            for slip in slips:
                its = _of(slip, wheel)
                during |= its
                noticed.append(out[its].any())
                left_out.append(out[its].mean())
            beside += int((out & ~during).sum())
        rows.append(
            (
                f"{size:.0%}",
                len(noticed),
                100 * np.mean(noticed),
                100 * np.mean(left_out),
                beside / max(len(noticed), 1),
            )
        )
    columns = [
        "slip",
        "episodes",
        "noticed, %",
        "its fixes left out, %",
        "right fixes, per episode",
    ]
    return pd.DataFrame(rows, columns=columns)


def _of(slip: Slip, wheel: Source) -> np.ndarray:
    return (wheel.t >= slip.start) & (wheel.t < slip.stop)


def false_alarms(drives: Sequence[Recording], name: str) -> tuple[str, float, int, float]:
    """(name, hours, episodes, per hour) of wheel speed without slip that is left out."""
    hours = sum(r.imu.dt.sum() for r in drives) / 3600
    episodes = sum(len(stretches(found(wheel_of(r), r.imu))) for r in drives)
    return name, hours, episodes, episodes / hours


def quiet(drives: Sequence[Recording], rough: Sequence[Recording]) -> pd.DataFrame:
    """False alarms on drives as they are, with a wheel speed that is late or reads too much, and on
    bad roads."""
    late = [_bend_speed(r, late=0.1) for r in drives]
    scaled = [_bend_speed(r, scale=SCALE) for r in drives]
    rows = [
        false_alarms(drives, "as simulated"),
        false_alarms(scaled, "reads 2 % too much"),
        false_alarms(late, "0.1 s late"),
        false_alarms(rough, "three times as rough a road and engine"),
    ]
    return pd.DataFrame(rows, columns=["wheel speed without slip", "hours", "episodes", "per hour"])


def _bend_speed(recording: Recording, scale: float = 0.0, late: float = 0.0) -> Recording:
    wheel = wheel_of(recording)
    bent = replace(wheel, t=wheel.t + late, y=wheel.y * (1 + scale))
    return _with(recording, bent)


def _with(recording: Recording, wheel: Source | None) -> Recording:
    """The recording with another wheel speed, or none."""
    others = tuple(a for a in recording.sources if a.kind != "speed")
    return replace(recording, sources=others if wheel is None else (*others, wheel))


def measure_worth(seed: int) -> dict[str, pd.DataFrame]:
    """{table: DataFrame} of a drive with GNSS and constraints, and a wheel speed that reads 2 % too
    much: the error of the scale that is estimated before the first outage (%), and the largest
    horizontal error of each outage (m)."""
    clean = _add_constraints(_bend_speed(drive(seed, gnss=Gnss()), scale=SCALE))
    mixed = add_slips(clean, seed, float(np.random.default_rng(seed).choice(SIZES)))[0]
    cases = {
        "no wheel speed": _with(mixed, None),
        "without slip": clean,
        "with slip, not tested": mixed,
        "with slip, tested": _with(mixed, without_slip(wheel_of(mixed), mixed.imu)[0]),
    }
    scales, errors = [], []
    for name, recording in cases.items():
        estimate = None if recording is cases["no wheel speed"] else ["scale"]
        solution = sd.fuse(recording.hidden(OUTAGES, GNSS), estimate=estimate)
        scores = sd.outages(solution, recording.reference, OUTAGES)
        errors += [(name, score.horizontal_max) for score in scores]
        if estimate:
            row = np.searchsorted(solution.t, OUTAGES[0][0])
            value = solution.columns["scale error of wheel"][row]
            scales.append((name, 100 * abs(value - SCALE)))
    return {
        SCALES: pd.DataFrame(scales, columns=["wheel speed", "error, %"]),
        WORTH: pd.DataFrame(errors, columns=["wheel speed", "outage, m"]),
    }


def medians(scales: pd.DataFrame, errors: pd.DataFrame) -> pd.DataFrame:
    """A row per case of `measure_worth`: over the drives and outages."""
    of_scale = scales.groupby("wheel speed")["error, %"].median()
    far = errors.groupby("wheel speed", sort=False)["outage, m"].agg(["median", "max"])
    found = pd.DataFrame({"error of the scale, %": of_scale.reindex(far.index)}).join(far)
    columns = {"median": "outage, median, m", "max": "outage, largest, m"}
    return found.rename(columns=columns).reset_index()


def _add_constraints(recording: Recording) -> Recording:
    """With the constraints of a car, 10 a second."""
    t = np.arange(recording.span[0] + 0.1, recording.span[1], 0.1)
    none = np.zeros((len(t), 1))
    constraints = tuple(
        Source(f"zero-{way}-velocity", t, none, none + 0.1, slip=slip)
        for way, slip in (("lateral", 0.005), ("vertical", 0.0))
    )
    return replace(recording, sources=(*recording.sources, *constraints))
