"""Names that loggers give the columns of a table, and the units in these names."""

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...typing import Array
from ..tables.table_file import FileTable

GYRO = r"(g|gyr|gyro|gyroscope|w|omega|rate|rates|ang(ular)?_?(vel|velocity|rate))"
MEASURED = r"_(meas(ured)?|noisy)"
"""Suffix of the columns with measured values where a simulation also writes true values."""
OWN_NAMES = {
    GYRO: [("roll_?rate|rollspeed", "pitch_?rate|pitchspeed", "yaw_?rate|yawspeed"), "pqr"]
}
"""Names without x, y, z of the three columns of a sensor."""
MAG = r"(m|mag|magn|magnet|magnetometer|magnetic|magnetic_?field|compass)"
ACCEL = r"(a|f|acc|accel|acceleration|accelerometer|lin(ear)?_?acc(el|eleration)?|spec(ific)?_?(force|acc))"
TEMPERATURE = r"((gyro?|acc(el)?|sensor|chip|die)_?)?temp(erature)?"
OF = r"(gps|gnss|pos|position|nav|fix|ubx)?[_ .]?"
"""Words that may precede the name of a column of fixes."""
POSITION = {
    "latitude": OF + r"(lat|latitude|latitud|breite(ngrad)?)|ll[ah]_1",
    "longitude": OF + r"(lon|lng|long|longitude|longitud|l(ä|ae)nge(ngrad)?)|ll[ah]_2",
    "ellipsoidal": OF
    + r"(h_?ell(ipsoid)?|ell(ipsoidal)?_?(height|alt(itude)?)|h_?wgs_?84|height_ell)",
    "sea": OF
    + r"(h_?msl|(alt(itude)?|height|hgt|h|elev(ation)?)_(a?msl|ortho(metric)?|sea|geoid)|a?msl"
    r"(_(alt(itude)?|height))?|ortho(metric)?_?(height|alt)?|elev(ation)?)",
    "height": OF
    + r"(alt|altitude|h|hgt|height|h(ö|oe)he|hauteur|altura|altitud|quota|altezza)|ll[ah]_3",
    "separation": r"(geoid(al)?_?)?(sep|separation|undulation|height_of_geoid)|geoid|n_geoid",
}
VELOCITY = {
    "north": OF
    + r"(vn|v_?n|vel_?n|v(el(ocity)?)?_?north|north_?vel(ocity)?)|v(el(ocity)?)?_?ned_1",
    "east": OF + r"(ve|v_?e|vel_?e|v(el(ocity)?)?_?east|east_?vel(ocity)?)|v(el(ocity)?)?_?ned_2",
    "down": OF + r"(vd|v_?d|vel_?d|v(el(ocity)?)?_?down|down_?vel(ocity)?)|v(el(ocity)?)?_?ned_3",
    "up": OF + r"(vu|v_?u|vel_?u|v(el(ocity)?)?_?up|up_?vel(ocity)?|climb(_?rate)?|v_?speed|"
    r"vert(ical)?_?(speed|vel(ocity)?))",
    "speed": OF + r"((gnd|ground|g|hor(izontal)?|h)?_?(speed|spd|vel_?2d)|sog|speed_over_ground|"
    r"ground_?velocity|velocity|knots|geschwindigkeit|v_?ground)",
    "course": OF + r"((ground_?)?course(_over_ground)?|cog|track(_angle)?|trk|motion_?heading|"
    r"head(ing)?_?(of_?)?mot(ion)?|direction|bearing|kurs)",
}
ECEF = {
    axis: rf"((ecef|pos(ition)?_?ecef|r_ecef)[_ .]?{axis}|{axis}([_ .]?ecef)?)" for axis in "xyz"
}
ECEF_VELOCITY = {
    axis: rf"((ecef[_ .]?v(el)?|vel(ocity)?_?ecef|v)[_ .]?{axis}|v{axis}[_ .]?ecef)"
    for axis in "xyz"
}
SPREAD = r"(sd|std(dev)?|sigma|acc(uracy)?|err(or)?|unc(ertainty)?|rms)"
NO_FORCE = r"(?!acc(uracy)?[_ .]?[xyz123]([^a-z].*)?$)"
"""`acc_x` is an acceleration, not an accuracy."""
DEVIATIONS = {
    "horizontal": rf"h_?acc|(h|hor|horizontal)_?{SPREAD}|{SPREAD}_?(h|hor|horizontal|xy|2d)|eph|accuracy",
    "vertical": rf"v_?acc|(v|vert|vertical)_?{SPREAD}|{SPREAD}_?(v|vert|vertical|z)|epv",
    "north": rf"{SPREAD}_?(n|north|lat(itude)?)|(n|north|lat(itude)?)_?{SPREAD}",
    "east": rf"{SPREAD}_?(e|east|lon(gitude)?)|(e|east|lon(gitude)?)_?{SPREAD}",
    "down": rf"{SPREAD}_?(u|up|d|down|alt(itude)?|height)|(u|up|d|down|alt(itude)?|height)_?{SPREAD}",
    "all": SPREAD + "|(pos|position|3d)_?" + SPREAD + "|" + SPREAD + "_?(pos|position|3d)",
    "speed": rf"s_?acc|(speed|vel|velocity)_?{SPREAD}|{SPREAD}_?(speed|vel|velocity)",
    "course": rf"(head(ing)?|course|cog|track)_?{SPREAD}|{SPREAD}_?(head(ing)?|course|cog)",
    "vn": rf"{SPREAD}_?(v_?n|vel_?n|v(el)?_?north)|(v_?n|vel_?n)_?{SPREAD}",
    "ve": rf"{SPREAD}_?(v_?e|vel_?e|v(el)?_?east)|(v_?e|vel_?e)_?{SPREAD}",
    "vd": rf"{SPREAD}_?(v_?[du]|vel_?[du]|v(el)?_?(down|up))|(v_?[du]|vel_?[du])_?{SPREAD}",
}
DEVIATIONS = {key: f"{NO_FORCE}({pattern})" for key, pattern in DEVIATIONS.items()}
FIX = (
    r"((gps|gnss)_?)?(fix(_?(type|quality|status|mode|ok|valid))?|quality|q|(pos_?|nav_?)?mode|"
    r"(sol(ution)?_?)?status|valid|rtk_?status)"
)
UNIT = r"(?P<unit>([_ .,\[(].*)?)"
SPELLINGS = {
    "mdps": r"(mdps|m°[_ /]*s(ec)?|mdeg.*s(ec)?|milli_?deg.*s(ec)?)",
    "mrad/s": r"(mrad.*s(ec)?|milli_?rad.*s(ec)?)(\^?-1)?",
    "deg/h": r"(deg|°)[_ /]*(p?h|hour|hr)(\^?-1)?",
    "rad/s": r"rad.*s(ec)?(ond)?(\^?-1)?",
    "deg/s": r"(deg.*s(ec)?|dps|°[_ /]*s(ec)?)",
    "m/s^2": r"(m.?/?s.?\^?2|m_s_?s|mps2|m/s²|m/s/s)",
    "mg": r"mg",
    "g": r"g",
    "degC": r"(deg_?c|°_?c|c|celsius)",
    "degF": r"(deg_?f|°_?f|f|fahrenheit)",
    "ns": r"ns(ec)?",
    "us": r"(us|µs|μs|usec)",
    "ms": r"(ms|msec|millis(ec(onds?)?)?)",
    "s": r"s(ec(onds?)?)?",
    "rad": r"rad(ians?)?",
    "deg": r"(deg(rees?)?|°)",
    "T": r"(t|tesla)",
    "uT": r"(ut|µt|μt|microtesla)(_?raw)?",
    "nT": r"(nt|nanotesla)(_?raw)?",
    "gauss": r"(gauss|gs)(_?raw)?",
    "mgauss": r"(mgauss|milligauss|mg)(_?raw)?",
    "m/s": r"m[_ /]?(p|s)(s|ec)?(\^?-1)?",
    "km/h": r"(km[_ /]?h|kph|kmph)",
    "knot": r"(kn|kt|kts|knots?)",
    "cm/s": r"cm[_ /]?s",
    "mm/s": r"mm[_ /]?s",
    "ft/s": r"(ft[_ /]?s|fps)",
    "m": r"m(et(er|re)s?)?",
    "km": r"km",
    "cm": r"cm",
    "mm": r"mm",
    "ft": r"(ft|feet|foot)",
}


