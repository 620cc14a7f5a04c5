"""What the sections of `recording.toml` are made of: parts that refuse unknown keys, columns, units,
times and signals."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
)

from ...checks import is_number
from ...units import factor

Found = TypeVar("Found")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]


def column(value: Any) -> str | int:
    """The name or number of a column as it is. Raises ValueError where it is none."""
    is_number = isinstance(value, int) and not isinstance(value, bool) and value >= 1
    if not is_number and not (isinstance(value, str) and value):
        raise ValueError(
            f"{value!r} is no column: give its name, or in a file without header its number, the "
            f"first being 1"
        )
    return value


Column = Annotated[Any, AfterValidator(column)]
Columns = Annotated[list[Column], Field(min_length=3, max_length=3)]


MISSING: Any = None
"""The unit of a description that gives none."""
Unit = Field(validate_default=True)  # a missing unit is refused too
TimeUnit = Annotated[float, Unit, BeforeValidator(partial(factor, of="time"))]
AngleUnit = Annotated[float, Unit, BeforeValidator(partial(factor, of="angle"))]
"""Fields whose value is the factor of the unit that the description names."""


class Part(BaseModel):
    """Base of all parts: unknown keys are refused, numbers are not taken from text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Condition(Part):
    """where: only rows count whose `column` is at least `least`, at most `most` or one of
    `equals`, numbers or texts."""

    column: Column
    least: Finite | None = None
    most: Finite | None = None
    equals: Any = None

    @property
    def values(self) -> list[Any]:
        """What the column may be equal to."""
        return self.equals if isinstance(self.equals, list) else [self.equals]

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        refuse(
            (
                self.least is None and self.most is None and self.equals is None,
                "least, most or equals is missing: say which rows count, as "
                '{ column = "fix", least = 3 } or { column = "status", equals = ["A", "D"] }',
            ),
            (
                self.equals is not None
                and not all(is_number(each) or isinstance(each, str) for each in self.values),
                f"equals: {self.equals!r} is no number, text or list of these",
            ),
        )
        return self

    def __str__(self) -> str:
        rules = (
            "" if self.least is None else f">= {self.least:g}",
            "" if self.most is None else f"<= {self.most:g}",
            "" if self.equals is None else f"in {', '.join(map(str, self.values))}",
        )
        return f"{self.column} {' and '.join(filter(None, rules))}"


def _conditions(value: Any) -> Any:
    """One condition is a list of one."""
    return [value] if isinstance(value, dict) else value


Where = Annotated[list[Condition], BeforeValidator(_conditions)]
"""Conditions of which each must hold for a row to count."""


class Time(Part):
    """t = column * scale * unit + offset, s, from the epoch of the recording where `clock` names
    an absolute clock: "gps", seconds from the zero of GPS time or of the week that the column or
    the number `week` says, or "unix", POSIX seconds."""

    column: Column
    unit: TimeUnit = MISSING
    scale: Finite = 1.0
    offset: Finite = 0.0
    clock: Literal["gps", "unix"] | None = None
    week: Any = None

    @model_validator(mode="after")
    def _week(self) -> Self:
        refuse(
            (
                self.week is not None and self.clock != "gps",
                'week: it belongs to clock = "gps", whose column then counts from that week',
            )
        )
        if self.week is not None:
            named("week", column, self.week)
        return self


class Signal(Part):
    """Three columns with one unit; `scale` is what a count is worth in that unit. The table and
    time are those of the section, or its own."""

    columns: Columns
    unit: str | None = None
    scale: Finite = 1.0
    file: str | None = None
    table: str | None = None
    time: Time | None = None


def named(key: str, function: Callable[..., Found], *arguments: Any) -> Found:
    """What the function returns; the ValueError that it raises begins with `key`."""
    try:
        return function(*arguments)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def refuse(*rules: tuple[object, str]) -> None:
    """Raise ValueError with the text of the first rule (is it wrong?, text) that is broken."""
    for wrong, text in rules:
        if wrong:
            raise ValueError(text)
