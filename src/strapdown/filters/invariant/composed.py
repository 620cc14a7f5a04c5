"""A correction composed into the estimate along the group, and P of the errors that are left.

Prediction, gain and correction of P do not depend on the coordinates of small errors and are those of the
closed loop. What is not small differs: the estimate goes to chi exp(c) or exp(c) chi, velocity and
position turn with the attitude, and P turns with them, by M = T(new)^-1 J T(old) with T of
`group_errors.to_group`.

    published     J = I: P of the group's errors stays what it was
    second order  J of `group_errors.about_correction`: errors about what the correction made of the
                  estimate. Biases are corrected by addition then, and M leaves them alone
"""

from ...core.compile.jit import helper, matrix
from ...core.compile.workspace import Slots
from ...core.mathematics.belief import ATT, POS, STATES, VEL, FilterState
from ...core.mathematics.earth import displace
from ...core.mathematics.error_state import DX, ERROR_STATE, inject_tail
from ...core.mathematics.rotation import (
    orthonormalise,
    rotate_left,
    rotate_vector,
    rotation_terms,
    turned_by,
)
from ...typing import Array
from .group_errors import (
    ADDED,
    B_A,
    B_G,
    ESTIMATE,
    IN_GROUP,
    LEFT,
    PLACE,
    RIGHT,
    P,
    V,
    about_correction,
    add,
    from_group,
    keep_estimate,
    left_jacobian,
    to_group,
    turn_covariance,
)

SECOND_ORDER, PUBLISHED = "second-order", "published"
FORMS = (SECOND_ORDER, PUBLISHED)
SLOTS = Slots(after=ERROR_STATE)
FIRST = SLOTS.number("FIRST")  # 1: as published, to first order
BIASES = SLOTS.number("BIASES")  # ADDED or IN_GROUP
THEN = SLOTS.array("THEN", ESTIMATE)  # the estimate before a correction
NOW = SLOTS.array("NOW", ESTIMATE)  # and after it
ON_GROUP = SLOTS.array("ON_GROUP", STATES)  # the correction c
ROW = SLOTS.array("ROW", STATES)
TERM = SLOTS.array("TERM", 9)
CHANGE = SLOTS.matrix("CHANGE", STATES, STATES)  # M


@helper
def compose(belief: FilterState, side: float) -> None:
    """Compose the correction workspace[DX] into the estimate on this side, and turn P."""
    work = belief.workspace
    c = work[ON_GROUP]
    keep_estimate(belief, work[THEN])
    for i in range(STATES):
        c[i] = work[DX][i]
    to_group(c, side, work[BIASES], work[THEN])
    move(belief, side)
    move_biases(belief, side)
    inject_tail(belief, work[DX])
    write_change(work, side)
    turn_covariance(belief.P, matrix(work, CHANGE, STATES, STATES), work[ROW])


@helper
def move(belief: FilterState, side: float) -> None:
    """chi <- chi exp(c), or exp(c) chi."""
    work = belief.workspace
    C, v, c, theta = matrix(work[THEN], PLACE, 3, 3), work[THEN][V], work[ON_GROUP], work[DX][ATT]
    p0, p1, p2 = left_jacobian(c[ATT], c[POS])
    v0, v1, v2 = left_jacobian(c[ATT], c[VEL])
    u0, u1, u2 = v[0], v[1], v[2]
    if side == RIGHT:
        u0, u1, u2 = turned_by(rotation_terms(theta[0], theta[1], theta[2]), u0, u1, u2)
    else:
        p0, p1, p2 = rotate_vector(C, p0, p1, p2)
        v0, v1, v2 = rotate_vector(C, v0, v1, v2)
    displace(belief.lla, p0, p1, p2)
    belief.v_n[0], belief.v_n[1], belief.v_n[2] = u0 + v0, u1 + v1, u2 + v2
    rotate_left(theta[0], theta[1], theta[2], belief.C_nb)
    orthonormalise(belief.C_nb)
    keep_estimate(belief, work[NOW])
    work[NOW][P][0], work[NOW][P][1], work[NOW][P][2] = p0, p1, p2


@helper
def move_biases(belief: FilterState, side: float) -> None:
    """b <- b + db, or in a group of two frames b <- exp(-c) b + c_b."""
    work = belief.workspace
    a, g, c = belief.b_a, belief.b_g, work[ON_GROUP]
    if side == LEFT and work[BIASES] == IN_GROUP:
        R = rotation_terms(-c[6], -c[7], -c[8])
        a[0], a[1], a[2] = turned_by(R, a[0], a[1], a[2])
        g[0], g[1], g[2] = turned_by(R, g[0], g[1], g[2])
    else:
        c = work[DX]
    add(a, 1.0, (c[9], c[10], c[11]))
    add(g, 1.0, (c[12], c[13], c[14]))
    for i in range(3):
        work[NOW][B_A][i], work[NOW][B_G][i] = a[i], g[i]


@helper
def write_change(work: Array, side: float) -> None:
    """M of the last correction, column by column."""
    M, x = matrix(work, CHANGE, STATES, STATES), work[ROW]
    biases = work[BIASES] if work[FIRST] > 0 else ADDED
    for j in range(STATES):
        for i in range(STATES):
            x[i] = 1.0 if i == j else 0.0
        to_group(x, side, biases, work[THEN])
        if work[FIRST] == 0:
            about_correction(x, side, work[ON_GROUP], work[TERM])
        from_group(x, side, biases, work[NOW])
        for i in range(STATES):
            M[i, j] = x[i]
