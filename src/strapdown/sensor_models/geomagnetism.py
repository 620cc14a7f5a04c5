"""The Earth's magnetic field at a date and place, from the World Magnetic Model (WMM) or the
International Geomagnetic Reference Field (IGRF).

Both are spherical harmonics of the field of the core, of degree 12 (WMM) and 13 (IGRF), with a
linear drift between the years of a model. Chulliat et al. (2025), The US/UK World Magnetic Model
for 2025-2030; Alken et al. (2021), International Geomagnetic Reference Field, Earth, Planets and
Space 73:49. Rocks, buildings, vehicles and magnetic storms are not in them: they change the field
by 1 % where nothing is near, and by as much as you like beside iron.
"""

import datetime
import math
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_number, is_number
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..extras import optional_import

YEARS = 5.0  # that each WMM is meant for
IGRF, IGRF_YEARS = "IGRF-14", (1900.0, 2030.0)
# m: the deepest sea, and where currents of the ionosphere and beyond end what the models claim
MIN_PLACE, MAX_PLACE = -12e3, 850e3
COMPASS = 6e-6  # T: horizontal intensity below which the WMM warns of compasses (its caution zone)


class GeomagneticField(NamedTuple):
    """The Earth's field at a date and place: SI and radians. `np.asarray(result.field)` is the
    vector that sources take."""

    field: tuple[float, ...]  # north, east, down, T
    declination: float  # rad, of magnetic north from true north, positive east
    inclination: float  # rad, below the horizon
    horizontal: float  # T, horizontal intensity
    total: float  # T, total intensity
    model: str  # the model used
    note: str  # what must be known where the field is used, or ""


def geomagnetic_field(
    date: datetime.date | str | float,
    lat: float,
    lon: float,
    height: float = 0.0,
    model: str | None = None,
) -> GeomagneticField:
    """Return the Earth's magnetic field at a date and place.

    Parameters
    ----------
    date : datetime.date, str or float
        A date or datetime, ISO text ("2012-10-10"), or a decimal year.
    lat, lon : float
        rad.
    height : float
        m above the WGS-84 ellipsoid.
    model : str, optional
        A name of `models()`; by default the World Magnetic Model of the date, or where there is none
        the IGRF (1900 to 2009).

    Returns
    -------
    GeomagneticField
        The field in NED, T, its declination and inclination, rad.

    Raises
    ------
    DataError
        Where no model covers the date: none is used past the years that it was made for.

    References
    ----------
    Chulliat et al. (2025), The US/UK World Magnetic Model for 2025-2030; Alken et al. (2021),
    International Geomagnetic Reference Field, Earth, Planets and Space 73:49.

    Examples
    --------
    >>> import math
    >>> import strapdown as sd
    >>> field = sd.geomagnetic_field("2024-05-01", math.radians(47.6), math.radians(9.4), 400.0)
    >>> round(math.degrees(field.declination), 1)
    3.7
    """
    year = decimal_year(date)
    _check_place(lat, lon, height)
    name = _model_at(year, date) if model is None else _check_model(model, year, date)
    evaluate = _igrf if name == IGRF else _wmm
    north, east, down = (
        1e-9 * float(value)
        for value in evaluate(name, year, math.degrees(lat), math.degrees(lon), height / 1000)
    )
    horizontal = math.hypot(north, east)
    note = (
        ""
        if horizontal > COMPASS
        else (
            f"the horizontal field is only {horizontal * 1e6:.1f} uT ({name}), so near the magnetic "
            f"pole that "
            "a magnetic heading is poor; trust it less or leave it out"
        )
    )
    return GeomagneticField(
        (north, east, down),
        math.atan2(east, north),
        math.atan2(down, horizontal),
        horizontal,
        math.hypot(horizontal, down),
        name,
        note,
    )


@cache
def models() -> dict[str, tuple[float, float]]:
    """{name: (first, last) decimal year} of all models: each WMM that the installed coefficients
    hold, and the IGRF."""
    import pygeomag

    files = sorted((Path(pygeomag.__file__).parent / "wmm").glob("WMM_20*.COF"))
    # a corrected WMM (2015v2) replaces the first
    newest = {int(file.stem[4:8]): file.stem.replace("_", "") for file in files}
    return {name: (float(year), year + YEARS) for year, name in newest.items()} | {IGRF: IGRF_YEARS}


