"""Messages on a run of rejections: its cause, its evidence, and the remedy."""

from collections.abc import Sequence

import numpy as np

from ... import aiding
from ...data.solution import Rejected, Source
from ...typing import Array
from ...units import quantities
from .causes import (
    ALWAYS,
    CLOCK,
    DISAGREE,
    DRIFT,
    JUMP,
    NOISE,
    OFFSET,
    OUTLIERS,
    SCALE,
    START,
    UNKNOWN,
)
from .contradictions import RejectedRun

VERTICAL = 0.3  # part of a vector above which its vertical component is reported too
WINDS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
REMEDIES = {
    JUMP: "check whether the fixes before or after the jump are correct, and leave out the others",
    DRIFT: "leave them out from there on if another source also contradicts them",
    CLOCK: "run `strapdown diagnose`, which finds its `time.offset`",
    NOISE: "give it a larger std, or run `strapdown tune`",
    DISAGREE: "run `strapdown inspect` and `strapdown diagnose`",
    OUTLIERS: "a few are harmless; if there are many, find out why the receiver makes them",
    UNKNOWN: "look at these times in the report",
}


def rejection_texts(runs: Sequence[RejectedRun], sources: Sequence[Source]) -> list[Rejected]:
    """Return the runs as text."""
    names = [a.name or a.kind for a in sources]
    return [_rejection_text(run, sources[run.source], names) for run in runs]


def _rejection_text(run: RejectedRun, source: Source, names: Sequence[str]) -> Rejected:
    shape = run.found.shape
    cause = DISAGREE if shape in (OFFSET, SCALE, ALWAYS) else UNKNOWN if shape == START else shape
    seen = _error_text(run, source)
    if cause == DISAGREE:
        others = ", ".join(names[s] for s in run.others)
        also = (
            f"fixes of {others} were also rejected" if others else "fixes of other sources were not"
        )
        seen = f"{', '.join(filter(None, [seen, also]))}: the sources contradict each other"
    span = run.start, run.stop, run.number, run.of
    return Rejected(names[run.source], *span, cause, seen, REMEDIES[cause])


def _error_text(run: RejectedRun, source: Source) -> str:
    found, size = run.found, run.found.size
    if found.shape == JUMP:
        lasted = found.until - found.since
        stayed = "and stayed" if np.isinf(lasted) else f"for {lasted:.3g} s"
        return f"they jumped by {_amount(size, source)} {stayed}"
    if found.shape in (DRIFT, ALWAYS):
        return f"they drift by {_amount(size, source, '/s')} from {found.since:.1f} s on"
    if found.shape == CLOCK:
        what = "velocity" if source.kind == "position" else "acceleration"
        return (
            f"their errors follow the {what}, as with time stamps about {abs(size[0]):.2g} s "
            f"{'late' if size[0] < 0 else 'early'}"
        )
    if found.shape == OFFSET:
        return f"all of them are off by {_amount(size, source)}"
    if found.shape == SCALE:
        return f"their errors are {100 * size[0]:.2g} % of the speed"
    return {
        NOISE: f"all of them scatter by {found.spread:.2g} times their standard deviations",
        OUTLIERS: f"single outliers, up to {run.largest:.3g} standard deviations off",
        START: f"up to {run.largest:.3g} standard deviations off, while the filter converged after "
        "its start",
        UNKNOWN: f"up to {run.largest:.3g} standard deviations off, for an unknown cause",
    }.get(found.shape, "")


def _amount(size: Array, source: Source, per: str = "") -> str:
    """A vector or a number with its unit and direction."""
    sensor = aiding.find(source.kind)
    unit, shown = quantities.shown_unit(sensor.quantities[0])
    unit, per = ("m/s^2", "") if per and unit == "m/s" else (unit, per)
    if source.kind not in ("position", "velocity"):
        width = len(sensor.quantities)
        values = ", ".join(f"{value * shown:+.3g}" for value in size[:width])
        return f"{values} {unit}{per}"
    level, down = float(np.hypot(size[0], size[1])), float(size[2])
    said, whole = [], float(np.hypot(level, down))
    if level > VERTICAL * whole:
        wind = WINDS[round(float(np.degrees(np.arctan2(size[1], size[0]))) / 45) % 8]
        said.append(f"{level:.3g} {unit}{per} to the {wind}")
    if abs(down) > VERTICAL * whole or not said:
        said.append(f"{abs(down):.3g} {unit}{per} {'down' if down > 0 else 'up'}")
    return " and ".join(said)
