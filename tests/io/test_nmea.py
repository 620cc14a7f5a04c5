"""NMEA 0183: equality with what was written and with pynmeagps, times of day with and without
dates, what is assumed, and damage."""

import io
import re

import numpy as np
import pytest
from support.written_nmea import GSV, gga, gst, rmc, sentence

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io import registry
from strapdown.io.readers.nmea import open_nmea, sniff
from strapdown.io.tables.table_file import read_bytes

pytestmark = pytest.mark.short
START = np.datetime64("2024-02-28T23:59:58.000", "ms")
SAMPLES = {
    "f9k": "zed-f9k_drive_27min.nmea.xz",
    "rtk": "rtk_gga_rmc_60s_half_second.nmea",
    "boat": "sailboat_plaka_first1000epochs.log.xz",
}


def moments(n=20, ms=200):
    return START + ms * np.arange(n) * np.timedelta64(1, "ms")


@pytest.fixture
def written(tmp_path):
    """Function of text -> Log."""

    def write(text):
        path = tmp_path / "a.nmea"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return open_nmea(path)

    return write


def test_fixes_are_those_that_were_written(written):
    t, rng = moments(), np.random.default_rng(5)
    lat, lon = rng.uniform(-80, 80, 20), rng.uniform(-180, 180, 20)
    speed, course = rng.uniform(0, 50, 20).round(3), rng.uniform(0, 360, 20).round(2)
    text = "".join(
        gga(m, a, o, 100 + i, 47.125) + rmc(m, a, o, s, c) + GSV + gst(m, 1 + i, 2, 3.0)
        for i, (m, a, o, s, c) in enumerate(zip(t, lat, lon, speed, course))
    )
    log = written(text)
    fixes, motion = log.tables["GGA"].frame, log.tables["RMC"].frame
    unix = t.astype(np.int64)
    assert (fixes["unix_ms"] == unix).all() and (motion["unix_ms"] == unix).all()
    assert np.allclose(fixes["lat"], lat, atol=2e-9) and np.allclose(fixes["lon"], lon, atol=2e-9)
    assert fixes["altitude"].tolist() == [100.0 + i for i in range(20)]
    assert (fixes["separation"] == 47.125).all()
    assert fixes["std_n"].tolist() == [1.0 + i for i in range(20)] and (fixes["std_d"] == 3).all()
    assert (motion["speed"] == speed).all() and (motion["course"] == course).all()
    position = log.sections[0]
    assert position.keys["geoid"] == {"column": "separation", "unit": "m"} and not position.assumed
    assert not log.left


@pytest.mark.parametrize("name", SAMPLES)
def test_the_samples_equal_pynmeagps(data_folder, name):
    pynmeagps = pytest.importorskip("pynmeagps")
    path = data_folder / "native" / "nmea" / SAMPLES[name]
    wanted = {}
    # without the flood of satellites, which takes the oracle seconds
    data = b"".join(re.findall(rb"\$(?!..GS)[^$]*", read_bytes(path)))
    for _, message in pynmeagps.NMEAReader(io.BytesIO(data), quitonerror=0):
        if message is not None:
            wanted.setdefault(message.msgID, []).append(message)
    tables = open_nmea(path).tables
    for kind in ("GGA", "GLL"):
        if kind not in tables:
            continue
        frame, messages = tables[kind].frame, wanted[kind]
        assert len(frame) == len(messages)
        for row, message in zip(frame.to_dict("records"), messages):
            assert row["lat"] == pytest.approx(message.lat, abs=6e-11)
            assert row["lon"] == pytest.approx(message.lon, abs=6e-11)
            if kind == "GGA":
                assert (row["altitude"], row["separation"]) == (message.alt, message.sep)
                assert (row["quality"], row["hdop"]) == (message.quality, message.HDOP)
            ms = row.get("unix_ms", row.get("day_ms")) % 86_400_000
            t = message.time
            assert ms == 1000 * (3600 * t.hour + 60 * t.minute + t.second) + t.microsecond // 1000
    kind = "RMC" if "RMC" in tables else "VTG"
    frame, messages = tables[kind].frame, wanted[kind]
    assert len(frame) == len(messages)
    for row, message in zip(frame.to_dict("records"), messages):
        speed = message.spd if kind == "RMC" else message.sogn
        course = message.cog if kind == "RMC" else message.cogt
        assert row["speed"] == float(speed)
        assert (
            (row["course"] == float(course))
            if course not in ("", None)
            else np.isnan(row["course"])
        )
        if kind == "RMC":
            day = np.datetime64(message.date.isoformat(), "ms").astype(np.int64)
            assert row["unix_ms"] // 86_400_000 * 86_400_000 == day


