"""All checks of a recording against itself."""

from collections.abc import Callable
from dataclasses import replace

from ..data.recording import Recording
from ..data.verdict import GRAVE, rank_reasons
from ..preprocessing.receiver_classes import join_classes
from . import (
    air_data,
    baseline,
    carrier_claims,
    clock_offsets as clock,
    field_turns,
    fix_noise,
    gyro_scale,
    height_differences as heights,
    plane,
    position_velocity,
    repeats,
    resolution,
    roughness,
    turns,
)
from .finding import Checked, label
from .motion import InspectedRecording

CHECKS: tuple[Callable[[InspectedRecording], Checked], ...] = (
    turns.check,
    field_turns.check,
    gyro_scale.check,
    plane.check,
    baseline.check,
    fix_noise.check,
    clock.check,
    heights.check,
    air_data.check,
    repeats.check,
    roughness.check,
    resolution.check,
)
"""In the order of their report, after that of positions against velocities."""
SPOILT = ("frame", "unit", "unknown")
"""Causes for which a velocity is of no use to the other checks."""


def check(recording: Recording) -> Checked:
    """Return the findings of all checks of a Recording, the weightiest reason first."""
    claims = carrier_claims.check(InspectedRecording(recording))
    recording = replace(recording, sources=join_classes(recording.sources))
    found = position_velocity.check(InspectedRecording(recording))
    useless = {
        reason.source
        for reason in found.reasons
        if reason.cause in SPOILT and reason.weight >= GRAVE
    }
    left = tuple(a for a in recording.sources if a.kind != "velocity" or label(a) not in useless)
    apart = any(reason.cause == "clock" for reason in found.reasons)
    subject = InspectedRecording(replace(recording, sources=left), apart)
    for name in sorted(useless):
        found.inconclusive.append(f"{name} against the IMU: correct {name} first")
    for each in CHECKS:
        found.add(each(subject))
    found.add(claims)
    return replace(found, reasons=rank_reasons(found.reasons))
