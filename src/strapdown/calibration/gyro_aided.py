"""Calibration of a magnetometer against the gyros: in a window of seconds the true field keeps its
direction while the body turns under it.

    y = A C(t)' u B + b + noise

with u the unit vector of the field in body axes at the start of its window, C what the gyros have
turned since then, A (3, 3) soft iron, scale and the turn of the magnetometer against the IMU, b
hard iron, B the field's strength; the gyro bias is estimated too. It is a fit by maximum likelihood
(white noise on y) over A, b, the bias and one u per window, and unlike the ellipsoid it needs no
attitude upside down: dm/dt = -omega x m is linear in the parameters of M = A^-1 whatever the
directions (Kok & Schoen 2016, IEEE Sensors Journal 16(14), fit the same model with a filter). What
the turns do not determine is held at identity. Where the dip is known, the mean specific force of a
window, which is up but for the change of velocity, tells a mirrored sensor, and where to begin. All
is in units of B.
"""

from typing import NamedTuple, TypeAlias

import numpy as np

from ..core.loop.contract import Imu
from ..geometry.rotations import Rotation, running_products
from ..preprocessing.imu_samples import GAP_MEDIANS
from ..typing import Array, Ints, Mask
from .ellipsoid import (
    OUTLIER,
    STEPS,
    WEAKEST,
    EllipsoidFit,
    inflation,
    robust_std,
    weakest_direction,
)

WINDOW_TIME = 30.0  # s: long against turns, short against the wander of a gyro of 0.1 deg/s
EPOCH = 0.1  # s between the samples that are used, at least
LAG = 2.0  # s between the samples of the linear start, in a window of full length
# weight of a sample's height above the horizon in the start: a change of velocity by 30 m/s in a
# window tilts it by 0.1 rad
HEIGHT_WEIGHT = 0.1
GYRO_STD = 0.1  # rad/s, of the bias before the fit
TURNING_PARAMETERS = tuple(
    f"soft iron {i}{j}" if i != j else f"scale {i}" for i in "xyz" for j in "xyz"
) + (
    "bias x",
    "bias y",
    "bias z",
)

Recover: TypeAlias = tuple[Array, Array, Array]
"""Function that gives the change of the directions u back from that of all else: see `_normal`."""


class Windows(NamedTuple):
    """Samples in windows of equal length; W windows of L samples."""

    rows: Ints  # (W, L) of the magnetometer
    z: Array  # (W, L, 3) in units of the strength
    # (W, L, 3, 3) from body axes at the sample to those at the one before, by gyros without bias;
    # the first is identity
    turn: Array
    # (W, L, 3, 3) s: rotation vector of the same turn per gyro bias, in body axes at the sample
    slip: Array
    # (W, L, 3) mean specific force since the sample before, in body axes at the sample, m/s^2; the
    # first is 0
    force: Array


class State(NamedTuple):
    """Estimated quantities."""

    A: Array  # (3, 3)
    b: Array  # (3,)
    gyro: Array  # (3,) bias, rad/s
    u: Array  # (W, 3)


