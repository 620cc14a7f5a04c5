"""Attributes and JSON of our own files, checked against models of pydantic: what all of them share."""

import json
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from ...checks import DataError
from ...checksum import DAMAGED
from ...time_scales import gps_of

Model = TypeVar("Model")


def _known_moment(text: str) -> str:
    gps_of(text)
    return text


Name = Annotated[str, Field(max_length=1000)]
Line = Annotated[str, Field(max_length=100_000)]
Moment = Annotated[str, AfterValidator(_known_moment)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Deviation = Annotated[float, Field(ge=0)]


class Said(BaseModel):
    """What a file says of itself. Keys beyond those that are named stay as they are: a later version
    or a user may have put them there."""

    model_config = ConfigDict(extra="allow", strict=True)


class Only(BaseModel):
    """What a file says, without further keys."""

    model_config = ConfigDict(extra="forbid", strict=True)


def from_json(text: Any, where: object) -> Any:
    """The values of a text that is JSON. Raises DataError that begins with `where`."""
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        said = str(error).splitlines()[0][:80]
        raise DataError(f"{where}: is no JSON ({said}); {DAMAGED}") from None


def check_values(model: Any, values: Any, where: object) -> Any:
    """Refuse values that do not fit a model or type; they stay as they are. Raises DataError with
    the first complaint, which begins with `where`."""
    try:
        TypeAdapter(model).validate_python(values, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))[:80]
        said = " ".join(first["msg"].removeprefix("Value error, ").split())
        raise DataError(
            f"{where}: {place and place + ': '}{said[0].lower()}{said[1:160]}; {DAMAGED}"
        ) from None
    return values
