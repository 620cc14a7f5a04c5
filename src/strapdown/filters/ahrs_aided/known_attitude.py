"""Functions shared by filters that take their attitude as known, such as from an AHRS: that
attitude, the effect of its errors on the velocity, Euler angles.

The known attitude is that of the last record, carried on by the gyros. Position and velocity are
computed with it, so that their errors, with those of the accelerometer biases, and the errors of
attitude and gyro biases are two linear filters beside each other. Source: Fossen (2021) 14.3-14.4.

The errors of the known attitude are not estimated, but considered: their covariance with those of
the states is kept beside P, so that a fix which corrects what they did to the velocity is weighed
rightly. Source: Schmidt (1966); Bierman (1977), Factorization Methods, chapter VIII. With
`attitude_error="neglected"` they are taken as zero, as in Fossen's equations and code (`ins_ahrs` of
the Marine Systems Simulator): the velocity trusts each record fully, and the standard deviations
of the records weigh the angles alone.

The stated covariance moves no mean, for it is a bound and seldom the variance of the error. To the
second order a turn by an error n of covariance S shortens what it turns: E exp[n x] = I - (tr S I -
S) / 2, 0.7 mm/s^2 of gravity at 0.5 deg, in every record to the same side. The share of it that is
real, 0 to 1, is considered as a constant of mean 0 and variance 1: it widens the standard deviation
of the accelerometer bias that it cannot be told from, where the filter has its 15 states alone.
"""

import math
from collections.abc import Mapping

from ...checks import check_choice, check_number
from ...core.compile.jit import helper, matrix
from ...core.loop.contract import (
    MAX_STATES,
    STATES,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    first_event,
)
from ...core.mathematics.error_state import (
    BLOCK,
    DV,
    DX,
    HEIGHT,
    JACOBIAN,
    MID,
    TRANSPORT,
    WORK,
    bias_free,
    inject_all,
    linearised_step,
    measure,
)
from ...core.mathematics.kalman import propagate_error, used_rows, whiten
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import (
    Three,
    euler_to_matrix,
    matrix_to_euler,
    measured_heading,
    wrap,
)
from ...typing import Array
from ..ins.open_loop import BESIDE

KNOWN_ATTITUDE = Slots(after=BESIDE)
"""Slots of every filter here, with what an open loop keeps."""
ANGLES = KNOWN_ATTITUDE.array("ANGLES", 3)  # Euler angles, rad
KNOWN = KNOWN_ATTITUDE.matrix("KNOWN", 3, 3)  # the known attitude C_nb
# covariance of its errors in n without those of the gyro biases, rad^2
ERROR_NN, ERROR_NE, ERROR_EE, ERROR_DD = KNOWN_ATTITUDE.numbers(
    "ERROR_NN", "ERROR_NE", "ERROR_EE", "ERROR_DD"
)
SINCE_TILT, SINCE_HEADING = KNOWN_ATTITUDE.numbers("SINCE_TILT", "SINCE_HEADING")
"""s since each was measured."""
DRIFT_TILT, DRIFT_HEADING = KNOWN_ATTITUDE.numbers("DRIFT_TILT", "DRIFT_HEADING")
"""Standard deviation of what gyro biases have turned each since, rad."""
CORRELATION = KNOWN_ATTITUDE.number("CORRELATION")  # s for which the errors of records are alike
CONSIDERED = KNOWN_ATTITUDE.number("CONSIDERED")  # 1, or 0 where these errors are neglected
# covariance (4, n) of what is considered with the errors of the n states: the errors of the known
# attitude, in n, and the share by which they shorten the force; that with attitude and gyro biases
# is left out
CONSIDER = 4
SHARED = KNOWN_ATTITUDE.matrix("SHARED", CONSIDER, MAX_STATES)
STEEP_PITCH = math.radians(85.0)
"""Pitch from which on Euler angles are read off the rotation matrix: roll and heading move 11
times as fast as the body, and ever faster."""
MIN_RECORD_INTERVAL = 1e-3  # s between two attitude records
ATTITUDE_ERRORS = {"considered": 1.0, "neglected": 0.0}
"""Effects of the errors of the known attitude on the velocity: names of the option, and CONSIDERED."""
WITH_ANGLES = Slots(after=KNOWN_ATTITUDE)
"""Slots of those that integrate Euler angles."""
BEYOND_COLUMN = "pitch_beyond_85_deg [s]"
BEYOND = WITH_ANGLES.output(BEYOND_COLUMN)  # with the pitch beyond STEEP_PITCH