def windows(t: Array, y: Array, imu: Imu, strength: float) -> Windows | None:
    """The Windows of samples y (n, 3) at t (n,) s; None where there are fewer than 20 samples
    without a gap."""
    after = np.minimum(np.searchsorted(imu.t, t - 1e-6), len(imu.t) - 1)
    covered = (t <= imu.t[-1] + 1e-6) & (t >= imu.t[after] - imu.dt[after] - 1e-6)
    rows = np.flatnonzero(np.isfinite(y).all(axis=1) & covered)
    if len(rows) < 20:
        return None
    rows = rows[:: max(1, round(EPOCH / max(float(np.median(np.diff(t[rows]))), 1e-6)))]
    spacing = float(np.median(np.diff(t[rows])))
    gaps = np.cumsum(np.r_[False, np.diff(imu.t) > imu.dt[1:] * GAP_MEDIANS])
    part = gaps[after[rows]] + np.cumsum(np.r_[0, np.diff(t[rows]) > 3 * spacing])
    stretches = [rows[part == k] for k in np.unique(part)]
    length = min(max(20, round(WINDOW_TIME / spacing)), max(map(len, stretches)))
    kept = [
        np.array_split(s[: len(s) // length * length], len(s) // length)
        for s in stretches
        if len(s) >= length
    ]
    if length < 20 or not kept:
        return None
    rows = np.array([window for s in kept for window in s])
    C, S, V = _attitude(t[rows.ravel()], imu)
    C, S, V = (each.reshape(*rows.shape, *each.shape[1:]) for each in (C, S, V))
    turn, slip, force = (
        np.tile(np.eye(3), (*rows.shape, 1, 1)),
        np.zeros(C.shape),
        np.zeros(V.shape),
    )
    turn[:, 1:] = np.swapaxes(C[:, :-1], -1, -2) @ C[:, 1:]
    slip[:, 1:] = np.swapaxes(C[:, 1:], -1, -2) @ (S[:, 1:] - S[:, :-1])
    force[:, 1:] = (
        np.einsum("wkji,wkj->wki", C[:, 1:], V[:, 1:] - V[:, :-1])
        / np.diff(t[rows], axis=1)[..., None]
    )
    return Windows(rows, y[rows] / strength, turn, slip, force)


def _attitude(t: Array, imu: Imu) -> tuple[Array, Array, Array]:
    """Attitude C (n, 3, 3) by the gyros alone, its integral (n, 3, 3) and that of C f (n, 3), at
    times t."""
    total = running_products(Rotation.from_rotvec(imu.dtheta)).as_matrix()  # at the ends of samples
    start = np.concatenate([np.eye(3)[None], total])
    middle = start[:-1] @ Rotation.from_rotvec(imu.dtheta / 2).as_matrix()
    integral = np.concatenate(
        [np.zeros((1, 3, 3)), np.cumsum(middle * imu.dt[:, None, None], axis=0)]
    )
    velocity = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(np.einsum("kij,kj->ki", middle, imu.dv), axis=0)]
    )
    k = np.minimum(np.searchsorted(imu.t, t - 1e-6), len(imu.t) - 1)
    share = np.clip(1 - (imu.t[k] - t) / imu.dt[k], 0, 1)
    C = start[k] @ Rotation.from_rotvec(imu.dtheta[k] * share[:, None]).as_matrix()
    return (
        C,
        integral[k] + share[:, None, None] * (integral[k + 1] - integral[k]),
        velocity[k] + share[:, None] * (velocity[k + 1] - velocity[k]),
    )


def fit_by_turns(
    t: Array, y: Array, imu: Imu, strength: float, dip: float | None = None
) -> tuple[EllipsoidFit, Array] | None:
    """(Fit, gyro bias (3,) rad/s) of a magnetometer y (n, 3) at times t against the gyros of `imu`,
    or None where there are too few samples.

    strength: of the Earth's field, unit of y; dip: rad below the horizon, None where it is not
    known.
    """
    w = windows(t, y, imu, strength)
    if w is None:
        return None
    state, free, weight = _start(w, dip), np.ones(12, bool), np.ones(w.rows.shape)
    state, free, weakest = _hold_weakest(w, state, free, weight)
    while weakest >= WEAKEST:
        state, weight = _estimate(w, state, free, weight)
        before = free.sum()
        state, free, weakest = _hold_weakest(w, state, free, weight)
        if free.sum() == before:
            break
    return _fit(w, state, free, weight, weakest, y, strength), state.gyro


