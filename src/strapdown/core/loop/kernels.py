"""The kernels of a run, by their addresses: those of its filter and sensors, and the stages that its
sources need. What a run has no use for is neither compiled nor called."""

from typing import NamedTuple

from ...typing import Ints
from ..compile.jit import caller
from ..compile.signatures import REAL, WHOLE, Function, reals, record, signature, wholes
from ..mathematics.belief import BELIEF, NOISE
from ..mathematics.source import OBSERVE, SOURCE
from .cursor import CURSOR
from .tables import FIXES


class Kernels(NamedTuple):
    """Addresses; 0 of a stage that the run does not need."""

    predict: int
    correct: int
    observers: Ints  # by the number of a kind; 0 where the run has no such source
    prepare: Ints  # stages between a measurement and the filter, in their order
    weigh: int  # corrects by a measurement of a robust or adaptive source
    contradicted: int  # tells which of two heights that contradict each other is left out
    correct_increments: int  # of the IMU, by states for its errors
    uncorrect_increments: int  # the other way round
    after_step: Ints  # stages behind a prediction


KERNELS = record(
    Kernels,
    predict=WHOLE,
    correct=WHOLE,
    observers=wholes("kinds"),
    prepare=wholes("prepared"),
    weigh=WHOLE,
    contradicted=WHOLE,
    correct_increments=WHOLE,
    uncorrect_increments=WHOLE,
    after_step=wholes("following"),
)
PREDICT = signature("predict", belief=BELIEF, u=reals(6), dt=REAL, noise=NOISE)
CORRECT = signature(
    "correct",
    REAL,
    belief=BELIEF,
    y=reals(3),
    std=reals(3),
    kind=WHOLE,
    observe=Function(OBSERVE),
    source=SOURCE,
    gate=REAL,
    innovation=reals(12),
)
STAGE = signature(
    "stage",
    WHOLE,
    kernels=KERNELS,
    belief=BELIEF,
    fixes=FIXES,
    k=WHOLE,
    cursor=CURSOR,
    record=reals("width"),
)
"""A stage of measurement k: (kernels, belief, fixes, k, cursor, record) -> 0, or 1 where its caller asks
a question. It reads and writes cursor.work, and asks by itself whether the source of the measurement
wants it. record: a row for the smoother, or (0,) without one."""
STEP = signature("step", belief=BELIEF, u=reals(6), dt=REAL, cursor=CURSOR, record=reals("width"))
"""A stage of a prediction over dt with the increments u."""

predict_at, correct_at = caller(PREDICT), caller(CORRECT)
observe_at, stage_at, step_at = caller(OBSERVE), caller(STAGE), caller(STEP)
