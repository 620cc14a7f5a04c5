"""The recorded flight and drive of examples/recordings: where their descriptions are, and which
seconds of them are scored."""

from pathlib import Path

from strapdown.evaluation.metrics import moving_windows
from strapdown.recording import Recording

DESCRIPTIONS = Path(__file__).resolve().parents[4] / "examples" / "recordings"
"""Folder of the descriptions in the source tree."""
FLIGHT = (240.0, 575.0)
"""Seconds of thor75 that are scored: heading cannot be observed before the launch at 211 s, and
the aircraft lands at 579 s."""


def windows_of(recording: Recording) -> list[tuple[float, float]]:
    """The nine 15 s outages of the drive, [(start, stop)] in s."""
    return moving_windows(
        recording.reference, count=9, length=15.0, every=50.0, after=60.0, speed=4.0
    )