class ColumnNames(NamedTuple):
    """The columns of a table by what they are called."""

    table: FileTable
    names: list[Any]

    @classmethod
    def of(cls, table: FileTable) -> "ColumnNames":
        """All columns of a table."""
        return cls(table, [*table.titles])

    def without(self, names: Iterable[str]) -> "ColumnNames":
        """The same without these columns."""
        left = set(names)
        return self._replace(names=[name for name in self.names if name not in left])

    def find(self, pattern: str) -> str | None:
        """Return the first column whose name matches, with or without a unit behind it, or None;
        names without a unit come first."""
        for whole in (f"(?:{pattern})", f"(?:{pattern}){UNIT}"):
            for name in self.names:
                if re.fullmatch(whole, plain(name)):
                    return name
        return None

    def triple(self, pattern: str) -> list[str] | None:
        """Names of the x, y and z column, or None."""
        for axes in ("xyz", "123"):  # the columns of a matrix have numbers
            for behind in (MEASURED, ""):
                found = [self.find(rf"{pattern}[_ .]?{axis}{behind}") for axis in axes]
                known = [name for name in found if name]
                if len(known) == 3:
                    return known
        names = [self._of_triple(pattern, i) for i in range(3)]
        return [name for name in names if name] if all(names) else None

    def _of_triple(self, pattern: str, axis: int) -> str | None:
        """Return a column of a triple whose axes have different names."""
        own = OWN_NAMES.get(pattern, [])
        unit = r"([_ .]?(m?rad|m?deg|m?dps).*|[_ ]*[\[(].*)?"
        found = (
            name
            for names in own
            for name in self.names
            if re.fullmatch(f"({names[axis]}){unit}", plain(name))
        )
        return next(found, None)

    def numbers(self, name: str | int) -> Array:
        """The column as floats, NaN where it is no number."""
        cells = self.table.content[name]
        if isinstance(cells, np.ndarray):
            return cells.astype(float)
        import pandas as pd

        return pd.to_numeric(cells, errors="coerce").to_numpy(float, na_value=np.nan)

    def unit(self, name: str, units: Iterable[str]) -> str | None:
        """Return the unit at the end of a column's name, or in the line of units, or None."""
        texts = []
        for spelt in (_lower(name), plain(name)):
            ends = re.split(r"[\[(]|(?<=[^_ ])[_ ]", spelt, maxsplit=4)
            texts += ["_".join(ends[i:]) for i in range(1, len(ends))]
        texts.append(self.table.units.get(name, "").lower())
        texts += [plain(name)] if len(name.strip()) > 1 else []  # `ms`, `knots`
        for unit in units:
            if any(re.fullmatch(SPELLINGS[unit] + r"[\])]?", text) for text in texts):
                return unit
        return None


def plain(name: str) -> str:
    """Return a name in the form of the patterns: lower case, words separated."""
    head, mark, tail = re.fullmatch(r"([^\[(]*)([\[(]?)(.*)", name.strip()).groups()  # type: ignore[union-attr]
    return re.sub(r"^imu[_ .]", "", _lower(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", head) + mark + tail))


def _lower(name: str) -> str:
    # except the micro sign, whose lower-case form is another character
    return re.sub(r"^imu[_ .]", "", name.strip().lower()).replace(" ", "_")
