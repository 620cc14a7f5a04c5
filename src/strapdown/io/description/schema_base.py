"""Building blocks of the sections of `recording.toml`: columns, units, times and signals, and parts
that refuse unknown keys."""

import datetime
import math
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ...checks import check_keys, check_number, is_number
from ...units.conversion import factor, quantity
from ..tables.calendar_text import Pattern, patterns

Found = TypeVar("Found")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]


def column(value: Any) -> str | int:
    """Return the name or number of a column unchanged. Raises ValueError for other values."""
    is_number = isinstance(value, int) and not isinstance(value, bool) and value >= 1
    if not is_number and not (isinstance(value, str) and value):
        raise ValueError(
            f"{value!r} is not a column: give its name, or its number in a file without a header, where "
            f"the first is 1"
        )
    return value


Column = Annotated[Any, AfterValidator(column)]
Columns = Annotated[list[Column], Field(min_length=3, max_length=3)]


MISSING: Any = None
"""The unit where a description gives none."""
Unit = Field(validate_default=True)  # a missing unit is refused too
AngleUnit = Annotated[float, Unit, BeforeValidator(partial(factor, of="angle"))]
"""Fields whose value is the factor of the unit in the description."""


class KeyPart(BaseModel):
    """Base of all parts: it refuses unknown keys and numbers in text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


def _day(value: Any) -> Any:
    """A column, or the one day that a `date` gives, as datetime.date."""
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        return value
    try:
        return datetime.date.fromisoformat(value)
    except (TypeError, ValueError):
        return value if value is None else column(value)


class KeyCondition(KeyPart):
    """where: only those rows count whose `column` is at least `least`, at most `most`, one of
    `equals` (numbers or texts), not the number `unequal`, or, with `changes`, different from the
    row before."""

    column: Column
    least: Finite | None = None
    most: Finite | None = None
    equals: Any = None
    unequal: Finite | None = None
    changes: bool = False

    @property
    def values(self) -> list[Any]:
        """Values that the column may equal."""
        return self.equals if isinstance(self.equals, list) else [self.equals]

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        refuse(
            (
                self.least is None
                and self.most is None
                and self.equals is None
                and self.unequal is None
                and not self.changes,
                "least, most, equals, unequal or changes is missing: choose the rows that count, as "
                '{ column = "fix", least = 3 } or { column = "status", equals = ["A", "D"] }',
            ),
            (
                self.equals is not None
                and not all(is_number(each) or isinstance(each, str) for each in self.values),
                f"equals: {self.equals!r} is not a number, a text or a list of these",
            ),
        )
        return self

    def __str__(self) -> str:
        rules = (
            "" if self.least is None else f">= {self.least:g}",
            "" if self.most is None else f"<= {self.most:g}",
            "" if self.equals is None else f"in {', '.join(map(str, self.values))}",
            "" if self.unequal is None else f"other than {self.unequal:g}",
            "that changes" if self.changes else "",
        )
        return f"{self.column} {' and '.join(filter(None, rules))}"


def _conditions(value: Any) -> Any:
    """Return one condition as a list of one."""
    return [value] if isinstance(value, dict) else value


Where = Annotated[list[KeyCondition], BeforeValidator(_conditions)]
"""Conditions; a row counts where all hold."""


class Time(KeyPart):
    """time, as numbers or as calendar text.

    Numbers: t = column * scale * unit + offset, s. With `clock` they are on an absolute clock,
    counted from the epoch of the recording: "gps", seconds since the zero of GPS time or of the
    week in the column or number `week`, or "unix", POSIX seconds.

    Text: `format` is "iso" or a pattern of strptime. With `date`, a column or one day (that of the
    first row), the column is the time of day, and `format` is that of both with a blank between.
    The times are UTC, or GPS time by `clock`.
    """

    column: Column
    format: str | None = None
    date: Annotated[Any, AfterValidator(_day)] = None
    unit: Annotated[float, Unit] = MISSING
    scale: Finite = 1.0
    offset: Finite = 0.0
    clock: Literal["gps", "unix"] | None = None
    week: Any = None

    @property
    def patterns(self) -> tuple[Pattern | None, Pattern]:
        """(Pattern of `date` where that is a column, Pattern of `column`), where there is a
        format."""
        assert self.format is not None
        is_day = isinstance(self.date, datetime.date)
        return patterns(self.format, "day" if is_day else "" if self.date is None else "column")

    @property
    def absolute(self) -> str | None:
        """The absolute clock of the times, one of `time_scales.CLOCKS`; None for other clocks."""
        if self.format is None:
            return self.clock
        return self.clock or "unix" if self.date is not None or self.patterns[1].dated else None

    @field_validator("unit", mode="before")
    @classmethod
    def _factor(cls, unit: Any, info: ValidationInfo) -> float:
        if info.data.get("format") is None:
            return factor(unit, "time")
        refuse((unit is not MISSING, "a calendar time has no unit; leave it out"))
        return 1.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.format is not None:
            call_with_key("format", lambda: self.patterns)
        refuse(
            (
                self.week is not None and (self.clock != "gps" or self.format is not None),
                'week: only clock = "gps" takes it; the column then counts from the beginning of that week',
            ),
            (
                self.format is not None and self.scale != 1.0,
                "scale: a calendar time has none; leave it out",
            ),
            (
                self.date is not None and self.format is None,
                'date: it goes with a time of day; give the format of both, as format = "iso"',
            ),
            (
                self.date is not None and self.format is not None and self.patterns[1].dated,
                "date: the column has its own date; leave one of them out",
            ),
            (
                self.format is not None and self.clock is not None and self.absolute is None,
                "clock: a time of day needs a `date` to be on a clock",
            ),
        )
        if self.week is not None:
            call_with_key("week", column, self.week)
        return self


class Signal(KeyPart):
    """Three columns with one unit; `scale` is the size of a count in that unit. Table and time are
    those of the section unless given here."""

    columns: Columns
    unit: str | None = None
    scale: Finite = 1.0
    file: str | None = None
    table: str | None = None
    time: Time | None = None


def call_with_key(key: str, function: Callable[..., Found], *arguments: Any) -> Found:
    """Return the function's result; a ValueError gets `key` at its beginning."""
    try:
        return function(*arguments)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def refuse(*rules: tuple[object, str]) -> None:
    """Raise ValueError with the text of the first broken rule; a rule is (True if broken, text)."""
    for wrong, text in rules:
        if wrong:
            raise ValueError(text)


