"""Every kind of bad input: one line that names file, row or field and the remedy, or a recording
with a note of what was handled."""

import gzip
import lzma
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import zstandard

from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.solution import Source
from strapdown.io import read
from strapdown.io.inspection import inspect
from strapdown.preprocessing.fixes import checked_sources

pytestmark = pytest.mark.short


def set_cell(row, column, value):
    def change(frame):
        frame = frame.astype(object) if isinstance(value, str) else frame.copy()
        frame.loc[row, column] = value
        return frame

    return change


def refused(path):
    with pytest.raises(DataError) as error:
        read(path)
    text = str(error.value)
    assert "\n" not in text and len(text) < 800
    return text


REFUSED = {
    "missing column": (
        dict(imu=lambda f: f.rename(columns={"gx": "gyx"})),
        ["imu.csv", "column 'gx' is missing (did you mean 'gyx'?)"],
    ),
    "no rows": (dict(imu=lambda f: f[:0]), ["imu.csv", "no rows"]),
    "one sample": (dict(imu=lambda f: f[:1]), ["imu.csv", "1 usable IMU sample; at least 2"]),
    "text in a cell": (
        dict(imu=set_cell(7, "ay", "off")),
        ["imu.csv, line 9, column 'ay': 'off' is not a number"],
    ),
    "clock set back": (
        dict(imu=lambda f: f.assign(t=np.r_[f.t[:1000], f.t[:1000]])),
        ["imu.csv, line 1002", "time goes back from 20.000 to 10.010 s", "cut the file"],
    ),
    "clock set far ahead": (
        dict(imu=lambda f: f.assign(t=f.t + 1e9 * (f.index > 999))),
        ["imu.csv, line 1002", "time jumps"],
    ),
    "no overlap": (
        dict(gnss=lambda f: f.assign(t=f.t + 3600)),
        [
            "[[source]] 1 (position)",
            "IMU 10.000 to 30.000 s, here 3610.500 to 3629.500 s",
            "offset",
        ],
    ),
    "zero std": (
        dict(gnss=set_cell(3, "std", 0.0)),
        ["gnss.csv, line 5", "standard deviation 0", "above 0"],
    ),
    "negative std": (
        dict(gnss=set_cell(4, "std", -2.0)),
        ["gnss.csv, line 6", "standard deviation -2"],
    ),
    "latitude beyond 90": (
        dict(gnss=set_cell(2, "lat", 91.5)),
        ["gnss.csv, line 4", "latitude is 91.5 deg", "the limit is 90"],
    ),
    "latitude as integers": (
        dict(gnss=lambda f: f.assign(lat=f.lat * 1e7)),
        ["gnss.csv, line", "unit and scale"],
    ),
    "near the pole": (
        dict(gnss=lambda f: f.assign(lat=f.lat + 44.5)),
        ["gnss.csv, line 2", "latitude is 89.5 deg", "up to 89 deg"],
    ),
    "height in mm": (
        dict(gnss=lambda f: f.assign(alt=f.alt * 1e4)),
        ["gnss.csv, line", "is the unit mm or ft?"],
    ),
    "deg/s given as rad/s": (
        dict(toml=lambda s: 'vehicle = "car"\n' + s.replace("deg/s", "rad/s")),
        ["recording.toml: [imu] gyro.unit", "deg/s read as rad/s?"],
    ),
    "g given as m/s^2": (
        dict(imu=lambda f: f.assign(ax=f.ax / 9.81, ay=f.ay / 9.81, az=f.az / 9.81)),
        ["[imu] accel.unit", "magnitude 0.999 m/s^2", "is the unit g?"],
    ),
    "m/s^2 given as g": (
        dict(toml=lambda s: s.replace('"m/s^2"', '"g"')),
        ["[imu] accel.unit", "96", "is the unit m/s^2?"],
    ),
    "wrong gravity sign": (
        dict(imu=lambda f: f.assign(az=-f.az)),
        ["[imu] axes", "must read -9.8 on z", "check axes"],
    ),
    "time in ms given as s": (
        dict(imu=lambda f: f.assign(t=f.t * 1000)),
        ["imu.csv", "10 s apart", "unit of time"],
    ),
    "fixes without values": (
        dict(gnss=lambda f: f.assign(lat=np.nan, lon=np.nan, alt=np.nan)),
        ["gnss.csv", "no usable fix of kind position"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(build, case):
    changes, words = REFUSED[case]
    text = refused(build(**changes))
    for word in words:
        assert word in text, text


def line(old, new):
    return lambda text: text.replace(old, new, 1)


TOMLS = {
    "unknown key": (
        line('kind = "rate"', 'kimd = "rate"'),
        "[imu] unknown key 'kimd' (did you mean 'kind'?)",
    ),
    "unknown key of a signal": (
        line('unit = "m/s^2"', 'units = "m/s^2"'),
        "[imu] accel: unknown key 'units' (did you mean 'unit'?)",
    ),
    "unknown section": (
        line("[imu]", "[imus]"),
        "top level: unknown key 'imus' (did you mean 'imu'?)",
    ),
    "unknown key of a source": (
        line("std = 0.1", "sdd = 0.1"),
        "[[source]] 2 (velocity) unknown key 'sdd' (did you mean 'std'?)",
    ),
    "missing key": (line("gyro = ", "#"), "[imu] gyro: is missing"),
    "missing unit": (
        line(', unit = "deg/s"', ""),
        "[imu] gyro.unit: unit is missing; accepted for angular rate: rad/s, deg/s, deg/h",
    ),
    "unknown unit": (
        line("deg/s", "degrees/s"),
        "[imu] gyro.unit: unknown unit 'degrees/s' (did you mean 'deg/s'?)",
    ),
    "unit of another kind": (
        line('unit = "m/s"', 'unit = "m"'),
        "[[source]] 2 (velocity) unit: unit 'm' is one of length; accepted for speed: m/s",
    ),
    "unknown kind": (
        line('"velocity"', '"velocities"'),
        "[[source]] 2 (velocities) kind: no aiding is of kind 'velocities' (did you mean 'velocity'?);",
    ),
    "unknown kind of samples": (
        line('kind = "rate"', 'kind = "rates"'),
        "[imu] kind: input should be 'rate' or 'increment', not 'rates'",
    ),
    "left-handed axes": (
        line('"FRD"', '"+x +y -z"'),
        "[imu] axes: axes '+x +y -z' are left-handed",
    ),
    "std missing": (line("std = 0.1", ""), "[[source]] 2 (velocity) std: is missing"),
    "std zero": (
        line("std = 0.1", "std = 0"),
        "[[source]] 2 (velocity) std is 0; it must be a finite number above 0",
    ),
    "std of wrong length": (
        line("std = 0.1", "std = [0.1, 0.2]"),
        "std: 2 given, velocity has 3: speed, speed, speed",
    ),
    "too few columns": (
        line('["vn", "ve", "vd"]', '["vn", "ve"]'),
        "columns: 2 given, velocity has 3",
    ),
    "rate of a fix": (
        line("std = 0.1", "std = 0.1\nrate = 5.0"),
        "rate: velocity takes none; its fixes come at the times of the file",
    ),
    "number as text": (
        line("std = 0.1", 'std = 0.1\ngate = "9"'),
        "[[source]] 2 (velocity) gate: input should be a valid number, not '9'",
    ),
    "lever arm of two": (line('axes = "FRD"', "lever_arm = [0.0, 1.0]"), "[imu] lever_arm"),
    "no date": (line("2024-05-01", "yesterday"), "date: 'yesterday' is not a date"),
    "no TOML": (line("[imu]", "[imu"), "is not TOML"),
    "other variable": (line("imu.csv", "${HOME}/imu.csv"), "only ${STRAPDOWN_DATA} is replaced"),
    "no such table": (
        line("imu.csv", "imu2.csv"),
        "imu2.csv: cannot be read (No such file or directory); check the path",
    ),
    "a folder": (line('"imu.csv"', '"."'), "is a folder"),
    "column by a wrong number": (line('"gx", "gy", "gz"', '"gx", 0, "gz"'), "0 is not a column"),
    "constraint with a file": (
        line('kind = "velocity"', 'kind = "zero-velocity"'),
        "file: zero-velocity takes none; it is a constraint of the vehicle",
    ),
    "empty": (lambda text: "", "is empty"),
}


@pytest.mark.parametrize("case", TOMLS)
def test_refused_description(build, case):
    change, words = TOMLS[case]
    text = refused(build(toml=change))
    assert words in text and (
        "recording.toml" in text or ".csv" in text or "is a folder" in text
    ), text


def test_all_complaints_are_counted(build):
    assert refused(
        build(
            toml=lambda s: s.replace('unit = "deg/s"', 'unit = "dps"').replace(
                "std = 0.1", "std = -1"
            )
        )
    ).endswith("(and 1 more)")


def test_empty_and_unreadable_files(build, tmp_path):
    path = build()
    (tmp_path / "imu.csv").write_text("")
    assert "imu.csv: is empty" in refused(path)
    (tmp_path / "imu.csv").write_bytes(b"\x89HDF\r\n\x1a\n\x00\x01" * 50)
    assert "imu.csv" in refused(path)
    assert "No such file" in refused(tmp_path / "nowhere.toml")
    assert "nowhere.nc: cannot be read (no such file)" in refused(tmp_path / "nowhere.nc")


@pytest.mark.parametrize(
    "suffix, pack", [("xz", lzma.compress), ("gz", gzip.compress), ("zst", zstandard.compress)]
)
def test_truncated_compressed_file(build, tmp_path, suffix, pack):
    path = build(toml=line("imu.csv", f"imu.csv.{suffix}"))
    whole = pack((tmp_path / "imu.csv").read_bytes())
    packed = tmp_path / f"imu.csv.{suffix}"
    packed.write_bytes(whole)
    assert len(read(path).imu.t) == 2000
    packed.write_bytes(whole[: len(whole) // 2])
    assert f"imu.csv.{suffix}: the compressed file is truncated or damaged" in refused(path)
    packed.write_bytes(b"not packed at all, just text\n")
    assert f"imu.csv.{suffix}" in refused(path)


def test_rows_with_too_many_cells(build, tmp_path):
    path = build()
    table = tmp_path / "imu.csv"
    table.write_text(table.read_text().replace("\n", ",9,9\n", 5).replace(",9,9\n", "\n", 1))
    assert "imu.csv: is not a table of comma-separated values" in refused(path)


def test_a_last_row_cut_short_is_dropped_and_noted(build, tmp_path):
    path = build()
    table = tmp_path / "imu.csv"
    table.write_text(table.read_text()[:-30])
    recording = read(path)
    assert len(recording.imu.t) == 1999
    assert recording.meta["notes"] == [
        f"{table}: 1 sample with NaN or infinite values dropped, the first in line 2001"
    ]


HANDLED = {
    "NaN": (
        dict(imu=set_cell(5, "gy", np.nan)),
        [
            "imu.csv: 1 sample with NaN or infinite values dropped, the first in line 7",
            "imu.csv: 1 gap",
        ],
    ),
    "infinite": (dict(imu=set_cell(5, "az", np.inf)), ["imu.csv: 1 sample with NaN or infinite"]),
    "repeated rows": (
        dict(imu=lambda f: f.loc[f.index.repeat(np.where(f.index == 8, 2, 1))]),
        ["imu.csv: 1 repeated time dropped, the first in line 11"],
    ),
    "swapped rows": (
        dict(imu=lambda f: f.loc[np.r_[0:50, 51, 50, 52:2000]]),
        ["imu.csv: 1 late row sorted by time, the first in line 53"],
    ),
    "stray time": (
        dict(imu=set_cell(100, "t", 1e7)),
        ["imu.csv: 1 row with a stray time dropped, the first in line 102"],
    ),
    "gap of 0.5 s": (
        dict(imu=lambda f: f.drop(range(500, 550))),
        ["imu.csv: 1 gap in time, the longest 0.500 s before line 502"],
    ),
    "gap of 5 s": (
        dict(imu=lambda f: f.drop(range(500, 1000))),
        ["imu.csv: 1 gap in time, the longest 5.000 s before line 502"],
    ),
    "fix without a value": (
        dict(
            gnss=lambda f: f.assign(
                lat=f.lat.where(f.index != 3),
                lon=f.lon.where(f.index != 3),
                alt=f.alt.where(f.index != 3),
            )
        ),
        ["gnss.csv: 1 row without time, value or standard deviation dropped, the first in line 5"],
    ),
    "fixes out of order": (
        dict(gnss=lambda f: f.loc[np.r_[0:5, 6, 5, 7:20]]),
        ["gnss.csv: 1 late row sorted by time, the first in line 8"] * 2,
    ),
    "repeated fix": (
        dict(gnss=lambda f: f.loc[f.index.repeat(np.where(f.index == 2, 2, 1))]),
        ["gnss.csv: 1 repeated row dropped, the first in line 5"] * 2,
    ),
}


@pytest.mark.parametrize("case", HANDLED)
def test_handled_and_noted(build, case):
    changes, expected = HANDLED[case]
    notes = read(build(**changes)).meta["notes"]
    assert len(notes) >= len(expected)
    for note, words in zip(notes, expected):
        assert words in note, notes


def test_sorted_fixes_keep_their_values(build):
    expected, sorted_ = (
        read(build(gnss=change)).sources[0]
        for change in (None, lambda f: f.loc[np.r_[0:5, 6, 5, 7:20]])
    )
    np.testing.assert_array_equal(expected.t, sorted_.t)
    np.testing.assert_array_equal(expected.y, sorted_.y)


def test_aidings_from_arrays_are_checked_alike():
    imu = Imu(*np.zeros((2, 50)), np.zeros((50, 3)), np.zeros((50, 3)))._replace(
        t=np.arange(1.0, 51), dt=np.ones(50)
    )
    fix = Source(
        "position",
        np.array([3.0, 2.0, 4.0, np.nan]),
        np.tile([0.8, 0.1, 100.0], (4, 1)),
        np.ones(3),
    )
    (source,), notes = checked_sources(imu, [fix])
    assert source.t.tolist() == [2, 3, 4] and source.std.shape == (3, 3) and len(notes) == 2
    for change, words in (
        (dict(std=np.zeros(3)), "position, row 1: standard deviation 0"),
        (dict(t=fix.t + 900), "nothing falls within the IMU record"),
        (dict(y=fix.y[:, :2]), r"needs y and std of shape \(4, 3\)"),
        (dict(y=np.degrees(fix.y)), "latitude is 2626.* deg"),
    ):
        with pytest.raises(DataError, match=words):
            checked_sources(imu, [replace(fix, **change)])


def test_a_missing_component_stays_missing(build):
    position = read(build(gnss=set_cell(3, "alt", np.nan))).sources[0]
    assert len(position.t) == 20 and np.isnan(position.y[3]).tolist() == [False, False, True]


def test_the_antimeridian_is_read_as_it_is(build):
    position = read(
        build(gnss=lambda f: f.assign(lon=np.where(f.index < 10, 179.9999, -179.9999)))
    ).sources[0]
    np.testing.assert_allclose(np.degrees(position.y[[0, -1], 1]), [179.9999, -179.9999])


@pytest.mark.parametrize(
    "name, words",
    [
        ("flight.csv", "cannot be read"),
        ("flight.csv.gz", "cannot be read"),
        ("flight.xyz", "supported are .bag, "),
        ("flight.ulg", "cannot be read"),
        ("flight", "cannot be read"),
    ],
)
def test_other_files(tmp_path, name, words):
    assert words in refused(tmp_path / name)


def test_an_archive_without_a_file_is_refused(tmp_path):
    path = tmp_path / "imu.csv.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.mkdir("empty")
    with pytest.raises(DataError, match="imu.csv.zip: .*it holds no file"):
        inspect(path)
    zipfile.ZipFile(path, "w").close()
    with pytest.raises(DataError, match="imu.csv.zip: .*it holds no file"):
        inspect(path)


@pytest.mark.parametrize("name", ["a" * 5000, "a\0b.csv"])
def test_what_can_be_no_path_is_refused(name):
    with pytest.raises(DataError, match="is not a path"):
        read(name)
