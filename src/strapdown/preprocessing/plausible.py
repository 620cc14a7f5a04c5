"""Signs of mistaken units and axes in IMU samples in SI and body FRD.

`mistakes` are contradictions to gravity, on which reading stops; `doubts` are possible mistakes
that `inspect` reports. Every text ends with the remedy. The limits leave a margin of a factor of 4
or more for the recorded car, aircraft and hand-held data.
"""

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.vehicle import GivenVehicle, find
from ..data.verdict import Reason
from ..typing import Array, ArrayLike
from ..units.constants import COMMON_GYRO_RANGE, STANDARD_GRAVITY as G
from .stationary import rate_at_rest

MIN_MEDIAN_FORCE, MAX_MEDIAN_FORCE = 3.0, 60.0
"""Limits of the median magnitude of a vehicle's specific force, m/s^2."""
STEADY, TILT_RATE = 0.4, 0.5
"""A second is steady when its mean specific force is within STEADY (m/s^2) of gravity and moves
by less than 0.3 between its halves; a body that tilts at TILT_RATE (rad/s) for that second would
move it by 2.4. Recorded data stay below 0.12 rad/s."""
ACCEL_SLIPS = (
    (1 / G, "values in g were read as m/s^2, is the unit g?"),
    (G, "values in m/s^2 were read as g, is the unit m/s^2?"),
    (1000 / G, "values in mg were read as m/s^2, is the unit mg?"),
    (G / 1000, "values in m/s^2 were read as mg, is the unit m/s^2?"),
    (1000.0, "values in mg were read as g, is the unit mg?"),
    (0.001, "values in g were read as mg, is the unit g?"),
)
"""Factors of mistaken units in gravity, and their messages."""
NO_GRAVITY = "gravity was taken out of them; record the raw accelerometer"
SPIKES = 0.01
"""Share of samples with rates beyond the range of gyros that may be spikes; of values in deg/s that
were read as rad/s it is larger wherever their rms is so."""
UNEVEN = 2.0
"""Ratio of the 90th to the 10th percentile of a force that is not mostly gravity."""

COLDEST, HOTTEST = -60.0, 130.0
"""Limits of the temperature inside an IMU, degC."""


def is_temperature(values: ArrayLike) -> bool:
    """Return True where the values are possible temperatures of an IMU, degC; all zeros, as
    simulators write, mean none."""
    values = np.asarray(values, float)
    known = values[np.isfinite(values)]
    return bool(known.any() and known.min() > COLDEST and known.max() < HOTTEST)


def mistakes(
    imu: Imu, kind: str | None = None, vehicle: GivenVehicle | None = None
) -> list[tuple[str, str]]:
    """Return [(field, text)] of impossible values; the field is the key of [imu] that is probably
    incorrect, `kind` the given kind of the samples, `vehicle` the carrier of the IMU."""
    imu = _without_spikes(imu)
    rate, force = half_seconds(imu)
    found = _unit_of_accel(force, float(np.median(imu.dt)), kind)
    if not found:
        feels_tilt = not find(vehicle).by_thrust
        found = _unit_of_gyro(imu, rate, force, feels_tilt) + _gravity_sign(force)
    return found


def refuse_mistakes(
    imu: Imu, where: object, kind: str | None = None, vehicle: GivenVehicle | None = None
) -> None:
    """Raise DataError, which begins with `where`, with the first of the `mistakes`."""
    for _, text in mistakes(imu, kind, vehicle):
        raise DataError(f"{where}: {text}")


def _without_spikes(imu: Imu) -> Imu:
    """Return the samples without single rates that no gyro measures, which filters bridge; where there
    are many, all of them."""
    beyond = np.abs(imu.dtheta).max(axis=1) > COMMON_GYRO_RANGE * imu.dt
    few = 0 < np.count_nonzero(beyond) <= SPIKES * len(imu.t)
    return Imu(*(column[~beyond] for column in imu)) if few else imu


def half_seconds(imu: Imu) -> tuple[Array, Array]:
    """Mean rate (rad/s) and mean specific force (m/s^2) over consecutive half seconds of
    samples, (m, 3) each."""
    width = min(len(imu.t), max(1, round(0.5 / float(np.median(imu.dt)))))
    whole = len(imu.t) // width * width
    seconds = imu.dt[:whole].reshape(-1, width).sum(axis=1)[:, None]
    return tuple(
        column[:whole].reshape(-1, width, 3).sum(axis=1) / seconds
        for column in (imu.dtheta, imu.dv)
    )


