"""The choice of an export: a filter with its options, sources and IMU, checked as for a run, and
the run over a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ... import aiding, filters
from ...aiding.more_parameters import placeholder
from ...checks import DataError, check_number
from ...core.loop.contract import Filter, InitialState, Noise
from ...core.loop.loop import SAME_TIME
from ...core.mathematics.source import PARAMETERS
from ...data.recording import Recording
from ...data.solution import Source
from ...data.vehicle import GivenVehicle, Vehicle, find as find_vehicle
from ...engine.heading_hypotheses import align_start
from ...engine.installation import without_estimates
from ...engine.options import run_options
from ...engine.plausible_limits import limits
from ...engine.prepare import (
    Run,
    check_needs,
    configure_options,
    has_position,
    merge,
    new_belief,
    new_cursor,
    new_output,
    ready,
    usable,
)
from ...sensor_models.imu import GivenImu, ImuSpec, imu as imu_spec
from ...typing import Notify

WAITING = 16
"""Default number of fixes that an exported filter can store until the sample that reaches their
time."""
MAX_WAITING = 4096
LOG_ROWS = 32
"""Rows of its log."""
REPLAYED = 60.0
"""s of the simulated flight without a recording."""
GIVEN = PARAMETERS
"""Number of parameters of a source that the user sets, such as a lever arm; the loop's own
follow."""


class Chosen(NamedTuple):
    """The filter, options, sources, IMU and recording of an export."""

    filter: Filter
    options: dict[str, Any]
    sources: tuple[Source, ...]  # the sources, in their order, with the fixes of the recording
    names: tuple[str, ...]  # of the sources
    spec: ImuSpec
    noise: Noise
    vehicle: Vehicle
    recording: Recording  # with these sources
    start: InitialState  # of the recording
    notes: tuple[str, ...]
    waiting: int  # number of fixes that can wait

    def records(self, start: InitialState, noise: Noise | None = None) -> dict[str, Sequence[Any]]:
        """All records of a run from `start` on before its first sample, by their names in
        `layout.RECORDS`; with room for one sample and `waiting` fixes. Raises DataError."""
        noise = noise or self.noise
        none = [replace(a, t=a.t[:0], y=a.y[:0], std=a.std[:0]) for a in self.sources]
        belief = new_belief(self.filter, start, noise, self.options, none)
        cursor = new_cursor(self.filter, start.t, none, limits(self.spec, noise, self.vehicle))
        room = np.zeros(self.waiting)
        return {
            "belief": belief,
            "imu": (np.zeros(1), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3))),
            "fixes": merge(none)._replace(
                t=room,
                source=np.zeros(self.waiting, np.int64),
                y=np.zeros((self.waiting, 3)),
                std=np.zeros((self.waiting, 3)),
            ),
            "noise": noise,
            "cursor": cursor._replace(log=cursor.log[:LOG_ROWS]),
            "out": [
                np.zeros_like(array)
                for array in new_output(self.filter, belief, 1, fixes=self.waiting)
            ],
        }

    def replay(self, notify: Notify | None = None) -> Run:
        """The run of the filter over the recording, to its end. Raises DataError."""
        asked = run_options(options=self.options, notify=notify, vehicle=self.vehicle)
        run = ready(self.recording, self.filter, self.start, self.noise, self.spec, asked)
        run.complete()
        if run.cursor.state[0].fault:
            raise DataError(
                f"filter {self.filter.name!r} stops in {self.recording.meta.get('name')}, so there is nothing "
                f"to compare with; give another recording"
            )
        together = np.bincount(np.searchsorted(run.samples.t + SAME_TIME, run.fixes.t)).max(
            initial=0
        )
        if together > self.waiting:
            raise DataError(
                f"the recording has {together} fixes up to one sample, over a gap of the IMU; the "
                f"filter has room for {self.waiting}: give --waiting {together}, or another recording"
            )
        return run


def choose_export(
    filter: str | Filter,
    sources: Sequence[str],
    recording: Recording,
    imu: GivenImu | None = None,
    vehicle: GivenVehicle | None = None,
    options: Mapping[str, Any] | None = None,
    waiting: int = WAITING,
) -> Chosen:
    """Check the arguments of an export, which are those of `fuse`, and return the choice.

    sources: kinds of measurement; the second of a kind is the second of the recording. A kind that
    the recording lacks becomes a source without fixes. waiting: number of fixes that can wait.

    Raises DataError.
    """
    filter = filters.find(filter)
    check_number(waiting, "waiting", least=1, most=MAX_WAITING, whole=True)
    if not sources:
        raise DataError("sources: there are none; name one or more, as position,velocity")
    chosen = _of(recording, sources)
    found, notes = usable(filter, chosen)
    if len(found) < len(chosen):
        raise DataError(f"filter {filter.name!r} cannot be exported with these sources: {notes[0]}")
    check_needs(filter, found, "name it among the sources")
    fit, said = configure_options(filter, dict(options or {}), found)
    spec = imu_spec(imu or recording.meta.get("grade") or "tactical")
    recording = replace(recording, sources=found).without_meta("estimate")
    vehicle = find_vehicle(vehicle or recording.meta.get("vehicle"))
    start = align_start(recording, spec, has_position(filter))
    counts = [[a.kind for a in found[:i]].count(a.kind) for i, a in enumerate(found)]
    names = tuple(f"{a.kind}-{k + 1}" if k else a.kind for a, k in zip(found, counts))
    return Chosen(
        filter,
        fit,
        found,
        names,
        spec,
        filter.with_bias_model(spec.noise(), fit),
        vehicle,
        recording,
        start._replace(motion=()),  # what it erred by belongs to states that are not exported
        (*notes, *said),
        waiting,
    )


def _of(recording: Recording, kinds: Sequence[str]) -> tuple[Source, ...]:
    """The sources of these kinds, of which those that the recording has with their fixes."""
    rest, found = list(without_estimates(recording.sources)), []
    for kind in kinds:
        sensor = aiding.find(kind)
        own = next((a for a in rest if a.kind == sensor.name), None)
        if own is not None:
            rest.remove(own)
        width = len(sensor.quantities)
        none = Source(
            sensor.name,
            np.empty(0),
            np.empty((0, width)),
            np.empty((0, width)),
            placeholder(sensor),
        )
        found.append(own or none)
    return tuple(found)
