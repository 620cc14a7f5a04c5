"""Wheel slip: wheel speeds that contradict the accelerometer because wheels spin or lock.

A filter with two states estimates the forward speed and the error of the forward acceleration
(bias, tilt). A fix with a significant innovation is slip. The acceleration is the forward specific
force less gravity, whose direction the gyro propagates and the lateral force corrects slowly:
without sideslip, the lateral acceleration of a car is yaw rate times speed.
"""

import numpy as np

from ..core.loop.contract import Imu
from ..data.solution import Source
from ..typing import Array, Mask
from .lever_arm import lever_arm_of
from .stationary import rate_at_rest, stretches

SURELY = 5.0  # standard deviations of an innovation above which it is slip
FORCE_NOISE = 0.05  # m/s/sqrt(s): noise of the increments from vibration and the lever arm
OFFSET, OFFSET_WALK = 0.5, 0.02  # m/s^2 and m/s^2/sqrt(s) of the error of the acceleration
LEVELLING = 10.0  # s in which the lateral force corrects the roll
MAX_SLIP = 8.0  # s: a longer contradiction is not slip, and the fixes are used again
BEGIN = 1.0  # s of the mean force that initialises the direction of gravity
MAX_SHARE = 0.3  # largest part of the fixes with slip
SHOWN = 5  # slips whose times a note lists
SCALE = 0.02  # of a change of speed: error of a wheel speed without slip
LATE = 0.05  # s: possible delay of a wheel speed


def without_slip(wheel: Source, imu: Imu) -> tuple[Source, list[str]]:
    """(the wheel speed, of kind speed and negative backwards, without the fixes that contradict the
    IMU samples; a note on them). Where more than `MAX_SHARE` do, all are kept, because this is not
    slip."""
    slips, name = is_slipping(wheel, imu), wheel.name or wheel.kind
    if not slips.any():
        return wheel, []
    if slips.mean() > MAX_SHARE:
        return wheel, [
            f"{name}: {slips.mean():.0%} of the fixes contradict the accelerometer, too many for wheel "
            f"slip, so all are kept; check scale, unit, sign and clock"
        ]
    spans = stretches(slips)
    shown = [f"{wheel.t[first]:.1f} to {wheel.t[last - 1]:.1f} s" for first, last in spans]
    more = f" and {len(spans) - SHOWN} more" if len(spans) > SHOWN else ""
    return wheel._where(~slips), [
        f"{name}: {slips.sum()} fixes left out that contradict the accelerometer, because wheels spin or "
        f"lock: {', '.join(shown[:SHOWN])}{more}"
    ]


def is_slipping(wheel: Source, imu: Imu) -> Mask:
    """(m,) bool: the fixes of a wheel speed that contradict the IMU."""
    found = np.zeros(len(wheel.t), bool)
    inside = np.flatnonzero((wheel.t > imu.t[0] - imu.dt[0]) & (wheel.t <= imu.t[-1]))
    inside = inside[np.isfinite(wheel.y[inside, 0])]
    if len(inside) < 2:
        return found
    t = wheel.t[inside]
    dt, dtheta, dv = _between(imu, t)
    gravity = _initial_gravity(imu, float(t[0]))
    arm = lever_arm_of(wheel)
    rate = dtheta / dt[:, None]
    # at the IMU: the wheels' point is `arm` from it
    speed = wheel.y[inside[1:], 0] - rate[:, 1] * arm[2] + rate[:, 2] * arm[1]
    swing = -arm[0] * (rate[:, 1] ** 2 + rate[:, 2] ** 2) * dt
    std = np.broadcast_to(wheel.std[:, 0], len(wheel.t))[inside[1:]]
    found[inside[1:]] = _follow(dt, dtheta, dv, swing, speed, std, gravity)
    return found


def _between(imu: Imu, t: Array) -> tuple[Array, Array, Array]:
    """(s, rad, m/s): the samples summed between successive times t, without the gyro bias. The bias
    is the mean rate at rest, or without a rest the mean about roll and pitch, whose angles stay
    bounded, and the median about the vertical, because roads are mostly straight."""
    bias = rate_at_rest(imu)
    if bias is None:
        bias = imu.dtheta.sum(axis=0) / imu.dt.sum()
        bias[2] = np.median(imu.dtheta[:, 2] / imu.dt)
    columns = np.c_[imu.dt, imu.dtheta - bias * imu.dt[:, None], imu.dv]
    edges = np.r_[imu.t[0] - imu.dt[0], imu.t]
    sums = np.vstack([np.zeros(7), np.cumsum(columns, axis=0)])
    between = np.diff(np.stack([np.interp(t, edges, each) for each in sums.T], axis=1), axis=0)
    return np.maximum(between[:, 0], 1e-6), between[:, 1:4], between[:, 4:]


def _initial_gravity(imu: Imu, t: float) -> Array:
    """(3,) m/s^2: gravity in the body around t, from the mean force."""
    rows = (imu.t > t - BEGIN) & (imu.t <= t + BEGIN)
    force = imu.dv[rows].sum(axis=0) / imu.dt[rows].sum()
    return -force


def _follow(
    dt: Array, dtheta: Array, dv: Array, swing: Array, speed: Array, std: Array, gravity: Array
) -> Mask:
    """Return True for the speeds (m,) that contradict the increments (m, 3) before them."""
    found = np.zeros(len(dt), bool)
    gx, gy, gz = gravity.tolist()
    v, offset, since = float(speed[0]), 0.0, 0.0
    pvv, pvo, poo = float(std[0]) ** 2, 0.0, OFFSET**2
    columns = zip(*(column.tolist() for column in (dt, dtheta, dv, swing, speed, std)))
    for k, (step, (p, q, r), (x, y, _), more, measured, noise) in enumerate(columns):
        # the gyro propagates gravity, to second order
        mx, my, mz = (
            gx - 0.5 * (q * gz - r * gy),
            gy - 0.5 * (r * gx - p * gz),
            gz - 0.5 * (p * gy - q * gx),
        )
        gx, gy, gz = gx - (q * mz - r * my), gy - (r * mx - p * mz), gz - (p * my - q * mx)
        gy -= min(step / LEVELLING, 1.0) * (y / step + gy - r / step * v)
        change = x + gx * step + more + offset * step
        v += change
        pvv += (2 * pvo + poo * step) * step + FORCE_NOISE**2 * step + (SCALE * change) ** 2
        pvo += poo * step
        poo += OFFSET_WALK**2 * step
        late = LATE * change / step
        innovation, S = measured - v, pvv + noise * noise + late * late
        if innovation * innovation > SURELY**2 * S:
            found[k] = True
            since += step
            if since < MAX_SLIP:
                continue
            v, offset, pvv, pvo, poo, since = measured, 0.0, noise * noise, 0.0, OFFSET**2, 0.0
            continue
        since = 0.0
        a, b = pvv / S, pvo / S
        v, offset = v + a * innovation, offset + b * innovation
        poo -= b * pvo
        pvv, pvo = (1 - a) * pvv, (1 - a) * pvo
    return found
