"""Tables of text as loggers write them: one table, written in many ways, is read the same."""

import time

import numpy as np
import pandas as pd
import pytest

from strapdown.checks import DataError
from strapdown.io import read
from strapdown.io.tables.table_layout import distinct
from strapdown.io.tables.table_text import read_table

pytestmark = pytest.mark.short
T = 1714567890123456789 + 5_000_000 * np.arange(40)
VALUES = np.random.default_rng(4).normal(0, 1, (40, 2)).round(4)
NAMES = ["time", "gx", "gy"]


def text(separator=",", decimal=".", names=NAMES, quote="", end="\n", trail=""):
    cells = [names] + [
        [str(t), *(f"{x:.4f}".replace(".", decimal) for x in row)] for t, row in zip(T, VALUES)
    ]
    return "".join(
        separator.join(f"{quote}{cell}{quote}" for cell in row) + trail + end for row in cells
    )


def after(line, more):
    """The table with more lines after one of its own."""
    lines = text().splitlines(keepends=True)
    return "".join([*lines[:line], more, *lines[line:]])


WAYS = {
    "comma": text(),
    "semicolon": text(";"),
    "tab": text("\t"),
    "bar": text("|"),
    "blanks": text("   "),
    "comma and blank": text(", "),
    "decimal comma": text(";", ","),
    "decimal comma and tab": text("\t", ","),
    "quoted decimal comma": text(",", ",", quote='"'),
    "quoted": text(quote='"'),
    "CRLF": text(end="\r\n"),
    "trailing separators": text(trail=","),
    "trailing semicolons": text(";", ",", trail=";"),
    "title": "Logger 7 of 2024-05-01\n\nrate 200 Hz\n" + text(),
    "title with comments": "# a\n% b\n// c, d, e, f, g\n" + text(),
    "line of units": after(1, "ns,deg/s,deg/s\n"),
    "line of units in brackets": after(1, "[ns],[deg/s],[rad/s]\n"),
    "rule below the header": after(1, "-----------\n"),
    "header as a comment": "# " + text(" "),
    "markers": after(9, "--- event ---\n").replace("--- event", "# 5,6,7,8,9,10\n--- event"),
    "many cells in a marker": after(9, "start, of, a, new, lap, now\n// 1,2,3\n"),
    "restarted logger": after(20, "time,gx,gy\n"),
    "blank lines": after(9, "\n\n"),
    "byte order mark": "\ufeff" + text(),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_table_is_read_the_same_in_every_way_of_writing(tmp_path, way, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes(WAYS[way].removeprefix("\ufeff" * (encoding != "utf-8")).encode(encoding))
    table = read_table(path)
    assert [str(name) for name in table.frame.columns] == NAMES
    assert table.cells("time").dtype == np.int64 and (table.cells("time") == T).all()
    for name, values in zip(NAMES[1:], VALUES.T):
        np.testing.assert_allclose(table.numbers(name), values, atol=1e-12)
    lines = WAYS[way].replace("\r", "").split("\n")
    for row in (0, 9, 39):  # the line that a complaint names is that of the row
        assert str(T[row]) in lines[table.lines[row] - 1]


def test_what_is_left_out_is_counted(tmp_path, build):
    path = build()
    rows = (tmp_path / "imu.csv").read_text().splitlines(keepends=True)
    rows[700:700] = ["--- event 5 ---\n"]
    rows[100:100] = ["# lap 1, of 9, with, many, more, cells, than, the, header\n", rows[0]]
    (tmp_path / "imu.csv").write_text("".join(rows))
    recording = read(path)
    assert len(recording.imu.t) == 2000
    assert recording.meta["notes"] == [
        f"{tmp_path / 'imu.csv'}: 3 lines without data left out, the first is line 101"
    ]


@pytest.mark.parametrize(
    "line, words",
    [
        ("5,off,1\n", "line 11, column 'gx': 'off' is not a number"),
        ("x5,1,2\n", "line 11, column 'time': 'x5' is not a number"),
        ("5,1,2,3\n", "is not a table of comma-separated values"),
    ],
)
def test_a_row_with_a_wrong_cell_is_refused(tmp_path, line, words):
    path = tmp_path / "log.csv"
    path.write_text(after(10, line))
    with pytest.raises(DataError, match=words):
        table = read_table(path)
        [table.numbers(name) for name in NAMES]


@pytest.mark.parametrize(
    "names, first",
    [
        (["Time (s)", "Acc X (m/s^2)", "acc_y[g]"], "Time (s)"),
        (["Time (s)", "Latitude (°)", "x"], "Time (s)"),
        (["t", "t", ""], "t"),
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
def test_units_in_the_header(tmp_path, names, first, separator):
    if separator == "  " and "" in names:
        return
    path = tmp_path / "log.csv"
    path.write_text(text(separator, names=names), encoding="cp1252")
    columns = list(read_table(path).frame.columns)
    expected = {"t": ["t", "t.1", "Unnamed: 2"]}.get(first, names)
    assert columns == expected


def test_a_line_of_units_is_kept(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(after(1, "ns,[deg/s],(g)\n"))
    assert read_table(path).units == {"time": "ns", "gx": "deg/s", "gy": "g"}


def test_columns_by_number_with_and_without_a_header(tmp_path):
    path = tmp_path / "log.csv"
    for content in (text(), text().partition("\n")[2]):
        path.write_text(content)
        table = read_table(path, header=False)
        assert list(table.frame.columns) == [1, 2, 3] and (table.cells(1) == T).all()


def test_other_encodings_and_binary_files(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t,a\xb0\n1,2\n3,4\n")
    assert list(read_table(path).frame.columns) == ["t", "a°"]
    path.write_bytes(bytes(range(256)) * 20)
    with pytest.raises(DataError, match="is not a text table"):
        read_table(path)


def test_a_text_column_and_missing_cells_stay(tmp_path):
    path = tmp_path / "log.csv"
    frame = pd.DataFrame({"t": [1, 2, 3], "fix": ["RTK", None, "3D"], "h": [1.5, np.nan, 2.5]})
    frame.to_csv(path, index=False)
    table = read_table(path)
    assert table.frame["fix"].tolist()[::2] == ["RTK", "3D"]
    np.testing.assert_array_equal(table.numbers("h"), [1.5, np.nan, 2.5])


@pytest.mark.short
def test_names_that_are_many_times_alike_get_numbers_soon():
    begin = time.process_time()
    found = distinct(["a", "a.1", *["a"] * 50_000])
    assert found[:4] == ["a", "a.1", "a.2", "a.3"] and len(set(found)) == len(found)
    assert time.process_time() - begin < 2


def test_no_row_is_lost_behind_a_line_that_is_left_out(tmp_path):
    """With ends of old Macs pandas skips a line too many after an empty one."""
    (tmp_path / "a.csv").write_text("t,x\r1,2\r\r# a,b\r7,8\r9,10\r", newline="")
    table = read_table(tmp_path / "a.csv")
    assert table.frame.to_numpy().tolist() == [[1, 2], [7, 8], [9, 10]]
    assert table.lines.tolist() == [2, 5, 6]
