"""The yardstick: a whole 15-state closed-loop error-state filter in one compiled function, to
measure the library against.

WGS-84 mechanisation on increments, block-sparse covariance step, position fixes as three scalar
updates, no gate, no lever arm, no contract: what a library adds on top is what the ratio shows. It
stores the state and 15 variances at every sample. States and errors as in the library: position (m,
NED), velocity, attitude (in n), accelerometer and gyro bias; delta = true - estimate. Sources:
Groves (2013), chapters 5 and 14; WGS-84 normal gravity after Somigliana.
"""

import numpy as np
from numba import njit

A, E2, OMEGA = 6378137.0, 6.6943799901413e-3, 7.292115e-5


@njit
def turn(x, y, z, R):
    """R = exp([x y z] x), rad."""
    s = x * x + y * y + z * z
    if s < 1e-8:
        a, b = 1 - s / 6 + s * s / 120, 0.5 - s / 24 + s * s / 720
    else:
        angle = np.sqrt(s)
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / s
    R[0, 0], R[0, 1], R[0, 2] = 1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    R[1, 0], R[1, 1], R[1, 2] = b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x
    R[2, 0], R[2, 1], R[2, 2] = b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)


@njit
def product(X, Y, out):
    """out = X Y of 3 x 3 matrices."""
    for i in range(3):
        for j in range(3):
            out[i, j] = X[i, 0] * Y[0, j] + X[i, 1] * Y[1, j] + X[i, 2] * Y[2, j]