def know(belief: FilterState, correlation: float, attitude_error: str) -> FilterState:
    """`belief` with its attitude as the known one, as uncertain as P says.

    correlation: time constant (s) of the errors of attitude records; 0 for errors that are
    independent from record to record. attitude_error: a name of ATTITUDE_ERRORS.
    """
    check_number(correlation, "correlation", "s", least=0)
    considered = ATTITUDE_ERRORS[check_choice(attitude_error, "attitude_error", ATTITUDE_ERRORS)]
    P, slots = belief.P, KNOWN_ATTITUDE.views(belief.workspace)
    slots["KNOWN"][:], belief.workspace[CORRELATION] = belief.C_nb, correlation
    belief.workspace[CONSIDERED] = considered
    for k, i, j in ((ERROR_NN, 6, 6), (ERROR_NE, 6, 7), (ERROR_EE, 7, 7), (ERROR_DD, 8, 8)):
        belief.workspace[k] = considered * P[i, j]
    return belief


def with_angles(belief: FilterState, start: InitialState) -> FilterState:
    """`belief` with the Euler angles of `start`."""
    belief.workspace[ANGLES] = start.rph
    return belief


@helper
def take_attitude(belief: FilterState, y: Array, std: Array) -> None:
    """The measured attitude is the known one from now on, its errors new; a heading that it
    lacks is the belief's, whose error goes on."""
    workspace, n, heading = belief.workspace, belief.P.shape[0], measured_heading(y, belief.C_nb)
    S = matrix(workspace, SHARED, CONSIDER, n)
    euler_to_matrix(y[0], y[1], heading, matrix(workspace, KNOWN, 3, 3))
    ch, sh, forward, right = math.cos(heading), math.sin(heading), std[0] * std[0], std[1] * std[1]
    workspace[ERROR_NN], workspace[ERROR_NE] = (
        ch * ch * forward + sh * sh * right,
        ch * sh * (forward - right),
    )
    workspace[ERROR_EE] = sh * sh * forward + ch * ch * right
    workspace[SINCE_TILT] = workspace[DRIFT_TILT] = keep = 0.0
    if math.isnan(y[2]):
        keep = _go_on(workspace, belief.P[8, 8])
    else:
        workspace[ERROR_DD] = std[2] * std[2]
        workspace[SINCE_HEADING] = workspace[DRIFT_HEADING] = 0.0
    for k in (ERROR_NN, ERROR_NE, ERROR_EE, ERROR_DD):
        workspace[k] *= workspace[CONSIDERED]
    for j in range(n):
        S[0, j] = S[1, j] = 0.0
        S[2, j] *= keep


@helper
def _go_on(workspace: Array, variance: float) -> float:
    """The error of the known heading becomes that of the belief, of that variance (rad^2). Returns
    which share of it is the same error still.

    Where fixes have made the belief more certain, an optimal estimate has that share, the ratio of
    the variances, in common with the former one.
    """
    before = workspace[ERROR_DD] + workspace[DRIFT_HEADING] * workspace[DRIFT_HEADING]
    keep = min(variance / before, 1.0) if before > 0 else 0.0
    workspace[ERROR_DD] = keep * workspace[ERROR_DD] + max(variance - before, 0.0)
    workspace[DRIFT_HEADING] *= math.sqrt(keep)
    return keep


@helper
def fade_shared(belief: FilterState, source: SourceRow) -> None:
    """Before a fix: what its correlated errors have in common with the errors of the known attitude
    fades as they did."""
    S = matrix(belief.workspace, SHARED, CONSIDER, belief.P.shape[0])
    for i in range(3):
        state = source.correlated_state[i]
        for k in range(CONSIDER if state > 0 else 0):
            S[k, state] *= source.kept


@helper
def inflate_attitude_noise(belief: FilterState, std: Array, kind: int) -> None:
    """Write the standard deviations to use of a fix into workspace[DV], which is free between
    predictions: those given.

    Those of an attitude record are so much larger that independent errors have the low-frequency
    power of its correlated ones.
    """
    workspace, used, scale = belief.workspace, belief.workspace[DV], 1.0
    if kind == Kind.ATTITUDE:
        scale = math.sqrt(
            max(
                2 * workspace[CORRELATION] / max(workspace[SINCE_TILT], MIN_RECORD_INTERVAL),
                1.0,
            )
        )
    for i in range(3):
        used[i] = scale * std[i]


