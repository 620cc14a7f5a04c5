"""Invariant extended Kalman filter: the error of attitude, velocity and position is one element of
SE_2(3), on the left for what is measured in n, on the right for what is measured in the body.

Without biases, Earth rotation and curvature the logarithm of such an error obeys a linear differential
equation, however large it is and wherever the vehicle flies. Biases, Earth rate, transport rate and the
gravity gradient break that; they stand in F as for every other filter (`kinematic_blocks`).
"""

from collections.abc import Sequence
from typing import Any

from ...checks import check_choice
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceLike,
    SourceRow,
    kernel,
)
from ...core.mathematics.error_state import allocate, measure
from ...core.mathematics.source import IN_BODY
from ...typing import Array
from ..ins.closed_loop import predict
from .adjoint_change import SMOOTHER
from .composed import BIASES, FIRST, FORMS, PUBLISHED, SECOND_ORDER, SLOTS, compose
from .group_errors import ADDED, IN_GROUP, LEFT, RIGHT
from .second_order import measure_to_second_order

BIAS_ERRORS = ("added", "two-frame")
NOT_OF_THE_POSE = ("heading", "course", "attitude", "range")
"""Kinds that are no vector of the pose in n or in the body."""


def start(
    start: InitialState, noise: Noise, form: str = SECOND_ORDER, biases: str = "added"
) -> FilterState:
    """The filter state at `start`. form: "second-order", with fixes to second order and P reset to errors about
    the corrected estimate; "published", without either. biases: "added", or "two-frame", a group of
    vectors in n and in the body, in the published form alone."""
    check_choice(biases, "biases", BIAS_ERRORS)
    if biases != "added" and check_choice(form, "form", FORMS) != PUBLISHED:
        raise ValueError(
            f'biases "{biases}" needs form "{PUBLISHED}": to second order biases are corrected by addition'
        )
    return on_group(start, form, IN_GROUP if biases == "two-frame" else ADDED)


def on_group(start: InitialState, form: str, biases: float) -> FilterState:
    """The filter state at `start` of a filter on the group, in this form and with these BIASES."""
    check_choice(form, "form", FORMS)
    belief = start.belief(allocate(SLOTS))
    belief.workspace[FIRST], belief.workspace[BIASES] = form == PUBLISHED, biases
    return belief


def say_usual(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """A note on sources that have no invariant form."""
    usual = dict.fromkeys(a.name or a.kind for a in sources if a.kind in NOT_OF_THE_POSE)
    notes = [f"{name}: has no invariant form; linearised as in the closed loop" for name in usual]
    return options, notes


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
    """Correct P; compose the correction along the group, on the side of the fix."""
    if belief.workspace[FIRST] > 0:
        nis = measure(belief, y, std, observe, source, gate, innovation)
    else:
        nis = measure_to_second_order(belief, y, std, observe, source, gate, innovation, 0.0)
    if nis <= gate:
        compose(belief, RIGHT if source.pose_axes == IN_BODY else LEFT)
    return nis


IEKF = Filter(
    "iekf",
    "Barrau & Bonnabel (2017), IEEE TAC 62(4); Brossard et al. (2022), IEEE T-RO 38(2)",
    start,
    predict,
    correct,
    slots=SLOTS,
    configure=say_usual,
    smoother=SMOOTHER,
    installation=True,
    bias=DECAYING,
    good_for="initial attitudes far off, without an observer",
    poor_for="studies of many runs: no lanes",
)
