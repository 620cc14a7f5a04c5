"""Samples, measurements and sources that a stream receives, and the checks on them: the same as for
arrays and files, in one line."""

from collections.abc import Iterable, Sequence
from math import inf, isfinite, nan
from typing import NamedTuple, NoReturn

import numpy as np

from .. import aiding
from ..checks import DataError, brief, is_number, one_line_repr
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..data.solution import Aiding
from ..preprocessing.attitude_record import possible_attitude
from ..preprocessing.fixes import possible
from ..preprocessing.imu_samples import MAX_INTERVAL
from ..preprocessing.origin import Origin
from ..units import quantities

MAX_WAITING_FIXES = 1024
"""Fixes that a stream holds while it waits for a sample."""


class Sample(NamedTuple):
    """One IMU sample of a stream: increments over (t - dt, t], body FRD, rad and m/s."""

    t: float
    dt: float
    dtheta: tuple[float, float, float]
    dv: tuple[float, float, float]


class Fix(NamedTuple):
    """One fix of a stream. `source` is the place of its source among the stream's `aidings`; y
    and sd as in Aiding, NaN where not measured."""

    t: float
    source: int
    y: tuple[float, ...]
    sd: tuple[float, ...]


class UsableFix(NamedTuple):
    """A fix with three components, NaN where there is none."""

    t: float
    source: int
    y: list[float]
    sd: list[float]


def refuse_event(event: object) -> NoReturn:
    """Raise DataError for what is neither a Sample nor a Fix."""
    raise DataError(
        f"step is given {brief(event)}; it must be a Sample(t, dt, dtheta, dv) with increments in "
        f"rad and m/s, or a Fix(t, source, y, sd)"
    )


def refuse_sample(sample: Sample) -> NoReturn:
    """Raise DataError for a Sample whose parts are not the numbers that they should be."""
    t, dt, dtheta, dv = sample
    where = f"IMU sample at {t:.3f} s" if is_number(t) else "IMU sample"
    for name, value in (("t", t), ("dt", dt)):
        if not is_number(value):
            raise DataError(f"{where}: {name} is {brief(value)}; it must be a number of seconds")
    if dt <= 0 or dt > MAX_INTERVAL:
        raise DataError(
            f"{where}: dt is {dt:g} s; it must be above 0 and at most {MAX_INTERVAL:g}: the "
            f"seconds over which the sample was summed up{'; is it in ms?' if dt > 0 else ''}"
        )
    wrong = ("dv", dv, "m/s") if _is_vector(dtheta) else ("dtheta", dtheta, "rad")
    raise DataError(
        f"{where}: {wrong[0]} is {brief(wrong[1])}; it must be three numbers, {wrong[2]}"
    )


def _is_vector(value: object) -> bool:
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        return False
    return array.shape == (3,) and not isinstance(value, str)


def checked_aidings(aidings: Sequence[Aiding]) -> tuple[Aiding, ...]:
    """Return the sources of a stream as a tuple. Raises DataError where they are not a list of
    Aiding."""
    if isinstance(aidings, Aiding):
        raise DataError("aidings is one Aiding; it must be a list of them: aidings=[...]")
    if isinstance(aidings, str) or not isinstance(aidings, Iterable):
        raise DataError(f"aidings is {brief(aidings)}; it must be a list of Aiding, [] for none")
    aidings = tuple(aidings)
    for i, each in enumerate(aidings):
        if not isinstance(each, Aiding):
            raise DataError(f"aidings[{i}] is {brief(each)}; it must be an Aiding")
    return aidings


class Sources:
    """The sources of a stream, and what a fix of each must be."""

    def __init__(self, aidings: Sequence[Aiding]) -> None:
        self._names = [a.name or a.kind for a in aidings]
        self._kinds = [aiding.find(a.kind) for a in aidings]
        self._most = [[_most(q) for q in kind.quantities] for kind in self._kinds]

    def usable(self, fix: Fix) -> UsableFix:
        """The fix with NaN for what is not finite. Raises DataError for what no source
        delivers."""
        if not is_number(fix.t):
            raise DataError(f"fix: t is {brief(fix.t)}; it must be a number of seconds")
        count, where = len(self._names), f"fix at {fix.t:.3f} s"
        if not (isinstance(fix.source, (int, np.integer)) and 0 <= fix.source < count):
            raise DataError(
                f"{where}: source is {fix.source!r}; the stream has {count}, counted from 0"
            )
        most = self._most[fix.source]
        width = len(most)
        try:
            y, deviations = [float(value) for value in fix.y], [float(value) for value in fix.sd]
        except (TypeError, ValueError):
            raise DataError(
                f"{where}: y is {brief(fix.y)} and sd {brief(fix.sd)}; each must be a tuple, "
                f"source {fix.source} needs {width} number{'s' * (width > 1)}"
            ) from None
        if not len(y) == len(deviations) == width:
            raise DataError(
                f"{where}: y has {len(y)} and sd {len(deviations)} numbers; source {fix.source} "
                f"needs {width}"
            )
        y = [value if isfinite(value) else nan for value in y]
        for value, sd, bound in zip(y, deviations, most):
            if value == value and not 0 < sd < inf:
                raise DataError(
                    f"{where}: standard deviations are {one_line_repr(tuple(fix.sd))}; they must be above zero"
                )
            if abs(value) > bound:
                self._refuse(fix.source, y, where)
        padding = [nan] * (3 - width)
        return UsableFix(fix.t, int(fix.source), y + padding, deviations + padding)

    def _refuse(self, source: int, y: list[float], where: str) -> None:
        """Raise DataError where a component is beyond what it can be."""
        kind, origin = self._kinds[source], _OneFix(f"{where}: {self._names[source]}")
        for quantity, value in zip(kind.quantities, y):
            if quantity == "latitude" and np.pi / 2 < abs(value) <= 90:
                raise DataError(f"{origin.name}: latitude is {value:g} rad; is it in degrees?")
        if kind.name == "attitude":
            possible_attitude(np.array([y]), origin)
        else:
            possible(np.array([y]), kind.quantities, origin)


class _OneFix(Origin):
    """A fix alone, which has no row."""

    def row(self, i: object) -> str:
        return self.name


def _most(quantity: str) -> float:
    """Largest magnitude that needs no second look."""
    if quantity == "latitude":
        return LATITUDE_LIMIT
    if quantity == "angle":
        return np.pi / 2  # of a pitch
    return 0.0 if quantity == "pressure" else quantities.REGISTRY.find(quantity).most
