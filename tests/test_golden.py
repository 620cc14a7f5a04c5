"""Golden replays: what the filters make of recorded data stays what it was, to a stated tolerance;
a wanted change is a diff of the CSVs.

Rounding differs between processors (fused multiply-add), hence the tolerances: 2 cm, 1 cm/s, 0.02
deg and 2 % of a standard deviation.
"""

import numpy as np
import pandas as pd
import pytest
from golden.replay import FOLDER, REPLAYS, replay

TOLERANCES = {
    "lat": 2e-7,
    "lon": 2e-7,
    "alt": 0.02,
    "V": 0.01,
    "roll": 0.02,
    "pitch": 0.02,
    "heading": 0.02,
    "accel": 0.002,
    "gyro": 20.0,
}
"""deg (2e-7 deg of latitude are 2 cm), m, m/s, deg, m/s^2, deg/h; by how a column's name begins."""


@pytest.mark.parametrize("name, filter", REPLAYS)
def test_a_replay_is_what_it_was(data_folder, name, filter):
    kept = pd.read_csv(FOLDER / f"{name}-{filter}.csv", index_col=0)
    now = replay(name, filter)
    assert np.allclose(now.index, kept.index) and list(now.columns) == list(kept.columns)
    for column in now:
        off = (now[column] - kept[column]).to_numpy()
        if column == "heading":
            off = (off + 180) % 360 - 180
        bound = next(
            (bound for begin, bound in TOLERANCES.items() if column.startswith(begin)), None
        )
        worst = int(np.argmax(abs(off)))
        allowed = bound if bound is not None else 0.02 * kept[column].to_numpy()
        assert (abs(off) <= allowed).all(), (
            f"{column} differs by {off[worst]:.3g} at {now.index[worst]:.1f} s"
        )
