"""The Verdict of a Solution, from statistics of its run."""

from ..data import Solution
from ..verdict import Verdict


def judge(solution: Solution) -> Verdict:
    """The Verdict of a Solution that `fuse` or `smooth` made of a recording."""
    return Verdict.of([])