@njit(error_model="numpy")
def run(
    dtheta,
    dv,
    dt,
    fix_of,
    fixes,
    variance,
    start_lla,
    start_v,
    start_C,
    start_P,
    q,
    out_lla,
    out_v,
    out_C,
    out_variance,
):
    """Filter all samples of `dt` seconds; `fix_of[k]` is the row of `fixes` (rad, rad, m) at the
    end of sample k, or -1."""
    lat, lon, alt = start_lla
    vn, ve, vd = start_v
    C, P, W, x, K, b_a, b_g = (
        start_C.copy(),
        start_P.copy(),
        np.empty((15, 15)),
        np.empty(15),
        np.empty(15),
        np.zeros(3),
        np.zeros(3),
    )
    R, T, D, VV, VA, AA = (
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.eye(3),
        np.zeros((3, 3)),
        np.eye(3),
    )
    for k in range(len(dtheta)):
        # mechanisation: velocity with Coriolis and frame rotation, trapezoidal position, attitude
        # as two rotations
        sine, cosine = np.sin(lat), np.cos(lat)
        root = np.sqrt(1 - E2 * sine * sine)
        north, east = A * (1 - E2) / (root * root * root) + alt, A / root + alt
        g = 9.7803253359 * (1 + 0.00193185265241 * sine * sine) / root * (1 - 2 * alt / A)
        en, ed = OMEGA * cosine, -OMEGA * sine
        tn, te = ve / east, -vn / north
        td = -tn * sine / cosine
        wn, we, wd = (en + tn) * dt, te * dt, (ed + td) * dt  # rotation of n, rad
        cn, ce, cd = wn + en * dt, we, wd + ed * dt  # with Coriolis, rad
        ax, ay, az = (
            dtheta[k, 0] - b_g[0] * dt,
            dtheta[k, 1] - b_g[1] * dt,
            dtheta[k, 2] - b_g[2] * dt,
        )
        bx, by, bz = dv[k, 0] - b_a[0] * dt, dv[k, 1] - b_a[1] * dt, dv[k, 2] - b_a[2] * dt
        sx, sy, sz = (
            bx + (ay * bz - az * by) / 2,
            by + (az * bx - ax * bz) / 2,
            bz + (ax * by - ay * bx) / 2,
        )
        fn = C[0, 0] * sx + C[0, 1] * sy + C[0, 2] * sz
        fe = C[1, 0] * sx + C[1, 1] * sy + C[1, 2] * sz
        fd = C[2, 0] * sx + C[2, 1] * sy + C[2, 2] * sz
        new_n = vn + fn - (we * fd - wd * fe) / 2 - (ce * vd - cd * ve)
        new_e = ve + fe - (wd * fn - wn * fd) / 2 - (cd * vn - cn * vd)
        new_d = vd + fd - (wn * fe - we * fn) / 2 - (cn * ve - ce * vn) + g * dt
        lat += (vn + new_n) / 2 * dt / north
        lon += (ve + new_e) / 2 * dt / (east * cosine)
        alt -= (vd + new_d) / 2 * dt
        vn, ve, vd = new_n, new_e, new_d
        # transition blocks: velocity to velocity, attitude to velocity, attitude to attitude,
        # biases through D
        VV[0, 1], VV[0, 2], VV[1, 0], VV[1, 2], VV[2, 0], VV[2, 1] = cd, -ce, -cd, cn, ce, -cn
        VA[0, 1], VA[0, 2], VA[1, 0], VA[1, 2], VA[2, 0], VA[2, 1] = fd, -fe, -fd, fn, fe, -fn
        AA[0, 1], AA[0, 2], AA[1, 0], AA[1, 2], AA[2, 0], AA[2, 1] = wd, -we, -wd, wn, we, -wn
        for i in range(3):
            for j in range(3):
                D[i, j] = -C[i, j] * dt
        turn(ax, ay, az, R)
        product(C, R, T)
        turn(-wn, -we, -wd, R)
        product(R, T, C)
        # W = Phi P, then P = W Phi' + Q, block by block
        for i in range(3):
            for j in range(15):
                velocity, attitude = 0.0, 0.0
                for m in range(3):
                    velocity += (
                        VV[i, m] * P[3 + m, j] + VA[i, m] * P[6 + m, j] + D[i, m] * P[9 + m, j]
                    )
                    attitude += AA[i, m] * P[6 + m, j] + D[i, m] * P[12 + m, j]
                W[i, j] = P[i, j] + dt * P[3 + i, j]
                W[3 + i, j], W[6 + i, j] = velocity, attitude
                W[9 + i, j], W[12 + i, j] = P[9 + i, j], P[12 + i, j]
        for i in range(15):
            for j in range(3):
                velocity, attitude = 0.0, 0.0
                for m in range(3):
                    velocity += (
                        W[i, 3 + m] * VV[j, m] + W[i, 6 + m] * VA[j, m] + W[i, 9 + m] * D[j, m]
                    )
                    attitude += W[i, 6 + m] * AA[j, m] + W[i, 12 + m] * D[j, m]
                P[i, j] = W[i, j] + dt * W[i, 3 + j]
                P[i, 3 + j], P[i, 6 + j] = velocity, attitude
                P[i, 9 + j], P[i, 12 + j] = W[i, 9 + j], W[i, 12 + j]
            P[i, i] += q[i]
        # three scalar position updates, then reset
        m = fix_of[k]
        if m >= 0:
            x[:] = 0.0
            for a in range(3):
                if a == 0:
                    residual = (fixes[m, 0] - lat) * north
                elif a == 1:
                    residual = (fixes[m, 1] - lon) * east * cosine
                else:
                    residual = alt - fixes[m, 2]
                residual -= x[a]
                S = P[a, a] + variance
                for i in range(15):
                    K[i] = P[i, a]
                for i in range(15):
                    gain = K[i] / S
                    x[i] += gain * residual
                    for j in range(i + 1):
                        P[i, j] -= gain * K[j]
                for i in range(15):
                    for j in range(i):
                        P[j, i] = P[i, j]
            lat, lon, alt = lat + x[0] / north, lon + x[1] / (east * cosine), alt - x[2]
            vn, ve, vd = vn + x[3], ve + x[4], vd + x[5]
            turn(x[6], x[7], x[8], R)
            product(R, C, T)
            C[:] = T
            for i in range(3):
                b_a[i] += x[9 + i]
                b_g[i] += x[12 + i]
        out_lla[k, 0], out_lla[k, 1], out_lla[k, 2] = lat, lon, alt
        out_v[k, 0], out_v[k, 1], out_v[k, 2] = vn, ve, vd
        out_C[k] = C
        for i in range(15):
            out_variance[k, i] = P[i, i]


def arguments(workload):
    """Inputs and outputs of `run` on a workload: (inputs, outputs), both tuples."""
    from scipy.spatial.transform import Rotation

    p, dt, n = workload.parameters, workload.dt, len(workload.t) - 1
    fix_of = np.full(n, -1)
    fix_of[np.rint((workload.fix_t - workload.t[0]) / dt).astype(int) - 1] = np.arange(
        len(workload.fix_t)
    )
    densities = [0.0, p["accel_noise"], p["gyro_noise"], p["accel_bias_walk"], p["gyro_bias_walk"]]
    lla, v, rph = workload.start
    C = np.ascontiguousarray(Rotation.from_euler("xyz", rph).as_matrix())
    inputs = (
        workload.dtheta[1:].copy(),
        workload.dv[1:].copy(),
        dt,
        fix_of,
        workload.fix.copy(),
        p["gnss_std"] ** 2,
        lla,
        v,
        C,
        np.diag(workload.std**2),
        np.repeat(densities, 3) ** 2 * dt,
    )
    return inputs, (np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 15)))
