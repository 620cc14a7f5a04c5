"""The Solution of a finished Run, with the events that the user must know."""

from collections.abc import Iterable, Sequence

import numpy as np

from ..checks import DataError
from ..core.compile.records import Table
from ..core.loop.contract import BA, BG, BRIDGED, DOUBTFUL, POS, STATES, VALID, VEL, Filter
from ..core.loop.gaps import BRIDGE
from ..core.loop.tables import FixRow
from ..core.mathematics.solution_row import BIASES, LLA, NAV_WIDTH, ROW_STATUS, STD, Q, T, V
from ..data.solution import Innovations, Solution, SolutionMeta, Source, Trajectory
from ..data.value import read_only
from ..typing import Array
from ..units.constants import SETTLING
from .installation import parameter_meta
from .prepare import Run, augmented_states


def solution(run: Run) -> Solution:
    """Return the Solution from the output of `run`; a run that stopped early keeps its rows and an
    event with the reason."""
    recording, filter, fixes = run.recording, run.filter, run.fixes
    cursor, out = run.cursor, run.out
    nav, used = out.nav[: cursor.state[0].out], out.fix[: cursor.state[0].fix]
    run.events.look_at(used, fixes.std[: len(used)])
    events, meta = run.events.all, _meta(run, used)
    if cursor.state[0].fault:
        t = float(run.samples.t[cursor.state[0].row])
        meta["stopped"] = stop_message(t)
        if (t, meta["stopped"]) not in events:  # a stream has reported it already
            events.append((t, meta["stopped"]))
        if not len(nav):
            raise DataError(f"{filter.name} {meta['stopped']}")
    _doubt_sequels(nav, run.events.unresolved, run.samples.t)
    _forget_unknown(filter, nav)
    nav = read_only(nav)
    columns = _columns(run, nav)
    if filter.diagnose:
        events += filter.diagnose(nav[:, T], nav[:, LLA:V], columns)
    return Solution(
        _trajectory(run, nav),
        nav[:, BIASES : BIASES + 3],
        nav[:, BIASES + 3 : STD],
        nav[:, ROW_STATUS].astype(np.int8),
        innovations(used, recording.sources, fixes.sources["gate"]),
        tuple(sorted(events)),
        columns,
        read_only(out.covariance[: len(nav)]) if len(out.covariance) else None,
        meta,
        recording,
    )


def _meta(run: Run, used: Table[FixRow]) -> SolutionMeta:
    """Return the metadata of a run."""
    recording, spec = run.recording, run.spec
    meta: SolutionMeta = {
        "filter": run.filter.name,
        "recording": recording.meta.get("name", ""),
        "notes": list(recording.meta.get("notes", [])),
        "imu": spec.name if spec else "",
        "vehicle": run.events.vehicle.name,
        "bias_std": list(map(float, spec.bias_std())) if spec else None,
        "start": run.start._asdict(),
        "noise": run.noise._asdict(),
        "fixes_outside": sum(len(a.t) for a in recording.sources) - len(used),
        "kinds": {a.name or a.kind: a.kind for a in recording.sources},
        "date": recording.meta.get("date"),
        "point": recording.meta.get("point", "imu"),
    }
    meta |= parameter_meta(recording, run.belief.P)
    if epoch := recording.meta.get("epoch"):
        meta["epoch"] = epoch
    if read := recording.meta.get("read"):
        meta["read"] = read
    if run.events.rejected:
        meta["rejected"] = [each._asdict() for each in run.events.rejected]
    if run.events.heights_apart:
        meta["heights_apart"] = run.events.heights_apart
    return meta


def _doubt_sequels(nav: Array, spans: Sequence[tuple[float, float]], samples: Array) -> None:
    """Mark the rows in which the filter still follows fixes that jumped or drifted away. Within
    SETTLING seconds after a gap in the times `samples` (s) of the IMU, the filter itself had
    drifted."""
    t, status = nav[:, T], nav[:, ROW_STATUS]
    gap = np.flatnonzero(np.diff(samples) > BRIDGE)
    for start, stop in spans:
        if ((start >= samples[gap]) & (start <= samples[gap + 1] + SETTLING)).any():
            continue
        told = np.isin(status, (VALID, BRIDGED)) & (t >= start) & (t < stop)
        status[told] = DOUBTFUL


def _forget_unknown(filter: Filter, nav: Array) -> None:
    """Replace quantities that a filter does not estimate, and missing standard deviations, by
    NaN."""
    for first, states in ((LLA, POS), (V, VEL), (BIASES, BA), (BIASES + 3, BG)):
        unknown = [first + i for i in range(3) if states.start + i not in filter.estimates]
        nav[:, unknown] = np.nan
    nav[:, [STD + i for i in range(STATES) if i not in filter.states]] = np.nan


def _trajectory(run: Run, nav: Array) -> Trajectory:
    """Return position, velocity and attitude of the point that the recording names."""
    made = Trajectory(
        nav[:, T], nav[:, LLA:V], nav[:, V:Q], nav[:, Q:BIASES], nav[:, STD:ROW_STATUS]
    )
    if run.recording.meta.get("point") != "reference":
        return made
    rows = np.searchsorted(run.samples.t, made.t)
    rate = run.samples.dtheta[rows] / run.samples.dt[rows, None]
    arm = np.asarray(run.recording.meta["imu_lever_arm"])
    return made.displaced(-arm, rate - nav[:, BIASES + 3 : STD])


def _columns(run: Run, nav: Array) -> dict[str, Array]:
    """Return by name the filter's own columns, and estimated parameters with their standard
    deviations."""
    own = augmented_states(run.recording.sources, run.recording.meta.get("estimate"))
    names = [(name, 1.0) for name in run.filter.columns]
    names += [(each.name, each.factor) for each in own]
    names += [(f"std of {each.name}", each.factor) for each in own]
    return {name: nav[:, NAV_WIDTH + i] * factor for i, (name, factor) in enumerate(names)}


def stop_message(t: float) -> str:
    """Return the message of a filter that stopped at the sample of `t` s."""
    return (
        f"stopped at {t:.2f} s: the latitude left +-89 deg, within which results hold, or the "
        "filter diverged"
    )


def innovations(
    used: Table[FixRow], sources: Sequence[Source], gates: Iterable[float]
) -> Innovations:
    """Return the Innovations from the fix rows of `run`."""
    of = {name: np.ascontiguousarray(used[name]) for name in used.dtype.names}
    return Innovations(
        of["t"],
        of["source"].astype(int),
        of["innovation"],
        of["nis"],
        of["use"] > 0,
        tuple(a.name or a.kind for a in sources),
        tuple(float(gate) for gate in gates),
        of["whitened"],
        of["root"],
        of["weight"],
        of["factor"],
    )