def test_speeds_of_the_drive_are_those_of_its_positions(data_folder):
    """Knots and degrees: the displacement from fix to fix is the mean of the velocities."""
    tables = open_nmea(data_folder / "native" / "nmea" / SAMPLES["f9k"]).tables
    fixes, motion = tables["GGA"].frame, tables["RMC"].frame
    north = np.radians(np.diff(fixes["lat"])) * 6.36e6
    v = motion["speed"] * 1852 / 3600 * np.cos(np.radians(motion["course"].fillna(0.0)))
    v = v.to_numpy()
    steady = np.diff(motion["unix_ms"]) == 1000
    off = (north - (v[1:] + v[:-1]) / 2)[steady]
    assert v.max() > 10 and np.median(np.abs(off)) < 0.05


def test_days_turn_at_midnight_also_where_only_some_sentences_have_dates(written):
    t = moments(20, 500)
    lines = [gga(m, 45, 7, 100) for m in t]
    lines.insert(0, rmc(t[0], 45, 7, 1, 2))
    log = written("".join(lines))
    assert (log.tables["GGA"].frame["unix_ms"] == t.astype(np.int64)).all()
    log = written("".join(lines[1:]))
    assert (np.diff(log.tables["GGA"].frame["day_ms"]) == 500).all()
    assert log.sections[0].keys["time"] == {"column": "day_ms", "unit": "ms"}
    assert any("no RMC or ZDA has one" in line for line in log.left)
    zda = sentence("GPZDA,235958.00,28,02,2024,00,00")
    empty = sentence("GPZDA,235958,,,,00,")
    found = written(zda + empty + "".join(lines[1:])).tables["GGA"].frame
    assert (found["unix_ms"] == t.astype(np.int64)).all()
    assert "day_ms" in written(empty + "".join(lines[1:])).tables["GGA"].frame


@pytest.mark.parametrize("quality", [0, 6, 7, 8])
def test_what_is_no_fix_is_not_used(written, quality):
    t = moments(10)
    lines = [gga(m, 45, 7, 100, quality=4 if i < 6 else quality) for i, m in enumerate(t)]
    log = written("".join(lines))
    assert len(log.tables["GGA"].frame) == 6
    assert any("4 GGA without a fix, or with an estimated, manual" in line for line in log.left)
    with pytest.raises(DataError, match="without a usable position.*10 GGA without a fix"):
        written("".join(gga(m, 45, 7, 100, quality=quality) for m in t))


@pytest.mark.parametrize("mode", "EMSN")
def test_speeds_that_are_estimated_are_not_used(written, mode):
    lines = [gga(m, 45, 7, 1) + rmc(m, 45, 7, 5, 9, mode) for m in moments()]
    assert set(written("".join(lines)).tables) == {"GGA"}
    lines = [gga(m, 45, 7, 1) + rmc(m, 45, 7, 5, 9, "A", "V") for m in moments()]
    assert set(written("".join(lines)).tables) == {"GGA"}


