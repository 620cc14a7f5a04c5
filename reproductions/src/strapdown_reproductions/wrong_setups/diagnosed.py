"""Results of `diagnose` on the mistakes of an installation, on one seed of each simulated motion:
how many runs of the filter it takes, and whether it finds what is wrong."""

from typing import Any

import strapdown as sd
from strapdown.checks import DataError

from .cases import SetUpCase
from .mistakes import MISTAKES, Mistake
from .not_showable import why_hidden

GROUPS = (
    "clock of GNSS",
    "clock of position",
    "clock of velocity",
    "antenna arm, forward",
    "antenna arm, up",
    "mounting",
    "odometer",
)
COLUMNS = ("mistake", "recording", "seed", "runs", "named", "found")


def diagnoses(case: SetUpCase, seed: int) -> list[dict[str, Any]]:
    """Rows of COLUMNS: every mistake of the installation that the recording can show."""
    made = []
    for mistake in MISTAKES:
        if mistake.group not in GROUPS or why_hidden(mistake, case.name):
            continue
        recording = mistake.make(case)
        if recording is not None:
            made.append(row(mistake, case, seed, recording))
    return made


def row(mistake: Mistake, case: SetUpCase, seed: int, recording: sd.Recording) -> dict[str, Any]:
    """The row of one diagnosis; 0 runs where it is refused."""
    try:
        diagnosis = sd.diagnose(recording)
        found = diagnosis.found
        values = (
            diagnosis.runs,
            any(each.cause in mistake.causes for each in found),
            "; ".join(f"{each.name} {each.seen}" for each in found),
        )
    except DataError as error:
        values = (0, False, str(error))
    return dict(zip(COLUMNS, (mistake.name, case.name, seed, *values)))
