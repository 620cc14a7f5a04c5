"""Samples, measurements and sources that a stream receives. Their checks, with one-line messages,
are those of arrays and files."""

from collections.abc import Iterable, Sequence
from math import inf, isfinite, nan
from operator import index
from typing import Any, NamedTuple, NoReturn

import numpy as np

from .. import aiding
from ..checks import DataError, brief, is_number, one_line_repr
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..data.solution import Source
from ..preprocessing.attitude_record import possible_attitude
from ..preprocessing.baseline_length import KIND as BASELINE, length_errors, wrong_lengths
from ..preprocessing.fixes import possible
from ..preprocessing.imu_samples import MAX_INTERVAL
from ..preprocessing.origin import Origin
from ..units import quantities

MAX_WAITING_FIXES = 1024
"""Largest number of fixes that a stream keeps while it waits for a sample."""


MAX_TIME = 1e11
"""Largest time, s: some thousand years. Beyond it the times of samples are no longer apart."""


SECONDS = f"it must be a number of seconds, at most {MAX_TIME:g}"


class Sample(NamedTuple):
    """One IMU sample of a stream: increments over (t - dt, t], body FRD, rad and m/s.

    Attributes
    ----------
    t : float
        End of the interval, s.
    dt : float
        Length of the interval, s.
    dtheta : tuple[float, float, float]
        Rotation increment, body axes, rad.
    dv : tuple[float, float, float]
        Velocity increment, body axes, m/s.
    """

    t: float
    dt: float
    dtheta: tuple[float, float, float]
    dv: tuple[float, float, float]


class Measurement(NamedTuple):
    """One measurement of a stream.

    Attributes
    ----------
    t : float
        Time of validity, s.
    source : str or int
        Name of its source among the stream's `sources` (the kind where it has no name), or its
        index there, from 0.
    y : tuple of float
        Measured values, SI and radians; NaN where not measured.
    std : tuple of float
        Standard deviations of the rows of the innovation, SI.
    """

    t: float
    source: str | int
    y: tuple[float, ...]
    std: tuple[float, ...]


class UsableFix(NamedTuple):
    """A fix with three components, NaN for missing ones."""

    t: float
    source: int
    y: list[float]
    std: list[float]


def sample_of(saved: Sequence[Any]) -> Sample:
    """Return the Sample of these fields, as JSON has them."""
    t, dt, dtheta, dv = saved
    return Sample(float(t), float(dt), _three(dtheta), _three(dv))


def measurement_of(saved: Sequence[Any]) -> Measurement:
    """Return the Measurement of these fields, as JSON has them. Raises TypeError, ValueError or
    OverflowError."""
    t, source, y, std = saved
    if not isinstance(source, str):
        source = index(source)
    return Measurement(float(t), source, tuple(map(float, y)), tuple(map(float, std)))


def fix_of(saved: Sequence[Any]) -> UsableFix:
    """Return the UsableFix of these fields, as JSON has them."""
    t, source, y, std = saved
    return UsableFix(float(t), int(source), [*_three(y)], [*_three(std)])


def _three(values: Iterable[Any]) -> tuple[float, float, float]:
    a, b, c = map(float, values)
    return a, b, c


def refuse_event(event: object) -> NoReturn:
    """Raise DataError for an object that is neither a Sample nor a Measurement."""
    raise DataError(
        f"step is given {brief(event)}; it must be a Sample(t, dt, dtheta, dv) with increments in "
        f"rad and m/s, or a Measurement(t, source, y, std)"
    )


def refuse_sample(sample: Sample) -> NoReturn:
    """Raise DataError for a Sample with invalid fields."""
    t, dt, dtheta, dv = sample
    where = f"IMU sample at {t:.3f} s" if _is_time(t) else "IMU sample"
    for name, value in (("t", t), ("dt", dt)):
        if not _is_time(value):
            raise DataError(f"{where}: {name} is {brief(value)}; {SECONDS}")
    if dt <= 0 or dt > MAX_INTERVAL:
        raise DataError(
            f"{where}: dt is {dt:g} s; it must be above 0 and at most {MAX_INTERVAL:g}: the "
            f"seconds over which the sample was integrated{'; is it in ms?' if dt > 0 else ''}"
        )
    wrong = ("dv", dv, "m/s") if _is_vector(dtheta) else ("dtheta", dtheta, "rad")
    raise DataError(
        f"{where}: {wrong[0]} is {brief(wrong[1])}; it must be three numbers, {wrong[2]}"
    )


def unit_of_stamps(apart: float) -> str:
    """Return the unit in which stamps of an IMU may be that are so many s apart, taken as s."""
    return "ms" if apart < 1e3 else "us" if apart < 1e6 else "ns"


def _is_time(value: object) -> bool:
    """True for a number up to MAX_TIME, and for NaN and inf, which are dropped."""
    return is_number(value) and (abs(value) <= MAX_TIME or value != value or abs(value) == inf)


