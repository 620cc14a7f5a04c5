"""From the first seconds of a Recording to a filter's Start: position and velocity from fixes, level from specific force, heading from what there is.

The start is the first position fix; where the heading can only come from the course, the first fix faster than `MOVING`. Everything found is
stated in `Start.note` and can be overridden with `Start._replace`. Source: Groves (2013) section 5.6.
"""
import numpy as np

from .core.contract import Start
from .core.earth import GRAVITY_EQUATOR, RATE
from .data import DataError
from .geodesy import displaced, displacement
from .rest import at_rest

MOVING = 5.0                    # m/s: above it the course of the velocity is taken as heading
COURSE_SD = np.radians(15.0)    # wind, sideslip
UNKNOWN_SD = np.radians(104.0)  # uniform over the circle
LEVEL_SD_REST, LEVEL_SD_MOVING, LEVEL_SD_GUESSED = np.radians(0.5), np.radians(5.0), np.radians(15.0)
REST_TIME = 2.0                 # s: shortest rest that is worth averaging
SLOW = 1.0                      # m/s: fixes surely faster than that are no rest, whatever the IMU feels
UNKNOWN_ACCELERATION = 3.0      # m/s^2: what a velocity may change by between fixes
REST_SEARCH = 600.0             # s before the start in which rest is looked for


def align(recording, imu, heading=None, heading_sd=np.radians(2.0), at=None):
    """A Start for `recording`, whose IMU is the ImuSpec `imu`.

    heading, heading_sd: rad, where the caller knows it; at: s, where the caller wants another instant (then the fixes next to it are used).
    Raises DataError where there is no position fix to start from.
    """
    position = _source(recording, "position")
    if position is None:
        raise DataError("no position fix to start from: add a position aiding, or give start=")
    if at is not None and not recording.span[0] <= at < recording.span[1]:
        raise DataError(f"cannot start at {at:g} s; the IMU record covers {recording.span[0]:.3f} to {recording.span[1]:.3f} s")
    velocity = _source(recording, "velocity")
    t, v, v_sd, moving = _instant(recording, position, velocity, heading, at)
    k = int(np.argmin(np.abs(position.t - t)))
    age = abs(t - position.t[k])
    b_a_sd, b_g_sd = imu.bias_sd()
    rest = _rest_before(recording, t)
    bg, bg_sd, bias_note = _gyro_bias(recording, rest, b_g_sd)
    omega, f = _rates(recording, t, bg)
    psi, psi_sd, psi_note = _heading(recording, t, v, moving, heading, heading_sd, omega)
    roll, pitch, level_sd, level_note = _level(recording, t, rest, v, psi, psi_sd, velocity, b_a_sd, bg, omega, f)
    C = body_to_navigation(roll, pitch, psi)
    v = v - C @ np.cross(omega, _arm(velocity))
    lla = displaced(position.y[k], v * (t - position.t[k]) - C @ _arm(position))
    sd = [*np.hypot(position.sd[k], age * v_sd), *v_sd, level_sd, level_sd, psi_sd, *[b_a_sd] * 3, *bg_sd]
    numbers = lambda values: tuple(float(value) for value in values)
    note = f"position and velocity at {t:.2f} s, {psi_note}, {level_note}, {bias_note}"
    return Start(float(t), numbers(lla), numbers(v), numbers((roll, pitch, psi)), (0.0, 0.0, 0.0), numbers(bg), numbers(sd), note)


def _arm(source):
    """Lever arm from the IMU to the antenna of a source, m, body."""
    return np.array((tuple(source.parameters) if source is not None else ()) + (0.0, 0.0, 0.0))[:3]


def _rates(recording, t, bg):
    """Mean angular rate (rad/s, less the gyro bias) and specific force (m/s^2) over half a second before and after t."""
    imu = recording.imu
    rows = slice(*np.clip(np.searchsorted(imu.t, [t - 0.5, t + 0.5 + 1e-9]), [0, 1], [len(imu.t) - 1, len(imu.t)]))
    seconds = imu.dt[rows].sum()
    return imu.dtheta[rows].sum(axis=0) / seconds - bg, imu.dv[rows].sum(axis=0) / seconds


