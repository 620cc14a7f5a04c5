"""A sensor of any kind of measurement, also of one from outside the package, simulated by the
observation that the filters themselves use.

    y such that  innovation(truth, y) = w,   w ~ N(0, std^2), independent from fix to fix

For nearly every kind the innovation is y - h(truth), so that this is y = h(truth) + w. A mistake in
the kind's observation is in the fixes too, and so does not show: sensors with an equation of their
own in this package (GNSS, magnetometer, barometer, AHRS) have none of this.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..aiding import compile_observation, find
from ..aiding.more_parameters import check_more_parameters
from ..checks import DataError, check_array, check_number
from ..core.loop.contract import (
    STATES,
    FilterState,
    Imu,
    MeasurementModel,
    bind_kernel,
)
from ..core.mathematics.source import PARAMETERS, new_source
from ..data.solution import Source, Trajectory
from ..typing import Array, Mask
from .magnetometer import rotation_at
from .sampling import interpolate_trajectory, sample_times
from .streams import RandomStream, SeedLike

STEP = {"latitude": 1e-6, "longitude": 1e-6, "angle": 1e-6}
"""By which y is changed to see what it does to the innovation; 1 of any other quantity."""
MAX_ATTEMPTS = 50
CLOSE = 1e-6  # of its standard deviation: an innovation as good as 0


@dataclass(frozen=True)
class Simulated:
    """A sensor of a kind of measurement, with white noise. SI and radians. Raises DataError on what
    none can be."""

    kind: str  # a name of `strapdown.aiding.names()`, not a constraint
    # of the innovation, for each component of the kind or one for all; pressure's is in m
    std: tuple[float, ...] | float
    rate: float | None = 1.0  # fixes per second; None: one with every IMU sample
    # as the kind has them: mostly the lever arm from the IMU, m, body; () are zeros
    parameters: tuple[float, ...] = ()
    name: str = ""  # of the source and of its random stream; the kind by default
    # true values of the states that the kind brings along, such as the wind; () are zeros
    states: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        measurement = self.measurement
        own = self.name or self.kind
        if not measurement.recorded:
            raise DataError(
                f"{own}: {self.kind} is a constraint of the vehicle, which no sensor measures; name "
                f"it where the recording is fused"
            )
        size = len(measurement.quantities)
        deviations = check_array(
            self.std if np.ndim(self.std) else [self.std] * size, f"{own}: std", (size,), above=0
        )
        if self.rate is not None:
            check_number(self.rate, f"{own}: rate", "Hz", above=0)
        parameters = check_array(self.parameters, f"{own}: parameters", (None,))
        wanted = {"": range(PARAMETERS + 1), "field": (3,), "baseline": (3,)}.get(
            measurement.parameters, (0, 3)
        )
        if measurement.more_parameters:
            check_more_parameters(measurement, parameters.tolist(), own)
        elif len(parameters) not in wanted:
            raise DataError(
                f"{own}: {len(parameters)} parameters; kind {self.kind} takes "
                f"{f'three: {measurement.parameters}' if measurement.parameters else f'at most {PARAMETERS}'}"
            )
        states = check_array(self.states, f"{own}: states", (None,))
        if len(states) not in (0, len(measurement.states)):
            raise DataError(
                f"{own}: {len(states)} states; kind {self.kind} brings "
                f"{', '.join(measurement.states) or 'none'}"
            )
        for field, value in (
            ("std", tuple(deviations.tolist())),
            ("parameters", tuple(parameters.tolist())),
            ("states", tuple(states.tolist())),
            ("name", own),
        ):
            object.__setattr__(self, field, value)

    @property
    def measurement(self) -> MeasurementModel:
        """The model of its kind. Raises DataError with the nearest name."""
        return find(self.kind)

    def own_states(self) -> Array:
        """The true values of the states of its kind, with zeros where none are given."""
        return np.array(self.states or [0.0] * len(self.measurement.states))

    def plan(
        self,
        truth: Trajectory,
        ideal: Imu,
        gate: float | None = None,
        states: Callable[[Array], Array] | None = None,
    ) -> "SimulatedPlan":
        """Return the SimulatedPlan that all runs over one trajectory share. `ideal`: the samples of
        an IMU without errors on it; `gate`: that of the source; `states`: the true states of its
        kind (n, k) at times (n,) where they change. Raises DataError."""
        t = sample_times(truth, self.rate)
        own = np.tile(self.own_states(), (len(t), 1)) if states is None else states(t)
        y, gain = _solve_values(self, _beliefs(truth, ideal, t, own))
        reads: Mask = np.asarray(np.isfinite(y).any(axis=1))
        t, y, gain = t[reads], y[reads], gain[reads]
        std = np.tile(self.std, (len(t), 1))
        source = Source(self.kind, t, y, std, self.parameters, gate, self.name)
        return SimulatedPlan(source, gain, int((~reads).sum()))


class SimulatedPlan(NamedTuple):
    """Noise-free measurements of such a sensor; each run adds its own noise."""

    source: Source  # its y without noise
    gain: Array  # (n, components, components) what of y a unit of the innovation is
    silent: int  # fixes in which it reads nothing, such as a course at a standstill

    def fixes(self, seed: SeedLike) -> Source:
        """The source of one run."""
        noise = RandomStream.of(seed).standard_normal(self.source.std.shape) * self.source.std
        return replace(self.source, y=self.source.y + np.einsum("nij,nj->ni", self.gain, noise))

    def exact(self) -> Source:
        """The source without noise, which states that of the one with it."""
        return replace(self.source, y=self.source.y.copy())

    def notes(self, source: Source) -> list[str]:
        """Sentences for the notes of a recording: no fix at all, or some in which it reads nothing."""
        if not len(source.t):
            return [f"{source.name}: not one fix falls into the recording; its rate is too low"]
        said = f"{source.name}: reads nothing {self.silent} times, as a course at a standstill"
        return [said] if self.silent else []


def _beliefs(truth: Trajectory, ideal: Imu, t: Array, own: Array) -> list[FilterState]:
    """Return the states of a filter without any error at times t (n,) s, with `own` (n, k) as its
    augmented states; rate and specific force are those between the middles of two samples."""
    from scipy.interpolate import make_interp_spline

    at = interpolate_trajectory(truth, t)
    assert at.v_n is not None
    samples = np.c_[ideal.dtheta, ideal.dv] / ideal.dt[:, None]
    felt = make_interp_spline(ideal.t - ideal.dt / 2, samples, k=1)(t)  # on beyond the last middle
    attitude = np.ascontiguousarray(rotation_at(truth, t).as_matrix())
    none, P = np.zeros(3), np.zeros((STATES + own.shape[1],) * 2)
    return [
        FilterState(lla, v, C, none, none, P, now[:3], now[3:], np.zeros(1), states)
        for lla, v, C, now, states in zip(at.lla, at.v_n, attitude, felt, own)
    ]


def _solve_values(sensor: Simulated, beliefs: Sequence[FilterState]) -> tuple[Array, Array]:
    """((n, k) y without innovation, (n, k, k) its derivative by the innovation) by Newton's
    method; NaN where the kind measures nothing. Raises DataError, also where it never does."""
    quantities = sensor.measurement.quantities
    innovations = _innovations(sensor, beliefs)
    steps = np.diag([STEP.get(quantity, 1.0) for quantity in quantities])
    # no sensor reads a pressure of 0
    y = np.tile(steps.sum(axis=0), (len(beliefs), 1))
    silent: Mask = np.asarray(np.isnan(innovations(y)).all(axis=1))
    for _ in range(0 if silent.all() and len(y) else MAX_ATTEMPTS):
        error = np.where(silent[:, None], 0.0, innovations(y))
        if not np.isfinite(error).all():
            break
        derivative = np.stack(
            [(innovations(y + step) - error) / step.sum() for step in steps], axis=2
        )
        derivative[silent] = np.eye(len(quantities))
        try:
            gain = np.linalg.inv(derivative)
        except np.linalg.LinAlgError:
            break
        y = y - np.einsum("nij,nj->ni", gain, error)
        if np.all(np.abs(error) <= CLOSE * np.array(sensor.std)):
            return np.where(silent[:, None], np.nan, y), gain
    raise DataError(
        f"{sensor.name}: no reading of kind {sensor.kind} was found that belongs to the true motion; "
        f"its observation must tell one reading from another in each of its {len(quantities)} "
        f"innovations"
    )


def _innovations(sensor: Simulated, beliefs: Sequence[FilterState]) -> Callable[[Array], Array]:
    """The function from y (n, k) to the innovations (n, k) that they would be at beliefs (n,)."""
    kind = sensor.measurement
    source, innovation = new_source(first_state=STATES if kind.states else 0), np.zeros(3)
    source.parameters[: len(sensor.parameters)] = sensor.parameters
    H = np.zeros((3, STATES + len(kind.states)))
    seen, measured = FilterState(*(part.copy() for part in beliefs[0])), np.full(3, np.nan)
    observe = bind_kernel(compile_observation(kind.name), seen, measured, source, innovation, H)

    def innovations(y: Array) -> Array:
        rows = np.empty_like(y)
        for row, belief, given in zip(rows, beliefs, y):
            for part, value in zip(seen, belief):
                part[...] = value
            measured[: len(given)] = given
            observe()
            row[:] = innovation[: len(given)]
        return rows

    return innovations
