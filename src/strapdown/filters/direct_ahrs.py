"""Direct Kalman filter with the attitude of an AHRS: the 15 states themselves, Euler angles among them, as one linear time-varying system.

The angles change by T(known attitude) times the bias-free rate, so that their model is linear; the price is an error of its own while the body turns.
"""
import math

from ..core.contract import ATTITUDE_KIND, CORRECT, PREDICT, Filter, kernel, helper
from ..core.error_state import DV, MID, auxiliary
from ..core.fed import (BEYOND, BEYOND_COLUMN, SINCE, STEEP, add_angles, bias_model, correct_angles, euler_rates, gentle, held, know, known_variances,
                        predict_fed, rate_of_body, read_angles, steep, take_attitude, weigh, with_angles)
from ..core.rotation import rotate_right

LEAST_COSINE = math.cos(STEEP)


def start(start, noise, bias="random-walk", correlation=0.0):
    """Belief at `start`. bias: "random-walk", or "decaying" with the time constants of the IMU. correlation: s for which errors of the AHRS are alike."""
    return with_angles(know(start.belief(auxiliary(len(start.sd))), bias, correlation), start)


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """Advance P, position and velocity with the known attitude, and the Euler angles with its transformation of rates."""
    noise = bias_model(belief, noise)
    r0, r1, r2 = predict_fed(belief, u, dt, noise)
    r0, r1, r2 = rate_of_body(belief, r0, r1, r2)
    mid = belief.aux[MID:MID + 9]
    cosine = math.sqrt(mid[7] * mid[7] + mid[8] * mid[8])
    if cosine > LEAST_COSINE and gentle(belief, math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)):
        roll, pitch, heading = euler_rates(mid[7] / cosine, mid[8] / cosine, -mid[6] / cosine, cosine, r0, r1, r2)
        _doubt_rates(belief, pitch, heading, dt, noise)
        add_angles(belief, roll, pitch, heading)
    else:
        rotate_right(belief.C, r0, r1, r2)
        read_angles(belief)
        belief.aux[BEYOND] += dt


@helper
def _doubt_rates(belief, pitch, heading, dt, noise):
    """What the rates of the angles err by, because they are those at the known attitude: its distance to the estimated one, by how much the body turns.

    That distance is the residual of the last record, independent of the errors of the estimate, with the variance that the record has more than it.
    """
    P, (nn, _, ee, _) = belief.P, known_variances(belief, noise)
    growth = max(0.5 * (nn + ee - P[6, 6] - P[7, 7]), 0.0) * held(belief, belief.aux[SINCE] - dt, dt) / (dt * dt)
    P[6, 6] += growth * heading * heading
    P[7, 7] += growth * heading * heading
    P[8, 8] += growth * pitch * pitch


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """Correct P and the states. A measured attitude also is the known one from now on."""
    weigh(belief, sd, kind)
    nis = correct_angles(belief, y, belief.aux[DV], observe, parameters, gate, innovation)
    if nis <= gate and kind == ATTITUDE_KIND:
        take_attitude(belief, y, sd)
    return nis


DIRECT_AHRS = Filter("direct-ahrs", "Fossen (2021) section 14.3.2", start, predict, correct, needs=("attitude",), columns=(BEYOND_COLUMN,), watch=steep)