def _source(recording, kind):
    """The first source of that kind with a complete fix within the IMU's time, those fixes only; or None."""
    for a in recording.aidings:
        usable = np.isfinite(a.y).all(axis=1) & (a.t >= recording.span[0]) & (a.t < recording.span[1]) if a.kind == kind else np.array([False])
        if usable.any():
            return a._where(usable)
    return None


def _instant(recording, position, velocity, heading, at):
    """When to start, and velocity (m/s), its sd and whether the course is to be believed then."""
    t, v, sd = _velocities(position, velocity)
    if at is not None:
        k = int(np.argmin(np.abs(t - at)))
        between = np.array([np.interp(at, t, column) for column in v.T])
        return at, between, np.hypot(sd[k], UNKNOWN_ACCELERATION * abs(at - t[k])), np.hypot(*between[:2]) > MOVING
    fast = np.hypot(v[:, 0], v[:, 1]) > MOVING
    wait = heading is None and _source(recording, "heading") is None and fast.any()
    k = int(np.argmax(fast)) if wait else 0
    return max(t[k], recording.span[0]), v[k], sd[k], fast[k]


def _velocities(position, velocity):
    """Times, velocities and standard deviations: of the velocity source, else of differences of positions."""
    if velocity is not None:
        later = velocity.t >= position.t[0] - 0.5
        if later.any():
            return velocity.t[later], velocity.y[later], velocity.sd[later]
    if len(position.t) < 2:
        return position.t, np.zeros((1, 3)), np.full((1, 3), 10.0)
    step = np.diff(position.t)[:, None]
    v = displacement(position.y[1:], position.y[:-1]) / step
    return position.t[1:], v, np.hypot(position.sd[1:], position.sd[:-1]) / step + 0.5


def _rest_before(recording, t):
    """The rests before t that lasted REST_TIME, as arrays of rows, in order."""
    imu = recording.imu
    first, n = np.searchsorted(imu.t, [t - REST_SEARCH, t])
    if n - first < 2:
        return []
    still = first + np.flatnonzero(at_rest(type(imu)(*(column[first:n] for column in imu))) & ~_moves(recording, imu.t[first:n]))
    runs = np.split(still, np.flatnonzero(np.diff(still) > 1) + 1) if len(still) else []
    return [run for run in runs if imu.t[run[-1]] - imu.t[run[0]] >= REST_TIME]


def _moves(recording, t):
    """Where the fixes around the times t say that the vehicle moves: smooth flight feels like rest to an IMU."""
    position, velocity = _source(recording, "position"), _source(recording, "velocity")
    t_fix, v, sd = _velocities(position, velocity)
    fast = np.hypot(v[:, 0], v[:, 1]) > SLOW + 2 * np.hypot(sd[:, 0], sd[:, 1])
    after = np.searchsorted(t_fix, t)
    return fast[np.clip(after - 1, 0, len(fast) - 1)] | fast[np.clip(after, 0, len(fast) - 1)]


def _heading(recording, t, v, moving, heading, heading_sd, omega):
    if heading is not None:
        return float(heading), float(heading_sd), "heading given"
    source = _source(recording, "heading")
    if source is not None:
        k = int(np.argmin(np.abs(source.t - t)))
        return float(source.y[k, 0]), float(np.hypot(source.sd[k, 0], np.linalg.norm(omega) * (t - source.t[k]))), "heading measured"
    if moving:
        return float(np.arctan2(v[1], v[0])), COURSE_SD, f"heading from the course at {np.hypot(v[0], v[1]):.1f} m/s"
    return 0.0, UNKNOWN_SD, f"heading unknown (never faster than {MOVING:g} m/s)"


