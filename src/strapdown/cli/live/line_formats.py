"""Samples and measurements from lines of text: JSON and CSV."""

from abc import abstractmethod
from collections.abc import Sequence
from math import nan
from typing import Any

from ...checks import DataError, brief
from ...engine.arrivals import unit_of_stamps
from ...engine.stream import Measurement, Sample
from ...fileio.file_access import json_of
from ...plugins import one_line
from ...units.time_scales import gps_from_unix
from .input_formats import Clock, Decoder

MAX_LINE = 1 << 16
"""Bytes of a line, at most."""
MAX_GAP = 1.0
"""s between two rates, at most, over which the first one gives the length of the sample."""
MANY_APART = 3
"""Number of rates in a row over MAX_GAP after which their stamps may have another unit."""
STEPPED = 0.5
"""s for which rates must come late in a row before their clock counts as one that stepped back."""
NO_CLOCK = "none"
"""Clock of an input without times: those of arrival count."""


class _Lines(Decoder):
    """Lines with a sample or a measurement each, by names as in JSON."""

    def __init__(self, clock: Clock, scale: str) -> None:
        super().__init__()
        self._clock, self._scale, self._rest = clock, scale, b""
        # s, of rates: the newest sample, and the first of those that came late in a row
        self._last = self._behind = nan
        self._apart = 0  # number of rates in a row that are too far from the ones before

    @property
    def unused(self) -> int:
        """As of Decoder."""
        return len(self._rest)

    def feed(self, piece: bytes) -> list[Sample | Measurement]:
        """As of Decoder."""
        *lines, self._rest = (self._rest + piece).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest, self.bad = b"", self.bad + 1
        found: list[Sample | Measurement] = []
        for line in lines:
            if line.strip():
                try:
                    event = self._event(self._table(line))
                    found += [event] if event is not None else []
                except (DataError, ValueError, TypeError, KeyError, OverflowError) as error:
                    self.bad += 1
                    self.why = self.why or f"{brief(line)}: {_reason(error)}"
        return found

    def end(self) -> list[Sample | Measurement]:
        """As of Decoder: an object of JSON shows whether it is whole."""
        return self.feed(b"\n") if self._rest else []

    @abstractmethod
    def _table(self, line: bytes) -> dict[str, Any]:
        """Return what a line says, by name; nothing where it is a header. Raises DataError."""

    def _event(self, table: dict[str, Any]) -> Sample | Measurement | None:
        if not table:
            return None
        if self._scale == NO_CLOCK and "source" not in table:
            raise DataError("a sample needs a time; its input cannot have the clock none")
        t = nan if self._scale == NO_CLOCK else _plain_number(table["t"])
        if self._scale in ("unix", "gps"):
            t = self._clock.of_gps(float(gps_from_unix(t)) if self._scale == "unix" else t)
        if "source" in table:
            y, std = (tuple(map(_number, table[key])) for key in ("y", "std"))
            if type(table["source"]) not in (int, str):
                raise DataError(
                    f"source is {brief(table['source'])}; it must be a name or an index"
                )
            return Measurement(t, table["source"], y, std)
        if "dtheta" in table:
            return Sample(
                t, _plain_number(table["dt"]), _three(table["dtheta"]), _three(table["dv"])
            )
        rates = [_three(table[key]) for key in ("gyro", "accel")]
        dt = _plain_number(table["dt"]) if "dt" in table else self._interval(t)
        if dt is None:  # the first one
            return None
        dtheta, dv = ((x * dt, y * dt, z * dt) for x, y, z in rates)
        return Sample(t, dt, dtheta, dv)

    def _interval(self, t: float) -> float | None:
        """Return s since the sample before, None for the first one of its clock. Raises DataError for
        one that comes late, since the one after it was integrated over its time, unless the clock
        stepped back, and for one that comes long after, whose length is unknown."""
        if t != t:
            raise DataError("a sample has no time")
        if t <= self._last:
            if not t >= self._behind:
                self._behind = t
            if t - self._behind < STEPPED:
                raise DataError("a sample of rates without dt came late")
        last, self._last, self._behind = self._last, t, nan
        if not t > last:
            return None
        if t - last <= MAX_GAP:
            self._apart = 0
            return t - last
        self._apart += 1
        text = f"{t - last:.4g} s apart"
        if self._apart == MANY_APART:
            unit = unit_of_stamps(t - last)
            self.news.append(f"samples are {text} and dropped: are their stamps in {unit}?")
        raise DataError(f"samples of rates without dt are {text}, so this one's length is unknown")


