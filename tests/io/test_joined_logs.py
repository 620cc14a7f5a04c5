"""Files of devices that make one recording together: which of their sections are taken, what is
said of it, and the description that says the same."""

from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown import plugins
from strapdown.checks import DataError
from strapdown.io import registry
from strapdown.io.inspection import draft, inspect
from strapdown.io.reader import Log, Reader, Section
from strapdown.io.tables.table_file import FileTable

pytestmark = pytest.mark.short
START = 1_714_521_600_000_000_000  # 2024-05-01, POSIX ns
WHEN = {"column": "stamp", "unit": "ns", "clock": "unix"}
GYRO = {"columns": ["gx", "gy", "gz"], "unit": "rad/s"}
ACCEL = {"columns": ["ax", "ay", "az"], "unit": "m/s^2"}


def imu_table(name, offset=0, rate=100.0, n=2000):
    """Slow turns at rest; `offset` in ns."""
    rng = np.random.default_rng(n + offset)
    t = START + offset + (np.arange(n) * 1e9 / rate).astype(np.int64)
    seconds = (t - START) * 1e-9
    noise = rng.normal(0.0, 1e-3, (n, 6))
    columns = {"stamp": t, "gx": 0.02 * np.sin(seconds) + noise[:, 0], "gy": noise[:, 1]}
    columns |= {"gz": noise[:, 2], "ax": noise[:, 3], "ay": noise[:, 4]}
    return FileTable.of(name, columns | {"az": -9.81 + noise[:, 5] + 0.01 * np.sin(seconds)})


def imu_section(number, title=""):
    keys = {"table": f"imu {number}", "time": WHEN, "gyro": GYRO, "accel": ACCEL}
    grade = {"grade": "of its kind"}
    return Section("imu", "imu", keys | {"grade": "consumer"}, number, title, grade)


def position_section(instance=0, left=""):
    n = {"column": "tow", "unit": "s", "clock": "gps", "week": 2312}
    keys = {"kind": "position", "table": "gnss", "time": n, "columns": ["lat", "lon", "h"]}
    keys |= {"unit": ["deg", "deg", "m"], "std": [1.0, 1.0, 2.0]}
    return Section("source", "gnss", keys, instance, left=left)


def gnss_table(name):
    t = 259218.0 + np.arange(20)
    return FileTable.of(
        name, {"tow": t, "lat": 47 + 1e-9 * t, "lon": 8 + 1e-9 * t, "h": 500 + 0 * t}
    )


def two_imus(path):
    tables = {"imu 0": imu_table("imu 0"), "imu 1": imu_table("imu 1", rate=50.0)}
    tables["gnss"] = gnss_table("gnss")
    sections = imu_section(0, "100 Hz"), imu_section(1, "50 Hz"), position_section()
    return Log(tables, sections, facts=("a log of two IMUs",), left=("3 lines without checksum",))


def receiver(path):
    sections = position_section(), position_section(1, "made of the same IMU")
    return Log({"gnss": gnss_table("gnss")}, sections)


def pieces(path):
    """An IMU whose gyro and accelerometer are tables of their own."""
    tables = {"gyro": imu_table("gyro"), "accel": imu_table("accel", 3_000_000)}
    gyro, accel = (
        Section("imu", "imu", {"table": name, "time": WHEN, name: signal})
        for name, signal in (("gyro", GYRO), ("accel", ACCEL))
    )
    return Log(tables, (accel, gyro))


@pytest.fixture(autouse=True)
def logs(monkeypatch, tmp_path):
    """A file of each kind, and readers of them."""
    monkeypatch.setattr(plugins, "_plugins", {})
    monkeypatch.chdir(tmp_path)
    for name, function in (("two", two_imus), ("gnss", receiver), ("parts", pieces)):
        registry.REGISTRY.add(Reader(name, (f".{name}",), f"log {name}", open=function), __name__)
        Path(f"a.{name}").write_text(name)


def test_the_first_instance_is_taken_and_the_rest_is_said():
    recording = sd.read("a.two")
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z" and recording.imu.t[0] == 0.0
    assert recording.meta["name"] == "a" and len(recording.imu.t) == 2000
    assert recording.meta["read"] == [
        "taken: imu 0 of a.two: 100 Hz",
        "taken: gnss 0 of a.two",
        'assumed: imu grade = "consumer": of its kind',
        "left: imu 1 of a.two: one IMU is taken; --imu 1 takes it",
        "left: a.two: 3 lines without checksum",
    ]
    np.testing.assert_allclose(recording.sources[0].t, np.arange(20.0))


def test_another_instance_where_it_is_asked_for():
    recording = sd.read("a.two", imu=1, gnss=None)
    assert np.median(recording.imu.dt) == pytest.approx(0.02) and recording.sources == ()
    assert "left: gnss 0 of a.two: not wanted" in recording.meta["read"]
    assert sd.read("a.two", "a.gnss", gnss=1).sources[0].kind == "position"


