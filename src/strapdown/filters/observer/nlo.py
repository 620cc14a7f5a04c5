"""Nonlinear observer with a translational motion observer, as Alam et al. use it:
filters/observer/equations.py on the belief itself, filters/observer/covariance.py beside it.

The gains are the observer's; the covariance says what they leave, and whether a fix is plausible.
docs/explanation/observer.md has its equations, what is corrected in the printed ones, and what its options
mean.
"""

import math
from typing import Any

from ...checks import check_number
from ...core.compile.selection import any_of, where
from ...core.compile.workspace import MAX_STATES
from ...core.loop.contract import (
    CORRECT,
    PREDICT,
    STATES,
    Condition,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    SourceRow,
    kernel,
    matrix,
)
from ...typing import Array
from .covariance import (
    AUXILIARY,
    CRAB as CRAB_STATE,
    CRAB_STD,
    FULL,
    SLOTS,
    after_fix,
    after_sample,
    all_states,
    foresee,
    learn_installation,
)
from .equations import CONDITION, OBSERVER, advance, take
from .gains import USES, begin, configure, takes_options

UNKNOWN = 0.5
"""Standard deviation of the attitude, rad, beyond which a field is used without a test: how far it is
off is far from linear in such an angle, and the observer needs it to come home."""
SLOW = Condition(
    "too slow for a course: the gyros alone carry the heading, ever less certain; a heading or a "
    "magnetic field would hold it",
    doubtful=False,
)
UNEXCITED = Condition(
    "accelerometer bias not excited: the motion has been too even to tell it from a tilt; pitch and "
    "roll more, or calibrate the accelerometer before",
    doubtful=False,
)


@takes_options
def start(start: InitialState, noise: Noise, crab: float = 5.0, **options: Any) -> FilterState:
    """The filter state at `start`. crab: standard deviation of the angle between course and heading, deg,
    which the claimed one of the heading has in it; no gain depends on it. docs/explanation/observer.md explains
    the other options, DEFAULTS of filters/observer/gains.py has them. Refuses gains that are not
    stable and a start beyond the bounds.
    """
    check_number(crab, "crab", "deg", least=0)
    belief = start.belief(SLOTS.zeros())
    begin(belief.workspace[: OBSERVER.size], start, noise, **options)
    belief.workspace[CRAB_STD] = math.radians(crab)
    n, m = len(belief.P), all_states(belief)
    if m > MAX_STATES:
        raise ValueError(
            f"{n - STATES} states of the installation are too many beside the observer; at most "
            f"{MAX_STATES - STATES - AUXILIARY}"
        )
    matrix(belief.workspace, FULL, m, m)[n + CRAB_STATE, n + CRAB_STATE] = math.radians(crab) ** 2
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """One IMU sample."""
    if dt > 0:
        advance(belief, u, dt, noise)
        after_sample(belief, dt, noise)


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
    """One fix, unless it is further off than the covariance allows. Returns the NIS, NaN where there
    is no test."""
    nis, P = foresee(belief, y, std, observe, source, innovation), belief.P
    unknown = (kind == Kind.MAGNETIC_FIELD) & (P[6, 6] + P[7, 7] + P[8, 8] > UNKNOWN * UNKNOWN)
    if any_of(unknown):
        nis = where(unknown, math.nan, nis)
        for i in range(3, innovation.size):
            innovation[i] = where(unknown, math.nan, innovation[i])
    taken = (nis <= gate) | unknown
    if any_of(taken):
        learn_installation(belief, nis <= gate)
        take(belief, y, std, kind, source, innovation, taken)
        after_fix(belief, std, kind, source)
    return nis


NLO = Filter(
    "nlo",
    "Alam, Whidborne & Millidere (2023) section 2.1; Grip, Fossen, Johansen & Saberi (2015); Hansen "
    "et al. (2016)",
    start,
    predict,
    correct,
    slots=SLOTS,
    uses=USES,
    configure=configure,
    conditions=(SLOW, UNEXCITED),
    condition=CONDITION,
    installation=True,
    weighs=False,
    lanes=True,
    good_for="initial attitude errors of up to 170 deg",
    poor_for="aircraft with large accelerometer biases; long outages",
)
