"""Unscented Kalman filter: sigma points through INS and measurements instead of Jacobians, in
square-root form. 15 error states on the manifold.

docs/explanation/sigma-points.md has its equations and says what it is good for.
"""

from ...checks import check_choice
from ...core.loop.contract import DECAYING, Filter, FilterState, InitialState, Noise
from .ins_sigma_points import NOISES, SLOTS, begin, correct, predict, repairs
from .sigma_points import merwe, symmetric

SETS = ("merwe", "symmetric")
NEAREST, FARTHEST = 1e-6, 100.0
"""Square of the spread over the number of states, alpha^2 (1 + kappa / n): the mean of nearer
points is lost in the rounding of a latitude."""


def start(
    start: InitialState,
    noise: Noise,
    sigma: str = "merwe",
    alpha: float = 0.1,
    beta: float = 2.0,
    kappa: float = 0.0,
) -> FilterState:
    """The filter state at `start`. sigma: "merwe", the scaled set with alpha, beta, kappa, or
    "symmetric", the set without a centre point. The prediction has points for the noise too, so
    that its set is that of n + 12 states. Refuses a set without points or with points too near or
    far, and parameters of another set.
    """
    n = len(start.std)
    check_choice(sigma, "sigma", SETS)
    if sigma == "symmetric" and (alpha, beta, kappa) != (0.1, 2.0, 0.0):
        raise ValueError("alpha, beta and kappa belong to sigma = 'merwe'; leave them out")
    made = [
        symmetric(states) if sigma == "symmetric" else merwe(states, alpha, beta, kappa)
        for states in (n, n + NOISES)
    ]
    if not all(
        NEAREST * (1 - 1e-9) <= spread * spread / states <= FARTHEST * (1 + 1e-9)
        for (spread, _), states in zip(made, (n, n + NOISES))
    ):
        raise ValueError(
            f"alpha is {alpha} and kappa {kappa}; alpha^2 (1 + kappa / {n}) must be from {NEAREST}, "
            f"with nearer points lost in rounding, "
            f"to {FARTHEST:.0f}"
        )
    return begin(start, made[1], made[0], augmented=True)


UKF = Filter(
    "ukf",
    "Julier & Uhlmann (2004); Van der Merwe (2004); Mollaei, Shafieirad & Moradi (2025) section 3.2",
    start,
    predict,
    correct,
    slots=SLOTS,
    diagnose=repairs,
    installation=True,
    bias=DECAYING,
    good_for="large initial errors; consumer IMUs in the hand",
    poor_for="daily use: the accuracy of closed-loop in 10 times its time",
)
