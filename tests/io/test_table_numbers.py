"""Texts of nothing but numbers are read without pandas, to the bit and the type as it reads them."""

import numpy as np
import pytest

from strapdown.io.tables import table_text
from strapdown.io.tables.table_file import NumberColumns

STAMP = 1_700_000_000_123_456_789
"""ns; a float is too short for it."""
RANDOM = np.random.default_rng(3).standard_normal((500, 4)) * [1e-9, 1.0, 1e5, 1e300]


def both(path, monkeypatch, header):
    """The Table as it is read, and as pandas reads it."""
    found = table_text.read_table(path, header)
    with monkeypatch.context() as patch:
        patch.setattr(table_text, "numbers_of", lambda path, found: None)
        return found, table_text.read_table(path, header)


def same(found, expected):
    assert found.names == expected.names == list(expected.frame.columns)
    assert found.frame.dtypes.tolist() == expected.frame.dtypes.tolist()
    for name in expected.names:
        assert np.array_equal(found.cells(name), expected.cells(name)), name
        assert found.cells(name).dtype == expected.cells(name).dtype
        assert np.array_equal(found.numbers(name), expected.numbers(name))
    assert found.lines.tolist() == expected.lines.tolist()
    assert found.units == expected.units and found.notes == expected.notes


@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize(
    "text",
    [
        "t,x,y\n0.5,1,2.5\n1.5,-3,1e5\n",
        "t;x\n0.1;2\n0.2;3",  # no end of the last line
        "t\tx\r\n0.1\t2\r\n0.2\t3\r\n",
        "# a comment\ntitle\nt, x\n[s], [m]\n0.1, 2\n  0.2 ,+3\n",
        "\ufefft,x\n1,2\n3,4\n",
        f"t,x\n{STAMP},1.0\n{STAMP + 1},2\n{STAMP + 2},3\n",  # whole, and not all of it so written
        "t,x\n1,1\n2,2.5\n3,3\n",
        "t\n1\n2\n",
        "t,x\n" + "\n".join(",".join(f"{each:.17g}" for each in row) for row in RANDOM[:, :2]),
        "\n".join(",".join(map(repr, row)) for row in RANDOM.tolist()),
        "\n".join(",".join(f"{each:.12g}" for each in row) for row in RANDOM),
    ],
)
def test_numbers_are_those_of_pandas(tmp_path, monkeypatch, text, header):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    found, expected = both(tmp_path / "a.csv", monkeypatch, header)
    assert isinstance(found.content, NumberColumns) and not isinstance(
        expected.content, NumberColumns
    )
    same(found, expected)
    rows = np.arange(len(found.lines)) % 2 == 1
    same(found.take(rows), expected.take(rows))


@pytest.mark.parametrize(
    "text",
    [
        "t,x\n1,2\n3,\n",
        "t,x\n1,2\n3,nan\n4,5\n",
        "t,x\n1,2\nnan,nan\n4,5\n",
        "t,x\n1,2\n3,inf\n",
        "t,x\n1,2\n\n3,4\n",
        "t,x\n1,2\n3,4\n\n",
        "t,x\n1,2\n# later\n3,4\n",
        "t,x\n1,2,\n3,4,\n",
        "t,x\n1,2\nt,x\n3,4\n",
        't,x\n"1",2\n3,4\n',
        "t;x\n1,5;2\n3,5;4\n",
        "t x\n1 2\n3 4\n",
        "t,x\n1,12:00:00\n2,12:00:01\n",
        f"t,x\n1,{2**63}\n2,{2**64 - 1}\n",
        "t,x,y\n1,2\n3,4\n",
    ],
)
def test_anything_else_is_left_to_pandas(tmp_path, monkeypatch, text):
    (tmp_path / "a.csv").write_text(text, newline="")
    found, expected = both(tmp_path / "a.csv", monkeypatch, True)
    assert not isinstance(found.content, NumberColumns)
    assert found.frame.equals(expected.frame) and found.notes == expected.notes


def test_a_long_text_is_left_to_pandas(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("t,x\n1,2\n3,4\n")
    monkeypatch.setattr(table_text, "SHORT", 11)
    assert not isinstance(table_text.read_table(tmp_path / "a.csv").content, NumberColumns)
    monkeypatch.setattr(table_text, "SHORT", 12)
    assert isinstance(table_text.read_table(tmp_path / "a.csv").content, NumberColumns)
