"""The encoder of each output format. What MAVLink needs is loaded only with it."""

from collections.abc import Callable, Sequence

import numpy as np

from ...sensor_models.geoid import undulation
from .output_formats import LINES, Shown

OUTPUTS = (*LINES, "mavlink")
MESSAGES = ("ODOMETRY", "VISION_POSITION_ESTIMATE", "GPS_INPUT")
"""Messages of MAVLink that can go out."""


def encoder(format: str, messages: Sequence[str]) -> Callable[[Shown], bytes]:
    """Return a function that makes bytes of a state: lines, or these messages of MAVLink. What it
    reads from the disk is read now, so that no state waits for it."""
    if format != "json":
        undulation(np.zeros(1), np.zeros(1))
    if format == "mavlink":
        from .mavlink_output import MavLinkOutput

        return MavLinkOutput(messages)
    return lambda it: LINES[format](it).encode()
