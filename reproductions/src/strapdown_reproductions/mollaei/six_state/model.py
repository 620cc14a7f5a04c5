"""The model shared by the six-state filters of Mollaei et al.: the state, the layout of its
numbers, its propagation and its measurements.

The state is position (m, north, east, down from the start) and velocity (m/s) on a flat, still
Earth of constant gravity:
    p' = v, v' = C f + g, f the specific force that the IMU measured, or that the aircraft's own
    model tells.
The attitude C is none of it: it is the start's, turned by the measured increments and never
corrected, so the truth (where the start is true) and the integrated error of the gyros. Biases are
the start's and stay.
"""

import math
from collections.abc import Callable, Sequence
from inspect import Parameter, Signature, signature
from typing import Any, NamedTuple, TypeVar

from strapdown.checks import check_number
from strapdown.core.compile.jit import helper, inline, matrix, row_in
from strapdown.core.loop.contract import FilterState, InitialState, Kind, Noise, Slots, SourceLike
from strapdown.core.mathematics.rotation import (
    Three,
    orthonormalise,
    rotate_right,
    rotate_vector,
    wrap,
)
from strapdown.flight import inputs
from strapdown.flight.aircraft_model.forces import density, forces
from strapdown.flight.aircraft_model.parameters import (
    PARAMETERS,
    Aircraft,
    aircraft as find_aircraft,
)
from strapdown.typing import Array, File

from ...common.signatures import keywords
from . import operating_point

SIX = Slots(room=8)
"""Workspace of every filter here."""
INPUTS = SIX.part("INPUTS", inputs.TOLD).start
"""First of the numbers of `workspace` that whoever flies the aircraft writes before each sample,
see strapdown.flight.inputs. Before them: output columns."""
X = SIX.array("X", 6)  # the state
ORIGIN = SIX.array("ORIGIN", 3)  # lla of the start
# variances: of the process noise per second, of a row of a fix; 0: not given
Q, R = SIX.numbers("Q", "R")
# random walk of the velocity that the model does not know, m/s/sqrt(s)
UNKNOWN = SIX.number("UNKNOWN")
SINCE = SIX.number("SINCE")  # s since the last fix
DENSITY = SIX.number("DENSITY")  # of the air at the height of the estimate, kg/m^3
TURNED = SIX.matrix("TURNED", 3, 3)  # C_nb at mid-sample
# change of velocity over the sample from the IMU, with gravity, m/s
DV = SIX.array("DV", 3)
A = SIX.matrix("A", 3, 3)  # d velocity after / d velocity before
# state and covariance that a fix would leave
TRIAL = SIX.array("TRIAL", 6)
TRIAL_P = SIX.matrix("TRIAL_P", 6, 6)
CRAFT = SIX.array("CRAFT", len(PARAMETERS.fields)).start  # the aircraft's parameters, as a row
# of the readings of the EKF that linearise the process once
POINT = SIX.part("POINT", operating_point.POINT).start
craft_in = row_in(PARAMETERS)
"""The row of the parameters in a workspace, at CRAFT."""
STEP = 1e-5
"""m/s: of the differences that make the Jacobian; their errors, of the bend and of rounding, are
below 1e-6 of it."""
REPRODUCED = dict(q=0.1, r=0.5)
"""Options that give the Q = 0.1 I and R = 0.5 I of the paper."""


StartFunction = TypeVar("StartFunction", bound=Callable[..., FilterState])


class Options(NamedTuple):
    """Options that all of these filters take."""

    # random walk of the velocity beyond what the aircraft's model predicts, where it does,
    # m/s/sqrt(s)
    model: float = 0.1
    # variance that each sample adds to each state instead of that and of the accelerometers' noise,
    # m^2 and m^2/s^2, and that of each row of a fix instead of its own; 0: neither
    q: float = 0.0
    r: float = 0.0
    rate: float = 100.0  # of the IMU, Hz
    aircraft: File | Aircraft = "aerosonde"  # its model predicts
    earth: str = "flat"  # no other


