"""Small deviations from steady flight: the linear model about a trim, its natural modes, and the
longest time step."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import combinations
from typing import TypeAlias

import numpy as np

from ...checks import DataError, check_number
from ...core.compile.records import rows
from ...core.mathematics.rotation import euler_terms
from ...data.value import Value
from ...typing import Array, File
from .dynamics import CONTROLS, LLA, OMEGA, QUATERNION, STATE, VELOCITY, Loads, evaluate
from .parameters import Aircraft, Parameters, aircraft as find
from .trim import Trim, quaternion

MODEL_STATES = ("u", "v", "w", "p", "q", "r", "roll", "pitch")
"""States of the linear model: velocity against the air (m/s) and rates (rad/s) in body axes, Euler
angles (rad)."""
MODEL_INPUTS = ("elevator", "aileron", "rudder", "throttle")
_LONGITUDINAL, _LATERAL = [0, 2, 4, 7], [1, 3, 5, 6]
_RESOLVED = 0.5
Eigenvalues: TypeAlias = Iterable[complex]


@dataclass(frozen=True)
class Mode:
    """One natural mode: its name and its eigenvalue or conjugate pair (1/s)."""

    name: str
    eigenvalues: tuple[complex, ...]

    @property
    def frequency(self) -> float:
        """|eigenvalue|, rad/s."""
        return abs(self.eigenvalues[0])

    @property
    def damping(self) -> float:
        """Damping ratio, negative where the mode grows; 0 where it stays as it is (eigenvalue
        0)."""
        return -self.eigenvalues[0].real / self.frequency if self.frequency > 0 else 0.0

    @property
    def time_constant(self) -> float:
        """s to fall to 1/e, negative where the mode grows, infinite where it does neither."""
        return -1 / self.eigenvalues[0].real if self.eigenvalues[0].real != 0 else math.inf


@dataclass(frozen=True, eq=False)
class Modes(Value):
    """The linear model x' = A x + B c of deviations from a trim (MODEL_STATES, MODEL_INPUTS) and
    its natural modes, fastest first."""

    A: Array = field(repr=False)
    B: Array = field(repr=False)
    modes: tuple[Mode, ...]

    def __getitem__(self, name: str) -> Mode:
        """A mode by name. Raises DataError for one that this flight has not."""
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise DataError(f"no mode {name!r}; modes: {', '.join(mode.name for mode in self.modes)}")

    def table(self) -> list[dict[str, str | float]]:
        """Rows {"mode": ..., "frequency, rad/s": ..., "damping": ..., "time constant, s": ...}."""
        return [
            {
                "mode": mode.name,
                "frequency, rad/s": mode.frequency,
                "damping": mode.damping,
                "time constant, s": mode.time_constant,
            }
            for mode in self.modes
        ]


def linearise(aircraft: Aircraft | File, trim: Trim) -> Modes:
    """Return the linear model about a steady flight, and its natural modes.

    It is made by central differences of the whole model with calm air and a flat Earth; actuators are
    not in it. In a steep turn, where motions along and across the plane of symmetry mix, each mode has
    the name of the one it is most like.

    Parameters
    ----------
    aircraft : str, path or Aircraft
        The aircraft, its name or its file.
    trim : Trim
        As `trim` gives it.

    Returns
    -------
    Modes
        A and B of x' = A x + B c, and the modes, fastest first.

    Raises
    ------
    DataError
        Where the trim is none.

    References
    ----------
    Beard & McLain (2012), "Small Unmanned Aircraft", chapter 5.

    Examples
    --------
    >>> import strapdown as sd
    >>> modes = sd.flight.linearise("aerosonde", sd.flight.trim("aerosonde", 25.0))
    >>> modes.A.shape, modes.B.shape
    ((8, 8), (8, 4))
    """
    aircraft, trim = find(aircraft), _check_trim(trim)
    parameters = aircraft.parameters("flat", trim.origin)
    x0, c0 = deviation_point(trim)

    def f(x: Array, c: Array) -> Array:
        return _rates(parameters, trim.origin, x, c)

    A = np.stack([(f(x0 + h, c0) - f(x0 - h, c0)) / 2e-4 for h in 1e-4 * np.eye(8)], axis=1)
    B = np.stack([(f(x0, c0 + h) - f(x0, c0 - h)) / 2e-4 for h in 1e-4 * np.eye(4)], axis=1)
    return Modes(A, B, _name_modes(A))


def deviation_point(trim: Trim) -> tuple[Array, Array]:
    """The eight numbers of the linear model (MODEL_STATES) and the controls at a Trim, about
    which it is taken."""
    V, alpha, roll, pitch = trim.airspeed, trim.alpha, trim.roll, trim.pitch
    rates = trim.turn_rate * np.array(
        [-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)]
    )
    return np.array(
        [V * math.cos(alpha), 0.0, V * math.sin(alpha), *rates, roll, pitch]
    ), trim.commands.copy()


def check_step(trim: Trim, dt: float) -> None:
    """Refuse a time step dt (s) too long for the fastest mode about a Trim: controls and gusts
    are held over it. Raises DataError naming the longest."""
    check_number(dt, "time step of the aircraft", "s", above=0)
    fastest = max(abs(np.linalg.eigvals(linearise(_check_trim(trim).aircraft, trim).A)))
    if dt > _RESOLVED / fastest:
        raise DataError(
            f"a time step of {dt:g} s is too long for aircraft {trim.aircraft.name!r} at "
            f"{trim.airspeed:g} m/s, whose fastest mode has a "
            f"time constant of {1 / fastest:.3g} s; take {_RESOLVED / fastest:.3g} s at most"
        )


def _check_trim(trim: Trim) -> Trim:
    """It, if it is a Trim. Raises DataError."""
    if not isinstance(trim, Trim):
        raise DataError(f"{trim!r} is no Trim; the function trim makes one")
    return trim


def _rates(
    parameters: Parameters, origin: tuple[float, float, float], x: Array, controls: Array
) -> Array:
    """x' of the eight numbers, from the compiled model, on the flat Earth and heading north."""
    velocity, omega, (roll, pitch) = x[0:3], x[3:6], x[6:8]
    state, rates = STATE.zeros(), np.zeros(19)
    C = np.reshape(euler_terms(roll, pitch, 0.0), (3, 3))
    state[LLA], state[VELOCITY], state[QUATERNION] = (
        origin,
        C @ velocity,
        quaternion(roll, pitch, 0.0),
    )
    state[OMEGA], state[CONTROLS] = omega, controls
    evaluate(parameters, state, np.zeros(9), rates, rows(Loads, 1)[0])
    p, q, r = omega
    across = q * math.sin(roll) + r * math.cos(roll)
    return np.r_[
        C.T @ rates[3:6] - np.cross(omega, velocity),
        rates[10:13],
        p + across * math.tan(pitch),
        q * math.cos(roll) - r * math.sin(roll),
    ]


