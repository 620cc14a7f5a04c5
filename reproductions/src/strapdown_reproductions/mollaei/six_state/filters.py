"""The six-state filters of Mollaei, Shafieirad & Moradi (2025) as Filter values: no filter, EKF,
UKF, CKF and particle Kalman filter.

They are no part of `strapdown.filters`, because they need a flat Earth, an attitude that is true at
the start and antennas without a lever arm: give the value itself, as in `fuse(recording, EKF6,
start=...)` or `fly(plan, filter=UKF6, earth="flat")`. They cannot be pickled.
"""

from typing import Any

from strapdown.core.loop.contract import Filter
from strapdown.filters.particle import pkf

from . import kalman_filters as kalman, particle_filter as particles, sigma_point_filters as points
from .model import INPUTS, REPRODUCED, SIX, configure

__all__ = ["RAW", "EKF6", "UKF6", "CKF6", "PKF6", "INPUTS", "REPRODUCED"]

PAPER = "Mollaei, Shafieirad & Moradi (2025)"
COMMON: dict[str, Any] = dict(
    states=tuple(range(6)),
    estimates=tuple(range(9)),
    uses=("position", "velocity"),
    needs=("position",),
    configure=configure,
)
RAW = Filter(
    "six-raw",
    f"{PAPER}: no filter, direct feedback",
    kalman.start_raw,
    kalman.hold,
    kalman.take,
    slots=SIX,
    **{**COMMON, "states": ()},
)
EKF6 = Filter(
    "six-ekf",
    f"{PAPER} equations (19)-(22), six states",
    kalman.start,
    kalman.predict,
    kalman.correct,
    slots=SIX,
    **COMMON,
)
UKF6 = Filter(
    "six-ukf",
    f"{PAPER} equations (23)-(32), six states",
    points.start,
    points.predict,
    points.correct,
    slots=points.SLOTS,
    diagnose=points.diagnose,
    **COMMON,
)
CKF6 = Filter(
    "six-ckf",
    "Arasaratnam & Haykin (2009), IEEE TAC 54(6), six states",
    points.start_cubature,
    points.predict,
    points.correct,
    slots=points.SLOTS,
    diagnose=points.diagnose,
    **COMMON,
)
PKF6 = Filter(
    "six-pkf",
    f"{PAPER} equations (33)-(36), six states; Hoteit, Luo & Pham (2012)",
    particles.start,
    particles.predict,
    particles.correct,
    slots=particles.SLOTS,
    diagnose=pkf.mixture_events,
    **COMMON,
)
