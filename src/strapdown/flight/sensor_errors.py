"""The errors of a flight's sensors before it is flown: what adds to IMU and fixes, drawn from the
sensors' own models and streams.

What does not depend on the motion (biases, noise, the receiver's noise, outages, latency) is drawn
in advance; what does (scale, misalignment, g-sensitivity, counting, full scale) is given as numbers
that the loop applies, in the order of `sensor_models.imu_errors`.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Fixes, Imu
from ..data.solution import Source, Trajectory
from ..sensor_models.barometer import KIND_OF_QUANTITY, Barometer
from ..sensor_models.errors import Triad
from ..sensor_models.gnss import Gnss, PositionPlan
from ..sensor_models.imu import ImuSpec
from ..sensor_models.streams import RandomStream
from ..typing import Array, Ints
from .flight_loop import COUNTER, DISTORTION, FULL_SCALE, IMU_ERRORS, STEP_SIZE

Outage: TypeAlias = str | Sequence[Sequence[float]] | None
"""When the receiver is cut, as a user writes it: see `outage_windows`."""
Windows: TypeAlias = tuple[tuple[float, float], ...]
"""(start, stop) of each, s; a stop at infinity is none."""


class ImuErrors(NamedTuple):
    """Errors of an IMU over a flight."""

    dtheta: Array  # (n, 3) rad: what bias and noise add to the increments
    dv: Array  # (n, 3) m/s
    numbers: Array  # see flight_loop.IMU_ERRORS
    b_a: Array  # (n, 3) m/s^2
    b_g: Array  # (n, 3) rad/s


def imu_errors(spec: ImuSpec, t: Array, dt: Array, stream: RandomStream) -> ImuErrors:
    """The ImuErrors of `spec` (ImuSpec) at samples t, dt (n,): those that `spec.corrupt` makes of the
    same stream."""
    zeros = np.zeros((len(t), 3))

    def smooth(triad: Triad) -> Triad:
        return replace(triad, quantisation=0.0, saturation=0.0)

    additive, b_a, b_g = replace(spec, gyro=smooth(spec.gyro), accel=smooth(spec.accel)).corrupt(
        Imu(t, dt, zeros, zeros), stream
    )
    own, numbers = spec.draw_constants(stream), IMU_ERRORS.zeros()
    numbers[DISTORTION] = own.distortions
    numbers[STEP_SIZE] = spec.gyro.quantisation, spec.accel.quantisation
    numbers[FULL_SCALE] = spec.gyro.saturation, spec.accel.saturation
    numbers[COUNTER] = own.left
    return ImuErrors(additive.dtheta, additive.dv, numbers, b_a, b_g)


class FixErrors(NamedTuple):
    """Sources of fixes, their values still to be measured, and the errors of each fix."""

    sources: tuple[Source, ...]
    # (m, 3) per source: metres or m/s, NED; of a barometer as flight_loop.Errors has them
    errors: tuple[Array, ...]
    delays: tuple[float, ...]  # s per source, from measuring to the stamp

    def with_those(self, others: "FixErrors") -> "FixErrors":
        """These sources and those of other FixErrors."""
        return FixErrors(
            self.sources + others.sources, self.errors + others.errors, self.delays + others.delays
        )


def fix_errors(gnss: Gnss, t: Array, stream: RandomStream, gate: float | None = None) -> FixErrors:
    """The FixErrors of a receiver (Gnss) over samples at t (n,), with its outages. Raises
    DataError."""
    t = np.r_[0.0, t]
    nowhere = Trajectory(
        t, np.zeros((len(t), 3)), np.zeros((len(t), 3)), np.tile([1.0, 0, 0, 0], (len(t), 1))
    )
    plan = gnss._replace(lever_arm=(0.0, 0.0, 0.0)).plan(nowhere, gate)
    noisy, exact = plan.fixes(stream), plan.exact()
    errors = []
    for part, with_noise, without in zip(plan.parts.values(), noisy, exact):
        error = with_noise.y - without.y
        errors.append(
            error * part.metres[slice(None) if part.keep is None else part.keep]
            if isinstance(part, PositionPlan)
            else error
        )
    lever_arm = tuple(map(float, gnss.lever_arm))
    sources = tuple(replace(a, y=np.zeros_like(a.y), parameters=lever_arm) for a in noisy)
    return FixErrors(sources, tuple(errors), (gnss.latency,) * len(errors))


def barometer_errors(
    barometer: Barometer, t: Array, height: float, stream: RandomStream
) -> FixErrors:
    """The FixErrors of a Barometer over samples at t (n,); the noise it states in m is that at
    `height` (m). Raises DataError."""
    t = np.r_[0.0, t]
    nowhere = Trajectory(
        t,
        np.tile([0.0, 0.0, height], (len(t), 1)),
        np.zeros((len(t), 3)),
        np.tile([1.0, 0, 0, 0], (len(t), 1)),
    )
    plan = replace(barometer, quantity="pressure", lever_arm=(0.0, 0.0, 0.0)).plan(nowhere)
    measured = plan.measure_with_bias(stream)[0]
    error = np.zeros((len(measured.t), 3))
    error[:, 0], error[:, 1] = measured.y[:, 0] - plan.pressure, barometer.zero
    source = replace(
        measured,
        kind=KIND_OF_QUANTITY[barometer.quantity],
        y=np.zeros_like(measured.y),
        parameters=barometer.lever_arm,
    )
    return FixErrors((source,), (error,), (0.0,))


def in_loop_order(
    fixes: Fixes, used: Sequence[Source], made: FixErrors
) -> tuple[Array, Array, Ints]:
    """(errors (m, 3), when each is measured (m,) s, order in which they are (m,)) of the sources
    that a filter uses, of the FixErrors `made`, in the order of the merged `fixes`
    (core.loop.contract.Fixes)."""
    merged, measured = np.zeros((len(fixes.t), 3)), fixes.t.copy()
    of_kind = {a.kind: (error, delay) for a, error, delay in zip(*made)}
    for s, a in enumerate(used):
        error, delay = of_kind[a.kind]
        merged[fixes.source == s] = error
        measured[fixes.source == s] -= delay
    return merged, measured, np.argsort(measured, kind="stable")


def outage_windows(outage: Outage, end: float) -> Windows:
    """((start, stop), ...) in s of "15:", "100:130,200:230" or a list of pairs; one that reaches
    the end (s) never stops.

    Raises DataError."""
    if outage is None:
        return ()
    remedy = 'write "15:" (from 15 s on), "100:130,200:230" or a list of (start, stop), s'
    try:
        if isinstance(outage, str):
            pairs = [part.split(":") for part in outage.split(",")]
            windows = [
                (float(start), float(stop) if stop.strip() else end) for start, stop in pairs
            ]
        else:
            windows = [(float(start), float(stop)) for start, stop in outage]
    except (TypeError, ValueError):
        raise DataError(f"outage is {outage!r}; {remedy}") from None
    windows.sort()
    for start, stop in windows:
        if not 0 <= start < stop or not start < end:
            raise DataError(
                f"outage {start:g}:{stop:g} s is not a window of the flight, which lasts {end:g} s; "
                f"{remedy}"
            )
    if any(later[0] < earlier[1] for earlier, later in zip(windows, windows[1:])):
        raise DataError(f"outage {outage!r}: windows overlap; {remedy}")
    return tuple((start, stop if stop < end else np.inf) for start, stop in windows)
