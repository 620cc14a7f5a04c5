"""What a file may be."""

import os

import pytest

import strapdown as sd
from strapdown.fileio.limits import FREE, ReadingLimits, check_size, in_force, regular

pytestmark = pytest.mark.short


def test_limits_hold_in_their_block_alone_and_inner_ones_add_to_outer_ones():
    with sd.reading_limits(size=10.0) as outer:
        assert outer == in_force() == ReadingLimits(size=10.0)
        with sd.reading_limits(pipes=True):
            assert in_force() == ReadingLimits(size=10.0, pipes=True)
        assert in_force() == outer
    assert in_force() == ReadingLimits()


@pytest.mark.parametrize("wrong", [{"sise": 1}, {"size": -1}, {"pipes": 2}, {"depth": "x"}])
def test_impossible_limits_are_refused(wrong):
    with pytest.raises(sd.DataError, match=next(iter(wrong))), sd.reading_limits(**wrong):
        pass


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX only: named pipes")
def test_pipes_and_devices_are_not_read(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, said in ((pipe, "a pipe.*--pipes"), ("/dev/zero", "a device.*copy it to a file$")):
        with pytest.raises(sd.DataError, match=f"no regular file but {said}"):
            regular(path)


def test_a_file_beyond_the_size_is_refused(tmp_path):
    path = tmp_path / "imu.csv"
    path.write_bytes(b"0123456789")
    with sd.reading_limits(size=10):
        assert regular(path) == path
    with sd.reading_limits(size=9), pytest.raises(sd.DataError, match="imu.csv.*--max-size"):
        regular(path)


def test_content_out_of_proportion_to_its_file_is_refused():
    check_size(FREE + 200e3, "a.gz", packed=1e3)
    with pytest.raises(sd.DataError, match="a.gz: unpacks to"):
        check_size(FREE + 201e3, "a.gz", packed=1e3)