@helper
def predict_fed(belief: FilterState, u: Array, dt: float, noise: Noise) -> Three:
    """Advance P, position, velocity and the known attitude with bias-corrected increments.
    Returns the rotation vector of the body, rad."""
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    linearised_step(belief, matrix(belief.workspace, KNOWN, 3, 3), 0.0, u, dt, noise, False)
    move(belief, belief.lla, belief.v_n, r, a, dt, noise)
    return r


@helper
def move(
    belief: FilterState,
    lla: Array,
    v: Array,
    r: Three,
    a: Three,
    dt: float,
    noise: Noise,
) -> None:
    """Advance lla, v and the known attitude by rotation r and velocity increment a (body), and P by
    what errors of that attitude do to the velocity.

    After `linearised_step`. An error n held for the time s since the record moves the velocity by n
    x f s and the position by n x f s^2/2.
    """
    workspace, f, w, n = (
        belief.workspace,
        belief.workspace[DX],
        belief.workspace[TRANSPORT],
        belief.P.shape[0],
    )
    S = matrix(workspace, SHARED, CONSIDER, n)
    mechanize(lla, v, matrix(workspace, KNOWN, 3, 3), r, a, dt, f, workspace[HEIGHT])
    f0, f1, f2 = f[0], f[1], f[2]
    for k in range(CONSIDER):
        propagate_error(
            S[k],
            workspace[BLOCK],
            matrix(workspace, MID, 3, 3),
            workspace[DV],
            (w[0], w[1], w[2]),
            dt,
            noise,
            workspace[WORK],
        )
    _consider(S, workspace, f0, f1, f2, dt)
    _add_attitude_noise(belief, S, f0, f1, f2, dt)
    _consider(S, workspace, f0, f1, f2, dt)
    _carry(belief, dt, noise)


@helper
def _mean_shortening(
    workspace: Array, n: int, f0: float, f1: float, f2: float
) -> tuple[float, float, float]:
    """(tr S I - S) / 2 f of the velocity increment f, m/s: what errors of the known attitude, of
    covariance S, shorten it by on average.

    0 with more than STATES states (n): a scale of the accelerometers has that uncertainty already,
    and the loop couples such states into P alone (core/mathematics/coupling.py).
    """
    if n > STATES:
        return 0.0, 0.0, 0.0
    nn, ne, ee = tilt_variances(workspace)
    dd = workspace[ERROR_DD] + workspace[DRIFT_HEADING] * workspace[DRIFT_HEADING]
    return (
        0.5 * ((ee + dd) * f0 - ne * f1),
        0.5 * ((nn + dd) * f1 - ne * f0),
        0.5 * (nn + ee) * f2,
    )


@helper
def _consider(S: Array, workspace: Array, f0: float, f1: float, f2: float, dt: float) -> None:
    """Add to S half of what the errors of the known attitude, and their shortening of the force, do
    to velocity and position over dt; f is the velocity increment, m/s.

    The turn by a constant gyro bias counts 1.5 times: that makes good for its covariance with the
    velocity, which is not kept, as far as velocity goes.
    """
    tilt, heading = (
        0.75 * workspace[DRIFT_TILT] * workspace[DRIFT_TILT],
        0.75 * workspace[DRIFT_HEADING] * workspace[DRIFT_HEADING],
    )
    nn, ne, ee, dd = (
        0.5 * workspace[ERROR_NN] + tilt,
        0.5 * workspace[ERROR_NE],
        0.5 * workspace[ERROR_EE] + tilt,
        0.5 * workspace[ERROR_DD] + heading,
    )
    for k, x, y, z in ((0, nn, ne, 0.0), (1, ne, ee, 0.0), (2, 0.0, 0.0, dd)):
        _move(S[k], y * f2 - z * f1, z * f0 - x * f2, x * f1 - y * f0, dt)
    m0, m1, m2 = _mean_shortening(workspace, S.shape[1], f0, f1, f2)
    _move(S[3], 0.5 * m0, 0.5 * m1, 0.5 * m2, dt)


