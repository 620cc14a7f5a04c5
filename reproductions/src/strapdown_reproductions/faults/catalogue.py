"""Every fault, in the order of the tables."""

from . import of_gnss, of_imu, of_others
from .fault import Fault

EVERY = (*of_gnss.FAULTS, *of_imu.FAULTS, *of_others.FAULTS)
FAULTS: dict[str, Fault] = {fault.name: fault for fault in EVERY}
"""{name: Fault}."""
