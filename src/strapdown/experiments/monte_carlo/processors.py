"""The processors that made the chunks of a campaign, and whether they agree.

Strict arithmetic gives the same bits on all of them, except for functions of the C library that use
other algorithms on other processors. Where chunks come from several processors, a run of each of
the others is therefore computed again here and compared with its file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.compile import library
from .chunks import Chunk, run_chunk

if TYPE_CHECKING:
    from .campaign import Campaign

SAME = "the same bits"


def compare_processors(campaign: Campaign) -> dict[str, str]:
    """Return {processor: SAME, or the difference of a run from the same run here}, with this
    machine first. A campaign of this processor alone has no comparison."""
    study, here = campaign.study, library.processor()
    assert study is not None  # it has just run
    found = {here: SAME}
    for chunk in study.chunks():
        path = campaign.path(chunk)
        name = campaign.made_by(path)
        if name not in found:
            found[name] = _difference(campaign, chunk)
    return found


def _difference(campaign: Campaign, chunk: Chunk) -> str:
    """The largest difference between the first run of a chunk in its file and computed here, in
    standard deviations of the states as stored."""
    assert campaign.study is not None
    here = run_chunk(campaign.study, chunk._replace(stop=chunk.first + 1))
    stored = campaign.chunk(chunk, ("error", "std"))
    error, std = stored["error"][:, 0], stored["std"][:, 0]
    mine = here["error"][:, 0]
    if np.array_equal(mine, error, equal_nan=True):
        return SAME
    if (np.isnan(mine) != np.isnan(error)).any():
        return "a filter ends at another time"
    with np.errstate(all="ignore"):
        most = float(np.nanmax(np.abs(mine - error) / std))
    return f"up to {most:.1g} standard deviations"