def _unit_of_accel(force: Array, interval: float, kind: str | None) -> list[tuple[str, str]]:
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    if MIN_MEDIAN_FORCE <= magnitude <= MAX_MEDIAN_FORCE:
        return []
    least, most = np.percentile(np.linalg.norm(force, axis=1), [10, 90])
    if magnitude < MIN_MEDIAN_FORCE and most > UNEVEN * least:
        return [
            (
                "accel",
                f"the forces have a median magnitude of {magnitude:.3g} m/s^2 and vary, but gravity "
                f"alone gives 9.8: {NO_GRAVITY}",
            )
        ]
    slips = [("accel.unit", ratio, text) for ratio, text in ACCEL_SLIPS]
    slips += [("kind", interval, "are these increments, not rates?")] * (kind != "increment")
    slips += [("kind", 1 / interval, "are these rates, not increments?")] * (kind != "rate")
    fitting = [(field, text) for field, ratio, text in slips if 0.6 < magnitude / G / ratio < 1.7]
    field = fitting[0][0] if fitting else "accel.unit"
    return [
        (
            field,
            f"specific force has median magnitude {magnitude:.3g} m/s^2, but gravity alone gives "
            f"9.8: "
            + (" Or ".join(text for _, text in fitting) or "check unit, scale and columns"),
        )
    ]


def _unit_of_gyro(imu: Imu, rate: Array, force: Array, feels_tilt: bool) -> list[tuple[str, str]]:
    remedy = "check the unit: deg/s read as rad/s?"
    rms = float(
        np.sqrt(np.einsum("ij,ij->", imu.dtheta, imu.dtheta) / len(imu.t)) / np.median(imu.dt)
    )
    if rms > COMMON_GYRO_RANGE:
        return [
            (
                "gyro.unit",
                f"angular rate has rms {rms:.3g} rad/s ({np.degrees(rms):.0f} deg/s): {remedy}",
            )
        ]
    tilt = steady_tilt_rate(rate, force)
    if feels_tilt and (tilt > TILT_RATE).sum() >= max(3, 0.01 * len(tilt)):
        return [
            (
                "gyro.unit",
                f"the gyro shows tilting at up to {tilt.max():.3g} rad/s {UNFELT}: {remedy} The "
                f'accelerometers of a multicopter do not show tilt: if it is one, set vehicle = "multicopter" (--vehicle '
                f"multicopter)",
            )
        ]
    return []


def steady_tilt_rate(rate: Array, force: Array) -> Array:
    """Return the mean rate about the horizontal axes, rad/s, in each second with a steady specific
    force equal to gravity, from the `half_seconds`."""
    first, second = force[:-1:2], force[1::2]
    mean, turn = (first + second) / 2, (rate[:-1:2] + rate[1::2]) / 2
    magnitude = np.linalg.norm(mean, axis=1)
    steady = (np.abs(magnitude - G) < STEADY) & (np.linalg.norm(first - second, axis=1) < 0.3)
    up, turn = mean[steady] / magnitude[steady, None], turn[steady]
    return np.linalg.norm(np.cross(turn, up), axis=1)


def _gravity_sign(force: Array) -> list[tuple[str, str]]:
    z = float(np.median(force[:, 2]))
    if z < 0.7 * np.median(np.linalg.norm(force, axis=1)):
        return []
    return [
        (
            "axes",
            f"specific force on z has median {z:+.2f} m/s^2; a level body at rest must read -9.8 on "
            f"z (forward-right-down): "
            "check axes (FLU or RFU instead of FRD?), mounting, or the sign of accel",
        )
    ]


UNFELT = "while the specific force stays steady"
"""Part of the message on tilting that the accelerometer does not show, as on a multicopter."""
USUAL_GYRO_BIAS = np.radians(2.5)
"""Largest reading at rest of a gyro without a description, rad/s."""


def doubts(imu: Imu, gyro_bias_std: float = 0.0) -> list[Reason]:
    """Return Reasons for unusual values that may be mistakes; `gyro_bias_std` (rad/s) is that of
    the IMU's description, 0 without one."""
    rate, force = half_seconds(imu)
    found = []
    median = np.median(force, axis=0)
    largest = int(np.argmax(np.abs(median)))
    if largest != 2 and abs(median[largest]) > 0.7 * np.linalg.norm(median):
        seen = f"specific force lies mostly on {'xyz'[largest]} ({median[largest]:+.2f} m/s^2), not on z"
        found.append(Reason("axes", seen, "check axes or mounting"))
    bias = rate_at_rest(imu)
    most = max(USUAL_GYRO_BIAS, 5 * gyro_bias_std)
    if bias is not None and np.abs(bias).max() > most:
        seen = (
            f"the gyro reads [{' '.join(f'{b:.2f}' for b in np.degrees(bias))}] deg/s at rest: a "
            f"large turn-on bias, or an incorrect unit or scale"
        )
        remedy = "check `gyro.unit` and `gyro.scale`, or describe an IMU with such a bias"
        found.append(Reason("gyro", seen, remedy))
    for name, columns in (("gyro", imu.dtheta), ("accel", imu.dv)):
        still = [
            axis
            for axis, column in zip("xyz", (columns / imu.dt[:, None]).T)
            if np.ptp(column) < 1e-9 * max(1.0, np.abs(column).max())
        ]
        if still and len(imu.t) > 10:
            seen = f"{name} {', '.join(still)} never changes"
            found.append(Reason("repeated", seen, "check its column"))
    return found