def test_a_course_is_empty_at_rest(tmp_path):
    path = tmp_path / "a.nmea"
    t = moments(10)
    speeds = [0.01, 0.02, 0.2, 5, 5, 5, 5, 0.1, 0.01, 3]
    courses = [None, None, None, 90, 90, 90, 90, None, None, None]
    lines = [gga(m, 45, 7, 1) + rmc(m, 45, 7, s, c) for m, s, c in zip(t, speeds, courses)]
    path.write_text("".join(lines))
    (tmp_path / "imu.csv").write_text(
        "t,gx,gy,gz,ax,ay,az\n"
        + "".join(
            f"{START.astype(np.int64) / 1e3 + 0.01 * i:.3f},0.0{i % 7},0,0,0,0.1,-9.8{i % 3}\n"
            for i in range(300)
        )
    )
    text = (
        '[imu]\nfile = "imu.csv"\ntime = { column = "t", unit = "s", clock = "unix" }\n'
        'gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }\n'
        'accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }\n[[source]]\n'
    )
    keys = open_nmea(path).sections[1].keys
    assert keys["form"] == "speed, course" and keys["unit"] == ["knot", "deg"]
    text += (
        'file = "a.nmea"\nkind = "velocity"\ntable = "RMC"\nform = "speed, course"\n'
        'time = { column = "unix_ms", unit = "ms", clock = "unix" }\n'
        'columns = ["speed", "course"]\nunit = ["knot", "deg"]\nstd = 0.6\n'
    )
    (tmp_path / "recording.toml").write_text(text)
    velocity = sd.read(tmp_path / "recording.toml").sources[0]
    assert len(velocity.t) == 9  # 3 knots without a course say nothing
    assert np.allclose(velocity.y[:3, :2], 0) and np.isnan(velocity.y[:, 2]).all()
    assert np.allclose(velocity.y[3:7, :2], [0, 5 * 1852 / 3600])


def test_heights_without_separation_get_that_of_the_model(written):
    t = moments(4)
    log = written("".join(gga(m, 45, 7, 100, None) for m in t))
    position = log.sections[0]
    assert position.keys["geoid"] == "EGM96" and "do not state" in position.assumed["geoid"]
    assert (
        "4 m for quality 1"
        in written("".join(gga(m, 45, 7, 1, quality=1) for m in t)).sections[0].assumed["std"]
    )
    lines = [rmc(m, 45, 7, 5, 9) for m in t]
    position = written("".join(lines)).sections[0]
    assert "no heights" in position.title and "geoid" not in position.keys


def test_fixes_in_two_dimensions_have_no_height(written):
    t = moments(6, 1000)
    lines = [
        gga(m, 45, 7, 100) + 2 * sentence(f"GNGSA,A,{2 if i < 2 else 3},1,2,3,1.4,0.7,1.2,1") + GSV
        for i, m in enumerate(t)
    ]
    altitude = written("".join(lines)).tables["GGA"].frame["altitude"]
    assert altitude.isna().tolist() == [True] * 2 + [False] * 4


def test_deviations_are_assumed_by_quality_and_hdop(written):
    m = moments(3)
    lines = [
        gga(m[0], 45, 7, 1, quality=1, hdop=2.5),
        gga(m[1], 45, 7, 1, quality=4, hdop=0.5),
        gga(m[2], 45, 7, 1, quality=5, hdop=1.0),
    ]
    log = written("".join(lines))
    assert log.tables["GGA"].frame["std_n"].tolist() == [10.0, 0.02, 0.5]
    assert log.tables["GGA"].frame["std_d"].tolist() == [20.0, 0.04, 1.0]
    assert "times HDOP" in log.sections[0].assumed["std"]


def test_deviations_of_zero_are_none(written):
    t = moments(4)
    lines = [gga(m, 45, 7, 1, quality=q, hdop=1.0) for m, q in zip(t, (4, 4, 5, 5))]
    zeros = [gst(m, 0, 0, 0) for m in t]
    table = written("".join(lines + zeros)).tables["GGA"].frame
    assert table["std_n"].tolist() == [0.02, 0.02, 0.5, 0.5]
    told = [gst(m, *std) for m, std in zip(t, ((0.005, 0.012, 0), (0.02,) * 3, (0.02,) * 3))]
    log = written("".join(lines + told))
    std_ned = log.tables["GGA"].frame[["std_n", "std_e", "std_d"]].to_numpy().tolist()
    assert std_ned == [[0.01, 0.012, 0.04], [0.02] * 3, [0.1] * 3, [0.5, 0.5, 1.0]]
    why = log.sections[0].assumed["std"]
    assert "where GST has none: 0.02 m for quality 4, 0.5 m for quality 5" in why
    assert "the std of GST, at least 0.01 m for quality 4, else 0.1 m" in why