def decimal_year(date: datetime.date | str | float) -> float:
    """Year with its fraction, from a date, a datetime, ISO text or a number. Raises DataError."""
    if is_number(date) and math.isfinite(date):
        return float(date)
    if isinstance(date, str):
        try:
            date = datetime.datetime.fromisoformat(date)
        except ValueError:
            raise DataError(f'date: {date!r} is no date; write it as "2012-10-10"') from None
    if not isinstance(date, datetime.date):
        raise DataError(
            f'date: {date!r} is no date; the geomagnetic model needs one, such as "2012-10-10"'
        )
    clock = getattr(date, "hour", 0) / 24 + getattr(date, "minute", 0) / 1440
    days = (
        datetime.date(date.year + 1, 1, 1).toordinal() - datetime.date(date.year, 1, 1).toordinal()
        if date.year < 9999
        else 365
    )
    return date.year + (date.timetuple().tm_yday - 1 + clock) / days


def _check_place(lat: float, lon: float, height: float) -> None:
    for name, value in (("latitude", lat), ("longitude", lon), ("height", height)):
        check_number(value, f"geomagnetic model: {name}")
    if abs(lat) > math.pi / 2 or abs(lon) > 2 * math.pi:
        raise DataError(
            f"latitude {lat:g}, longitude {lon:g} rad: no place has these; are they in degrees?"
        )
    if abs(lat) > LATITUDE_LIMIT + 1e-9:
        raise DataError(
            f"latitude is {math.degrees(lat):.6g} deg; results hold up to "
            f"{math.degrees(LATITUDE_LIMIT):.0f} deg"
        )
    if not MIN_PLACE <= height <= MAX_PLACE:
        raise DataError(
            f"height is {height:g} m; geomagnetic models hold from {MIN_PLACE / 1000:.0f} to "
            f"{MAX_PLACE / 1000:.0f} km"
        )


def _model_at(year: float, date: datetime.date | str | float) -> str:
    for name, (first, last) in models().items():  # the IGRF is the last of them
        if first <= year < last:
            return name
    newest = max(models().items(), key=lambda item: item[1])
    if year >= newest[1][1]:
        raise DataError(
            f"date {date} is past the newest geomagnetic model ({newest[0]}, {_years(newest[1])}): "
            f"it has expired; "
            "install a newer `pygeomag`, or give the field itself"
        )
    raise DataError(
        f"date {date} is before the oldest geomagnetic model ({IGRF}, {_years(IGRF_YEARS)}): check "
        f"the date, or give the field itself"
    )


def _check_model(model: str, year: float, date: datetime.date | str | float) -> str:
    if model not in models():
        raise DataError(f"there is no geomagnetic model {model!r}; there are {', '.join(models())}")
    first, last = models()[model]
    if not first <= year < last:
        better = next(
            (name for name, (begin, end) in models().items() if begin <= year < end), None
        )
        raise DataError(
            f"geomagnetic model {model} holds {_years((first, last))}, not on {date}: "
            f"it {'had expired' if year >= last else 'had not begun'}; "
            + (f"use {better}" if better else "no model holds then, give the field itself")
        )
    return model


def _years(span: tuple[float, float]) -> str:
    return f"{span[0]:.0f} to {span[1]:.0f}"


@cache
def _coefficients(name: str) -> Any:
    from pygeomag import GeoMag

    return GeoMag(coefficients_file=f"wmm/{name.replace('WMM', 'WMM_')}.COF")


def _wmm(
    name: str, year: float, lat: float, lon: float, height: float
) -> tuple[float, float, float]:
    """North, east, down in nT; degrees and km."""
    found = _coefficients(name).calculate(glat=lat, glon=lon, alt=height, time=year)
    return found.x, found.y, found.z


def _igrf(
    name: str, year: float, lat: float, lon: float, height: float
) -> tuple[float, float, float]:
    """North, east, down in nT; degrees and km."""
    with optional_import(f"{name}, the geomagnetic model of dates before 2010,"):
        import ppigrf
    whole = int(year)
    begin = datetime.datetime(whole, 1, 1)
    east, north, up = ppigrf.igrf(
        lon, lat, height, begin + (year - whole) * (datetime.datetime(whole + 1, 1, 1) - begin)
    )
    return np.ravel(north)[0], np.ravel(east)[0], -np.ravel(up)[0]
