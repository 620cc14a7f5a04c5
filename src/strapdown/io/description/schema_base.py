"""What the sections of `recording.toml` are made of: parts that refuse unknown keys, columns, units,
times and signals."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

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


class Time(Part):
    """t = column * scale * unit + offset, s."""

    column: Column
    unit: TimeUnit = MISSING
    scale: Finite = 1.0
    offset: Finite = 0.0


class Signal(Part):
    """Three columns with one unit; `scale` is what a count is worth in that unit."""

    columns: Columns
    unit: str | None = None
    scale: Finite = 1.0


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