@pytest.mark.parametrize(
    "files, take, words",
    [
        (["a.two"], {"imu": 2}, "there is no IMU 2; of them there is 0, 1"),
        (["a.two"], {"barometer": 0}, "there is no barometer 0; none was found"),
        (["a.two"], {"gps": 0}, "instance of is 'gps'.*must be one of imu, gnss"),
        (["a.gnss"], {}, "a.gnss: no IMU in it; name its file too"),
        (["a.two", "a.two"], {}, "a.two: is named twice"),
    ],
)
def test_what_is_refused(files, take, words):
    with pytest.raises(DataError, match=words) as error:
        sd.read(*files, **take)
    assert "\n" not in str(error.value)


def test_of_several_files_the_last_counts():
    told = sd.read("a.two", "a.gnss").meta["read"]
    assert "taken: gnss 0 of a.gnss" in told and "taken: imu 0 of a.two: 100 Hz" in told
    assert any(line.startswith("left: gnss 0 of a.two: one GNSS receiver") for line in told)
    assert "left: gnss 1 of a.gnss: made of the same IMU; --take gnss=1 takes it" in told


OWN = {"column": "s", "unit": "s"}


def add_own_clock(name, epoch, first=100.0):
    """A reader of logs on a clock of their own, whose zero is `epoch`."""
    keys = {"kind": "position", "table": "gnss", "time": OWN, "columns": ["lat", "lon", "h"]}
    keys |= {"unit": ["deg", "deg", "m"], "std": [1.0, 1.0, 2.0]}

    def open_it(path):
        table = gnss_table("gnss")
        columns = {each: table.cells(each) for each in ("lat", "lon", "h")}
        table = FileTable.of("gnss", {"s": first + np.arange(20.0), **columns})
        head = {} if epoch is None else {"epoch": epoch}
        return Log({"gnss": table}, (Section("source", "gnss", keys),), head=head)

    registry.REGISTRY.add(Reader(name, (f".{name}",), f"log {name}", open=open_it), __name__)
    Path(f"a.{name}").write_text(name)


def add_own_imu(name, epoch):
    """The same of an IMU, whose first sample is at 0 s."""

    def open_it(path):
        table, section = imu_table("imu 0"), imu_section(0)
        seconds = (table.cells("stamp") - START) * 1e-9
        columns = {each: table.cells(each) for each in table.frame.columns} | {"s": seconds}
        keys = {**section.keys, "time": OWN}
        head = {} if epoch is None else {"epoch": epoch}
        found = section._replace(keys=keys, assumed={})
        return Log({"imu 0": FileTable.of("imu 0", columns)}, (found,), head=head)

    registry.REGISTRY.add(Reader(name, (f".{name}",), f"log {name}", open=open_it), __name__)
    Path(f"a.{name}").write_text(name)


def test_a_magnetometer_without_a_place_may_be_left_out():
    keys = {"kind": "magnetic-field", "table": "mag", "time": OWN, "columns": ["mx", "my", "mz"]}
    keys |= {"unit": "uT", "std": 1.0}

    def open_it(path):
        t = np.arange(20.0)
        table = FileTable.of("mag", {"s": t, "mx": 20 + 0 * t, "my": 0 * t, "mz": 45 + 0 * t})
        sections = (Section("source", "magnetometer", keys),)
        return Log({"mag": table}, sections, head={"epoch": "2024-05-01T12:00:00Z"})

    add_own_imu("boot", "2024-05-01T12:00:00Z")
    registry.REGISTRY.add(Reader("mag", (".mag",), "log mag", open=open_it), __name__)
    Path("a.mag").write_text("mag")
    asked = (
        "at the top, or give field in the draft of `strapdown inspect ... --write recording.toml`; "
    )
    asked += "`--take magnetometer=none` leaves it out"
    with pytest.raises(DataError) as error:
        sd.read("a.boot", "a.mag")
    assert str(error.value).endswith(asked)
    assert inspect("a.boot", "a.mag").problems[0].endswith(asked)
    assert sd.read("a.boot", "a.mag", magnetometer=None).sources == ()
    Path("recording.toml").write_text(draft([Path("a.boot"), Path("a.mag")], {}, Path(".")))
    with pytest.raises(DataError, match="at the top, or give field$"):
        sd.read("recording.toml")


def test_files_of_different_days_are_told_with_both_dates():
    add_own_imu("boot", "2024-05-01T12:00:00Z")
    for zero, words in (
        (
            "2024-07-13T12:00:00Z",
            "from different days, the IMU 2024-05-01 12:00:00.0 to 12:00:20.0 UTC, here 2024-07-13 "
            "12:01:40.0 to 12:01:59.0 UTC: give files of one recording",
        ),
        ("2024-05-01T13:00:00Z", r"here 3700.000 to 3719.000 s; add `offset`"),
    ):
        add_own_clock(f"d{zero[5:7]}", zero)
        with pytest.raises(DataError, match=words) as error:
            sd.read("a.boot", f"a.d{zero[5:7]}")
        assert ("days" in str(error.value)) == ("2024-07" in zero)


