"""Axes of the IMU that a reader guessed: a solution is not trusted before its motion or its user
confirms them."""

from ..data.recording import Recording
from ..data.verdict import Reason
from ..inspection import plane
from ..inspection.motion import InspectedRecording


def of_guessed_axes(recording: Recording) -> list[Reason]:
    """Reasons against axes of the IMU that are a guess: what the motion contradicts, or that it does
    not test them; none where it confirms them, or where the user stated them."""
    if "guessed_axes" not in recording.meta:
        return []
    axes, tested = recording.meta["guessed_axes"], plane.check(InspectedRecording(recording))
    if tested.facts or tested.reasons:
        return tested.reasons
    why = "".join(f" ({line.partition(': ')[2]})" for line in tested.inconclusive[:-1][:1])
    seen = (
        f'"{axes}" is a guess that the motion does not confirm{why}: roll, pitch and heading may '
        "be off by 90 or 180 deg; only the position can be trusted"
    )
    return [Reason("axes", seen, plane.confirm(axes))]