def _level(recording, t, rest, v, psi, psi_sd, velocity, b_a_sd, bg, omega, f):
    """Roll, pitch, their sd and a note: from the last rest, carried to t by the gyros; else from specific force less the acceleration."""
    imu = recording.imu
    if rest and t - imu.t[rest[-1][-1]] < 30.0:
        last = rest[-1]
        roll, pitch = level(imu.dv[last].sum(axis=0) / imu.dt[last].sum())
        since = slice(last[-1] + 1, int(np.searchsorted(imu.t, t)))
        roll, pitch = _carried(roll, pitch, imu.dtheta[since] - bg * imu.dt[since, None])
        age = t - imu.t[last[-1]]
        return roll, pitch, np.hypot(LEVEL_SD_REST, b_a_sd / GRAVITY_EQUATOR) + np.radians(0.05) * age, f"level from the rest {age:.0f} s before"
    if psi_sd == UNKNOWN_SD:
        return *level(f), LEVEL_SD_GUESSED, "level from specific force alone"
    if velocity is not None and len(velocity.t) > 1:
        k = int(np.clip(np.searchsorted(velocity.t, t), 1, len(velocity.t) - 1))
        step = velocity.t[k] - velocity.t[k - 1]
        if step <= 2.0 and velocity.t[k - 1] <= t <= velocity.t[k]:
            return *level(f, (velocity.y[k] - velocity.y[k - 1]) / step, psi), LEVEL_SD_MOVING, "level in motion"
    c, s = np.cos(psi), np.sin(psi)
    v_b = np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], 0.0])
    return *level(f - np.cross(omega, v_b)), LEVEL_SD_GUESSED, "level in motion, without the change of speed"


def level(f_b, a_n=(0.0, 0.0, 0.0), heading=0.0):
    """Roll and pitch (rad, upright branch) from specific force f_b (m/s^2) of a body that accelerates by a_n (m/s^2, NED) at a known heading.

    Solves Ry(pitch) Rx(roll) f_b = Rz(heading)' (a_n - g); without acceleration roll = atan2(-f_y, -f_z), pitch = atan2(f_x, hypot(f_y, f_z)).
    """
    g = np.linalg.norm(f_b) if not np.any(a_n) else GRAVITY_EQUATOR
    n = np.asarray(a_n, float) - [0, 0, g]
    c, s = np.cos(heading), np.sin(heading)
    h = np.array([c * n[0] + s * n[1], c * n[1] - s * n[0], n[2]])
    h *= np.linalg.norm(f_b) / np.linalg.norm(h)
    across = np.hypot(f_b[1], f_b[2])
    roll = -np.arccos(np.clip(h[1] / max(across, 1e-9), -1, 1)) - np.arctan2(f_b[2], f_b[1])
    roll = (roll + np.pi) % (2 * np.pi) - np.pi
    w = f_b[1] * np.sin(roll) + f_b[2] * np.cos(roll)
    return float(roll), float(np.arctan2(h[0] * w - h[2] * f_b[0], h[0] * f_b[0] + h[2] * w))


def body_to_navigation(roll, pitch, heading):
    """C_nb (3, 3) of Euler angles, rad."""
    from scipy.spatial.transform import Rotation
    return Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()


def _carried(roll, pitch, dtheta):
    """Roll and pitch after the rotation increments dtheta (n, 3), rad: they turn the direction of specific force in the body."""
    from scipy.spatial.transform import Rotation
    turn = Rotation.from_rotvec(np.vstack([np.zeros(3), dtheta]))
    while len(turn) > 1:    # products of neighbours, in order, until one is left
        pairs = turn[0:len(turn) - 1:2] * turn[1::2]
        turn = Rotation.concatenate([pairs, turn[-1:]]) if len(turn) % 2 else pairs
    return level(turn[0].inv().apply(body_to_navigation(roll, pitch, 0.0).T @ [0.0, 0.0, -GRAVITY_EQUATOR]))


def _gyro_bias(recording, rest, b_g_sd):
    """Gyro bias (rad/s) from all rest, where the IMU's own turn-on bias is larger than the Earth's rate that rest cannot tell from it."""
    if not rest or b_g_sd <= 2 * RATE:
        return np.zeros(3), np.full(3, b_g_sd), "biases smaller than the Earth's rate" if rest else "biases unknown"
    imu, rows = recording.imu, np.concatenate(rest)
    T = imu.dt[rows].sum()
    noise = imu.dtheta[rows].std(axis=0) * np.sqrt(len(rows)) / T
    return imu.dtheta[rows].sum(axis=0) / T, np.hypot(noise, RATE), f"gyro bias from {T:.0f} s of rest"
