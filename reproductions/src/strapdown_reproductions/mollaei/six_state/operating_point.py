"""The aircraft's process linearised once, at a trim, for the readings of an extended Kalman filter
that "linearizes the process around the operating point" (section 3.1 of Mollaei et al.).

Specific force in body axes to first order in velocity v_b against the air, rates and controls c:
    f = f0 + S (v_b - v0, omega - omega0, c - c0), S the derivative of forces / mass at the trim.
TRIM takes the attitude C as it is: v_b = C'(v - wind), v' = C f + g. ONCE is of first order in the
attitude too: C = C0 (I + [phi x]), and products of phi with other deviations are left out:
    v' = C0 (f0 + phi x f0 + S (C0'(v - wind) - phi x v0 - v0, ...)) + g.
"""

import numpy as np

from strapdown.checks import check_choice, check_number
from strapdown.core.compile.jit import helper, matrix
from strapdown.core.compile.workspace import Slots
from strapdown.core.loop.contract import FilterState, InitialState
from strapdown.core.mathematics.rotation import euler_terms, rotate_vector
from strapdown.flight import trim
from strapdown.flight.aircraft_model.dynamics import CONTROLS, OMEGA
from strapdown.flight.aircraft_model.forces import density, forces
from strapdown.flight.aircraft_model.parameters import Aircraft
from strapdown.flight.inputs import CONTROLS as TOLD_CONTROLS, WIND
from strapdown.typing import Array

READINGS = ("estimate", "trim", "once", "held")
"""Where the process is linearised: at the estimate, as in equation (22); forces at a trim, with the
attitude as it is; all of it at the trim; the states alone, with the attitude held at the trim's."""
ESTIMATE, _, ONCE, _ = map(float, range(len(READINGS)))
POINT = Slots()
READING = POINT.number("READING")
ATTITUDE = POINT.matrix("ATTITUDE", 3, 3)  # C0
AT = POINT.array("AT", 10)  # velocity against the air and rates in body axes, controls
FORCE = POINT.array("FORCE", 3)  # f0, m/s^2
SLOPES = POINT.matrix("SLOPES", 3, 10)  # S
# v' = A v + B in the sample in force
OWN_A = POINT.matrix("OWN_A", 3, 3)
OWN_B = POINT.array("OWN_B", 3)
DIFFERENCE = 1e-4  # m/s, rad/s, rad: of the differences that make S


def point_of(
    craft: Aircraft, start: InitialState, linearised: str, airspeed: float | None
) -> Array:
    """The numbers of POINT: level flight of `craft` at `airspeed` (m/s) along the start's heading.
    Raises DataError for an unknown reading, or one whose trim is missing or cannot be flown."""
    check_choice(linearised, "linearised", READINGS)
    own = POINT.zeros()
    if linearised == "estimate":
        if airspeed is not None:
            raise ValueError(
                "airspeed is that of the trim about which the process is linearised; give "
                'linearised="trim", "once" or "held" with it, or leave it out'
            )
        return own
    if airspeed is None:
        raise ValueError(
            f"linearised={linearised!r} needs the airspeed of its trim; give airspeed, m/s"
        )
    check_number(airspeed, "airspeed", "m/s", above=0)
    begun = trim(craft, airspeed, origin=start.lla, course=start.rph[2], earth="flat")
    parameters = craft.parameters(earth="flat", origin=start.lla)
    C = np.reshape(euler_terms(begun.roll, begun.pitch, _heading(begun.state[6:10])), (3, 3))
    at = np.r_[C.T @ begun.state[3:6], begun.state[OMEGA], begun.state[CONTROLS]]
    air = density(parameters, start.lla[2])

    def force(x: Array) -> Array:
        return np.array(forces(parameters, air, x[:3], x[3:6], x[6:])[:3]) / parameters.mass

    own[READING] = READINGS.index(linearised)
    own[ATTITUDE : ATTITUDE + 9] = C.ravel()
    own[AT], own[FORCE] = at, force(at)
    own[SLOPES : SLOPES + 30] = np.stack(
        [(force(at + h) - force(at - h)) / (2 * DIFFERENCE) for h in DIFFERENCE * np.eye(len(at))],
        axis=1,
    ).ravel()
    return own