class JsonLines(_Lines):
    """A JSON object in each line, in SI and body axes forward, right, down: a sample with `t` and
    `dt`, `dtheta`, `dv`, or `gyro`, `accel`; a measurement with `t`, `source`, `y`, `std`."""

    def _table(self, line: bytes) -> dict[str, Any]:
        found: dict[str, Any] = json_of(line, "input")
        if not found:
            raise DataError("it is empty")
        return found


class CsvLines(_Lines):
    """Samples in lines of numbers with commas. The names of the columns are given, or those of the
    first line: t and dt, dtheta_x to dv_z, or gyro_x to accel_z; others are skipped."""

    def __init__(self, clock: Clock, scale: str, columns: Sequence[str]) -> None:
        super().__init__(clock, scale)
        self._names = [*columns]

    @property
    def memory(self) -> list[str]:
        """As of Decoder: the names, since a header comes once."""
        return self._names

    def resume(self, memory: Any) -> None:
        """As of Decoder."""
        self._names = [*map(str, memory)]

    def end(self) -> list[Sample | Measurement]:
        """As of Decoder: of a line without its end the last number may be cut."""
        if self._rest.strip():
            self.bad += 1
            self.why = self.why or f"{brief(self._rest)}: the last line has no end"
        self._rest = b""
        return []

    def _table(self, line: bytes) -> dict[str, Any]:
        cells = [cell.strip().strip('"') for cell in line.decode().split(",")]
        if not any(map(_is_number, cells)):
            check_columns(self._names or cells)
            self._names = self._names or cells
            return {}
        if not self._names:
            raise DataError("no line with names was before; name the columns as `columns`")
        if len(cells) != len(self._names):
            raise DataError(f"{len(cells)} cells, not {len(self._names)}")
        row = {name: float(cell) if cell else nan for name, cell in zip(self._names, cells)}
        found: dict[str, Any] = {name: row[name] for name in ("t", "dt") if name in row}
        for name in VECTORS:
            if name + "_x" in row:
                found[name] = [row[f"{name}_{axis}"] for axis in "xyz"]
        return found


VECTORS = ("dtheta", "dv", "gyro", "accel")


def check_columns(names: Sequence[str]) -> None:
    """Refuse names of columns that make no sample, or one of them twice. Raises DataError."""
    whole = [name for name in VECTORS if all(f"{name}_{axis}" in names for axis in "xyz")]
    known = [name for name in names if name]
    increments = {"dtheta", "dv"} <= {*whole} and "dt" in names
    if "t" not in names or not (increments or {"gyro", "accel"} <= {*whole}):
        raise DataError(
            f"columns are {brief(known)}; they must have t, and gyro_x to accel_z, or dt and dtheta_x to "
            "dv_z"
        )
    if len(known) > len({*known}):
        raise DataError(f"columns are {brief(known)}; each must be named once")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _reason(error: Exception) -> str:
    """Return why a line was refused."""
    if isinstance(error, KeyError):
        return f"it has no {error}"
    return str(error) if isinstance(error, DataError) else one_line(error)


def _plain_number(value: Any) -> float:
    """Return a number of JSON as a float. Raises DataError for anything else."""
    if type(value) not in (int, float):
        raise DataError(f"{brief(value)} is no number")
    return float(value)


def _number(value: Any) -> float:
    if type(value) is float:  # as nearly all are
        return value
    return nan if value is None else _plain_number(value)


def _three(values: Sequence[Any]) -> tuple[float, float, float]:
    x, y, z = map(_number, values)
    return x, y, z
