"""Cubature Kalman filter: the UKF with the 2 n points of the third-degree cubature rule and process
noise that is added instead of spread out.

docs/explanation/sigma-points.md says what it shares with `ukf` and what it is good for.
"""

from ...core.loop.contract import DECAYING, Filter, FilterState, InitialState, Noise
from .ins_sigma_points import SLOTS, begin, correct, predict, repairs
from .sigma_points import symmetric


def start(start: InitialState, noise: Noise) -> FilterState:
    """The filter state at `start`."""
    n = len(start.std)
    return begin(start, symmetric(n), symmetric(n), augmented=False)


CKF = Filter(
    "ckf",
    "Arasaratnam & Haykin (2009), IEEE Trans. Automatic Control 54(6)",
    start,
    predict,
    correct,
    slots=SLOTS,
    diagnose=repairs,
    installation=True,
    bias=DECAYING,
    good_for="large initial errors, with fewer points than ukf",
    poor_for="daily use: the accuracy of closed-loop in 10 times its time",
)
