"""The chapter's attitude observer with a reference vector that varies with time: the specific force
in n by differentiated GNSS velocity less gravity, as in the helicopter's demonstration (FCS-20).

Between two velocities the accelerometers have gathered s = integral of C f, and the fixes say that
it was r = v2 - v1 - g T. The cross product of the two unit vectors turns the attitude:

    C <- exp(k s x r) C, b_ars <- b_ars - k_i k C' (s x r), k = 1 - exp(-k1 T)

With the constant reference r = - g T an acceleration counts as a tilt, as in the other observer of
the chapter. A magnetic field or a compass corrects the heading about the vertical alike, with k2.
Source: Fossen (2021) 14.2; Grip et al. (2013); Hua (2010), Control Engineering Practice 18(7).
"""

import math
from collections.abc import Sequence
from typing import Any

from strapdown.checks import check_choice, check_number
from strapdown.core.compile.jit import helper
from strapdown.core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceLike,
    SourceRow,
    kernel,
)
from strapdown.core.mathematics.earth import RATE, gravity
from strapdown.core.mathematics.kalman import decay, of_estimates
from strapdown.core.mathematics.rotation import (
    orthonormalise,
    rotate_left,
    rotate_right,
    rotate_vector,
    wrap,
)
from strapdown.filters.attitude.attitude_error_state import SIX
from strapdown.typing import Array

SLOTS = Slots()
K1, K2, KI = SLOTS.numbers("K1", "K2", "KI")  # gains, 1/s
BY_GNSS = SLOTS.number("BY_GNSS")  # 1 where fixes tell the reference vector
GATHERED = SLOTS.array("GATHERED", 3)  # integral of C f since the last velocity, n, m/s
SECONDS = SLOTS.number("SECONDS")  # of it
BEFORE = SLOTS.array("BEFORE", 3)  # that velocity, m/s
KNOWN = SLOTS.number("KNOWN")  # 1 where there was one
SINCE = SLOTS.number("SINCE")  # s since the last field or compass
REFERENCES = {"gravity": 0.0, "gnss": 1.0}
MAX_INTERVAL = 1.0
"""s between two fixes, beyond which a direction counts as if it had come after so long."""
MIN_FORCE = 0.5  # m/s^2: below it a mean specific force has no direction