@helper
def _move(row: Array, v0: float, v1: float, v2: float, dt: float) -> None:
    """Add a change of velocity over dt, and what it moves, to a row of covariances."""
    row[3] += v0
    row[4] += v1
    row[5] += v2
    row[0] += 0.5 * dt * v0
    row[1] += 0.5 * dt * v1
    row[2] += 0.5 * dt * v2


@helper
def _add_attitude_noise(
    belief: FilterState, S: Array, f0: float, f1: float, f2: float, dt: float
) -> None:
    """Add to P what the errors of the known attitude, of covariance S with the states, do over dt;
    further, as white noise, what they do beyond the record where those of several records are
    alike.
    """
    workspace, P, n, half = belief.workspace, belief.P, S.shape[1], 0.5 * dt
    # covariance of the velocity that is gained with the states
    G = matrix(workspace, JACOBIAN, 3, n)
    m0, m1, m2 = _mean_shortening(workspace, n, f0, f1, f2)
    for j in range(n):
        s0, s1, s2, s = S[0, j], S[1, j], S[2, j], S[3, j]
        G[0, j] = s1 * f2 - s2 * f1 + m0 * s
        G[1, j] = s2 * f0 - s0 * f2 + m1 * s
        G[2, j] = s0 * f1 - s1 * f0 + m2 * s
    for i in range(3):
        for j in range(6, n):
            P[i, j] = P[j, i] = P[j, i] + half * G[i, j]
            P[3 + i, j] = P[j, 3 + i] = P[j, 3 + i] + G[i, j]
        for j in range(3):
            P[i, 3 + j] = P[3 + j, i] = P[i, 3 + j] + half * G[i, 3 + j] + G[j, i]
    for i in range(3):
        for j in range(i + 1):
            P[i, j] = P[j, i] = P[i, j] + half * (G[i, j] + G[j, i])
            P[3 + i, 3 + j] = P[3 + j, 3 + i] = P[3 + i, 3 + j] + G[i, 3 + j] + G[j, 3 + i]
    tilt, heading = (
        2 * max(workspace[CORRELATION] - workspace[SINCE_TILT], 0.0) / dt,
        2 * max(workspace[CORRELATION] - workspace[SINCE_HEADING], 0.0) / dt,
    )
    nn, ne, ee, dd = (
        tilt * workspace[ERROR_NN],
        tilt * workspace[ERROR_NE],
        tilt * workspace[ERROR_EE],
        heading * workspace[ERROR_DD],
    )
    P[3, 3] += f2 * f2 * ee + f1 * f1 * dd
    P[4, 4] += f2 * f2 * nn + f0 * f0 * dd
    P[5, 5] += f1 * f1 * nn - 2 * f0 * f1 * ne + f0 * f0 * ee
    for i, j, more in (
        (3, 4, -f2 * f2 * ne - f0 * f1 * dd),
        (3, 5, f1 * f2 * ne - f0 * f2 * ee),
        (4, 5, f0 * f2 * ne - f1 * f2 * nn),
    ):
        P[i, j] += more
        P[j, i] += more


@helper
def _carry(belief: FilterState, dt: float, noise: Noise) -> None:
    """Propagate the errors of the known attitude over dt: the noise of the gyros, and the turn by
    their biases."""
    workspace, P = belief.workspace, belief.P
    walk = workspace[CONSIDERED] * noise.gyro * noise.gyro * dt
    drift = workspace[CONSIDERED] * math.sqrt((P[12, 12] + P[13, 13] + P[14, 14]) / 3) * dt
    workspace[ERROR_NN] += walk
    workspace[ERROR_EE] += walk
    workspace[ERROR_DD] += walk
    workspace[SINCE_TILT] += dt
    workspace[SINCE_HEADING] += dt
    workspace[DRIFT_TILT] += drift
    workspace[DRIFT_HEADING] += drift


@helper
def tilt_variances(workspace: Array) -> tuple[float, float, float]:
    """Covariance of the tilt of the known attitude, rad^2: nn, ne, ee."""
    drift = workspace[DRIFT_TILT] * workspace[DRIFT_TILT]
    return workspace[ERROR_NN] + drift, workspace[ERROR_NE], workspace[ERROR_EE] + drift


@helper
def learn_from_fix(belief: FilterState, y: Array, std: Array, kind: int) -> None:
    """After a fix that was used: what it tells of the known attitude; a measured attitude is
    that one from now on."""
    learn(belief)
    if kind == Kind.ATTITUDE:
        take_attitude(belief, y, std)


