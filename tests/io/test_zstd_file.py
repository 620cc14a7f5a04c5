"""Files packed by zstd: equality with what was packed, and refusal of what is not whole."""

import numpy as np
import pytest
import zstandard

from strapdown.checks import DataError
from strapdown.io.registry import find
from strapdown.io.tables.table_arrays import tables_of
from strapdown.io.tables.table_file import read_bytes

pytestmark = pytest.mark.short
CONTENT = np.random.default_rng(0).integers(0, 9, 300_000).astype(np.uint8).tobytes()


@pytest.mark.parametrize("most", [-1, 0, 7, 250_000])
@pytest.mark.parametrize("pieces", [1, 3, 3000])
def test_frames_are_read_to_the_last_byte(tmp_path, pieces, most):
    """One frame, or many of which each call brings several."""
    size = len(CONTENT) // pieces
    parts = [CONTENT[k * size : (k + 1) * size] for k in range(pieces)]
    path = tmp_path / "a.bin.zst"
    path.write_bytes(b"".join(map(zstandard.compress, parts)))
    assert read_bytes(path, most) == CONTENT[: None if most < 0 else most]


@pytest.mark.parametrize("damage", [lambda c: c[:-1], lambda c: c[:3], lambda c: c + b"abcdefgh"])
def test_what_is_not_whole_is_refused(tmp_path, damage):
    path = tmp_path / "a.bin.zst"
    path.write_bytes(damage(zstandard.compress(CONTENT)))
    with pytest.raises(DataError, match="a.bin.zst: the compressed file is truncated or damaged"):
        read_bytes(path)


@pytest.mark.parametrize("ending", [".zst", ".zstd"])
def test_packed_files_find_their_readers(tmp_path, ending):
    names = {".ulg": "ulog", ".bag": "rosbag1", ".mcap": "mcap", ".csv": "table"}
    for suffix, name in names.items():
        path = tmp_path / f"a{suffix}{ending}"
        path.write_bytes(zstandard.compress(b"a,b\n1,2\n3,4\n"))
        assert find(path).name == name
    (table,) = tables_of(path).values()
    assert table.numbers("b").tolist() == [2, 4]
