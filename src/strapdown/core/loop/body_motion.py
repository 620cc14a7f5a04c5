"""The motion of the last seconds, which stages/clock.py keeps."""

from typing import Annotated

from ...typing import Array

ROWS = 256
S, X, ANGLE = 0, 3, 6
"""Where the integrals begin, of force (m/s, n), of that (m) and of the angular rate (rad, body)."""


class BodyMotion:
    """The motion up to an instant."""

    t: float  # s
    sums: Annotated[Array, 9]  # the integrals
