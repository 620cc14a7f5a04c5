"""Wheel speed that contradicts the accelerometer: wheels that spin or lock.

A filter of two states follows the forward speed and what the forward acceleration is wrong by (bias,
tilt), and a fix whose innovation is beyond chance is slip. The acceleration is the forward specific
force less gravity, whose direction the gyro carries on and the lateral force corrects slowly: that
of a car that does not slip sideways is yaw rate times speed.
"""

import numpy as np

from ..core.loop.contract import Imu
from ..data.solution import Source
from ..typing import Array, Mask
from .lever_arm import lever_arm_of
from .stationary import rate_at_rest, stretches

SURELY = 5.0  # standard deviations of an innovation: beyond it is slip
FORCE_NOISE = 0.05  # m/s/sqrt(s): what vibration and the lever arm leave in the increments
OFFSET, OFFSET_WALK = 0.5, 0.02  # m/s^2 and m/s^2/sqrt(s) of what the acceleration is wrong by
LEVELLING = 10.0  # s in which the lateral force corrects the roll
MAX_SLIP = 8.0  # s: what contradicts for longer is no slip, and the fixes are followed again
BEGIN = 1.0  # s over whose mean force the direction of gravity begins
MAX_SHARE = 0.3  # of the fixes that slip
SHOWN = 5  # slips whose times a note tells
SCALE = 0.02  # of a change of speed, by which a wheel speed may be off without slip
LATE = 0.05  # s by which it may be late


def without_slip(wheel: Source, imu: Imu) -> tuple[Source, list[str]]:
    """(the wheel speed, of kind speed and below zero backwards, without the fixes that contradict the
    samples of the IMU; a note on them). Where more than `MAX_SHARE` do, all are kept: that is no slip."""
    slips, name = is_slipping(wheel, imu), wheel.name or wheel.kind
    if not slips.any():
        return wheel, []
    if slips.mean() > MAX_SHARE:
        return wheel, [
            f"{name}: {slips.mean():.0%} of the fixes contradict the accelerometer, which is no slip "
            f"of wheels, so all are kept; check scale, unit, sign and clock"
        ]
    spans = stretches(slips)
    shown = [f"{wheel.t[first]:.1f} to {wheel.t[last - 1]:.1f} s" for first, last in spans]
    more = f" and {len(spans) - SHOWN} more" if len(spans) > SHOWN else ""
    return wheel._where(~slips), [
        f"{name}: {slips.sum()} fixes left out that contradict the accelerometer, wheels that spin or "
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
    # of the IMU: the point of the wheels is `arm` from it
    speed = wheel.y[inside[1:], 0] - rate[:, 1] * arm[2] + rate[:, 2] * arm[1]
    swing = -arm[0] * (rate[:, 1] ** 2 + rate[:, 2] ** 2) * dt
    std = np.broadcast_to(wheel.std[:, 0], len(wheel.t))[inside[1:]]
    found[inside[1:]] = _follow(dt, dtheta, dv, swing, speed, std, gravity)
    return found


def _between(imu: Imu, t: Array) -> tuple[Array, Array, Array]:
    """(s, rad, m/s) that the samples sum up to between neighbours of the times t, without the mean
    rate: at rest where there is rest, else that of roll and pitch, which do not add up, and the median
    about the vertical, because roads are mostly straight."""
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
    """(3,) m/s^2: gravity in the body about t, by the mean force."""
    rows = (imu.t > t - BEGIN) & (imu.t <= t + BEGIN)
    force = imu.dv[rows].sum(axis=0) / imu.dt[rows].sum()
    return -force


def _follow(
    dt: Array, dtheta: Array, dv: Array, swing: Array, speed: Array, std: Array, gravity: Array
) -> Mask:
    """Which of the speeds (m,) contradict the increments (m, 3) before them."""
    found = np.zeros(len(dt), bool)
    gx, gy, gz = gravity.tolist()
    v, offset, since = float(speed[0]), 0.0, 0.0
    pvv, pvo, poo = float(std[0]) ** 2, 0.0, OFFSET**2
    columns = zip(*(column.tolist() for column in (dt, dtheta, dv, swing, speed, std)))
    for k, (step, (p, q, r), (x, y, _), more, measured, noise) in enumerate(columns):
        # gravity is carried on by the gyro, to second order
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
