"""Open loop (feed-forward): the INS runs raw and alone; its error is estimated beside it and never reset. The belief is INS (+) error."""
from ..core.contract import BA, BG, CORRECT, PREDICT, Filter, helper, kernel, matrix
from ..core.error_state import DV, DX, HEIGHT, OWN, X, auxiliary, decay_biases, inject, linearised_step, measure
from ..core.mechanization import mechanize

LLA, V, C = slice(OWN, OWN + 3), slice(OWN + 3, OWN + 6), OWN + 6   # of the raw INS in aux
INS_ERROR = ("ins_error_north [m]", "ins_error_east [m]", "ins_error_down [m]")  # the first numbers of aux: true - raw INS, as estimated
BIAS = slice(OWN + 15, OWN + 21)                                     # what the raw INS takes off its IMU: accelerometer, gyro


def start(start, noise, error_model="corrected"):
    """Belief at `start`: the INS begins there, and only the initial biases of `start` are taken off its IMU (decaying as the model says).

    error_model: "corrected", or a name of core.error_dynamics.MODELS: what Hager & Bryne print, whole or in part.
    """
    belief = start.belief(auxiliary(len(start.sd), error_model))
    belief.aux[LLA], belief.aux[V], belief.aux[C:C + 9] = belief.lla, belief.v, belief.C.ravel()
    belief.aux[BIAS] = *belief.ba, *belief.bg
    return belief


@helper
def predict_beside(belief, u, dt, noise):
    """One step of the raw INS and of the error beside it; the belief is composed of both."""
    aux = belief.aux
    b = aux[BIAS]
    linearised_step(belief, u, dt, noise, True)
    mechanize(aux[LLA], aux[V], matrix(aux, C, 3, 3), u[0] - b[3] * dt, u[1] - b[4] * dt, u[2] - b[5] * dt,
              u[3] - b[0] * dt, u[4] - b[1] * dt, u[5] - b[2] * dt, dt, aux[DV], aux[HEIGHT])
    decay_biases(b[0:3], b[3:6], dt, noise)
    compose(belief)


@helper
def compose(belief):
    """belief = INS (+) error: equations (20)-(23) of the paper."""
    aux = belief.aux
    x, b, raw = aux[X], aux[BIAS], matrix(aux, C, 3, 3)
    lla, v, xa, xg = aux[LLA], aux[V], x[BA], x[BG]
    for i in range(3):
        belief.lla[i], belief.v[i] = lla[i], v[i]
        belief.ba[i], belief.bg[i] = b[i] + xa[i], b[3 + i] + xg[i]
        for j in range(3):
            belief.C[i, j] = raw[i, j]
    inject(belief.lla, belief.v, belief.C, x)


@helper
def correct_beside(belief, y, sd, observe, parameters, gate, innovation):
    """Correct the error beside the INS: its prior is kept and the correction added to it."""
    nis = measure(belief, y, sd, observe, parameters, gate, innovation)
    if nis <= gate:
        x, dx = belief.aux[X], belief.aux[DX]
        for i in range(x.size):
            x[i] += dx[i]
        compose(belief)
    return nis


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    """Advance P, the raw INS and the error beside it."""
    predict_beside(belief, u, dt, noise)


@kernel(CORRECT)
def correct(belief, y, sd, kind, observe, parameters, gate, innovation):
    """Correct P and the error beside the INS."""
    return correct_beside(belief, y, sd, observe, parameters, gate, innovation)


OPEN_LOOP = Filter("open-loop", "Hager & Bryne, section IV-A, equations (19)-(23)", start, predict, correct,
                   columns=INS_ERROR)