def test_clocks_of_two_devices_are_set_to_one_by_their_zeros():
    add_own_imu("boot", "2024-05-01T00:00:00Z")
    add_own_clock("dated", "2024-04-30T23:58:21Z")  # 99 s before
    recording = sd.read("a.boot", "a.dated")
    np.testing.assert_allclose(recording.sources[0].t, 1.0 + np.arange(20.0), atol=1e-6)
    assert any("by the UTC of both logs" in line for line in recording.meta["read"])


def test_a_clock_whose_zero_is_known_stands_beside_an_absolute_one():
    add_own_clock("dated", "2024-04-30T23:58:21Z")
    recording = sd.read("a.two", "a.dated")
    later = recording.sources[0].t - recording.imu.t[0]
    np.testing.assert_allclose(later, 1.0 + np.arange(20.0), atol=1e-5)


def test_a_clock_without_zero_is_asked_beside_one_that_has_it():
    add_own_imu("boot", "2024-05-01T00:00:00Z")
    add_own_clock("loose", None, first=1.0)
    with pytest.raises(DataError, match=r"a\.loose: the zero of its time 's' .* is unknown"):
        sd.read("a.boot", "a.loose")


def test_two_clocks_without_zero_are_taken_for_one_and_this_is_said():
    add_own_imu("boot", None)
    add_own_clock("loose", None, first=1.0)
    told = sd.read("a.boot", "a.loose").meta["read"]
    assert "assumed: the clocks of a.boot, a.loose count from the same moment" in told


def test_a_recording_is_read_alone():
    sd.write_recording(sd.read("a.two"), "a.nc")
    with pytest.raises(DataError, match=r"a\.nc: is a complete recording"):
        sd.read("a.two", "a.nc")
    with pytest.raises(DataError, match="no instances to choose from"):
        sd.read("a.nc", imu=1)


@pytest.mark.parametrize("files", [["a.two"], ["a.two", "a.gnss"], ["a.parts", "a.gnss"]])
def test_the_draft_says_the_same(files):
    Path("drafts").mkdir()
    text = draft([Path(each) for each in files], {}, Path("drafts").resolve())
    Path("drafts/same.toml").write_text(text)
    one, other = sd.read(*files), sd.read("drafts/same.toml")
    for a, b in zip(one.imu, other.imu):
        np.testing.assert_array_equal(a, b)
    assert len(one.sources) == len(other.sources) == 1
    np.testing.assert_array_equal(one.sources[0].y, other.sources[0].y)
    assert one.meta["epoch"] == other.meta["epoch"]


def test_gyro_and_accelerometer_of_tables_of_their_own():
    recording = sd.read("a.parts")
    assert any("joined at the times of the gyro" in note for note in recording.meta["notes"])
    table = imu_table("accel", 3_000_000)
    there = (table.cells("stamp") - START) * 1e-9
    force = np.interp(recording.imu.t[1:], there, table.numbers("az"))
    np.testing.assert_allclose(recording.imu.dv[1:, 2] / recording.imu.dt[1:], force, rtol=1e-9)


def test_inspect_says_what_reading_would():
    found = inspect("a.two", imu=1)
    assert found.facts[0] == "a log of two IMUs" and "taken: imu 1 of a.two: 50 Hz" in found.facts
    assert any("1000 samples" in fact or "2000 samples" in fact for fact in found.facts)
    alone = inspect("a.gnss")
    assert any("no IMU in it" in problem for problem in alone.problems)


def test_the_command_takes_several_files_and_instances(command):
    code, out, err = command("inspect", "a.two", "a.gnss", "--imu", "1", "--write", "both.toml")
    assert err == [] and code in (0, 3) and "taken: imu 1 of a.two: 50 Hz" in out
    assert 'table = "imu 1"' in Path("both.toml").read_text()
    code, out, err = command("fuse", "a.two", "--imu", "1,tactical", "--take", "gnss=0")
    assert code == 0 and "taken: imu 1 of a.two" in out
    code, _, err = command("fuse", "a.two", "--take", "gnss")
    assert code == 2 and "write NAME=N" in err[0]


def test_fuse_keeps_the_clock_and_leaves_the_description(command):
    words = "fuse", "a.two", "--imu", 1, "--filter", "mahony"
    code, out, err = command(*words, "--write", "b.toml", "--out", "b")
    assert (code, err) == (0, []) and "wrote b.toml" in out
    recording, same = sd.read("a.two", imu=1), sd.read("b.toml")
    np.testing.assert_array_equal(same.imu.dv, recording.imu.dv)
    found = sd.read_solution("b/solution.nc")
    assert found.meta["epoch"] == "2024-05-01T00:00:00Z" == same.meta["epoch"]
    assert found.meta["read"] == recording.meta["read"] and found.meta["date"] == "2024-05-01"
    assert found.utc[-1] == recording.utc[-1]
    sd.write_recording(recording, "c.nc")
    np.testing.assert_array_equal(sd.read("c.nc").utc, recording.utc)
    part = recording.between(5.0, 6.0).hidden([(5.2, 5.4)])
    assert part.utc[0] == np.datetime64("2024-05-01T00:00:05.02")
