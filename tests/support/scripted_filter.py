"""A filter that knows nothing: what its innovations are, its fixes say themselves, so that the
loop's rules meet any series of them."""

import numpy as np

from strapdown.core.loop.contract import CORRECT, PREDICT, Filter, kernel
from strapdown.data.solution import Source

GATE = 16.0
MIN_DEVIATION = 1.0  # larger than any floor


def begin(start, noise):
    return start.belief(np.zeros(1))


@kernel(PREDICT)
def predict(belief, u, dt, noise):
    belief.omega[0] = u[0]


@kernel(CORRECT)
def correct(belief, y, std, kind, observe, source, gate, innovation):
    for i in range(6):
        innovation[i] = np.nan
    if y[0] == y[0]:
        innovation[0] = source.parameters[0]
        innovation[3] = y[2]
    return y[0]


SCRIPTED = Filter("scripted", "none", begin, predict, correct)


def scripted(nis, kind="position", t=None, whitened=np.nan, off=0.0):
    """A Source, once a second where no times are given, whose fixes have these NIS (NaN: nothing
    measured) and, of a position, these whitened first components; all are `off` metres away."""
    nis = np.asarray(nis, float)
    t = np.arange(1.0, len(nis) + 1) if t is None else np.asarray(t, float)
    y = nis[:, None] if kind == "altitude" else np.c_[nis, np.ones(len(nis)), whitened + 0 * nis]
    return Source(kind, t, y, np.full(y.shape, MIN_DEVIATION), (off, 0.0, 0.0), GATE, name="script")
