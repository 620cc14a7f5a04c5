"""Complete a partly given InitialState: the missing fields are found as in `align`."""

import numpy as np

from ..core.loop.contract import ATT, POS, VEL, InitialState
from ..data.recording import Recording
from ..sensor_models.imu import ImuSpec
from .first_fixes import source
from .initial import align
from .location import GIVEN_STD
from .rest import rests

PARTS = {"lla": 3, "v_n": 3, "rph": 3, "b_a": 3, "b_g": 3, "std": 15}
"""Fields of an InitialState that may be missing, and their length."""
MAX_HEADING = 4 * np.pi  # rad: a larger value is probably in degrees
GIVEN_SPEED_STD = 0.5  # m/s, of a velocity that was given without its standard deviation
GIVEN_ANGLE_STD = np.radians(2.0)  # the same of roll, pitch and heading
REST_SPEED_STD = 0.1  # m/s, where no fix measures the velocity and the IMU shows rest


def missing_fields(start: InitialState) -> list[str]:
    """Names of the parts that are not given; `rph` where roll and pitch are NaN."""
    return [name for name in PARTS if not _is_given(start, name)]


def _is_given(start: InitialState, name: str) -> bool:
    values = getattr(start, name)
    return np.size(values) > 0 and not _heading_alone(name, values)


def _heading_alone(name: str, values: object) -> bool:
    """True where `rph` has only a heading: NaN, NaN and a number. Other values are refused
    elsewhere."""
    try:
        rph = np.asarray(values, float)
    except (TypeError, ValueError):
        return False
    known = np.isfinite(rph) & (np.abs(rph) <= MAX_HEADING)
    return (
        name == "rph" and known.tolist() == [False, False, True] and bool(np.isnan(rph[:2]).all())
    )


def fill_missing(
    start: InitialState, recording: Recording, imu: ImuSpec, position: bool = True
) -> InitialState:
    """Return `start` with its missing fields (`()`, or roll and pitch NaN) found from the data of
    `recording` around its time; position: False for an attitude filter.

    A field given without standard deviations gets typical ones. Raises DataError where a field
    cannot be found.
    """
    missing = missing_fields(start)
    if not missing:
        return start
    heading, heading_std = None, float(GIVEN_ANGLE_STD)
    if np.size(start.rph) == 3:
        heading = float(start.rph[2])
        heading_std = heading_std if "std" in missing else float(start.std[ATT.stop - 1])
    if "lla" not in missing:
        recording = recording.with_meta(place=start.lla)
    from_fixes = position and ("lla" in missing or source(recording, "position") is not None)
    found = align(
        recording, imu, heading=heading, heading_std=heading_std, at=start.t, position=from_fixes
    )
    std, v = np.array(found.std), found.v_n
    if not from_fixes and rests(recording, start.t).until(recording.imu, start.t) > start.t:
        v, std[VEL] = (0.0, 0.0, 0.0), REST_SPEED_STD
    for name, states, usual in (
        ("lla", POS, GIVEN_STD),
        ("v_n", VEL, GIVEN_SPEED_STD),
        ("rph", ATT, GIVEN_ANGLE_STD),
    ):
        if name not in missing:
            std[states] = usual
    parts = found._replace(v_n=v, std=tuple(map(float, std)))
    given = {name: getattr(start, name) for name in PARTS if name not in missing}
    note = f"{', '.join(given) or 'time'} given; {found.note}"
    return parts._replace(t=start.t, note=note, motion=(), **given)