def _is_vector(value: object) -> bool:
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError, OverflowError):
        return False
    return array.shape == (3,) and not isinstance(value, str)


def checked_sources(sources: Sequence[Source]) -> tuple[Source, ...]:
    """Return the sources of a stream as a tuple. Raises DataError where they are not a list of
    Source."""
    if isinstance(sources, Source):
        raise DataError("sources is one Source; it must be a list of them: sources=[...]")
    if isinstance(sources, str) or not isinstance(sources, Iterable):
        raise DataError(f"sources is {brief(sources)}; it must be a list of Source, [] for none")
    sources = tuple(sources)
    for i, each in enumerate(sources):
        if not isinstance(each, Source):
            raise DataError(f"sources[{i}] is {brief(each)}; it must be a Source")
    return sources


class Sources:
    """The sources of a stream, and the rules for their fixes."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self._names = [a.name or a.kind for a in sources]
        self._places = {
            each: k for k, each in enumerate(self._names) if self._names.count(each) == 1
        }
        self._kinds = [aiding.find(a.kind) for a in sources]
        self._given = [a.parameters for a in sources]
        self._most = [[_most(q) for q in kind.quantities] for kind in self._kinds]

    def usable(self, fix: Measurement) -> UsableFix:
        """Return the fix with NaN for values that are not finite. Raises DataError for an invalid
        fix."""
        if not _is_time(fix.t):
            raise DataError(f"fix: t is {brief(fix.t)}; {SECONDS}")
        where = f"fix at {fix.t:.3f} s"
        place = self.place(fix.source, where)
        most = self._most[place]
        width = len(most)
        try:
            y, deviations = [float(value) for value in fix.y], [float(value) for value in fix.std]
        except (TypeError, ValueError, OverflowError):
            raise DataError(
                f"{where}: y is {brief(fix.y)} and std {brief(fix.std)}; each must be a tuple, "
                f"source {place} needs {width} number{'s' * (width > 1)}"
            ) from None
        if not len(y) == len(deviations) == width:
            raise DataError(
                f"{where}: y has {len(y)} and std {len(deviations)} numbers; source {place} "
                f"needs {width}"
            )
        y = [value if isfinite(value) else nan for value in y]
        for value, std, bound in zip(y, deviations, most):
            if value == value and not 0 < std < inf:
                raise DataError(
                    f"{where}: standard deviations are {one_line_repr(tuple(fix.std))}; they must be above zero"
                )
            if abs(value) > bound:
                self._refuse(place, y, where)
        padding = [nan] * (3 - width)
        return UsableFix(fix.t, place, y + padding, deviations + padding)

    def length_error(self, fix: UsableFix) -> float:
        """m by which a vector between antennas is too long or short, where that is more than its
        noise allows; else 0."""
        if self._kinds[fix.source].parameters != BASELINE:
            return 0.0
        of_fix = np.array([fix.y]), np.array([fix.std]), self._given[fix.source]
        return float(abs(length_errors(*of_fix)[0][0])) if wrong_lengths(*of_fix)[0] else 0.0

    def place(self, source: str | int, where: str) -> int:
        """Return the index of a source in the stream. Raises DataError."""
        if isinstance(source, str):
            if source in self._places:
                return self._places[source]
            many = self._names.count(source)
            remedy = f"{many} have that name: give its index" if many else self._names_text()
        elif isinstance(source, int | np.integer) and 0 <= source < len(self._names):
            return int(source)
        else:
            remedy = self._names_text()
        raise DataError(f"{where}: source is {source!r}; {remedy}")

    def _names_text(self) -> str:
        count = len(self._names)
        return f"the stream has {count}, counted from 0: {', '.join(self._names) or 'none'}"

    def _refuse(self, source: int, y: list[float], where: str) -> None:
        """Raise DataError where a component is impossible."""
        kind, origin = self._kinds[source], _OneFix(f"{where}: {self._names[source]}")
        for quantity, value in zip(kind.quantities, y):
            if quantity == "latitude" and np.pi / 2 < abs(value) <= 90:
                raise DataError(f"{origin.name}: latitude is {value:g} rad; is it in degrees?")
        if kind.name == "attitude":
            possible_attitude(np.array([y]), origin)
        else:
            possible(np.array([y]), kind.quantities, origin)


class _OneFix(Origin):
    """Origin of a single fix, which has no row."""

    def row(self, i: object) -> str:
        return self.name


def _most(quantity: str) -> float:
    """Return the largest magnitude that needs no further check."""
    if quantity == "latitude":
        return LATITUDE_LIMIT
    if quantity == "angle":
        return np.pi / 2  # of a pitch
    return 0.0 if quantity == "pressure" else quantities.REGISTRY.find(quantity).most