# ---- values that are tables


def _field(value: Any) -> str | tuple[float, ...]:
    """ "record", or north, east, down in T."""
    if value == "record":
        return "record"
    example = '{ north = 17.6, east = 0.1, down = 52.8, unit = "uT" }'
    axes = ("north", "east", "down")
    if (
        not isinstance(value, dict)
        or set(value) != {*axes, "unit"}
        or not all(is_number(value[key]) for key in axes)
    ):
        raise ValueError(
            f'give {example}, or "record" for the strengths in the record, or leave it out for the '
            f"geomagnetic model"
        )
    north, east, down = (value[key] * factor(value["unit"], "magnetic field") for key in axes)
    strength = math.hypot(north, east, down)
    refuse(
        (
            not 1e-6 <= strength <= 100e-6,
            f"its strength is {strength * 1e6:.4g} uT, but the Earth's is 22 to 67 uT; check the unit",
        ),
        (
            math.hypot(north, east) < 1e-3 * strength,
            "it has no horizontal part and so gives no heading; give north and east, or leave it "
            "out for the geomagnetic model",
        ),
    )
    return north, east, down


EarthField = Annotated[Any, AfterValidator(_field)]


class Declination(KeyPart):
    """declination of a field from the record: magnetic from true north, positive east."""

    value: Finite
    unit: AngleUnit = MISSING

    @property
    def angle(self) -> float:
        """rad."""
        return self.value * self.unit


class SeparationKeys(NamedTuple):
    """geoid: the height of the geoid above the ellipsoid in m, column * size or value."""

    value: float = 0.0
    column: str | int | None = None
    size: float = 1.0


def _geoid(value: Any) -> Literal["EGM96"] | SeparationKeys:
    """ "EGM96", or the separation in a column or as one number."""
    if value == "EGM96":
        return "EGM96"
    if not isinstance(value, dict) or not ({"column"} <= set(value) or {"value"} <= set(value)):
        raise ValueError(
            f'{value!r} is not a geoid; give "EGM96", its height above the ellipsoid as '
            '{ value = 46.3, unit = "m" }, or the column that has it, { column = "sep", unit = "m" }'
        )
    if "value" in value:
        return SeparationKeys(quantity(value, "m", "its height", "m", -math.inf))
    check_keys(value, ["column", "unit", "scale"])
    scale = check_number(value.get("scale", 1.0), "scale", least=-math.inf)
    return SeparationKeys(0.0, column(value["column"]), scale * factor(value.get("unit"), "length"))


Geoid = Annotated[Any, AfterValidator(_geoid)]
