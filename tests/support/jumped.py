"""What must come of a log whose clock jumps on the way."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.io.inspection import inspect

HOUR = 3_600_000_000


def jumping(t, jump):
    """Times in us from two hours on, which jump by so many us after 10 s."""
    return t + 2 * HOUR + jump * (t > 10_000_000)


def in_order(monkeypatch, module):
    """Let `module` write records in the order they were made, whatever their clock says."""
    real = module.interleaved
    monkeypatch.setattr(
        module, "interleaved", lambda blocks, times: real(blocks, [t % HOUR for t in times])
    )


def check_jump(path, flown, jump):
    """Forward by `jump` us: all samples are there, and the gap is said; back: one line."""
    if jump < 0:
        with pytest.raises(sd.DataError, match="time goes back") as error:
            sd.read(path)
        assert len(str(error.value).splitlines()) == 1 and path.name in str(error.value)
        return
    recording = sd.read(path)
    assert abs(len(recording.imu.t) - len(flown.imu.t)) < 3
    step = np.diff(recording.imu.t)
    assert np.count_nonzero(step > 1) == 1 and abs(step.max() - jump / 1e6) < 1
    assert any("gap" in line for line in inspect(path).lines), inspect(path).lines
