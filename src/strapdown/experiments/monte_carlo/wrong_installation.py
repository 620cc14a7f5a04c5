"""Simulated recordings with unknown installation errors: the errors are drawn from standard
deviations, and the recording is set up without them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from ...checks import DataError, locate_errors
from ...core.loop.contract import InitialState
from ...data.calibration_parameters import (
    ACCEL_MISALIGNMENT,
    ACCEL_SCALE,
    CLOCK,
    DECLINATION,
    FIELD,
    GYRO_MISALIGNMENT,
    GYRO_SCALE,
    HARD_IRON,
    LEVER_ARM,
    MOUNTING,
    OF_SOURCE,
    SCALE,
    SOFT_IRON,
    CalibrationParameter,
    prior,
)
from ...data.recording import Recording
from ...data.solution import Source, Trajectory
from ...engine.installation import Prior, StateParameter, parameters, with_estimates
from ...geometry.rotations import Rotation
from ...preprocessing.rotated_imu import with_the_imu
from ...sensor_models.streams import RandomStream, SeedLike
from ...typing import Array
from ..filter_label import check_parameter

Installation: TypeAlias = Mapping[str, Prior]
"""{parameter: standard deviation, SI, one or one per component; None for that of
`calibration_parameters`}."""


class Installed(NamedTuple):
    """A recording with installation errors, and these errors."""

    recording: Recording  # its reference and its true biases are those of the axes as described
    parameters: tuple[StateParameter, ...]
    error: Array  # (m,) true - given, SI

    @property
    def true(self) -> dict[str, float]:
        """{column of a Solution: true value in its unit}, as `nees_of` takes it."""
        return {p.name: float(e * p.of.factor) for p, e in zip(self.parameters, self.error)}


def check_installation(installation: object) -> dict[str, tuple[float, ...]]:
    """An Installation with a standard deviation for each component. Raises DataError."""
    if not isinstance(installation, Mapping):
        raise DataError(
            f"installation is {installation!r}; it must be {{name: standard deviation}}, such as "
            f"{{'clock': 0.1}}"
        )
    found = {}
    for name, given in installation.items():
        with locate_errors("installation"):
            found[name] = prior(check_parameter(name), given)
    return found


def parameters_of(recording: Recording, installation: Installation) -> tuple[StateParameter, ...]:
    """The parameters that `estimate=installation` makes states of. Raises DataError."""
    wanted = with_estimates(recording, installation)
    return tuple(parameters(wanted.sources, wanted.meta.get("estimate", {})))


def draw_installation(
    recording: Recording, installation: Installation, seed: SeedLike
) -> Installed:
    """Return the recording with an error of each parameter, drawn from its standard deviation.
    Raises DataError."""
    found = parameters_of(recording, installation)
    return installed_wrong(
        recording,
        found,
        np.array([each.std for each in found]) * RandomStream.of(seed).standard_normal(len(found)),
    )


def installed_wrong(
    recording: Recording, found: Sequence[StateParameter], error: Array
) -> Installed:
    """Return the recording with parameter errors `error` (m,), true - given, SI.

    Parameters of sources change these sources. A mounting and errors of the IMU's axes change its
    samples; the true attitude and biases are then in its own axes.
    """
    sources = list(recording.sources)
    vectors: dict[str, Array] = {}
    of_sources: dict[tuple[int, str], Array] = {}
    for parameter, value in zip(found, error):
        of = parameter.of
        zero = np.zeros(len(of.components))
        if of.name in OF_SOURCE:
            for i in parameter.sources:
                of_sources.setdefault((i, of.name), zero)[parameter.component] = value
        else:
            vectors.setdefault(of.name, zero)[parameter.component] = value
    for name, make_wrong in GIVEN_WRONG.items():
        for i, a in enumerate(sources):
            if (i, name) in of_sources:
                sources[i] = make_wrong(a, of_sources[i, name])
    start, stop = recording.span
    changed = replace(recording, sources=tuple(a.between(start, stop + 1e-9) for a in sources))
    return Installed(_samples_wrong(changed, vectors), tuple(found), np.asarray(error, float))


def start_of(installed: Installed, start: InitialState) -> InitialState:
    """An InitialState of the right recording, with the same error, in the axes as described."""
    turn = np.zeros(3)
    for parameter, value in zip(installed.parameters, installed.error):
        if parameter.of is MOUNTING:
            turn[parameter.component] = value
    if not turn.any():
        return start
    own = Rotation.from_rotvec(turn)
    roll, pitch, heading = (Rotation.from_rph(start.rph) * own).as_rph()
    b_a, b_g = (own.inv().apply(bias) for bias in (start.b_a, start.b_g))
    return start._replace(
        rph=(float(roll), float(pitch), float(heading % (2 * np.pi))),
        b_a=tuple(map(float, b_a)),
        b_g=tuple(map(float, b_g)),
    )


def _vector_wrong(a: Source, error: Array) -> Source:
    """A source whose lever arm, or whose field's model, is less by the error."""
    given = np.array([*a.parameters, 0.0, 0.0, 0.0][:3]) - error
    return replace(a, parameters=tuple(given.tolist()))


