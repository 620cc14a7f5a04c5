"""Unscented Kalman filter: sigma points through INS and measurements instead of Jacobians, in square-root form. 15 error states on the manifold.

docs/sigma-points.md has its equations and says what it is good for.
"""
from ..core.contract import CORRECT, PREDICT, Filter, kernel
from ..core.sigma_points import merwe, symmetric
from ..core.sigma_states import COLUMNS, NOISES, auxiliary, fixed, predicted, repairs, width

SETS = ("merwe", "symmetric")


def start(start, noise, sigma="merwe", alpha=0.1, beta=2.0, kappa=0.0):
    """Belief at `start`. sigma: "merwe", the scaled set with alpha, beta, kappa, or "symmetric", without centre. The prediction has points for the
    noise too, so that its set is that of n + 12 states. Refuses a set without points, and parameters that the set does not have.
    """
    n = len(start.sd)
    if sigma not in SETS:
        raise ValueError(f"sigma is {sigma!r}; it must be one of {', '.join(SETS)}")
    if sigma == "symmetric" and (alpha, beta, kappa) != (0.1, 2.0, 0.0):
        raise ValueError("alpha, beta and kappa belong to sigma = 'merwe'; leave them out")
    made = [symmetric(states) if sigma == "symmetric" else merwe(states, alpha, beta, kappa) for states in (n, n + NOISES)]
    return start.belief(auxiliary(n, made[1], made[0]))


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """One IMU sample through the mechanization at every point, those of the noise included."""
    n = belief.P.shape[0]
    predicted(n, width(n), True, belief, u, dt, noise)


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """One fix, observed at every point."""
    n = belief.P.shape[0]
    return fixed(n, width(n), belief, y, sd, kind, observe, parameters, gate, innovation)


UKF = Filter("ukf", "Julier & Uhlmann (2004); Van der Merwe (2004); Mollaei, Shafieirad & Moradi (2025) section 3.2", start, predict, correct,
             columns=COLUMNS, watch=repairs)