def test_headings_of_two_antennas(written):
    t = moments(10)
    lines = [gga(m, 45, 7, 1) + sentence(f"GNHDT,{10 + i}.5,T") for i, m in enumerate(t)]
    lines.append(sentence("GNHDT,,T"))
    log = written("".join(lines))
    heading = log.tables["HDT"].frame
    assert heading["heading"].tolist() == [10.5 + i for i in range(10)]
    lines = [gga(m, 45, 7, 1) + sentence(f"GNTHS,10.5,{'AEMSV'[i % 5]}") for i, m in enumerate(t)]
    assert len(written("".join(lines)).tables["THS"].frame) == 2


def test_vtg_is_of_the_sentences_beside_it(written):
    t = moments(10, 1000)
    lines = [
        sentence(f"GNVTG,{i}.0,T,,M,{i}.5,N,,K,A") + gga(m, 45, 7, 1) + GSV for i, m in enumerate(t)
    ]
    frame = written("".join(lines)).tables["VTG"].frame
    ms = frame["day_ms"].to_numpy()
    assert (ms - ms[0] == 1000 * np.arange(10)).all()
    assert frame["speed"].tolist() == [i + 0.5 for i in range(10)]


def test_other_devices_on_the_bus_are_left(written):
    lines = [gga(m, 45, 7, 1) + gga(m, 46, 8, 1, talker="II") for m in moments(10)]
    lines += [gga(m, 45, 7, 1) for m in moments(3)]
    log = written("".join(lines))
    assert (np.abs(log.tables["GGA"].frame["lat"] - 45) < 1e-6).all()
    assert any("10 GGA of other devices (II)" in line for line in log.left)


def test_damage_and_glued_lines(written):
    t = moments(6)
    lines = [gga(m, 45, 7, 100) for m in t]
    lines[1] = lines[1].replace("45", "46", 1)  # wrong checksum
    lines[2] = lines[2].strip()  # glued to the next
    lines[4] = lines[4][:30]  # cut, and the next begins
    log = written("".join(lines) + lines[0][:40])
    assert len(log.tables["GGA"].frame) == 4
    assert any("1 NMEA sentences fail their checksum" in line for line in log.left)
    assert any("2 NMEA sentences without a checksum, or cut short" in line for line in log.left)
    whole = "".join(gga(m, 45, 7, 100) for m in t)
    for cut in range(0, 90, 7):
        try:
            log = written(whole[:cut])
        except DataError as error:
            assert cut < 84 and "\n" not in str(error)
        else:
            assert len(log.tables["GGA"].frame) == 1


def test_sentences_out_of_order_are_sorted(written):
    t = moments(4)
    log = written("".join(gga(t[i], 45, 7, 100) for i in (0, 2, 1, 3, 3)) + rmc(t[3], 1, 1, 1, 1))
    assert (log.tables["GGA"].frame["unix_ms"] == t.astype(np.int64)).all()
    assert any("1 GGA out of order" in line for line in log.left)
    assert any("1 GGA that repeat a time" in line for line in log.left)


def test_content_tells_the_format(tmp_path):
    text = "".join(gga(m, 45, 7, 100) for m in moments())
    for name, content, expected in (
        ("a.log", text, "nmea"),
        ("a.txt", "# logged\n" + text, "nmea"),
        ("a.nmea.gz", text, None),
        ("b.txt", "t,x\n1,2\n", "table"),
        ("plain", text, "nmea"),
    ):
        path = tmp_path / name
        path.write_text(content)
        if expected:
            assert registry.find(path).name == expected
    assert not sniff(tmp_path) and not sniff(tmp_path / "a.nmea.gz")


def test_a_day_that_no_month_has_is_no_date(written):
    """31 February would count as 2 March."""
    bad = [rmc(m, 45, 7, 5, 9, date="2024-02-31") + gga(m, 45, 7, 100) for m in moments()]
    columns = written("".join(bad)).tables["GGA"].frame.columns
    assert "unix_ms" not in columns and "day_ms" in columns