def _heading(q: Array) -> float:
    """rad, of a quaternion, scalar first."""
    a, b, c, d = q
    return float(np.arctan2(2 * (b * c + a * d), a * a + b * b - c * c - d * d))


@helper
def _turned_a_little(p0: float, p1: float, p2: float, x: Array) -> tuple[float, float, float]:
    """x + p x x, of the first three numbers of x."""
    return (
        x[0] + p1 * x[2] - p2 * x[1],
        x[1] + p2 * x[0] - p0 * x[2],
        x[2] + p0 * x[1] - p1 * x[0],
    )


@helper
def sample_model(
    own: Array, told: Array, C: Array, belief: FilterState, gravity: float, dt: float, dv: Array
) -> None:
    """Make A and B of a sample from the attitude C and the belief's rates in it; for ONCE and HELD also
    the increment dv (m/s, NED) that the IMU tells."""
    C0, S, A, B = (
        matrix(own, ATTITUDE, 3, 3),
        matrix(own, SLOPES, 3, 10),
        matrix(own, OWN_A, 3, 3),
        own[OWN_B],
    )
    at, f0, wind, controls, f = own[AT], own[FORCE], told[WIND], told[TOLD_CONTROLS], belief.f
    p0, p1, p2, R = 0.0, 0.0, 0.0, C
    if own[READING] >= ONCE:
        R = C0
    if own[READING] == ONCE:
        # phi: C0'C = I + [phi x] + ..., of which the symmetric part is of second order
        for k in range(3):
            p0 += 0.5 * (C0[k, 2] * C[k, 1] - C0[k, 1] * C[k, 2])
            p1 += 0.5 * (C0[k, 0] * C[k, 2] - C0[k, 2] * C[k, 0])
            p2 += 0.5 * (C0[k, 1] * C[k, 0] - C0[k, 0] * C[k, 1])
    b0, b1, b2 = _turned_a_little(p0, p1, p2, f0)
    if own[READING] >= ONCE:
        d0, d1, d2 = rotate_vector(C0, f[0] + b0 - f0[0], f[1] + b1 - f0[1], f[2] + b2 - f0[2])
        dv[0], dv[1], dv[2] = d0 * dt, d1 * dt, (d2 + gravity) * dt
    v0, v1, v2 = _turned_a_little(p0, p1, p2, at)
    b0 -= S[0, 0] * v0 + S[0, 1] * v1 + S[0, 2] * v2
    b1 -= S[1, 0] * v0 + S[1, 1] * v1 + S[1, 2] * v2
    b2 -= S[2, 0] * v0 + S[2, 1] * v1 + S[2, 2] * v2
    for k in range(7):
        off = (belief.omega[k] if k < 3 else controls[k - 3]) - at[3 + k]
        b0 += S[0, 3 + k] * off
        b1 += S[1, 3 + k] * off
        b2 += S[2, 3 + k] * off
    B[0], B[1], B[2] = rotate_vector(R, b0, b1, b2)
    B[2] += gravity
    for j in range(3):
        A[0, j], A[1, j], A[2, j] = rotate_vector(
            R,
            S[0, 0] * R[j, 0] + S[0, 1] * R[j, 1] + S[0, 2] * R[j, 2],
            S[1, 0] * R[j, 0] + S[1, 1] * R[j, 1] + S[1, 2] * R[j, 2],
            S[2, 0] * R[j, 0] + S[2, 1] * R[j, 1] + S[2, 2] * R[j, 2],
        )
    for i in range(3):
        B[i] -= A[i, 0] * wind[0] + A[i, 1] * wind[1] + A[i, 2] * wind[2]
