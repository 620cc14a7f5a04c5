"""The claims of a receiver for its float solutions against what float solutions are known to reach.

Errors of float ambiguities last for minutes, so that nothing in a walk or a drive shows them: from fix to
fix they scatter by millimetres, and a velocity drifts away by as much. Some receivers and programs state
the standard deviation of fixed solutions for float ones too.
"""

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from .finding import Checked, label
from .motion import InspectedRecording

FLOAT = "float"
"""Last word of the name of the class of float solutions."""
BEST, TOO_SURE = 0.09, 0.5
"""m: horizontal standard deviation of float solutions under an open sky (sensor_models/receivers,
rtk-float, with its source), and the share of it below which a claim is not believed."""
MAX_WEIGHT = 2.0
"""Claims alone make a solution doubtful; they show no error."""


def check(subject: InspectedRecording) -> Checked:
    """The claims of each class of float positions; of a recording whose classes are not joined."""
    found = Checked.empty()
    for source in subject.sources("position"):
        if source.receiver and label(source).endswith(FLOAT) and len(source.t):
            found.add(_claims(source, _beside(subject, source)))
    return found


def _beside(subject: InspectedRecording, source: Source) -> str:
    """Words on what fixed solutions of the same receiver claim; "" without any."""
    for other in subject.sources("position"):
        if other.receiver == source.receiver and label(other).endswith("fixed") and len(other.t):
            return f", and {label(other)} {_median(other):.3f} m"
    return ""


def _median(source: Source) -> float:
    """The claimed horizontal standard deviation of its white errors, m."""
    return float(np.median(source.std[:, :2]))


def _claims(source: Source, beside: str) -> Checked:
    """Compare the claims of a class of float positions, with its correlated errors, with the best."""
    white = _median(source)
    lasting = 0.0 if source.correlated is None else float(np.mean(source.correlated.std[:2]))
    total = float(np.hypot(white, lasting))
    if white >= TOO_SURE * BEST:
        return Checked.empty()
    seen = f"it states {white:.3f} m horizontally{beside}; float solutions reach {BEST:g} m at best"
    if total >= TOO_SURE * BEST:
        fact = (
            f"{label(source)}: {seen}, so correlated errors of {lasting:.2g} m are counted beside"
        )
        return Checked([fact], [], [])
    remedy = (
        "add `correlated = { std = [0.2, 0.2, 0.4], time = 300 }` to its [[source]], or tune it"
    )
    weight = min(TOO_SURE * BEST / total, MAX_WEIGHT)
    return Checked([], [Reason("fix noise", seen, remedy, label(source), weight)], [])
