"""Cubature Kalman filter: the UKF with the 2 n points of the third-degree cubature rule and process noise that is added instead of spread out.

docs/sigma-points.md says what it shares with `ukf` and what it is good for.
"""
from ..core.contract import CORRECT, PREDICT, Filter, kernel
from ..core.sigma_points import symmetric
from ..core.sigma_states import COLUMNS, auxiliary, fixed, predicted, repairs, width


def start(start, noise):
    """Belief at `start`."""
    n = len(start.sd)
    return start.belief(auxiliary(n, symmetric(n), symmetric(n)))


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """One IMU sample through the mechanization at every point; then the rows of the noise."""
    n = belief.P.shape[0]
    predicted(n, width(n), False, belief, u, dt, noise)


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """One fix, observed at every point."""
    n = belief.P.shape[0]
    return fixed(n, width(n), belief, y, sd, kind, observe, parameters, gate, innovation)


CKF = Filter("ckf", "Arasaratnam & Haykin (2009), IEEE Trans. Automatic Control 54(6)", start, predict, correct, columns=COLUMNS, watch=repairs)
