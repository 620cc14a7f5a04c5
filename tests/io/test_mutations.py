"""Files of every format, damaged at random: each ends in a recording or in one line, soon and in
little memory."""

import re

import looks
import mutations
import numpy as np
import pytest
import written_nmea
import written_ubx
from all_cases import CASES
from mutations import Case, Job

from strapdown.io import registry

MANY, DEEP = 300, 2000


@pytest.mark.parametrize("name", CASES)
def test_damaged_files_end_in_a_recording_or_in_one_line(name, tmp_path):
    check(name, tmp_path, range(MANY))


@pytest.mark.deep
@pytest.mark.parametrize("name", CASES)
def test_many_damaged_files_end_in_a_recording_or_in_one_line(name, tmp_path):
    check(name, tmp_path, range(MANY, MANY + DEEP))


def check(name, tmp_path, seeds):
    case = CASES[name](tmp_path)
    found = mutations.run(Job(case, seeds, tmp_path))
    assert not found, f"{len(found)} of {len(seeds)}:\n" + "\n".join(map(str, found[:20]))


@pytest.mark.parametrize(
    "body, words",
    [
        ("while True: pass", "takes more than 0.3 s of the processor"),
        ("return bytearray(4 * 10**9)", "needs more memory"),
        ("import os; os.abort()", "the process ends with"),
        ("raise KeyError('a')", "fails in `open` .KeyError"),
    ],
)
def test_what_may_not_be_is_found(tmp_path, monkeypatch, body, words):
    """A reader that hangs, takes memory, ends the process or raises."""
    plugin = tmp_path / "plugin.py"
    plugin.write_text(PLUGIN.format(body=body))
    monkeypatch.setenv("STRAPDOWN_PLUGINS", str(plugin))
    case = Case("mine", {"a.mine": b"good"}, ("a.mine",), ("a.mine",), refused=True)
    found = mutations.run(Job(case, range(3), tmp_path, cpu=0.3))
    assert [each.seed for each in found] == [0, 1, 2]
    assert all(re.search(words, each.said) for each in found), found
    assert all((each.kept / "a.mine").is_file() for each in found)


def test_a_log_named_as_another_format_has_no_seal(tmp_path):
    made = CASES["mcap"](tmp_path)
    path = tmp_path / "a.nc"
    path.write_bytes(made.files[made.bent[0]])
    assert looks.recording([path], False) == ""


PLUGIN = """
import numpy as np
import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.reader import Log, Reader


def bad(path):
    if path.read_bytes() == b"good":
        return Log({{}}, ())
    {body}


sd.register(Reader("mine", (".mine",), "log of mine", open=bad))
"""


def ubx_frames():
    """Frames of position and velocity, each with a height of its own."""
    moments = 1_398_556_818_000 + 200 * np.arange(40)
    return written_ubx.pvt(moments, height=1000 * (1 + np.arange(40)))


def sentences():
    """GGA of 40 epochs, each with a height of its own, as lines."""
    start = np.datetime64("2024-05-01T10:00:00", "ms")
    lines = []
    for k in range(40):
        moment = start + np.timedelta64(200 * k, "ms")
        lines.append(written_nmea.rmc(moment, 45.0, 7.0, 1.0, 90.0).encode())
        lines.append(written_nmea.gga(moment, 45.0, 7.0, 100.0 + k).encode())
    return lines


def tables(path, content):
    path.write_bytes(content)
    return registry.find(path).open(path).tables


@pytest.mark.parametrize("seed", range(20))
def test_frames_of_ubx_that_fail_their_checksum_are_never_used(tmp_path, seed):
    """Bytes of some frames are changed, also in their lengths: what is read is what the other
    frames alone give."""
    rng, frames = np.random.default_rng(seed), ubx_frames()
    broken = rng.choice(len(frames), 12, replace=False)
    bent = frames.copy()
    for k in broken:
        bent[k, rng.integers(frames.shape[1])] ^= rng.integers(1, 256)
    whole = np.delete(frames, broken, axis=0)
    same_tables(
        tables(tmp_path / "a.ubx", bent.tobytes()), tables(tmp_path / "b.ubx", whole.tobytes())
    )


@pytest.mark.parametrize("seed", range(20))
def test_sentences_that_fail_their_checksum_are_never_used(tmp_path, seed):
    """A character of some GGA is changed: what is read is what the others give."""
    rng, lines = np.random.default_rng(seed), sentences()
    broken = 1 + 2 * rng.choice(len(lines) // 2, 12, replace=False)
    bent = [bytearray(line) for line in lines]
    for k in broken:
        at = rng.integers(1, len(lines[k]) - 2)
        new = rng.choice([each for each in b"0123456789,.NEWSGA" if each != lines[k][at]])
        bent[k][at] = new
    whole = [line for k, line in enumerate(lines) if k not in broken]
    same_tables(
        tables(tmp_path / "a.nmea", b"".join(bent)), tables(tmp_path / "b.nmea", b"".join(whole))
    )


def same_tables(found, expected):
    assert found.keys() == expected.keys() and expected
    for name, table in expected.items():
        for column in table.frame.columns:
            values = found[name].frame[column].to_numpy()
            assert np.array_equal(values, table.frame[column].to_numpy(), equal_nan=True), column
