"""Rows and columns of the table: filters, scenarios with each filter's aiding, grades."""

from typing import NamedTuple

from strapdown.checks import DataError
from strapdown.core.loop.contract import STATES
from strapdown.experiments.filter_label import parse_label
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import Scenario, scenario

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
SCENARIOS = ("demo", "straight", "car", "ship", "hand-held", "robot", "hover", "ship-heave")
GRADES = ("consumer", "industrial", "dmu10", "tactical", "navigation")
LONG = 120.0
"""s: of longer scenarios every third epoch is kept."""
EPOCH, KEPT = 1.0, 3


class WorldCell(NamedTuple):
    """A filter in a scenario with a grade of IMU."""

    filter: str
    scenario: str
    grade: str


def world(name: str, fed: bool) -> Scenario:
    """The built-in scenario with GNSS, `fed` with an AHRS too, and with nothing else.

    The receiver of hand-held, which measures nothing there, is the default one here.
    """
    built_in = scenario(name)
    gnss = Gnss() if built_in.gnss.position_std is None else built_in.gnss
    return built_in.replace(
        gnss=gnss,
        magnetometer=None,
        barometer=None,
        attitude=Ahrs() if fed else None,
    )


def is_fed(filter: str) -> bool:
    """True where the filter with that label gets the records of an AHRS."""
    return parse_label(filter).filter.name in FED


def keep(world: Scenario) -> int:
    """Every how many epochs are kept."""
    return KEPT if world.duration > LONG else 1


def check_filter(label: str) -> None:
    """Raise DataError where the table cannot have the filter of that label."""
    filter = parse_label(label).filter
    if len(filter.states) < STATES:
        raise DataError(
            f"filter {label!r} does not state how well it knows all {STATES} states; the table is "
            f"of filters that do, such as {', '.join(FILTERS[:3])}"
        )
