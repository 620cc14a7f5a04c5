"""A cell: a fault, a filter and the way it runs, a motion and a seed; and its result."""

from typing import Any, NamedTuple

import numpy as np

from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState
from strapdown.data.recording import Recording

from .catalogue import FAULTS
from .fault import NOMINAL, WORLD, Fault
from .judging import JudgedRun, Nominal, judge_error, judge_run, nominal
from .not_showable import why_hidden
from .raw import Raw, raw
from .runs import FaultSubject, family, kinds, kinds_with, run, start_of
from .worlds import DATE, GENTLE, MOTIONS, WORLDS, FaultWorld, simulate_world


class CellTask(NamedTuple):
    """The task of one process."""

    motion: str
    subject: FaultSubject
    seed: int


class _Right(NamedTuple):
    """The run without a fault, its recording and its initial state."""

    recording: Recording
    start: InitialState
    nominal: Nominal
    judged: JudgedRun


def right(task: CellTask, kinds: tuple[str, ...]) -> _Right:
    """The run without a fault, with these sources."""
    world = MOTIONS[task.motion]
    recording = simulate_world(world, task.seed)
    data = raw(recording, kinds, task.seed, NOMINAL)
    cleaned = data.recording(world.imu, date=DATE)
    start = start_of(task.subject, cleaned)
    outcome = run(task.subject, data, world, recording, start)
    assert recording.reference is not None
    return _Right(recording, start, *nominal(outcome, recording.reference))


def cells(task: CellTask, names: tuple[str, ...] | None = None) -> list[dict[str, Any]]:
    """Rows of the table: the run without a fault, every fault that concerns the filter (or those
    of these names), and in the gentle motion the worlds without a fault."""
    filter = filters.find(task.subject.filter)
    own = kinds(filter)
    known = {own: right(task, own)}
    rows = [_row(task, NOMINAL, NOMINAL, known[own].judged)]
    for fault in FAULTS.values():
        there = kinds_with(fault, task.subject)
        if there is None or (names is not None and fault.name not in names):
            continue
        if there not in known:
            known[there] = right(task, there)
        rows.append(_row(task, fault.name, fault.of, _run_fault(task, fault, there, known[there])))
    if task.motion != GENTLE:
        return rows
    for world in WORLDS.values():
        if family(filter) in world.families and (names is None or world.name in names):
            rows.append(_row(task, world.name, WORLD, _elsewhere(task, world, own, known[own])))
    return rows


def _run_fault(task: CellTask, fault: Fault, kinds: tuple[str, ...], right: _Right) -> JudgedRun:
    data = raw(right.recording, kinds, task.seed, fault.name)
    with np.errstate(all="ignore"):
        fault.change(data)
        return _run(task.subject, data, MOTIONS[task.motion], right, right.start)


def _elsewhere(
    task: CellTask, world: FaultWorld, kinds: tuple[str, ...], right: _Right
) -> JudgedRun:
    recording = simulate_world(world, task.seed)
    there = right._replace(recording=recording, nominal=right.nominal._replace(truth=None))
    data = raw(recording, kinds, task.seed, NOMINAL)
    try:
        start = start_of(task.subject, data.recording(world.imu, date=DATE))
    except DataError as error:
        return judge_error(error)
    return _run(task.subject, data, world, there, start)


def _run(
    subject: FaultSubject, data: Raw, world: FaultWorld, right: _Right, start: InitialState
) -> JudgedRun:
    reference = right.recording.reference
    assert reference is not None
    try:
        return judge_run(
            run(subject, data, world, right.recording, start), reference, right.nominal
        )
    except Exception as error:  # what is no DataError is the finding
        return judge_error(error)


def _row(task: CellTask, name: str, of: str, found: JudgedRun) -> dict[str, Any]:
    subject, filter = task.subject, filters.find(task.subject.filter)
    why = why_hidden(name, family(filter), task.motion, kinds(filter))
    return {
        "fault": name,
        "of": of,
        "filter": subject.filter,
        "way": subject.way,
        "motion": task.motion,
        "seed": task.seed,
        **found._asdict(),
        "showable": why is None,
    }
