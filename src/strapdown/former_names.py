"""Modules under the names that documentation of version 0.1 showed: they import as before, with a
DeprecationWarning that says the new name.

This module is itself the finder, the last one on `sys.meta_path`: it is asked for what nobody else
has.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

TYPE_CHECKING = False  # `typing` would be half of what importing the package takes
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

MOVED = {
    "bounds": "evaluation.cramer_rao",
    "consistency": "evaluation.consistency",
    "console": "cli.console",
    "filters.fixed_gain": "filters.ahrs_aided.fixed_gain",
    "filters.mahony": "filters.attitude.mahony",
    "io.broad": "io.readers.broad",
    "io.netcdf": "io.readers.netcdf",
    "io.psins": "io.readers.psins",
    "metrics": "evaluation.metrics",
    "reports.allan": "allan.page",
    "reports.comparison_figures": "experiments.outages.figures",
    "reports.fixes": "reports.fix_figures",
    "rest": "preprocessing.stationary",
    "sensors.ahrs": "sensor_models.ahrs",
    "sensors.allan": "allan.deviation",
    "sensors.allan_grade": "allan.suggested_grade",
    "sensors.atmosphere": "sensor_models.atmosphere",
    "sensors.barometer": "sensor_models.barometer",
    "sensors.errors": "sensor_models.errors",
    "sensors.geomagnetism": "sensor_models.geomagnetism",
    "sensors.gnss": "sensor_models.gnss",
    "sensors.imu": "sensor_models.imu",
    "sensors.magnetometer": "sensor_models.magnetometer",
    "sim.aircraft.dynamics": "flight.aircraft.dynamics",
    "sim.aircraft.modes": "flight.aircraft.modes",
    "sim.aircraft.parameters": "flight.aircraft.parameters",
    "sim.aircraft.wind": "flight.aircraft.wind",
    "sim.flight": "flight.fly",
    "sim.flight_plan": "flight.plan",
    "sim.jsbsim_craft": "flight.jsbsim_craft",
    "sim.jsbsim_definition": "flight.jsbsim_definition",
    "statics": "alignment.static_attitude",
    "studies.advice": "experiments.advice.advise",
    "studies.mission": "experiments.advice.mission",
    "studies.summaries": "experiments.monte_carlo.summaries",
    "studies.verdicts": "experiments.advice.verdicts",
    "transport": "preprocessing.lever_arm",
}
"""{module as it was called: as it is}, below `strapdown`."""
PACKAGES = {name.rpartition(".")[0] for name in MOVED} - {""} | {"papers"}
"""Folders that such modules were in. Those of `papers` are named by the package of the
reproductions, in a module called as this one."""
REPRODUCTIONS = "strapdown_reproductions"


def _present_name(old: str) -> str | None:
    if old in MOVED:
        return f"strapdown.{MOVED[old]}"
    folder, _, module = old.partition(".")
    if folder == "papers" and module:
        try:
            return import_module(f"{REPRODUCTIONS}.former_names").MOVED.get(module)
        except ModuleNotFoundError:
            raise ModuleNotFoundError(
                f"strapdown.{old} is in the package strapdown-reproductions, which is not installed",
                name=f"strapdown.{old}",
            ) from None
    return None


def find_spec(
    name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
) -> ModuleSpec | None:
    """As the import system asks: how to make the module `name`, or None where it is none of
    these."""
    old = name.removeprefix("strapdown.")
    if old == name:
        return None
    loader: Any = sys.modules[__name__]
    if new := _present_name(old):
        return ModuleSpec(name, loader, origin=new)
    return ModuleSpec(name, loader, is_package=True) if old in PACKAGES else None


def create_module(spec: ModuleSpec) -> None:
    """As the import system asks; None is an ordinary module."""
    return None


def exec_module(module: ModuleType) -> None:
    """Fill the module with what the present one has."""
    if module.__spec__ and (new := module.__spec__.origin):
        warnings.warn(f"{module.__name__} is {new} now", DeprecationWarning, stacklevel=2)
        module.__dict__.update(
            {
                name: value
                for name, value in vars(import_module(new)).items()
                if not name.startswith("__")
            }
        )
