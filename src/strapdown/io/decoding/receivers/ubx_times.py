"""GPS time of u-blox messages: times of week, and the weeks and dates that some messages say."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....time_scales import gps_from_unix
from ....typing import Array, Ints
from .cyclic_times import WEEK, moments, undated
from .ubx_frames import Frames
from .ubx_layouts import LAYOUTS, NAV_HPPOSLLH, NAV_POSLLH, NAV_PVAT, NAV_PVT, NAV_SOL, NAV_TIMEGPS

EPOCHS = (NAV_PVT, NAV_SOL, NAV_TIMEGPS, NAV_PVAT)
"""Messages that say a date or a week."""
WEEKLESS = (NAV_POSLLH, NAV_HPPOSLLH)
"""Messages of positions that say no week."""
VALID = {NAV_PVT: 0x03, NAV_PVAT: 0x03, NAV_TIMEGPS: 0x03, NAV_SOL: 0x0C}
"""Bits that all stand where date (or week) and time are valid."""


class Clock(NamedTuple):
    """The moments that a file knows, and whether they are GPS time or count from an unknown
    week."""

    place: Ints  # in the file (m,)
    moment: Ints  # ms of GPS time since its zero, or since the zero of some week (m,)
    absolute: bool

    def gps_ms(self, place: Ints, tow: Ints) -> Ints:
        """Moments (n,) of times of week in ms at places in the file."""
        return moments(place, tow.astype(int), self.place, self.moment, WEEK)


def clock(frames: Frames) -> Clock:
    """The clock of a file."""
    places, dates, weekless = [], [], []
    for key in EPOCHS:
        place, records = frames.records(key, LAYOUTS[key])
        valid = records["flags" if key == NAV_SOL else "valid"] & VALID[key] == VALID[key]
        tow = records["iTOW"].astype(int)
        weekless.append((place, tow))
        if key in (NAV_PVT, NAV_PVAT):
            moment = np.round(1e3 * gps_from_unix(_unix(records))).astype(int)
            moment = moments(place, tow, place, moment, WEEK)
        else:
            moment = records["week"].astype(int) * WEEK + tow
        valid &= moment > 0
        places.append(place[valid])
        dates.append(moment[valid])
    place, moment = np.concatenate(places), np.concatenate(dates)
    absolute = len(place) > 0
    if not absolute:
        for key in WEEKLESS:
            start, records = frames.records(key, LAYOUTS[key])
            weekless.append((start, records["iTOW"].astype(int)))
        place, tow = (np.concatenate(each) for each in zip(*weekless))
        place, moment = undated(place, tow, WEEK)
    if not len(place):
        place = moment = np.zeros(1, int)
    order = np.argsort(place, kind="stable")
    return Clock(place[order], moment[order], absolute)


def _unix(records: NDArray[Any]) -> Array:
    """POSIX seconds of the fields year to second."""
    month = 12 * (records["year"].astype(int) - 1970) + records["month"] - 1
    days = month.astype("datetime64[M]").astype("datetime64[D]").astype(int) + records["day"] - 1
    seconds = records["hour"] * 3600.0 + records["minute"] * 60.0 + records["second"]
    return np.asarray(days * 86400.0 + seconds)
