"""Nonlinear observer with a translational motion observer, as Alam et al. use it:
filters/observer/equations.py on the belief itself. No covariance.

docs/observer.md has its equations, what is corrected in the printed ones, and what its options
mean.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...core.contract import CORRECT, PREDICT, Belief, Filter, Noise, Observe, Start, kernel
from ...typing import Array
from .equations import EXCITATION, FORGETTING, HELD, OBSERVER, advance, inject
from .gains import USES, begin, configure, takes_options

LONG_HELD = 10.0  # s without a course that is worth an event
EXCITED = 1e-3  # of the smallest eigenvalue, in which 1 is a specific force of 1 g


@takes_options
def start(start: Start, noise: Noise, **options: Any) -> Belief:
    """Belief at `start`; docs/observer.md explains the options, DEFAULTS of
    filters/observer/gains.py has them. Refuses gains that are not stable and a start beyond the
    bounds.
    """
    belief = start.belief(OBSERVER.zeros())
    begin(belief.workspace, start, noise, **options)
    return belief


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """One IMU sample."""
    advance(belief, u, dt, noise)


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """One fix. It does not gate."""
    inject(belief, y, sd, kind, observe, parameters, innovation)
    return math.nan


def unobserved(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where the course was held for long because it was too slow for one, and where
    the accelerometer bias was not excited."""
    held, excitation = (columns[OBSERVER.columns[which]] for which in (HELD, EXCITATION))
    events = []
    if len(t) and held[-1] >= LONG_HELD:
        events.append(
            (
                float(t[np.argmax(held > 0)]),
                f"course held for {held[-1]:.0f} s in all, from here on: too slow to have one; the "
                f"gyros alone carried the heading",
            )
        )
    if len(t) and t[-1] - t[0] > FORGETTING and not np.max(excitation) >= EXCITED:
        events.append(
            (
                float(t[-1]),
                f"accelerometer bias not excited: the smallest eigenvalue of the mean of phi phi' "
                f"never passed {np.max(excitation):.1g}",
            )
        )
    return events


NLO = Filter(
    "nlo",
    "Alam, Whidborne & Millidere (2023) section 2.1; Grip, Fossen, Johansen & Saberi (2015); Hansen "
    "et al. (2016)",
    start,
    predict,
    correct,
    states=(),
    slots=OBSERVER,
    uses=USES,
    configure=configure,
    diagnose=unobserved,
)
