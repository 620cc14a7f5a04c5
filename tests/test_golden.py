"""Golden replays: what the filters make of recorded data, and of simulated data with a fault, stays
what it was, to a stated tolerance; a wanted change is a diff of the files.

What a recording is read into, aligned and simulated by goes through libraries that round as the
processor does, hence the tolerances: 2 cm, 1 cm/s, 0.02 deg and 2 % of a standard deviation; of
numbers in events 2 % too. The filters themselves are held to the bit (`golden/bits.py`): every
machine whose mathematical library is that of bits.json must agree with it, compiled or not.
"""

import json
import re

import numpy as np
import pandas as pd
import pytest
from golden import bits, faulted
from golden.replay import FOLDER, REPLAYS, replay
from recordings import SWIFT

from strapdown import filters

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
    same_table(replay(name, filter), pd.read_csv(FOLDER / f"{name}-{filter}.csv", index_col=0))


@pytest.mark.short
@pytest.mark.parametrize("name", [name for name in filters.names() if name in SWIFT])
def test_a_filter_is_what_it_was_to_the_bit(name):
    kept = bits.kept()
    if bits.libm() != kept["libm"]:
        pytest.skip("another mathematical library than that of bits.json")
    if name not in bits.BY_LAPACK:
        assert bits.digest(name) == kept[name]
        return
    found = bits.found(name)
    if found.get("lapack") != kept["lapack"]:
        pytest.skip("another library of matrices than that of bits.json")
    assert found[name] == kept[name]


NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"


@pytest.mark.parametrize("name", faulted.FAULTED)
def test_a_faulted_run_is_and_says_what_it_did(name):
    """Events with their times, and where the status changes."""
    now, said = faulted.replay(name)
    kept = json.loads(faulted.SAID.read_text(encoding="utf-8"))[name]
    same_table(now, pd.read_csv(FOLDER / f"faulted-{name}.csv", index_col=0))
    assert said["status"] == kept["status"]
    words, words_before = (
        [re.sub(NUMBER, "#", text) for _, text in x["events"]] for x in (said, kept)
    )
    assert words == words_before
    numbers, before = (
        [[t, *map(float, re.findall(NUMBER, text))] for t, text in x["events"]]
        for x in (said, kept)
    )
    for row, old in zip(numbers, before):
        assert row == pytest.approx(old, rel=0.02)


def same_table(now, kept):
    """Every column within its tolerance."""
    assert np.allclose(now.index, kept.index) and list(now.columns) == list(kept.columns)
    for column in now:
        off = np.nan_to_num((now[column] - kept[column]).to_numpy())
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
