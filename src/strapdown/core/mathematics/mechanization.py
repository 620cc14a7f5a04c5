"""Strapdown mechanization on increments in geodetic NED: from rotation and velocity increments to
position, velocity, attitude.

The equations, with L latitude, l longitude, h height, v = v_n, C = C_nb, M = R_M + h, N = R_N + h:

    L' = v_N / M,  l' = v_E / (N cos L),  h' = -v_D
    v' = C f_ib_b + g_n - (2 omega_ie_n + omega_en_n) x v
    C' = C S(omega_ib_b) - S(omega_in_n) C,  omega_in_n = omega_ie_n + omega_en_n
    omega_ie_n = omega_ie (cos L, 0, -sin L),  omega_en_n = (v_E/N, -v_N/M, -v_E tan L/N)

Source: Groves (2013) sections 5.4 and 5.5; Hager & Bryne (3) for the radii and (6) to (10) for a step;
Savage (1998), "Strapdown inertial navigation integration algorithm design", parts 1 and 2, for increments.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from ..compile.selection import any_of, where
from .earth import displaced_lat_lon, gravity, gravity_north, place, rotation_rates
from .rotation import Three, rotate_left, rotate_right


@helper
def compensate(dtheta: Array, dv: Array, dt: float, previous: Array, u: Array) -> None:
    """Coning and sculling: from plain integrals of rate and specific force over one sample (dtheta,
    rad; dv, m/s; body) to what `mechanize` expects, with those before them alpha and nu:

        c = dt^2 / (6 dt_before (dt_before + dt)),  1/12 where both are equal
        r = dtheta + c alpha x dtheta
        a = dv + c (alpha x dv + nu x dtheta)

    u[0:3] gets the rotation vector r of the sample, rad; u[3:6] the velocity increment a including
    sculling, m/s. `previous` is the last sample (increments and dt, s; dt 0 where there is none);
    rate and force are taken as linear over the two. Savage (1998) has them for equal dt.
    """
    before = max(previous[6], 1e-30)  # 0 where there is none, which must not divide
    c = where(previous[6] > 0, dt / (6 * before * (before + dt)) * dt, 0.0)
    a0, a1, a2, b0, b1, b2 = (
        previous[0],
        previous[1],
        previous[2],
        previous[3],
        previous[4],
        previous[5],
    )
    x0, x1, x2, y0, y1, y2 = dtheta[0], dtheta[1], dtheta[2], dv[0], dv[1], dv[2]
    u[0] = x0 + c * (a1 * x2 - a2 * x1)
    u[1] = x1 + c * (a2 * x0 - a0 * x2)
    u[2] = x2 + c * (a0 * x1 - a1 * x0)
    u[3] = y0 + c * (a1 * y2 - a2 * y1 + b1 * x2 - b2 * x1)
    u[4] = y1 + c * (a2 * y0 - a0 * y2 + b2 * x0 - b0 * x2)
    u[5] = y2 + c * (a0 * y1 - a1 * y0 + b0 * x1 - b1 * x0)


@helper
def mechanize(
    lla: Array,
    v: Array,
    C: Array,
    r: Three,
    a: Three,
    dt: float,
    dv_n: Array,
    height: float = 1.0,
) -> None:
    """Advance lla (rad, rad, m), v = v_n (m/s, NED) and C = C_nb by one sample of bias-free
    increments over dt (s): rotation vector r (rad) and velocity a (m/s), body.

        w   = omega_in_n dt,  c = (2 omega_ie_n + omega_en_n) dt         at the start of the sample
        s   = a + r x a / 2 + r x (r x a) / 6                            in the body of its start
        f   = (I - S(w) / 2) C s
        v_m = v + (f - c x v + g dt) / 2                                 at mid-interval
        v  <- v + f - c x v_m + g dt                                     g of mid-interval's height
        w   = omega_in_n dt                                              of mid-interval
        C  <- exp(-S(w)) C exp(S(r))
        p  <- p + (v before + v after) dt / 2                            p as lla, see `_move`

    dv_n[0:3] receives f, m/s. Gravity is that of `height` times the height: 1, or 0 for an Earth
    whose gravity depends on latitude alone and points along the normal of the ellipsoid.

    Written out in scalars, because each product of c x v is subtracted by itself.
    """
    r0, r1, r2 = r
    a0, a1, a2 = a
    sine, cosine, M, N = place(lla[0], lla[2])
    ie_n, ie_d, w0, w1, w2 = rotation_rates(v[0], v[1], sine, cosine, M, N)
    w0, w1, w2 = w0 * dt, w1 * dt, w2 * dt
    x0, x1, x2 = r1 * a2 - r2 * a1, r2 * a0 - r0 * a2, r0 * a1 - r1 * a0
    # without the second order, turns at 20 Hz feel 5e-4 m/s^2 too little lift
    s0 = a0 + 0.5 * x0 + (r1 * x2 - r2 * x1) / 6
    s1 = a1 + 0.5 * x1 + (r2 * x0 - r0 * x2) / 6
    s2 = a2 + 0.5 * x2 + (r0 * x1 - r1 * x0) / 6
    f0 = C[0, 0] * s0 + C[0, 1] * s1 + C[0, 2] * s2
    f1 = C[1, 0] * s0 + C[1, 1] * s1 + C[1, 2] * s2
    f2 = C[2, 0] * s0 + C[2, 1] * s1 + C[2, 2] * s2
    f0, f1, f2 = (
        f0 - 0.5 * (w1 * f2 - w2 * f1),
        f1 - 0.5 * (w2 * f0 - w0 * f2),
        f2 - 0.5 * (w0 * f1 - w1 * f0),
    )
    c0, c1, c2 = w0 + ie_n * dt, w1, w2 + ie_d * dt
    v0, v1, v2 = v[0], v[1], v[2]
    h = height * (lla[2] - 0.5 * v2 * dt)
    g, north = gravity(sine, h) * dt, gravity_north(sine, cosine, h) * dt
    m0 = v0 + 0.5 * (f0 - c1 * v2 + c2 * v1 + north)
    m1 = v1 + 0.5 * (f1 - c2 * v0 + c0 * v2)
    m2 = v2 + 0.5 * (f2 - c0 * v1 + c1 * v0 + g)
    v[0] = v0 + f0 - c1 * m2 + c2 * m1 + north
    v[1] = v1 + f1 - c2 * m0 + c0 * m2
    v[2] = v2 + f2 - c0 * m1 + c1 * m0 + g
    m0, m1, m2 = 0.5 * (v0 + v[0]), 0.5 * (v1 + v[1]), 0.5 * (v2 + v[2])
    # the frame turns at the rates of mid-interval: at its start they would be of first order only
    turn, tan = 0.5 * dt * m0 / M, sine / cosine
    w0, w1, w2 = (
        ie_n + ie_d * turn + m1 / N,
        -m0 / M,
        ie_d - ie_n * turn - (tan + (1 + tan * tan) * turn) * m1 / N,
    )
    rotate_right(C, r0, r1, r2)
    rotate_left(-w0 * dt, -w1 * dt, -w2 * dt, C)
    _move(lla, (sine, cosine, M, N), (m0 * dt, m1 * dt, m2 * dt))
    dv_n[0], dv_n[1], dv_n[2] = f0, f1, f2


@helper
def _move(lla: Array, at: tuple[float, float, float, float], way: Three) -> None:
    """`displace` by a way (north, east, down; m) over a sample, `at` being `place` of its start:
    longitude with the cosine of the mid-latitude, so that the position is of second order in dt."""
    sine, cosine, M, N = at
    north, east, down = way
    lat = lla[0] + north / M
    lon = lla[1] + east / (N * (cosine - 0.5 * sine * north / M))
    beyond = abs(lon) > math.pi
    if any_of(beyond):
        lon = where(beyond, lon - math.copysign(2 * math.pi, lon), lon)
    # within 1.2 deg of a pole: only a raw INS gets here, and it must stay finite
    polar = abs(lla[0]) > 1.55
    if any_of(polar):
        polar_lat, polar_lon = displaced_lat_lon(lla, north, east)
        lat, lon = where(polar, polar_lat, lat), where(polar, polar_lon, lon)
    lla[0], lla[1] = lat, lon
    lla[2] -= down


@helper
def stationary_increments(lla: Array, v: Array, C: Array, dt: float, u: Array) -> None:
    """The increments of a bias-free IMU whose velocity and attitude in n do not change over dt (s):
    what `mechanize` would need to hold them.

        u[0:3] = C' omega_in_n dt,  u[3:6] = C' ((2 omega_ie_n + omega_en_n) x v - g_n) dt

    lla (rad, rad, m), v = v_n (m/s, NED), C = C_nb; u in rad and m/s, body.
    """
    sine, cosine, M, N = place(lla[0], lla[2])
    ie_n, ie_d, w0, w1, w2 = rotation_rates(v[0], v[1], sine, cosine, M, N)
    c0, c1, c2 = w0 + ie_n, w1, w2 + ie_d
    f0, f1, f2 = (
        c1 * v[2] - c2 * v[1] - gravity_north(sine, cosine, lla[2]),
        c2 * v[0] - c0 * v[2],
        c0 * v[1] - c1 * v[0] - gravity(sine, lla[2]),
    )
    for i in range(3):
        u[i] = dt * (C[0, i] * w0 + C[1, i] * w1 + C[2, i] * w2)
        u[3 + i] = dt * (C[0, i] * f0 + C[1, i] * f1 + C[2, i] * f2)
