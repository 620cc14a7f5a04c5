"""The section of an airspeed of a table, from the names of its columns. Whether its unit is the named one,
the checks of the recording tell by the speed over ground."""

from typing import Any

from ...typing import Array
from ...units.conversion import UNITS
from ...units.time_scales import rate_of
from ..reader import Section
from .column_names import ColumnNames

TRUE = r"tas|(true_?air_?(speed|spd|velocity))|(air_?(speed|spd)_?true)"
INDICATED = (
    r"[iec]as|((indicated|calibrated|equivalent)_?air_?(speed|spd))|(air_?(speed|spd)(_?(indicated|ind|"
    r"cal(ibrated)?|raw))?)|pitot(_?(speed|spd))?|arsp"
)
STD, READINGS = 1.4, 5.0
"""m/s of a reading, the default of PX4's and ArduPilot's estimators; readings a second that are independent."""
SCALE = 0.05
"""Standard deviation of its calibration. Where no state takes that up, a wrong scale spoils outages."""
REMARKS = (
    "# correlated = { std = 1.06, time = 15.0 }    # gusts near the ground, over 260 m of way",
)


def airspeed_section(
    columns: ColumnNames, time: dict[str, Any], t: Array
) -> tuple[Section | None, list[str]]:
    """The airspeed of a table: the true one, else the indicated one.

    Parameters
    ----------
    columns : ColumnNames
        The columns that are not taken otherwise.
    time : dict
        The key `time` of its sections.
    t : (n,) array
        Times of its rows, s.

    Returns
    -------
    section : Section or None
        Of the kind `true-airspeed` or `indicated-airspeed`.
    facts : list of str
        A line on it.
    """
    true = columns.find(TRUE)
    name = true or columns.find(INDICATED)
    if name is None:
        return None, []
    kind = "true-airspeed" if true else "indicated-airspeed"
    named = columns.unit(name, tuple(UNITS["speed"]))
    unit = named or "m/s"
    weight = max(rate_of(t) / READINGS, 1.0) ** 0.5
    keys = {
        "kind": kind,
        "time": time,
        "columns": [name],
        "unit": unit,
        "std": float(f"{STD * weight / UNITS['speed'][unit]:.2g}"),
    }
    keys["estimate"] = {"scale": SCALE}
    assumed = {
        "estimate": "the calibration of a pitot tube is as uncertain as that",
        "std": f"{STD:g} m/s, {READINGS:g} readings a second having the weight of one each",
    }
    if not named:
        assumed["unit"] = "the usual one; inspect compares it with the speed over ground"
    fact = f"airspeed: {name} in {unit}{'' if named else ' (a guess)'}, {kind.partition('-')[0]}"
    return Section("source", "airspeed", keys, assumed=assumed, remarks=REMARKS), [fact]
