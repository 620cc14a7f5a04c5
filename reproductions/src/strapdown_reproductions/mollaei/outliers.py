"""Flights some of whose fixes are outliers, for what Mollaei et al. say of non-Gaussian noise.

`fly` draws white errors. So the aircraft is steered by the true state, the errors of some of its
fixes are made larger afterwards, and the filter runs over what was measured, with the controls.
"""

from dataclasses import replace

import numpy as np

from strapdown.core.loop.contract import Filter
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory
from strapdown.engine.batch import begin
from strapdown.engine.finish import solution
from strapdown.engine.options import run_options
from strapdown.flight.run_flight import Flight
from strapdown.typing import Array

from .six_state.model import INPUTS

SHARE, FACTOR = 0.1, 10.0
"""A fix in ten has ten times the error that it states (Tukey's contaminated normal)."""
CONTROLS = ("elevator, rad", "aileron, rad", "rudder, rad", "throttle")
_STREAM = 10  # of the fixes that are hit, apart from the sensors'


def contaminate(recording: Recording, seed: int) -> Recording:
    """The Recording with the errors of a SHARE of its fixes FACTOR times as large."""
    rng = np.random.default_rng([seed, _STREAM])
    truth = recording.reference
    assert truth is not None  # a flight has one
    sources = tuple(
        replace(a, y=_exact(a, truth) + (a.y - _exact(a, truth)) * _factors(len(a.t), rng))
        for a in recording.sources
    )
    return replace(recording, sources=sources)


def _exact(source: Source, truth: Trajectory) -> Array:
    """Return the fixes at samples without errors (n, 3)."""
    rows = np.searchsorted(truth.t, source.t - 1e-6)
    values = truth.lla if source.kind == "position" else truth.v_n
    assert values is not None
    return values[rows]


def _factors(fixes: int, rng: np.random.Generator) -> Array:
    """(n, 1) of the errors."""
    return np.where(rng.random((fixes, 1)) < SHARE, FACTOR, 1.0)


def with_filter(flight: Flight, recording: Recording, filter: Filter) -> Flight:
    """The Flight with what `filter`, on which it was flown, makes of `recording` in place of its
    own, with the controls and the predictions of the flight."""
    options = recording.meta["filter_options"]
    asked = run_options(options=options, start=flight.start, covariance=True)
    run = begin(recording, filter, asked)
    if flight.log["model predicts"].any():
        for row, told in enumerate(told_inputs(flight)):
            run.belief.workspace[INPUTS : INPUTS + len(told)] = told
            run.advance(row + 1)
    run.complete()
    return replace(flight, recording=recording, solution=solution(run))


def told_inputs(flight: Flight) -> Array:
    """(n, 9) what a filter that computes with controls is told before each sample of a flight in
    calm air, see strapdown.flight.inputs: the controls are those of mid-sample."""
    log, imu = flight.log, flight.recording.imu
    ends = np.column_stack([log[name] for name in CONTROLS])
    begins = np.vstack([flight.trim.state[None, 13:17], ends[:-1]])
    calm = np.zeros((len(ends), 3))
    return np.column_stack([log["model predicts"], 0.5 * (begins + ends), calm, imu.dt])