def start(
    start: InitialState,
    noise: Noise,
    reference: str = "gnss",
    k1: float = 0.5,
    k2: float = 0.1,
    ki: float = 0.005,
) -> FilterState:
    """The filter state at `start`. reference: of the specific force, "gnss" or "gravity"; k1: its
    gain, k2: that of field and compass, ki: of the gyro bias, 1/s."""
    for name, value in {"k1": k1, "k2": k2, "ki": ki}.items():
        check_number(value, name, "1/s", least=0)
    workspace = SLOTS.zeros()
    workspace[BY_GNSS] = REFERENCES[check_choice(reference, "reference", REFERENCES)]
    workspace[K1], workspace[K2], workspace[KI] = k1, k2, ki
    return start.belief(workspace)


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """Refuses an antenna away from the IMU: its velocity is not the IMU's."""
    for source in sources:
        if source.kind == "velocity" and any(source.parameters[:3]):
            raise ValueError(
                f"{source.name or source.kind} has a lever arm; give the velocity of the IMU's place"
            )
    return options, []


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Turn the attitude with the bias-free gyros, and gather the specific force in n."""
    if dt <= 0:
        return
    workspace, C, b_g = belief.workspace, belief.C_nb, belief.b_g
    r0, r1, r2 = u[0] - b_g[0] * dt, u[1] - b_g[1] * dt, u[2] - b_g[2] * dt
    a0, a1, a2 = u[3] - belief.b_a[0] * dt, u[4] - belief.b_a[1] * dt, u[5] - belief.b_a[2] * dt
    rotate_right(C, 0.5 * r0, 0.5 * r1, 0.5 * r2)
    s0, s1, s2 = rotate_vector(C, a0, a1, a2)
    rotate_right(C, 0.5 * r0, 0.5 * r1, 0.5 * r2)
    w0, w2 = RATE * math.cos(belief.lla[0]) * dt, -RATE * math.sin(belief.lla[0]) * dt
    rotate_left(-w0, 0.0, -w2, C)
    gathered = workspace[GATHERED]
    gathered[0] += s0
    gathered[1] += s1
    gathered[2] += s2
    workspace[SECONDS] += dt
    workspace[SINCE] += dt
    keep = decay(of_estimates(noise).gyro_decay * dt)
    for i in range(3):
        b_g[i] *= keep
        belief.omega[i], belief.f[i] = u[i] / dt - b_g[i], u[3 + i] / dt - belief.b_a[i]
    orthonormalise(C)


@helper
def _pull(belief: FilterState, x: float, y: float, z: float, gain: float) -> None:
    """Correct attitude and gyro bias by a cross product (x, y, z) in n."""
    C, learnt = belief.C_nb, belief.workspace[KI] * gain
    for i in range(3):
        belief.b_g[i] -= learnt * (C[0, i] * x + C[1, i] * y + C[2, i] * z)
    rotate_left(gain * x, gain * y, gain * z, C)


@helper
def _by_velocity(belief: FilterState, y: Array) -> None:
    """The gathered force against that of the fixes, or of gravity alone."""
    workspace = belief.workspace
    s, before, T = workspace[GATHERED], workspace[BEFORE], workspace[SECONDS]
    r0 = r1 = 0.0
    r2 = -gravity(math.sin(belief.lla[0]), belief.lla[2]) * T
    if workspace[BY_GNSS] > 0:
        r0, r1, r2 = y[0] - before[0], y[1] - before[1], r2 + y[2] - before[2]
    size = math.sqrt((s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) * (r0 * r0 + r1 * r1 + r2 * r2))
    least = MIN_FORCE * T
    if workspace[KNOWN] > 0 and size > least * least:
        x, y_, z = s[1] * r2 - s[2] * r1, s[2] * r0 - s[0] * r2, s[0] * r1 - s[1] * r0
        gain = 1 - decay(workspace[K1] * min(T, MAX_INTERVAL))
        _pull(belief, x / size, y_ / size, z / size, gain)
    for i in range(3):
        before[i], s[i] = y[i], 0.0
    workspace[SECONDS], workspace[KNOWN] = 0.0, 1.0


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct the attitude towards the direction of a fix, without a gate."""
    workspace, C = belief.workspace, belief.C_nb
    for i in range(innovation.size):
        innovation[i] = math.nan
    if kind == Kind.VELOCITY:
        if not math.isnan(y[0] + y[1] + y[2]):
            _by_velocity(belief, y)
        return math.nan
    if kind == Kind.HEADING:
        innovation[0] = wrap(y[0] - math.atan2(C[1, 0], C[0, 0]))
    elif kind == Kind.MAGNETIC_FIELD:
        m0, m1, _ = rotate_vector(C, y[0], y[1], y[2])
        n0, n1 = source.parameters[0], source.parameters[1]
        innovation[0] = math.atan2(m0 * n1 - m1 * n0, m0 * n0 + m1 * n1)
    if not math.isnan(innovation[0]):
        gain = 1 - decay(workspace[K2] * min(workspace[SINCE], MAX_INTERVAL))
        _pull(belief, 0.0, 0.0, math.sin(innovation[0]), gain)
        workspace[SINCE] = 0.0
    return math.nan


FORCE_OBSERVER = Filter(
    "force-observer",
    "Fossen (2021) section 14.2 with a reference vector by GNSS velocity",
    start,
    predict,
    correct,
    states=(),
    estimates=SIX,
    slots=SLOTS,
    uses=("velocity", "magnetic-field", "heading"),
    needs=("velocity",),
    configure=configure,
    weighs=False,
    bias=DECAYING,
)
"""Give the value itself to `fuse`, or `strapdown.register` it."""