def _declination_wrong(a: Source, error: Array) -> Source:
    field = Rotation.from_rotvec([0.0, 0.0, -error[0]]).apply(np.array(a.parameters[:3]))
    return replace(a, parameters=tuple(field.tolist()))


def _soft_iron_wrong(a: Source, error: Array) -> Source:
    """A magnetometer with a soft iron (6,)."""
    made = np.eye(3)
    for pair, value in zip(SOFT_IRON.components, error):
        i, j = ("xyz".index(letter) for letter in pair)
        made[i, j] = made[j, i] = float(i == j) + value
    return replace(a, y=a.y @ made)


GIVEN_WRONG: dict[str, Callable[[Source, Array], Source]] = {
    CLOCK.name: lambda a, error: replace(a, t=a.t - error[0]),
    LEVER_ARM.name: _vector_wrong,
    SCALE.name: lambda a, error: replace(a, y=a.y * (1 + error[0])),
    SOFT_IRON.name: _soft_iron_wrong,
    HARD_IRON.name: lambda a, error: replace(a, y=a.y + error),
    FIELD.name: _vector_wrong,
    DECLINATION.name: _declination_wrong,
}
"""{parameter: what its errors (components,), true - given, make of a source that was right}, in the order in
which they come about."""


def _samples_wrong(recording: Recording, vectors: Mapping[str, Array]) -> Recording:
    """The recording with samples as an IMU gives them whose axes are off by these errors."""
    imu, reference = recording.imu, recording.reference
    sources = recording.sources
    back = Rotation.from_rotvec(-vectors[MOUNTING.name]) if MOUNTING.name in vectors else None
    rates, forces = imu.dtheta, imu.dv
    if back is not None:
        rates, forces = back.apply(rates), back.apply(forces)
        if "b_a" in recording.meta:
            b_a, b_g = recording.meta["b_a"], recording.meta["b_g"]
            recording = recording.with_meta(b_a=back.apply(b_a), b_g=back.apply(b_g))
        reference = _rotate_reference(reference, back.inv())
        sources = tuple(with_the_imu(a, back) for a in sources)
    gyro = _triad(vectors, GYRO_SCALE, GYRO_MISALIGNMENT)
    accel = _triad(vectors, ACCEL_SCALE, ACCEL_MISALIGNMENT)
    return replace(
        recording,
        imu=imu._replace(dtheta=rates @ gyro.T, dv=forces @ accel.T),
        reference=reference,
        sources=sources,
    )


def _rotate_reference(reference: Trajectory | None, turn: Rotation) -> Trajectory | None:
    """The reference with the attitude of axes from which `turn` leads to its own."""
    if reference is None or reference.q_nb is None:
        return reference
    own = Rotation.from_wxyz(reference.q_nb) * turn
    return replace(reference, q_nb=own.as_wxyz())


def _triad(
    vectors: Mapping[str, Array], scale: CalibrationParameter, misalignment: CalibrationParameter
) -> Array:
    """(3, 3) from the true rates or forces to those of sensors with these errors."""
    made = np.eye(3)
    if scale.name in vectors:
        made += np.diag(vectors[scale.name])
    if misalignment.name in vectors:
        for pair, value in zip(misalignment.components, vectors[misalignment.name]):
            made["xyz".index(pair[0]), "xyz".index(pair[1])] += value
    return made
