"""From a Run that has come to its end to the Solution that it makes, with the events of which the
user must know."""

from collections.abc import Iterable, Sequence

import numpy as np

from ..checks import DataError
from ..core import loop
from ..core.contract import BA, BG, POS, STATES, VEL, Imu, Start
from ..data import Aiding, Innovations, Solution, Trajectory
from ..preprocessing.imu_samples import MOST_SHORT_GAPS, SHORT_GAP
from ..typing import Array
from .prepare import ROWS_AT_ONCE, Run, brought, positioned


def solution(run: Run) -> Solution:
    """The Solution from what `run` wrote; a run that stopped early keeps what it has and says
    why."""
    recording, samples, filter, _, start, noise, spec, _, fixes, cursor, out, *_ = run
    nav, used = out.nav[: cursor.at[loop.OUT]], out.fix[: cursor.at[loop.FIX]]
    names = [a.name or a.kind for a in recording.aidings]
    events = _events(
        samples,
        cursor.at[loop.ROW],
        start,
        used,
        names,
        "velocity and attitude held, invalid until the next position fix"
        if positioned(filter)
        else "attitude held",
    )
    meta = {
        "filter": filter.name,
        "recording": recording.meta.get("name", ""),
        "notes": list(recording.meta.get("notes", [])),
        "imu": spec.name if spec else "",
        "start": start._asdict(),
        "noise": noise._asdict(),
        "fixes_outside": sum(len(a.t) for a in recording.aidings) - len(used),
        "kinds": {a.name or a.kind: a.kind for a in recording.aidings},
        "date": recording.meta.get("date"),
        "point": recording.meta.get("point", "imu"),
    }
    if cursor.at[loop.FAULT]:
        t = samples.t[cursor.at[loop.ROW]]
        meta["stopped"] = (
            f"stopped at {t:.2f} s: the latitude left the +-89 deg where results hold, or the "
            f"filter diverged"
        )
        events.append((float(t), meta["stopped"]))
        if not len(nav):
            raise DataError(f"{filter.name} {meta['stopped']}")
    # what is not estimated is no number
    for columns_of, states in (
        (loop.LLA, POS),
        (loop.V, VEL),
        (loop.BIASES, BA),
        (loop.BIASES + 3, BG),
    ):
        nav[:, [columns_of + i for i in range(3) if states.start + i not in filter.estimates]] = (
            np.nan
        )
    sd = nav[:, loop.SD : loop.ROW_STATUS]
    sd[:, [i for i in range(STATES) if i not in filter.states]] = np.nan
    trajectory = Trajectory(
        nav[:, loop.T],
        nav[:, loop.LLA : loop.V],
        nav[:, loop.V : loop.Q],
        nav[:, loop.Q : loop.BIASES],
        sd,
    )
    if recording.meta.get("point") == "reference":
        rows = np.searchsorted(samples.t, trajectory.t)
        omega = samples.dtheta[rows] / samples.dt[rows, None] - nav[:, loop.BIASES + 3 : loop.SD]
        trajectory = trajectory.displaced(-np.asarray(recording.meta["imu_lever_arm"]), omega)
    own = [name for name, _ in brought(recording.aidings)]
    columns = {
        name: nav[:, loop.NAV_WIDTH + i]
        for i, name in enumerate((*filter.columns, *own, *(f"sd of {name}" for name in own)))
    }
    if filter.diagnose:
        events += filter.diagnose(nav[:, loop.T], nav[:, loop.LLA : loop.V], columns)
    return Solution(
        trajectory,
        nav[:, loop.BIASES : loop.BIASES + 3],
        nav[:, loop.BIASES + 3 : loop.SD],
        nav[:, loop.ROW_STATUS].astype(np.int8),
        innovations(used, recording.aidings, fixes.gate),
        tuple(sorted(events)),
        columns,
        out.covariance[: len(nav)] if len(out.covariance) else None,
        meta,
        recording,
    )


def innovations(used: Array, aidings: Sequence[Aiding], gates: Iterable[float]) -> Innovations:
    """Innovations from the fix rows that `run` wrote."""
    return Innovations(
        used[:, loop.F_T],
        used[:, loop.F_SOURCE].astype(int),
        used[:, loop.F_INNOVATION : loop.F_NIS],
        used[:, loop.F_NIS],
        used[:, loop.F_USE] > 0,
        tuple(a.name or a.kind for a in aidings),
        tuple(float(gate) for gate in gates),
    )


def _events(
    samples: Imu, rows: int, start: Start, used: Array, names: Sequence[str], long_gap: str
) -> list[tuple[float, str]]:
    """Gaps in the first `rows` samples and re-acquisitions of a source, as (t, text); `long_gap`
    is what happens in one beyond a second."""
    events: list[tuple[float, str]] = []
    short: list[tuple[float, float]] = []
    # in pieces: a day of samples is too long for temporary columns
    for first in range(0, rows, ROWS_AT_ONCE):
        t, dt = (column[first : min(first + ROWS_AT_ONCE, rows)] for column in samples[:2])
        before = np.r_[samples.t[first - 1] if first else start.t, t[:-1]]
        gap = t - dt - np.maximum(before, start.t)
        for k in np.flatnonzero((gap > 0.5 * dt + loop.SAME_TIME) & (t > start.t)):
            if gap[k] <= min(SHORT_GAP * dt[k], loop.BRIDGE):
                short.append((float(before[k]), float(gap[k])))
                continue
            rule = "bridged" if gap[k] <= loop.BRIDGE else long_gap
            events.append((float(before[k]), f"IMU gap of {gap[k]:.3g} s: {rule}"))
    events += _short_gaps(short)
    for s, name in enumerate(names):
        events += _lifted(used[used[:, loop.F_SOURCE] == s], name)
    return events


def _short_gaps(short: list[tuple[float, float]]) -> list[tuple[float, str]]:
    """Events for gaps [(t, s)] of a sample or two: one for all where they are many."""
    if len(short) <= MOST_SHORT_GAPS:
        return [(t, f"IMU gap of {gap:.3g} s: bridged") for t, gap in short]
    gaps = [gap for _, gap in short]
    return [
        (
            short[0][0],
            f"{len(short)} IMU gaps of {min(gaps):.3g} to {max(gaps):.3g} s from here on: bridged; "
            f"single lost samples, or time stamps that jitter",
        )
    ]


def _lifted(own: Array, name: str) -> list[tuple[float, str]]:
    """[(t, text)] of the fixes of one source: where its gate was lifted, and where that did not
    help."""
    t, use = own[:, loop.F_T], own[:, loop.F_USE]
    series = np.cumsum(use == loop.ACCEPTED)  # from one fix that passes to the next
    lifted = np.flatnonzero(use == loop.REACQUIRED)
    _, first, count = np.unique(series[lifted], return_index=True, return_counts=True)
    text = f"{name}: gate lifted after {loop.REJECTED} or more rejections in a row over {loop.LIFT_AFTER:g} s"
    events = [(float(at), text) for at in t[lifted[first]]]
    passed, rejected = (
        np.r_[np.flatnonzero(use == loop.ACCEPTED), len(use)],
        np.r_[0, np.cumsum(use == loop.REJECTED_FIX)],
    )
    last = lifted[first + count - 1][count >= loop.LIFTS]
    in_vain = last[
        rejected[passed[np.searchsorted(passed, last)]] - rejected[last] >= loop.REJECTED
    ]
    text = f"{name}: left out from here until one of its fixes passes the gate: lifting it {loop.LIFTS} times did not help"
    return events + [(float(at), text) for at in t[in_vain]]