def _hold_weakest(w: Windows, state: State, free: Mask, weight: Array) -> tuple[State, Mask, float]:
    """(State, free, weakest): entries of A held at identity until the turns determine the rest,
    those with most part in the weakest first."""
    free, A = free.copy(), state.A.copy()
    while True:
        H, _, _ = _normal(w, state._replace(A=A), weight)
        weakest, pattern = weakest_direction(_marginal(H, free) / (3 * max(weight.sum(), 1)))
        entries = np.flatnonzero(free[:9])
        if weakest >= WEAKEST or not len(entries):
            return state._replace(A=A), free, weakest
        k = entries[np.argmax(np.abs(pattern[: len(entries)]))]
        free[k], A[k // 3, k % 3] = False, float(k % 4 == 0)


def _start(w: Windows, dip: float | None) -> State:
    """The State of the linear fit: M y - c turned by the gyros from sample to sample; with M =
    identity where that does not determine M."""
    lag = max(1, round(w.z.shape[1] * LAG / WINDOW_TIME))
    C, _ = _window_rotations(w, np.zeros(3))
    down = np.einsum("wkji,wj->wki", C, _down_vectors(w, C))  # at each sample
    R = (np.swapaxes(C[:, :-lag], -1, -2) @ C[:, lag:]).reshape(-1, 3, 3)
    first, second = w.z[:, :-lag].reshape(-1, 3), w.z[:, lag:].reshape(-1, 3)
    rows = np.concatenate(
        [
            np.einsum("ia,kb->kiab", np.eye(3), first).reshape(-1, 3, 9)
            - np.einsum("kia,kb->kiab", R, second).reshape(-1, 3, 9),
            R - np.eye(3),
        ],
        axis=2,
    ).reshape(-1, 12)
    values, vectors = np.linalg.eigh(rows.T @ rows / len(rows))
    M, c = vectors[:9, 0].reshape(3, 3), vectors[9:, 0]
    m = w.z @ M.T - c
    mirrored = np.linalg.det(M) < 0 if dip is None else np.sum(m * down) * np.sin(dip) < 0
    size = np.median(np.linalg.norm(m, axis=2)) * (-1 if mirrored else 1)
    if (
        np.sqrt(max(values[1], 0)) > WEAKEST / 2
        and size
        and np.ptp(np.log(np.linalg.svd(M / size)[1])) < np.log(5)
    ):
        A = np.linalg.inv(M / size)
        b = A @ (c / size)
    else:
        A, turned, come = (
            np.eye(3),
            (np.eye(3) - R).reshape(-1, 3),
            (first - np.einsum("kij,kj->ki", R, second)).ravel(),
        )
        if dip is not None:
            turned = np.concatenate([turned, HEIGHT_WEIGHT * down.reshape(-1, 3)])
            come = np.r_[
                come, HEIGHT_WEIGHT * (np.einsum("wki,wki->wk", down, w.z) - np.sin(dip)).ravel()
            ]
        b = np.linalg.lstsq(turned, come, rcond=1e-2)[0]
    u = np.einsum("wkij,wkj->wki", C, (w.z - b) @ np.linalg.inv(A).T).mean(axis=1)
    return State(A, b, np.zeros(3), u / np.maximum(np.linalg.norm(u, axis=1), 1e-9)[:, None])


def _window_rotations(w: Windows, gyro: Array) -> tuple[Array, Array]:
    """(C (W, L, 3, 3) from the body at each sample to that at the start of its window, its
    integral per gyro bias (W, L, 3, 3))."""
    slip = Rotation.from_rotvec((-w.slip @ gyro).reshape(-1, 3)).as_matrix().reshape(w.slip.shape)
    C, S = np.empty(w.turn.shape), np.zeros(w.slip.shape)
    C[:, 0] = np.eye(3)
    for k in range(1, w.turn.shape[1]):
        C[:, k] = C[:, k - 1] @ w.turn[:, k] @ slip[:, k]
        S[:, k] = S[:, k - 1] + C[:, k] @ w.slip[:, k]
    return C, S


def _misfit(w: Windows, state: State) -> tuple[Array, Array, Array, Array]:
    """(z - A C' u - b (W, L, 3), C' u (W, L, 3), C, S)."""
    C, S = _window_rotations(w, state.gyro)
    m = np.einsum("wkji,wj->wki", C, state.u)
    return w.z - m @ state.A.T - state.b, m, C, S


def _down_vectors(w: Windows, C: Array) -> Array:
    """(W, 3) unit vectors of the mean specific force, reversed, in body axes at the start of
    each window."""
    force = -np.einsum("wkij,wkj->wi", C, w.force)
    return force / np.maximum(np.linalg.norm(force, axis=1), 1e-9)[:, None]


def _normal(w: Windows, state: State, weight: Array) -> tuple[Array, tuple[Array, Recover], Array]:
    """(H (15, 15), g (15,), residuals (W, L, 3)) of A, b and the gyro bias, the directions
    eliminated, and what recovers these.

    The bias is in units of rad per `WINDOW_TIME`.
    """
    r, m, C, S = _misfit(w, state)
    W, L, _ = r.shape
    E = _tangents(state.u)
    to_z = state.A @ np.swapaxes(C, -1, -2)
    J = np.zeros((W, L, 3, 15))
    for i in range(3):
        J[:, :, i, 3 * i : 3 * i + 3] = m
        J[:, :, i, 9 + i] = 1.0
    J[..., 12:] = -to_z @ _cross(state.u)[:, None] @ S / WINDOW_TIME
    K = to_z @ E[:, None]
    sigma = max(robust_std(r[weight > 0]), 1e-9)
    weighted = weight[..., None, None] * J
    H = np.einsum("wkia,wkib->ab", weighted, J)
    H[12:, 12:] += np.eye(3) * (sigma / (GYRO_STD * WINDOW_TIME)) ** 2
    g = np.einsum("wkia,wki->a", weighted, r)
    g[12:] -= state.gyro * WINDOW_TIME * (sigma / (GYRO_STD * WINDOW_TIME)) ** 2
    Hc = np.einsum("wkia,wkib->wab", weighted, K)
    Hu = np.einsum("wkia,wkib->wab", weight[..., None, None] * K, K)
    gu = np.einsum("wkia,wki->wa", weight[..., None, None] * K, r)
    Hu = Hu + 1e-12 * L * np.eye(2)
    gain = np.linalg.solve(Hu, np.swapaxes(Hc, 1, 2))  # (W, 2, 15)
    recover = (E, gain, np.linalg.solve(Hu, gu[..., None])[..., 0])
    return (
        H - np.einsum("wab,wbc->ac", Hc, gain),
        (g - np.einsum("wba,wb->a", gain, gu), recover),
        r,
    )


def _estimate(w: Windows, state: State, free: Mask, weight: Array) -> tuple[State, Array]:
    """(State, weights) by Levenberg-Marquardt: with weights that fall with the misfit first,
    then without the outliers."""
    all_free = np.r_[free, True, True, True]
    for robust in (True, False):
        for _ in range(5):
            state = _descend(w, state, all_free, weight, robust)
            size = np.sqrt(np.mean(_misfit(w, state)[0] ** 2, axis=2))
            kept = (size <= max(OUTLIER * float(np.median(size)), 1e-9)).astype(float)
            same, weight = np.array_equal(kept, weight), kept
            if robust or same:
                break
    return state, weight


def _descend(w: Windows, state: State, free: Mask, weight: Array, robust: bool) -> State:
    damping = 1e-4
    for _ in range(STEPS):
        size = np.linalg.norm(_misfit(w, state)[0], axis=2)
        scale = 3 * max(float(np.median(size)), 1e-9)
        soften = weight / (1 + (size / scale) ** 2) if robust else weight
        H, (g, recover), r = _normal(w, state, soften)
        cost = float(np.sum(soften[..., None] * r**2))
        H, ridge = H[np.ix_(free, free)], np.diag(np.maximum(np.diag(H)[free], 1e-12))
        while damping < 1e8:
            step = np.zeros(15)
            step[free] = np.linalg.solve(H + damping * ridge, g[free])
            moved = _step_state(state, step, recover)
            if (
                float(np.sum(soften[..., None] * _misfit(w, moved)[0] ** 2))
                <= cost * (1 + 1e-9) + 1e-18
            ):
                break
            damping *= 4
        else:
            return state
        state, damping = moved, max(damping / 10, 1e-12)
        if np.abs(step).max() < (1e-5 if robust else 1e-9):
            break
    return state


def _step_state(state: State, step: Array, recover: Recover) -> State:
    E, gain, own = recover
    u = state.u + np.einsum("wia,wa->wi", E, own - gain @ step)
    return State(
        state.A + step[:9].reshape(3, 3),
        state.b + step[9:12],
        state.gyro + step[12:] / WINDOW_TIME,
        u / np.linalg.norm(u, axis=1)[:, None],
    )


def _marginal(H: Array, free: Mask) -> Array:
    """Information on the free ones of A and b, the gyro bias eliminated."""
    keep = np.flatnonzero(free)
    cross = H[np.ix_(keep, np.array([12, 13, 14]))]
    return H[np.ix_(keep, keep)] - cross @ np.linalg.solve(H[12:, 12:], cross.T)


def _fit(
    w: Windows, state: State, free: Mask, weight: Array, weakest: float, y: Array, strength: float
) -> EllipsoidFit:
    used, (H, _, r) = weight > 0, _normal(w, state, weight)
    variance = float(np.sum(r[used] ** 2)) / max(
        1, 3 * int(used.sum()) - int(free.sum()) - 3 - 2 * len(state.u)
    )
    covariance = np.zeros((12, 12))
    if weakest > 1e-6:
        covariance[np.ix_(free, free)] = (
            np.linalg.inv(_marginal(H, free)) * variance * inflation(r[used])
        )
    M = np.asarray(np.linalg.inv(state.A), float)
    to_full = np.zeros((12, 12))
    to_full[:3, 9:] = np.eye(3) * strength
    to_full[3:, :9] = -np.kron(M, M.T)  # dM = -M dA M
    residuals, mask = np.full(y.shape, np.nan), np.zeros(len(y), bool)
    residuals[w.rows[used]], mask[w.rows[used]] = (r[used] @ M.T) * strength, True
    held = tuple(name for name, is_free in zip(TURNING_PARAMETERS, free) if not is_free)
    missing = TURNING_PARAMETERS[9:] if weakest < WEAKEST else ()
    return EllipsoidFit(
        state.b * strength,
        M,
        to_full @ covariance @ to_full.T,
        residuals,
        mask,
        weakest,
        held,
        missing,
    )


def _tangents(u: Array) -> Array:
    """(W, 3, 2) two unit vectors across each of u (W, 3) and each other."""
    least = np.eye(3)[np.abs(u).argmin(axis=1)]
    first = np.cross(u, least)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(u, first)], axis=2)


def _cross(u: Array) -> Array:
    """(W, 3, 3) matrices of u x."""
    x, y, z = u.T
    zero = np.zeros(len(u))
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
