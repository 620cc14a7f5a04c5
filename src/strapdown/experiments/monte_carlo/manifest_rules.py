"""Rules for the manifest of a campaign."""

from typing import Annotated

from pydantic import Field

from ...io.own.text_rules import Deviation, Finite, Line, Name, SaidRules

Count = Annotated[int, Field(ge=1, le=10**9)]
Positive = Annotated[Finite, Field(gt=0)]


class Named(SaidRules):
    """The scenario or IMU of a cell."""

    name: Line


class CellRules(SaidRules):
    """A cell, whose name is that of a folder."""

    name: Annotated[str, Field(pattern=r"^[^/\\\x00]*[^/\\\x00.][^/\\\x00]*$", max_length=250)]
    scenario: Named
    imu: Named


class LimitRules(SaidRules):
    """When a run is given up."""

    distance: Deviation
    alarm: Deviation
    seconds: Deviation


class ManifestRules(SaidRules):
    """`manifest.json`."""

    format: int
    versions: dict[Name, Name]
    seed: Annotated[int, Field(ge=0)]
    runs: Count
    filters: Annotated[list[Line], Field(min_length=1)]
    epoch_s: Positive
    keep: Count
    limits: LimitRules
    installation: dict[Name, Deviation | list[Deviation]] = {}
    chunk_steps: Annotated[int, Field(ge=1)]
    cells: Annotated[list[CellRules], Field(min_length=1)]
    processors: dict[Name, Line] = {}
    plugins: list[Annotated[list[Name], Field(min_length=2, max_length=2)]] = []
