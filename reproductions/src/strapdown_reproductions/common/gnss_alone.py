"""Scenarios with GNSS as the only aid, and the grades of IMU that studies of consistency fly in them."""

from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import Scenario, scenario

SCENARIOS = ("demo", "straight", "car", "ship", "hand-held", "robot", "hover", "ship-heave")
GRADES = ("consumer", "industrial", "dmu10", "tactical", "navigation")
EPOCH = 1.0
"""s between scored rows."""
LONG, KEPT = 120.0, 3
"""s: of longer scenarios every third scored row is kept."""


def gnss_alone(name: str) -> Scenario:
    """The built-in scenario with GNSS and nothing else.

    The receiver of hand-held, which measures nothing there, is the default one here.
    """
    built_in = scenario(name)
    gnss = Gnss() if built_in.gnss.position_std is None else built_in.gnss
    return built_in.replace(gnss=gnss, magnetometer=None, barometer=None, attitude=None)


def keep(world: Scenario) -> int:
    """Every how many scored rows are kept."""
    return KEPT if world.duration > LONG else 1
