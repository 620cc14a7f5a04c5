"""The filters of Alam et al. in outages of recorded data: thor75 at every offset, drive0708 in
its nine windows. Their flight is not public."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown import io
from strapdown.checks import DataError
from strapdown.experiments.outages.compare import compare
from strapdown.experiments.outages.result import Comparison
from strapdown.experiments.outages.summaries import blocks, overlap_factor
from strapdown.typing import File, Notify, Progress

from ..common.example_recordings import DESCRIPTIONS, FLIGHT, windows_of
from ..common.runner import part_of
from .readings import Variant
from .runs import MEASURES
from .xkf_as_printed import make_known

SWEEP = f"30@{FLIGHT[0]:g}:{FLIGHT[1]:g}/5"
"""thor75: windows of 30 s inside its scored seconds, one every 5 s, each a run of its own."""
RECORDINGS = ("thor75", "drive0708")


class Recorded(NamedTuple):
    """Results of the runs on recordings."""

    # a row per recording, filter and outage, with the columns of runs.Results.scores
    scores: pd.DataFrame
    # {recording: Comparison.growth}, its filters by their names here
    growth: dict[str, pd.DataFrame]
    notes: list[tuple[str, str]]  # (recording, sentence)


NONE = Recorded(pd.DataFrame(), {}, [])


def run(
    variants: dict[str, Variant],
    folder: File | None = None,
    threads: int | None = None,
    notify: Notify | None = None,
    progress: Progress | None = None,
) -> Recorded:
    """Recorded of `variants` {name: Variant} on the descriptions in `folder`. Recordings that are
    not there are noted.

    Raises DataError where `folder` is named and lacks one.
    """
    make_known()
    folder, parts, growth, notes = Path(folder or DESCRIPTIONS), [], {}, []
    for number, name in enumerate(RECORDINGS):
        part = part_of(progress, number / len(RECORDINGS), (number + 1) / len(RECORDINGS))
        try:
            recording = io.read(folder / f"{name}.toml")
        except DataError as error:
            if folder != DESCRIPTIONS:
                raise
            notes.append((name, f"not run: {error}"))
            continue
        compared = compare(
            recording,
            [(each.filter, each.options) for each in variants.values()],
            outages=SWEEP if name == "thor75" else windows_of(recording),
            threads=threads,
            notify=notify,
            progress=part,
        )
        named = dict(zip(compared.filters, variants))
        parts.append(scores(compared, name, named))
        growth[name] = compared.growth.assign(filter=compared.growth["filter"].map(named))
        notes += [(name, note) for note in compared.notes]
    return Recorded(pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(), growth, notes)


def scores(compared: Comparison, case: str, named: dict[str, str]) -> pd.DataFrame:
    """The scores of a Comparison as rows of the study: capped where a filter went too far or did
    not get through, its windows in blocks."""
    table = compared.scores.copy()
    starts, stops = (table.groupby("outage")[name].first() for name in ("start_s", "stop_s"))
    lengths = (stops - starts).to_numpy()
    block = blocks(starts.to_numpy(), lengths)
    number = dict(zip(starts.index, block))
    table = table.assign(
        case=case,
        widening=overlap_factor(starts.to_numpy(), lengths, block),
        block=table["outage"].map(number),
        filter=table["filter"].map(named),
    )
    for measure, most in MEASURES.items():
        lost = table["said"].ne("")
        table[measure] = np.where(lost, most, np.minimum(table[measure], most))
        table.loc[~lost & (table[measure] >= most), "said"] = "diverged"
    return table[
        ["case", "block", "filter", "outage", "start_s", "stop_s", *MEASURES, "widening", "said"]
    ]
