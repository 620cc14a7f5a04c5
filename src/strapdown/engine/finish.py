"""From a Run that has come to its end to the Solution that it makes, with the events of which the
user must know."""

from collections.abc import Iterable, Sequence

import numpy as np

from ..checks import DataError
from ..core.compile.records import Table
from ..core.loop.contract import BA, BG, POS, STATES, VEL
from ..core.loop.tables import FixRow
from ..core.mathematics import solution_row
from ..data import Aiding, Innovations, Solution, SolutionMeta, Trajectory
from .installation import told
from .prepare import Run, brought


def solution(run: Run) -> Solution:
    """The Solution from what `run` wrote; a run that stopped early keeps what it has and says
    why."""
    recording, samples, filter, _, start, noise, spec, belief, fixes, cursor, out, *_ = run
    nav, used = out.nav[: cursor.state[0].out], out.fix[: cursor.state[0].fix]
    run.events.look_at(used, fixes.sd[: len(used)])
    events = run.events.all
    meta: SolutionMeta = {
        "filter": filter.name,
        "recording": recording.meta.get("name", ""),
        "notes": list(recording.meta.get("notes", [])),
        "imu": spec.name if spec else "",
        "vehicle": run.events.vehicle.name,
        "bias_sd": list(map(float, spec.bias_sd())) if spec else None,
        "start": start._asdict(),
        "noise": noise._asdict(),
        "fixes_outside": sum(len(a.t) for a in recording.aidings) - len(used),
        "kinds": {a.name or a.kind: a.kind for a in recording.aidings},
        "date": recording.meta.get("date"),
        "point": recording.meta.get("point", "imu"),
    }
    meta |= told(recording, belief.P)
    if epoch := recording.meta.get("epoch"):
        meta["epoch"] = epoch
    if read := recording.meta.get("read"):
        meta["read"] = read
    if run.events.rejected:
        meta["rejected"] = [each._asdict() for each in run.events.rejected]
    if run.events.heights_apart:
        meta["heights_apart"] = run.events.heights_apart
    if cursor.state[0].fault:
        t = samples.t[cursor.state[0].row]
        meta["stopped"] = stopped(t)
        if (float(t), meta["stopped"]) not in events:  # a stream said so already
            events.append((float(t), meta["stopped"]))
        if not len(nav):
            raise DataError(f"{filter.name} {meta['stopped']}")
    # what is not estimated is no number
    for columns_of, states in (
        (solution_row.LLA, POS),
        (solution_row.V, VEL),
        (solution_row.BIASES, BA),
        (solution_row.BIASES + 3, BG),
    ):
        nav[:, [columns_of + i for i in range(3) if states.start + i not in filter.estimates]] = (
            np.nan
        )
    sd = nav[:, solution_row.SD : solution_row.ROW_STATUS]
    sd[:, [i for i in range(STATES) if i not in filter.states]] = np.nan
    trajectory = Trajectory(
        nav[:, solution_row.T],
        nav[:, solution_row.LLA : solution_row.V],
        nav[:, solution_row.V : solution_row.Q],
        nav[:, solution_row.Q : solution_row.BIASES],
        sd,
    )
    if recording.meta.get("point") == "reference":
        rows = np.searchsorted(samples.t, trajectory.t)
        omega = (
            samples.dtheta[rows] / samples.dt[rows, None]
            - nav[:, solution_row.BIASES + 3 : solution_row.SD]
        )
        trajectory = trajectory.displaced(-np.asarray(recording.meta["imu_lever_arm"]), omega)
    own = brought(recording.aidings, recording.meta.get("estimate"))
    names = [(name, 1.0) for name in filter.columns]
    names += [(each.name, each.factor) for each in own]
    names += [(f"sd of {each.name}", each.factor) for each in own]
    columns = {
        name: nav[:, solution_row.NAV_WIDTH + i] * factor for i, (name, factor) in enumerate(names)
    }
    if filter.diagnose:
        events += filter.diagnose(
            nav[:, solution_row.T], nav[:, solution_row.LLA : solution_row.V], columns
        )
    return Solution(
        trajectory,
        nav[:, solution_row.BIASES : solution_row.BIASES + 3],
        nav[:, solution_row.BIASES + 3 : solution_row.SD],
        nav[:, solution_row.ROW_STATUS].astype(np.int8),
        innovations(used, recording.aidings, fixes.sources["gate"]),
        tuple(sorted(events)),
        columns,
        out.covariance[: len(nav)] if len(out.covariance) else None,
        meta,
        recording,
    )


def stopped(t: float) -> str:
    """What is said of a filter that stopped at the sample of `t` s."""
    return (
        f"stopped at {t:.2f} s: the latitude left the +-89 deg where results hold, or the filter "
        f"diverged"
    )


def innovations(
    used: Table[FixRow], aidings: Sequence[Aiding], gates: Iterable[float]
) -> Innovations:
    """Innovations from the fix rows that `run` wrote."""
    of = {name: np.ascontiguousarray(used[name]) for name in used.dtype.names}
    return Innovations(
        of["t"],
        of["source"].astype(int),
        of["innovation"],
        of["nis"],
        of["use"] > 0,
        tuple(a.name or a.kind for a in aidings),
        tuple(float(gate) for gate in gates),
        of["whitened"],
        of["root"],
        of["weight"],
        of["factor"],
    )
