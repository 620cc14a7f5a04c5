"""Functions of time that make up motions. Each takes real times, or complex times with a negligible
imaginary part.

The complex step only needs a function's slope: value and slope are computed in real arithmetic,
many times faster than with complex functions.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..typing import Array, ArrayLike

Times: TypeAlias = NDArray[np.inexact[Any]]
"""Times, s, real or complex, or values of a function of them."""
Numbers: TypeAlias = float | Times

_REACH = 20.0  # widths from a kink at which its rounding falls below 1e-17


def lift_complex(
    function: Callable[[Array], Numbers], slope: Callable[[Array], Numbers]
) -> Callable[[Numbers], Numbers]:
    """Return the function of complex times with this real `function` and its derivative `slope`."""

    def of(z: Numbers) -> Numbers:
        t: NDArray[Any] = np.asarray(z)
        return (
            function(t.real) + 1j * (t.imag * slope(t.real)) if np.iscomplexobj(t) else function(t)
        )

    return of


sine, cosine = lift_complex(np.sin, np.cos), lift_complex(np.cos, lambda x: -np.sin(x))
arctangent = lift_complex(np.arctan, lambda x: 1 / (1 + x * x))
root = lift_complex(np.sqrt, lambda x: 0.5 / np.sqrt(x))


def waves(t: Numbers, terms: Iterable[tuple[float, float, float]]) -> Numbers:
    """Sum of amplitude * sin(2 pi t / period + phase) over `terms` (amplitude, period s, phase
    rad)."""
    return sum(
        amplitude * sine(t * (2 * np.pi / period) + phase) for amplitude, period, phase in terms
    )


class MotionProfile(NamedTuple):
    """A piecewise linear function of time with rounded kinks: the integral of a sum of
    `trajectory.ramp`s.

    At a kink of width w, the slope goes from 12 % to 88 % of its change within 2 w; far from it the
    function equals the lines.
    """

    value: float  # at t = 0 of the first line
    slopes: Array  # (k + 1,) of the lines, per s
    at: Array  # (k,) times of the kinks, s, increasing
    widths: Array  # (k,) s

    @classmethod
    def of(
        cls, value: float, durations: ArrayLike, slopes: ArrayLike, smoothing: float
    ) -> "MotionProfile":
        """Return consecutive lines with these durations (s) and slopes, the last one unlimited;
        widths are at most `smoothing` and a fifth of a line."""
        durations, slopes = np.asarray(durations, float), np.asarray(slopes, float)
        at = np.cumsum(durations)[:-1]
        widths = np.minimum(smoothing, 0.2 * np.minimum(durations[:-1], durations[1:]))
        bends = np.diff(slopes) != 0
        return cls(float(value), slopes[np.r_[True, bends]], at[bends], widths[bends])

    def __call__(self, t: Numbers) -> Numbers:
        """The value."""
        return self._at(t)[0]

    def rate(self, t: Numbers) -> Numbers:
        """The slope, per s."""
        return self._at(t)[1]

    def _at(self, t: Numbers) -> tuple[Times, Times]:
        """(value, slope), complex where t is."""
        t = np.asarray(t)
        x = np.ravel(t.real)
        order = None if np.all(x[1:] >= x[:-1]) else np.argsort(x, kind="stable")
        parts = self._real(x if order is None else x[order], np.iscomplexobj(t))
        if order is not None:
            back = np.argsort(order, kind="stable")
            parts = [part[back] for part in parts]
        value, slope, *bend = (part.reshape(t.shape) for part in parts)
        return (
            (value + 1j * (t.imag * slope), slope + 1j * (t.imag * bend[0]))
            if bend
            else (value, slope)
        )

    def _real(self, x: Array, bent: bool) -> list[Array]:
        """Value, slope and, where `bent`, second derivative at increasing times x (n,)."""
        parts = [np.empty(len(x)), np.empty(len(x)), *([np.zeros(len(x))] if bent else [])]
        begin, level = 0.0, self.value
        rows = np.r_[0, np.searchsorted(x, self.at), len(x)]
        for slope, first, last, at in zip(self.slopes, rows, rows[1:], np.r_[self.at, 0.0]):
            parts[0][first:last] = level + slope * (x[first:last] - begin)
            parts[1][first:last] = slope
            level, begin = level + slope * (at - begin), at
        for at, width, jump in zip(self.at, self.widths, np.diff(self.slopes)):
            near = slice(*np.searchsorted(x, [at - _REACH * width, at + _REACH * width]))
            d = (x[near] - at) / width
            e = np.exp(-2 * np.abs(d))
            parts[0][near] += (0.5 * jump * width) * np.log1p(e)
            parts[1][near] += np.where(d >= 0, -jump, jump) * (e / (1 + e))
            if bent:
                parts[2][near] += (2 * jump / width) * e / (1 + e) ** 2
        return parts
