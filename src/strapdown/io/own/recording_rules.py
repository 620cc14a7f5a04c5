"""What a recording as NetCDF says in words: the attributes of its groups and its meta."""

from typing import Annotated, Any

from pydantic import Field

from .text_rules import Deviation, Finite, Line, Moment, Name, Said, Triple


class AidingAttributes(Said):
    """Of the group of a source."""

    kind: Name
    name: Name
    gate: Annotated[float, Field(gt=0)] | None = None
    parameters: list[Finite] = []
    estimate: dict[Name, list[Deviation]] = {}
    slip: Annotated[Finite, Field(ge=0)] = 0.0
    correlated_sd: list[Deviation] = []
    correlation_time: Annotated[Finite, Field(gt=0)] = 1.0
    correlated_states: bool = True
    robust: bool = False
    adaptive: Annotated[Finite, Field(ge=0)] = 0.0


class RecordingMeta(Said):
    """`Recording.meta`, as far as the library asks for it."""

    name: Line = ""
    epoch: Moment | None = None
    date: Name | None = None
    grade: Name | dict[str, Any] | None = None
    notes: list[Line] = []
    read: list[Line] = []
    place: Triple | None = None
    vehicle: Name | dict[str, Any] | None = None
    imu_lever_arm: Triple = [0.0, 0.0, 0.0]
    imu_mounting: Triple = [0.0, 0.0, 0.0]
    guessed_axes: Name | None = None
    undecided_gyro: Line | None = None
    point: Name = "imu"
    estimate: dict[Name, list[Deviation]] | None = None
    sensors: dict[str, Any] = {}
    height_columns: dict[Name, Name] = {}