def takes_options(start: StartFunction) -> StartFunction:
    """A `start` whose **options are Options, for the engine, which goes by its signature."""
    own = [p for p in signature(start).parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    # the type of a function knows no __signature__
    start.__signature__ = Signature([*own, *keywords(Options._field_defaults)])  # type: ignore[attr-defined]
    return start


def begin(start: InitialState, slots: Slots, options: Options, rest: int = 0) -> FilterState:
    """Return the filter state at `start` for a filter whose slots are SIX or continue it; `rest` is
    the size of their last part. Refuses bad options."""
    model, q, r, rate, craft, earth = options
    variance = "m^2 and m^2/s^2"
    for value, name, unit in (
        (model, "model", "m/s/sqrt(s)"),
        (q, "q", variance),
        (r, "r", variance),
    ):
        check_number(value, name, unit, least=0)
    check_number(rate, "rate", "Hz", above=0)
    if earth != "flat":
        raise ValueError(
            f"earth is {earth!r}; the six-state form knows a flat, still Earth alone: give "
            f'earth="flat", and fly over it'
        )
    workspace = slots.zeros(rest)
    belief = start.belief(workspace)
    belief.P[6:], belief.P[:, 6:] = 0.0, 0.0
    workspace[X][3:], workspace[ORIGIN] = start.v_n, start.lla
    workspace[Q], workspace[R], workspace[UNKNOWN] = q * rate, r, model
    flown, kept = find_aircraft(craft), craft_in(workspace, CRAFT)
    parameters = flown.parameters(earth="flat", origin=start.lla)
    for name, *_ in PARAMETERS.fields:
        setattr(kept, name, getattr(parameters, name))
    return belief


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """Refuses an antenna away from the IMU: six states know no lever arm."""
    for source in sources:
        if any(source.parameters[:3]):
            raise ValueError(
                f"{source.name or source.kind} has a lever arm of {tuple(source.parameters[:3])} m; "
                f"the six-state form knows none: "
                "give the fixes of the IMU's own place"
            )
    return options, []


@helper
def turn(belief: FilterState, u: Array, dt: float) -> None:
    """Advance the attitude by the measured increments u, and leave in workspace what they say of
    the velocity and the attitude at mid-sample."""
    workspace, C, half = belief.workspace, belief.C_nb, matrix(belief.workspace, TURNED, 3, 3)
    dv, craft = workspace[DV], craft_in(workspace, CRAFT)
    r0, r1, r2 = u[0] - belief.b_g[0] * dt, u[1] - belief.b_g[1] * dt, u[2] - belief.b_g[2] * dt
    a0, a1, a2 = u[3] - belief.b_a[0] * dt, u[4] - belief.b_a[1] * dt, u[5] - belief.b_a[2] * dt
    x0, x1, x2 = r1 * a2 - r2 * a1, r2 * a0 - r0 * a2, r0 * a1 - r1 * a0
    d0, d1, d2 = rotate_vector(
        C,
        a0 + 0.5 * x0 + (r1 * x2 - r2 * x1) / 6,
        a1 + 0.5 * x1 + (r2 * x0 - r0 * x2) / 6,
        a2 + 0.5 * x2 + (r0 * x1 - r1 * x0) / 6,
    )
    dv[0], dv[1], dv[2] = d0, d1, d2 + craft.gravity * dt
    for i in range(3):
        for j in range(3):
            half[i, j] = C[i, j]
    rotate_right(half, 0.5 * r0, 0.5 * r1, 0.5 * r2)
    rotate_right(C, r0, r1, r2)
    orthonormalise(C)
    if dt > 0:
        for i in range(3):
            belief.omega[i] = (u[i] - belief.b_g[i] * dt) / dt
            belief.f[i] = (u[3 + i] - belief.b_a[i] * dt) / dt
    workspace[SINCE] += dt
    if by_model(workspace):
        workspace[DENSITY] = density(craft, workspace[ORIGIN][2] - workspace[X][2])


@inline
def by_model(workspace: Array) -> bool:
    """True where the aircraft's model predicts, not the IMU."""
    return workspace[INPUTS:][inputs.BY_MODEL] != 0


@helper
def acceleration(
    workspace: Array, omega: Array, v0: float, v1: float, v2: float
) -> tuple[float, float, float]:
    """m/s^2 that the aircraft's model gives at that velocity (m/s, NED), with the attitude,
    rates, controls and wind in force; or what is left of it linearised at an operating point."""
    own = workspace[POINT:]
    if own[operating_point.READING] != operating_point.ESTIMATE:
        a, b = matrix(own, operating_point.OWN_A, 3, 3), own[operating_point.OWN_B]
        a0, a1, a2 = rotate_vector(a, v0, v1, v2)
        return a0 + b[0], a1 + b[1], a2 + b[2]
    C, told, craft = matrix(workspace, TURNED, 3, 3), workspace[INPUTS:], craft_in(workspace, CRAFT)
    wind = told[inputs.WIND]
    v0, v1, v2, scale = v0 - wind[0], v1 - wind[1], v2 - wind[2], 1 / craft.mass
    against_air = (
        C[0, 0] * v0 + C[1, 0] * v1 + C[2, 0] * v2,
        C[0, 1] * v0 + C[1, 1] * v1 + C[2, 1] * v2,
        C[0, 2] * v0 + C[1, 2] * v1 + C[2, 2] * v2,
    )
    Fx, Fy, Fz, _, _, _ = forces(
        craft, workspace[DENSITY], against_air, omega, told[inputs.CONTROLS]
    )
    a0, a1, a2 = rotate_vector(C, scale * Fx, scale * Fy, scale * Fz)
    return a0, a1, a2 + craft.gravity


@helper
def propagate_velocity(
    workspace: Array, omega: Array, v0: float, v1: float, v2: float, dt: float
) -> tuple[float, float, float]:
    """Velocity (m/s, NED) after dt: with the IMU's increment, or with the model's acceleration
    by the midpoint rule."""
    dv = workspace[DV]
    if not by_model(workspace):
        return v0 + dv[0], v1 + dv[1], v2 + dv[2]
    a0, a1, a2 = acceleration(workspace, omega, v0, v1, v2)
    b0, b1, b2 = acceleration(
        workspace, omega, v0 + 0.5 * dt * a0, v1 + 0.5 * dt * a1, v2 + 0.5 * dt * a2
    )
    return v0 + dt * b0, v1 + dt * b1, v2 + dt * b2


@inline
def propagate_linearised(belief: FilterState, x: Array, P: Array, dt: float, noise: Noise) -> None:
    """Advance one Gaussian, x (6,) and P (its first 6 rows and columns), as an extended Kalman
    filter does."""
    workspace, omega, dv = belief.workspace, belief.omega, belief.workspace[DV]
    v0, v1, v2 = x[3], x[4], x[5]
    if not by_model(workspace):
        drift(P, dt)
        w0, w1, w2 = v0 + dv[0], v1 + dv[1], v2 + dv[2]
    else:
        a0, a1, a2 = acceleration(workspace, omega, v0, v1, v2)
        m0, m1, m2 = v0 + 0.5 * dt * a0, v1 + 0.5 * dt * a1, v2 + 0.5 * dt * a2
        b0, b1, b2 = acceleration(workspace, omega, m0, m1, m2)
        jacobian(workspace, omega, (m0, m1, m2), (b0, b1, b2), dt)
        transform(P, workspace, dt)
        w0, w1, w2 = v0 + dt * b0, v1 + dt * b1, v2 + dt * b2
    add_noise(P, workspace, noise, dt)
    x[0] += 0.5 * dt * (v0 + w0)
    x[1] += 0.5 * dt * (v1 + w1)
    x[2] += 0.5 * dt * (v2 + w2)
    x[3], x[4], x[5] = w0, w1, w2


@inline
def drift(P: Array, dt: float) -> None:
    """P <- Phi P Phi' with Phi = [I, dt I; 0, I]: positions follow velocities, which only gain
    the same for all."""
    for i in range(3):
        for j in range(3):
            P[i, 3 + j] += dt * P[3 + i, 3 + j]  # the new covariance of position and velocity
    for i in range(3):
        for j in range(i, 3):
            P[i, j] += dt * (P[i, 3 + j] + P[j, 3 + i] - dt * P[3 + i, 3 + j])
            P[j, i] = P[i, j]
        for j in range(3):
            P[3 + j, i] = P[i, 3 + j]


@helper
def jacobian(workspace: Array, omega: Array, v: Three, a: Three, dt: float) -> None:
    """A = I + J dt + J^2 dt^2 / 2, J the derivative of the model's acceleration a by the
    velocity v at mid-sample, from differences over STEP."""
    s, F = dt / STEP, matrix(workspace, A, 3, 3)
    # a loop, because three copies of the forces take the compiler three times as long
    for k in range(3):
        b0, b1, b2 = acceleration(
            workspace,
            omega,
            v[0] + (STEP if k == 0 else 0.0),
            v[1] + (STEP if k == 1 else 0.0),
            v[2] + (STEP if k == 2 else 0.0),
        )
        F[0, k], F[1, k], F[2, k] = s * (b0 - a[0]), s * (b1 - a[1]), s * (b2 - a[2])
    j00, j01, j02 = F[0, 0], F[0, 1], F[0, 2]
    j10, j11, j12 = F[1, 0], F[1, 1], F[1, 2]
    j20, j21, j22 = F[2, 0], F[2, 1], F[2, 2]
    F[0, 0] += 1 + 0.5 * (j00 * j00 + j01 * j10 + j02 * j20)
    F[0, 1] += 0.5 * (j00 * j01 + j01 * j11 + j02 * j21)
    F[0, 2] += 0.5 * (j00 * j02 + j01 * j12 + j02 * j22)
    F[1, 0] += 0.5 * (j10 * j00 + j11 * j10 + j12 * j20)
    F[1, 1] += 1 + 0.5 * (j10 * j01 + j11 * j11 + j12 * j21)
    F[1, 2] += 0.5 * (j10 * j02 + j11 * j12 + j12 * j22)
    F[2, 0] += 0.5 * (j20 * j00 + j21 * j10 + j22 * j20)
    F[2, 1] += 0.5 * (j20 * j01 + j21 * j11 + j22 * j21)
    F[2, 2] += 1 + 0.5 * (j20 * j02 + j21 * j12 + j22 * j22)


@inline
def transform(P: Array, workspace: Array, dt: float) -> None:
    """P <- Phi P Phi' with Phi = [I, dt/2 (I + A); 0, A]."""
    F = matrix(workspace, A, 3, 3)
    h = 0.5 * dt
    for j in range(6):
        n0, n1, n2 = rotate_vector(F, P[3, j], P[4, j], P[5, j])
        P[0, j] += h * (P[3, j] + n0)
        P[1, j] += h * (P[4, j] + n1)
        P[2, j] += h * (P[5, j] + n2)
        P[3, j], P[4, j], P[5, j] = n0, n1, n2
    for i in range(6):
        n0, n1, n2 = rotate_vector(F, P[i, 3], P[i, 4], P[i, 5])
        P[i, 0] += h * (P[i, 3] + n0)
        P[i, 1] += h * (P[i, 4] + n1)
        P[i, 2] += h * (P[i, 5] + n2)
        P[i, 3], P[i, 4], P[i, 5] = n0, n1, n2
    for i in range(6):
        for j in range(i):
            P[i, j] = P[j, i]


@inline
def random_walk(workspace: Array, noise: Noise) -> float:
    """Return the random walk of the velocity, m/s/sqrt(s): of the accelerometers, or of what the
    model does not know."""
    return workspace[UNKNOWN] if by_model(workspace) else noise.accel


@inline
def add_noise(P: Array, workspace: Array, noise: Noise, dt: float) -> None:
    """Process noise of dt: white acceleration, or q on each of the six, as the paper has it."""
    if workspace[Q] > 0:
        for i in range(6):
            P[i, i] += workspace[Q] * dt
        return
    v = random_walk(workspace, noise) * random_walk(workspace, noise) * dt
    for i in range(3):
        P[i, i] += v * dt * dt / 3
        P[i, 3 + i] += 0.5 * v * dt
        P[3 + i, i] += 0.5 * v * dt
        P[3 + i, 3 + i] += v


@helper
def copy(x: Array, P: Array, to: Array, To: Array) -> None:
    """A Gaussian of six states into another place."""
    for i in range(6):
        to[i] = x[i]
        for j in range(6):
            To[i, j] = P[i, j]


@helper
def innovation_at(workspace: Array, y: Array, kind: int, x: Array, innovation: Array) -> int:
    """Innovation (m or m/s; NaN where not measured) of a fix of position or velocity at the
    state x. Returns the first of the states that it sees."""
    origin, craft = workspace[ORIGIN], craft_in(workspace, CRAFT)
    if kind == Kind.POSITION:
        innovation[0] = (y[0] - origin[0]) / craft.latitude_rate - x[0]
        innovation[1] = wrap(y[1] - origin[1]) / craft.longitude_rate - x[1]
        innovation[2] = origin[2] - y[2] - x[2]
        return 0
    for i in range(3):
        innovation[i] = y[i] - x[3 + i]
    return 3


@inline
def variance(workspace: Array, std: Array, i: int) -> float:
    """Return the variance of row i of a fix: r where it is given, else the fix's own."""
    return workspace[R] if workspace[R] > 0 else std[i] * std[i]


@helper
def correct_gaussian(
    workspace: Array, x: Array, P: Array, first: int, innovation: Array, std: Array
) -> tuple[float, float]:
    """Correct one Gaussian by the measured rows of a fix, one after the other. Returns NIS and
    log det of their covariance; NaN without any."""
    nis, spread, rows = 0.0, 1.0, 0
    b0, b1, b2 = x[first], x[first + 1], x[first + 2]
    for i in range(3):
        # minus the corrections by the earlier rows
        e = innovation[i] + ((b0 if i == 0 else (b1 if i == 1 else b2)) - x[first + i])
        if math.isnan(e):
            continue
        k = first + i
        s = P[k, k] + variance(workspace, std, i)
        rows += 1
        nis += e * e / s
        spread *= s
        g0, g1, g2, g3, g4, g5 = P[0, k], P[1, k], P[2, k], P[3, k], P[4, k], P[5, k]
        gains = (g0, g1, g2, g3, g4, g5)
        for m in range(6):
            w = gains[m] / s
            x[m] += w * e
            for n in range(6):
                P[m, n] -= w * gains[n]
    return (nis, math.log(spread)) if rows else (math.nan, math.nan)


@helper
def publish(belief: FilterState) -> None:
    """Write the state into the belief as its affine image: latitude, longitude, height and
    velocity."""
    workspace = belief.workspace
    x, origin, craft = workspace[X], workspace[ORIGIN], craft_in(workspace, CRAFT)
    belief.lla[0] = origin[0] + x[0] * craft.latitude_rate
    belief.lla[1] = wrap(origin[1] + x[1] * craft.longitude_rate)
    belief.lla[2] = origin[2] - x[2]
    for i in range(3):
        belief.v_n[i] = x[3 + i]


@helper
def is_changed(P: Array, left: Array) -> bool:
    """True where the covariance differs from the one that the filter left."""
    for i in range(6):
        for j in range(6):
            if P[i, j] != left[i, j]:
                return True
    return False


@helper
def keep(P: Array, left: Array) -> None:
    """Remember the covariance as the filter leaves it."""
    for i in range(6):
        for j in range(6):
            left[i, j] = P[i, j]