@helper
def learn(belief: FilterState) -> None:
    """After a correction of P by `measure`: the covariance of the states with the errors of the
    known attitude, corrected alike."""
    workspace, n = belief.workspace, belief.P.shape[0]
    S, H, work = (
        matrix(workspace, SHARED, CONSIDER, n),
        matrix(workspace, JACOBIAN, 3, n),
        workspace[WORK],
    )
    whiten(H, work)
    for k in range(CONSIDER):
        x = y = z = 0.0
        for j in range(n):
            x, y, z = x + H[0, j] * S[k, j], y + H[1, j] * S[k, j], z + H[2, j] * S[k, j]
        seen = (x, y, z)
        for m in range(int(work[used_rows(n)])):
            for j in range(n):
                S[k, j] -= seen[m] * work[n * m + j]


@helper
def rate_of_body(
    belief: FilterState, r0: float, r1: float, r2: float
) -> tuple[float, float, float]:
    """Rotation vector of the body to n, in the body (rad): r less that of n."""
    m, w = matrix(belief.workspace, MID, 3, 3), belief.workspace[TRANSPORT]
    w0, w1, w2 = w[0], w[1], w[2]
    return (
        r0 - m[0, 0] * w0 - m[1, 0] * w1 - m[2, 0] * w2,
        r1 - m[0, 1] * w0 - m[1, 1] * w1 - m[2, 1] * w2,
        r2 - m[0, 2] * w0 - m[1, 2] * w1 - m[2, 2] * w2,
    )


@helper
def euler_rates(
    sr: float, cr: float, tp: float, cp: float, r0: float, r1: float, r2: float
) -> tuple[float, float, float]:
    """T(Theta) r: changes of roll, pitch and heading by a small rotation r of the body, from
    sine and cosine of roll, tangent and cosine of pitch."""
    across = sr * r1 + cr * r2
    return r0 + tp * across, cr * r1 - sr * r2, across / cp


@helper
def gentle(belief: FilterState, turn: float) -> bool:
    """True where the Euler angles stay away from their singularity while the body turns by `turn`
    (rad)."""
    return abs(belief.workspace[ANGLES][1]) + turn < STEEP_PITCH


@helper
def add_angles(belief: FilterState, d0: float, d1: float, d2: float) -> None:
    """Add to the Euler angles and make the belief's attitude of them."""
    angles = belief.workspace[ANGLES]
    angles[0], angles[1], angles[2] = wrap(angles[0] + d0), angles[1] + d1, wrap(angles[2] + d2)
    euler_to_matrix(angles[0], angles[1], angles[2], belief.C_nb)


@helper
def read_angles(belief: FilterState) -> None:
    """The Euler angles are those of the belief's attitude."""
    angles = belief.workspace[ANGLES]
    angles[0], angles[1], angles[2] = matrix_to_euler(belief.C_nb)


@helper
def correct_angles(
    belief: FilterState,
    y: Array,
    std: Array,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and the belief by one fix: angles by angles, unless they are steep. Returns the
    NIS."""
    nis = measure(belief, y, std, observe, source, gate, innovation)
    if nis <= gate:
        dx = belief.workspace[DX]
        inject_all(belief, dx)
        if gentle(belief, math.sqrt(dx[6] * dx[6] + dx[7] * dx[7] + dx[8] * dx[8])):
            inject_angles(belief, dx[6], dx[7], dx[8])
        else:
            read_angles(belief)
    return nis


@helper
def inject_angles(belief: FilterState, x: float, y: float, z: float) -> None:
    """Add to the Euler angles what a small rotation (x, y, z) in n (rad) means to first order:
    the inverse of their Jacobian."""
    angles = belief.workspace[ANGLES]
    ch, sh = math.cos(angles[2]), math.sin(angles[2])
    forward = (ch * x + sh * y) / math.cos(angles[1])
    add_angles(belief, forward, ch * y - sh * x, z + forward * math.sin(angles[1]))


def steep(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where the pitch first was beyond STEEP_PITCH, else []."""
    seconds = columns[BEYOND_COLUMN]
    return first_event(
        t,
        seconds > 0,
        f"pitch beyond 85 deg for {seconds[-1:].sum():.3g} s, first here: Euler angles are near "
        f"their singularity and attitude is kept as a rotation matrix meanwhile",
    )
