"""Rows and columns of the table: filters, scenarios with each filter's aiding, grades."""

from typing import NamedTuple

from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES
from strapdown.experiments.filter_label import parse_label
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sim.scenario import Scenario

from ..common.gnss_alone import gnss_alone

FILTERS = (
    "closed-loop",
    "mekf",
    "ukf",
    "ekf",
    "iekf",
    "eqf",
    "xkf",
    "nlo",
    "two-stage-ekf",
    "xkf-two-stage",
    "direct-ahrs",
    "direct-euler",
    "indirect-ahrs-closed",
    "indirect-ahrs-open",
)
FED = ("direct-ahrs", "direct-euler", "indirect-ahrs-closed", "indirect-ahrs-open")
"""Those that get the records of an AHRS beside GNSS."""


class WorldCell(NamedTuple):
    """A filter in a scenario with a grade of IMU."""

    filter: str
    scenario: str
    grade: str


def world(name: str, fed: bool) -> Scenario:
    """The scenario with GNSS alone, `fed` with an AHRS too."""
    return gnss_alone(name).replace(attitude=Ahrs() if fed else None)


def is_fed(filter: str) -> bool:
    """True where the filter with that label gets the records of an AHRS."""
    return parse_label(filter).filter.name in FED


def check_filter(label: str) -> None:
    """Raise DataError where the table cannot have the filter of that label."""
    filter = parse_label(label).filter
    if len(filter.states) < STATES:
        raise DataError(
            f"filter {label!r} does not state how well it knows all {STATES} states; the table is "
            f"of filters that do, such as {', '.join(FILTERS[:3])}"
        )
