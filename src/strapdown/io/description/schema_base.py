"""What the sections of `recording.toml` are made of: parts that refuse unknown keys, columns,
times and signals."""

import math
from collections.abc import Callable
from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from ...units import factor

Found = TypeVar("Found")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]


def column(value: Any) -> str | int:
    """The name or number of a column as it is. Raises ValueError where it is none."""
    if (
        isinstance(value, str)
        and value
        or isinstance(value, int)
        and not isinstance(value, bool)
        and value >= 1
    ):
        return value
    raise ValueError(
        f"{value!r} is no column: give its name, or in a file without header its number, the first "
        f"being 1"
    )


Column = Annotated[Any, AfterValidator(column)]
Columns = Annotated[list[Column], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    """Base of all parts: unknown keys are refused, numbers are not taken from text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Time(Part):
    """t = column * scale * unit + offset, s."""

    column: Column
    unit: str | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0

    @model_validator(mode="after")
    def _units(self) -> Self:
        named("unit", factor, self.unit, "time")
        return self


class Signal(Part):
    """Three columns with one unit; `scale` is what a count is worth in that unit."""

    columns: Columns
    unit: str | None = None
    scale: Finite = 1.0


def is_number(value: Any) -> bool:
    """Whether it is a finite number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def named(key: str, function: Callable[..., Found], *arguments: Any) -> Found:
    """What the function returns; the ValueError that it raises begins with `key`."""
    try:
        return function(*arguments)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