def _name_modes(A: Array) -> tuple[Mode, ...]:
    """The modes of an 8 x 8 system: the four eigenvalues that move it most along its plane of
    symmetry, and the four that move it across.

    Half a conjugate pair is no mode: of all ways to choose four eigenvalues in whole pairs, the one
    that moves it most along.
    """
    values, vectors = np.linalg.eig(A)
    # m/s beside rad: which modes are symmetric does not depend on it
    scale = np.array([25.0, 25.0, 25.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    weight = np.abs(vectors / scale[:, None]) ** 2
    along = weight[_LONGITUDINAL].sum(0) / weight.sum(0)
    # LAPACK puts a pair side by side, + first
    wholes = [(i, i + 1) if values[i].imag > 0 else (i,) for i in range(8) if values[i].imag >= 0]
    fours = [
        sum(chosen, ())
        for count in (2, 3, 4)
        for chosen in combinations(wholes, count)
        if sum(map(len, chosen)) == 4
    ]
    chosen = list(max(fours, key=lambda four: along[list(four)].sum()))
    others = [i for i in range(8) if i not in chosen]
    return tuple(
        sorted(
            [*_along(values[chosen]), *_across(values[others])], key=lambda mode: -mode.frequency
        )
    )


def _split_eigenvalues(values: Eigenvalues) -> tuple[list[complex], list[complex]]:
    """Eigenvalues with their conjugates -> (those of pairs, one pair after the other; the real
    ones); each from fast to slow."""
    turning = sorted(
        (value for value in values if value.imag != 0),
        key=lambda value: (-abs(value), abs(value.imag), value.imag),
    )
    return turning, sorted(
        (value for value in values if value.imag == 0), key=lambda value: -abs(value)
    )


def _along(values: Eigenvalues) -> list[Mode]:
    """Short period and phugoid of four eigenvalues."""
    turning, straight = _split_eigenvalues(values)
    twos = [
        *(turning[i : i + 2] for i in range(0, len(turning), 2)),
        *(straight[i : i + 2] for i in range(0, len(straight), 2)),
    ]
    fast, slow = sorted(twos, key=lambda two: -abs(two[0] * two[1]))
    return [*_modes("short period", fast), *_modes("phugoid", slow)]


def _across(values: Eigenvalues) -> list[Mode]:
    """Roll, Dutch roll and spiral of four eigenvalues."""
    turning, straight = _split_eigenvalues(values)
    if len(turning) == 2:
        return [
            *_modes("Dutch roll", turning),
            *_modes("roll", straight[:1]),
            *_modes("spiral", straight[1:]),
        ]
    if len(turning) == 4:
        return [*_modes("Dutch roll", turning[:2]), *_modes("roll and spiral", turning[2:])]
    return [
        *_modes("roll", straight[:1]),
        *_modes("Dutch roll", straight[1:3]),
        *_modes("spiral", straight[3:]),
    ]


def _modes(name: str, values: Eigenvalues) -> list[Mode]:
    """One Mode of a conjugate pair or of a single eigenvalue; two of two real ones."""
    values = [complex(value) for value in values]
    if len(values) == 1 or values[0].imag != 0:
        return [Mode(name, tuple(sorted(values, key=lambda value: -value.imag)))]
    return [
        Mode(f"{name} {number}", (value,))
        for number, value in enumerate(sorted(values, key=lambda value: -abs(value)), 1)
    ]
