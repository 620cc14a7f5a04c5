"""u-blox UBX: equality with what was written and with pyubx2, fixes that are not used, clocks, and
damage."""

import io

import numpy as np
import pandas as pd
import pytest
from support import written_nmea as nmea, written_ubx as ubx
from support.written_ubx import GPS, drive

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.description.logs import join, open_logs
from strapdown.io.readers.ubx import open_ubx, sniff
from strapdown.io.tables.table_file import read_bytes

pytestmark = pytest.mark.short
SAMPLES = {
    "m8u": "neo-m8u_esfraw_2s.log",
    "f9r": "zed-f9r_mixed_ubx_nmea_rtcm_29s.log.xz",
    "fused": "f9_dr_nav-pvat_nav-att_526s.log.xz",
}


@pytest.fixture
def written(tmp_path):
    """Function of bytes -> Log."""

    def write(data, name="a.ubx"):
        path = tmp_path / name
        path.write_bytes(bytes(data))
        return open_ubx(path)

    return write


def check_fixes(frame, moments, fixes):
    assert (frame["gps_ms"] == moments).all()
    for name, values in fixes.items():
        scale = 1e7 if name in ("lat", "lon") else 1e3
        assert (frame[name] == values / scale).all(), name


def test_fixes_and_samples_are_those_that_were_written(written):
    data, tag, gyro, accel, moments, fixes = drive()
    log = written(data)
    check_fixes(log.tables["NAV-PVT"].frame, moments, fixes)
    frame = log.tables["ESF-RAW"].frame
    names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
    assert (frame[names].to_numpy() == np.concatenate([gyro, accel], axis=1)).all()
    # a NAV-PVT stands between the samples i 10 - 1 and i 10
    assert np.allclose(frame["gps_us"], 1000 * (GPS + 100 + tag - tag[0] - 95), atol=1)
    assert not log.left and not log.asked


def test_a_drive_is_read_with_its_units(tmp_path):
    data, _, gyro, accel, moments, fixes = drive()
    path = tmp_path / "drive.ubx"
    path.write_bytes(data)
    recording = sd.read(path)
    imu, signs = recording.imu, [1, -1, -1]
    rate, force = imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]
    many = len(imu.t)
    assert many >= 199 and np.allclose(rate, np.radians(gyro[-many:] / 4096.0) * signs, rtol=1e-6)
    assert np.allclose(force, accel[-many:] / 1024.0 * signs, rtol=1e-6)
    position, velocity = recording.sources
    assert np.allclose(
        np.degrees(position.y[:, :2]), np.stack([fixes["lat"], fixes["lon"]], 1) / 1e7
    )
    assert np.allclose(velocity.y[:, 2], fixes["velD"] / 1e3)
    assert np.allclose(np.diff(position.t), 0.1) and recording.meta["epoch"].startswith(
        "2024-05-17"
    )


@pytest.mark.parametrize("name", SAMPLES)
def test_the_samples_equal_pyubx2(data_folder, name):
    pyubx2 = pytest.importorskip("pyubx2")
    path = data_folder / "native" / "ubx" / SAMPLES[name]
    log, wanted, messages = open_ubx(path), {}, 0
    reader = pyubx2.UBXReader(io.BytesIO(read_bytes(path)), protfilter=2, quitonerror=0)
    for _, message in reader:
        wanted.setdefault(message.identity, []).append(message)
        messages += 1
    assert f"{messages} UBX messages" in log.facts[0]
    for identity in ("NAV-PVT", "NAV-PVAT"):
        for k, message in enumerate(wanted.get(identity, [])):
            row = log.tables[identity].frame.iloc[k]
            payload = message.payload
            assert row["gps_ms"] % ubx.WEEK == int.from_bytes(payload[:4], "little")
            assert np.allclose([row["lat"], row["lon"]], [message.lat, message.lon], atol=1e-12)
            for field in ("height", "hAcc", "vAcc", "velN", "velE", "velD", "sAcc"):
                assert row[field] == pytest.approx(getattr(message, field) / 1e3, abs=1e-9), field
            if identity == "NAV-PVAT":
                for field in ("vehRoll", "vehPitch", "vehHeading"):
                    assert row[field] == pytest.approx(getattr(message, field), abs=1e-9)
    _equal_sensors(log, wanted)


def _equal_sensors(log, wanted):
    """ESF-MEAS and ESF-RAW of pyubx2, which gives the 24 bits without a sign."""
    names = {14: "gyro_x", 13: "gyro_y", 5: "gyro_z", 16: "accel_x", 17: "accel_y", 18: "accel_z"}
    found = {name: [] for name in names.values()}
    for message in wanted.get("ESF-MEAS", []):
        for i in range(1, message.numMeas + 1):
            kind = getattr(message, f"dataType_{i:02d}")
            if kind in names:
                value = getattr(message, f"dataField_{i:02d}")
                value = int.from_bytes(value, "little") if isinstance(value, bytes) else value
                found[names[kind]].append(value - (value >> 23 << 24))
    for name, values in found.items():
        if values:
            assert log.tables[f"ESF-MEAS {name[:-2]}"].frame[name].tolist() == values
    found = {name: [] for name in names.values()}
    for message in wanted.get("ESF-RAW", []):
        for i in range(1, len(message.payload) // 8 + 1):
            word = int.from_bytes(getattr(message, f"data_{i:02d}"), "little")
            if word >> 24 in names:
                value = word & 0xFFFFFF
                found[names[word >> 24]].append(value - (value >> 23 << 24))
    for name, values in found.items():
        if values:
            assert log.tables["ESF-RAW"].frame[name].tolist() == values


def test_the_clock_of_the_sample_is_steady(data_folder):
    log = open_ubx(data_folder / "native" / "ubx" / SAMPLES["m8u"])
    t = log.tables["ESF-RAW"].frame["gps_us"].to_numpy()
    step = np.diff(t)
    assert (step > 0).all() and 9900 < np.median(step) < 10050 and step.max() < 11100
    # 2021-05-26 16:52:44 UTC, GPS week 2159
    assert abs(t[0] / 1e6 - (2159 * 604800 + 319982)) < 0.5


def test_what_the_receiver_fused_is_left_until_asked_for(written, tmp_path):
    moments = GPS + 1000 * np.arange(40)
    kinds = np.repeat([3, 4, 1, 2], 10)
    log = written(ubx.pvt(moments, fixType=kinds, lat=np.arange(40), height=5000).tobytes())
    frame = log.tables["NAV-PVT"].frame
    assert frame["fixType"].tolist() == [3] * 10 + [2] * 10
    assert frame["height"].isna().tolist() == [False] * 10 + [True] * 10
    assert frame["velD"].isna().sum() == 10
    fused = [each for each in log.sections if each.instance == 1]
    assert len(log.tables["NAV-PVT fused"].frame) == 20 and all(each.left for each in fused)
    joined = join(open_logs([tmp_path / "a.ubx"]))
    assert all(each.section.instance == 0 for each in joined.taken)
    assert any("no independent aiding" in line for line in joined.told)


def test_fixes_without_a_right_time_or_fix_are_left(written):
    moments = GPS + 1000 * np.arange(30)
    valid = np.repeat([7, 0, 7], 10)
    flags = np.repeat([1, 1, 0], 10)
    log = written(ubx.pvt(moments, valid=valid, flags=flags).tobytes())
    assert log.tables["NAV-PVT"].frame["gps_ms"].tolist() == moments[:10].tolist()
    assert any("10 epochs of NAV-PVT without a fix" in line for line in log.left)
    log = written(ubx.pvt(moments, fixType=0).tobytes())
    assert not log.sections and any("30 epochs" in line for line in log.left)


def test_the_week_turns_inside_a_file(written):
    begin = 2300 * ubx.WEEK
    moments = begin + 1000 * np.arange(-20, 20)
    sol = np.zeros((40, 52), np.uint8)
    sol[:, :4] = ubx.rows((moments % ubx.WEEK).astype("<u4"))
    sol[:, 8:10] = ubx.rows((moments // ubx.WEEK).astype("<i2"))
    sol[:, 10], sol[:, 11] = 3, 0x0D
    tow = (moments % ubx.WEEK)[:, None]
    place = [73000000, 450000000, 250000, 203000, 1500, 2500]
    older = ubx.rows(np.hstack([tow, np.tile(place, (40, 1))]).astype("<i4"))
    motion = [123, -45, 6, 131, 131, 0, 12, 0]
    velocity = ubx.rows(np.hstack([tow, np.tile(motion, (40, 1))]).astype("<i4"))
    parts = (0x0102, older), (0x0112, velocity), (0x0106, sol)
    data = np.concatenate([ubx.frames(kind, part) for kind, part in parts], axis=1)
    frame = written(data.tobytes()).tables["NAV-POSLLH"].frame
    assert (frame["gps_ms"] == moments).all()
    first = frame.iloc[0][["lat", "lon", "height", "velN", "velE", "velD", "sAcc", "hAcc"]]
    assert np.allclose(first.astype(float), [45, 7.3, 250, 1.23, -0.45, 0.06, 0.12, 1.5])
    # weeks stated by few messages serve all; by none, the file has times of its own
    sol[:39, 11] = 0x09
    data = np.concatenate([ubx.frames(kind, part) for kind, part in parts], axis=1)
    assert (written(data.tobytes()).tables["NAV-POSLLH"].frame["gps_ms"] == moments).all()
    data = np.concatenate([ubx.frames(kind, part) for kind, part in parts[:2]], axis=1)
    frame = written(data.tobytes()).tables["NAV-POSLLH"].frame
    assert (np.diff(frame["tow_ms"]) == 1000).all()


def test_high_precision_positions_replace_the_others(written):
    moments = GPS + 1000 * np.arange(5)
    fine = np.zeros((5, 36), np.uint8)
    fine[:, 4:8] = ubx.rows((moments % ubx.WEEK).astype("<u4"))
    fine[:, 8:24] = np.array([-73000001, 450000000, 250000, 203000], "<i4").view(np.uint8)
    fine[:, 24:28] = np.array([-37, 12, -4, 5], "i1").view(np.uint8)
    fine[:, 28:36] = np.array([141, 205], "<u4").view(np.uint8)
    data = np.concatenate([ubx.pvt(moments), ubx.frames(0x0114, fine)], axis=1)
    row = written(data.tobytes()).tables["NAV-PVT"].frame.iloc[3]
    assert row["lat"] == 45.000000012 and row["lon"] == -7.300000137
    assert [row[each] for each in ("height", "hAcc", "vAcc")] == [249.9996, 0.0141, 0.0205]


def test_nmea_serves_where_there_is_no_ubx_solution(written):
    data, *_ = drive(200, 10)
    frames = np.frombuffer(data, np.uint8).reshape(20, -1)
    start = np.datetime64("2024-05-17T16:53:02", "ms")
    parts = []
    for i in range(20):
        moment = start + i * np.timedelta64(100, "ms")
        text = nmea.rmc(moment, 45, 7.3, 3, 20) + nmea.gga(moment, 45, 7.3, 200)
        parts += [text.encode(), frames[i, 100:].tobytes()]
    log = written(b"".join(parts))
    assert set(log.tables) == {"GGA", "RMC", "ESF-RAW"}
    shift = log.tables["ESF-RAW"].frame["gps_us"].iloc[0] / 1e6 - GPS / 1e3
    assert abs(shift) < 0.02
    both = written(data + b"".join(parts))
    assert "GGA" not in both.tables and any("more digits" in line for line in both.left)


def test_nmea_of_a_receiver_that_fuses_is_left(data_folder, written):
    data = read_bytes(data_folder / "native" / "ubx" / SAMPLES["fused"])
    text = nmea.gga(np.datetime64("2026-04-20T13:48:55", "ms"), 51, 0, 80).encode()
    log = written(data + text)
    assert log.sections and all(each.left for each in log.sections)


def test_a_sensor_clock_that_begins_anew_and_drifts(written):
    """Two pieces of 100 s; in each the sensor's clock is 80 ppm slow, and some epochs came late."""
    rng = np.random.default_rng(2)
    parts, truth = [], []
    for piece in range(2):
        n = 10_000
        gps = GPS + 300_000 * piece + 10.0 * np.arange(n)
        tag = np.round((gps - gps[0]) * (1 - 80e-6)).astype(int) + 1000 + 7777 * piece
        raw = ubx.esf_raw(tag, np.ones((n, 3), int), np.tile([1, 2, 10042], (n, 1)))
        late = np.where(rng.random(n // 100) < 0.2, 3, 0)
        fixes = ubx.pvt(np.round(gps[::100]).astype(int))
        for k in range(n // 100):
            parts += [raw[100 * k : 100 * k + late[k]].tobytes(), fixes[k].tobytes()]
            parts += [raw[100 * k + late[k] : 100 * k + 100].tobytes()]
        truth.append(gps)
    t = written(b"".join(parts)).tables["ESF-RAW"].frame["gps_us"].to_numpy() / 1e3
    assert len(t) == 20_000 and (np.diff(t) > 0).all()
    off = t - np.concatenate(truth)
    assert np.ptp(off[:10_000]) < 3 and np.abs(off).max() < 12


def test_mounting_angles_of_the_receiver_are_taken(written, tmp_path):
    data, *_ = drive()
    alg = np.zeros((1, 16), np.uint8)
    alg[:, 5] = 3 << 1 | 1
    alg[:, 8:12] = np.array([9000], "<u4").view(np.uint8)
    alg[:, 12:16] = np.array([500, -200], "<i2").view(np.uint8)
    log = written(data + ubx.frames(0x1010, alg).tobytes())
    assert all("mounting" not in each.keys for each in log.sections)  # 10 10 is ESF-STATUS
    log = written(data + ubx.frames(0x1014, alg).tobytes())
    imu = next(each for each in log.sections if each.of == "imu")
    wanted = {"roll": -2.0, "pitch": -5.0, "heading": -90.0, "unit": "deg"}
    assert imu.keys["mounting"] == wanted
    assert imu.assumed["mounting"] == "as the receiver found it (ESF-ALG)"
    alg[:, 5] = 0  # angles that a user has set
    for angles, expected in ((alg, wanted), (np.r_[alg[:, :8].T, np.zeros((8, 1))].T, None)):
        content = data + ubx.frames(0x1014, angles.astype(np.uint8)).tobytes()
        imu = next(each for each in written(content).sections if each.of == "imu")
        assert imu.keys.get("mounting") == expected
        assert ("from its settings" in imu.assumed.get("mounting", "")) == (expected is not None)
    for status in (1, 2):  # still looking for them
        alg[:, 5] = status << 1
        log = written(data + ubx.frames(0x1014, alg).tobytes())
        assert all("mounting" not in each.keys for each in log.sections)


@pytest.mark.parametrize("many", [0, 1, 5, 7, 99, 100, 101, 107, 250, 1111])
def test_a_file_cut_anywhere_keeps_what_is_whole(written, many):
    data, *_, moments, _ = drive()
    if many < 100:
        with pytest.raises(DataError, match="holds no whole UBX message"):
            written(data[:many])
        return
    log = written(data[:many])
    assert len(log.tables["NAV-PVT"].frame) == 1 + (many >= 1111)
    assert (log.left != ()) == (many > 101)


def test_what_fails_its_checksum_is_not_used(written):
    data, *_, moments, fixes = drive()
    broken = bytearray(data)
    size = len(data) // 20
    broken[30] ^= 1  # the first NAV-PVT
    broken[3 * size + 100 + 20] ^= 64  # a sample after the fourth
    log = written(broken)
    assert log.tables["NAV-PVT"].frame["gps_ms"].tolist() == moments[1:].tolist()
    assert len(log.tables["ESF-RAW"].frame) == 199
    assert any("2 UBX frames fail their checksum" in line for line in log.left)


def test_frames_inside_other_frames_and_noise_between_them(written):
    data, *_, moments, fixes = drive()
    inner = ubx.pvt(np.array([GPS + 10**8])).ravel()
    outer = ubx.frames(0x2104, inner[None]).tobytes()  # a message that carries another one
    noise = np.random.default_rng(4).integers(0, 256, 4000, np.uint8).tobytes()
    log = written(b"# text\n" + outer + noise + data + b"\xb5b\x01\x07\xff\xff" + noise)
    check_fixes(log.tables["NAV-PVT"].frame, moments, fixes)


def test_messages_out_of_order_are_sorted(written):
    moments = GPS + 1000 * np.array([0, 2, 1, 3, 3, 10, 4])
    log = written(ubx.pvt(moments).tobytes())
    frame = log.tables["NAV-PVT"].frame
    assert ((frame["gps_ms"] - GPS) // 1000).tolist() == [0, 1, 2, 3, 4, 10]
    assert any("2 messages out of order, which are sorted, 1 repeated" in line for line in log.left)


def test_a_receiver_beside_an_imu_of_another_maker(tmp_path):
    _, _, gyro, accel, moments, _ = drive()
    (tmp_path / "gnss.ubx").write_bytes(ubx.pvt(moments, lat=450000000, height=2000).tobytes())
    unix = GPS / 1e3 + 315964800 - 18 + 0.01 * np.arange(200)
    frame = pd.DataFrame({"t": unix, **dict(zip(("gx", "gy", "gz"), (gyro * 1e-7).T))})
    frame = frame.assign(ax=0.0, ay=0.1, az=-9.8)
    frame.to_csv(tmp_path / "imu.csv", index=False)
    text = (
        '[imu]\nfile = "imu.csv"\ntime = { column = "t", unit = "s", clock = "unix" }\n'
        'gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }\n'
        'accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }\n'
        '[[source]]\nkind = "position"\nfile = "gnss.ubx"\n'
        'time = { column = "gps_ms", unit = "ms", clock = "gps" }\n'
        'columns = ["lat", "lon", "height"]\nunit = ["deg", "deg", "m"]\nstd = 1.0\n'
    )
    (tmp_path / "recording.toml").write_text(text, encoding="utf-8")
    recording = sd.read(tmp_path / "recording.toml")
    assert abs(recording.sources[0].t[0] - recording.imu.t[0]) < 0.02


def test_content_tells_the_format(tmp_path, written):
    data, *_ = drive()
    path = tmp_path / "port.log"
    path.write_bytes(b"$GNGGA,,*00\r\n" * 3 + data)
    assert sniff(path) and sd.read(path).imu.t.size > 0
    path.write_bytes(b"no frame")
    assert not sniff(path)


def beside_imu(tmp_path, times, data):
    """Paths of an IMU at rest at these `times`, (name of the column, s), and of a receiver's file."""
    n = len(times[1])
    frame = pd.DataFrame({times[0]: times[1]}).assign(gx=0.0, gy=0.0, gz=1e-5 * np.arange(n))
    frame.assign(ax=0.0, ay=0.1, az=-9.8).to_csv(tmp_path / "imu.csv", index=False)
    (tmp_path / "gnss.ubx").write_bytes(data)
    return tmp_path / "imu.csv", tmp_path / "gnss.ubx"


def test_messages_without_a_date_are_counted(tmp_path):
    """A receiver that never knew the time: nothing is silently lost."""
    moments = GPS + 1000 * np.arange(10)
    unix = "unix_s", GPS / 1e3 + 315964800 - 18 + 0.01 * np.arange(1000)
    recording = sd.read(*beside_imu(tmp_path, unix, ubx.pvt(moments, valid=0).tobytes()))
    assert not recording.sources
    assert any("10 NAV-PVT without a valid date" in line for line in recording.meta["read"])


@pytest.mark.parametrize("absolute", [True, False])
def test_a_time_of_week_gets_the_week_of_the_file_beside_it(tmp_path, absolute):
    """NAV-POSLLH alone says no week: an IMU on UTC, or on a time of week of its own, tells it."""
    tow = GPS % ubx.WEEK + 1000 * np.arange(10)
    fixed = np.tile([73000000, 450000000, 250000, 203000, 1500, 2500], (10, 1))
    payload = ubx.rows(np.hstack([tow[:, None], fixed]).astype("<i4"))
    dt = 0.01 * np.arange(1000)
    unix, of_week = GPS / 1e3 + 315964800 - 18 + dt, tow[0] / 1e3 + dt
    times = ("unix_s", unix) if absolute else ("tow_s", of_week)
    data = ubx.frames(0x0102, payload).tobytes()
    recording = sd.read(*beside_imu(tmp_path, times, data))
    (position,) = recording.sources
    assert np.allclose(position.t - recording.imu.t[0], np.arange(10), atol=0.02)
    assert ("epoch" in recording.meta) == absolute


def test_an_imu_with_two_tables_and_no_date(written, tmp_path):
    """ESF-MEAS, gyro and accelerometer apart, beside NAV-POSLLH alone: all on the time of week."""
    rng, n = np.random.default_rng(0), 400
    tow = GPS % ubx.WEEK + 100 * np.arange(n // 10)
    fixed = np.tile([73000000, 450000000, 250000, 203000, 1500, 2500], (n // 10, 1))
    place = ubx.frames(0x0102, ubx.rows(np.hstack([tow[:, None], fixed]).astype("<i4")))
    tag, noise = 5_000_000 + 10 * np.arange(n), rng.integers(-40, 40, (n, 6))
    gyro = ubx.esf_meas(tag, [14, 13, 5], noise[:, :3])
    accel = ubx.esf_meas(tag + 1, [16, 17, 18], noise[:, 3:] + [0, 0, 10042])
    both = np.concatenate([gyro, accel], axis=1).reshape(n // 10, -1)
    written(np.concatenate([place, both], axis=1).tobytes())
    recording = sd.read(tmp_path / "a.ubx")
    (position,) = recording.sources
    assert np.allclose(position.t, tow / 1e3) and abs(recording.imu.t[0] - tow[0] / 1e3) < 0.2
    assert len(recording.imu.t) > n - 5


@pytest.mark.parametrize("version", [0, 1])
def test_a_baseline_is_left_until_asked_for(tmp_path, version):
    """Vectors to an antenna that moves along are those that were written, to 0.1 mm; those to a fixed
    base, or without a carrier solution, are counted."""
    data, *_, moments, _ = drive()
    rng = np.random.default_rng(4)
    vectors = rng.integers(-9000, 9000, (len(moments), 3))
    flags = np.full(len(moments), 0x137)
    flags[:2], flags[2:5] = 0x117, 0x127  # a fixed base; no carrier solution
    path = tmp_path / "a.ubx"
    path.write_bytes(data + ubx.relposned(moments, vectors, flags, 60, version).tobytes())
    log = open_ubx(path)
    frame = log.tables["NAV-RELPOSNED"].frame
    assert np.array_equal(frame["gps_ms"], moments[5:])
    for axis, values in zip("NED", vectors[5:].T):
        assert np.allclose(frame[f"relPos{axis}"], values / 1e4, atol=1e-9)
        assert (frame[f"acc{axis}"] == 0.006).all()
    assert any("5 NAV-RELPOSNED without a carrier solution" in line for line in log.left)
    (section,) = (each for each in log.sections if each.keys.get("kind") == "baseline")
    assert "--take baseline=0" in section.left and "baseline" in section.assumed


def test_a_baseline_that_is_taken_points_forward(tmp_path):
    moments = GPS + 200 * np.arange(40)
    vectors = np.tile([8000, -6000, 300], (40, 1))
    data = ubx.pvt(moments).tobytes() + ubx.relposned(moments, vectors).tobytes()
    unix = "unix_s", GPS / 1e3 + 315964800 - 18 + 0.01 * np.arange(900)
    paths = beside_imu(tmp_path, unix, data)
    assert [a.kind for a in sd.read(*paths).sources] == ["position", "velocity"]
    joined = join(open_logs(paths), {"baseline": 0})
    (tmp_path / "recording.toml").write_text(joined.text(tmp_path))
    source = sd.read(tmp_path / "recording.toml").sources[-1]
    assert source.kind == "baseline" and np.allclose(source.y, [0.8, -0.6, 0.03])
    assert source.parameters == (1.0, 0.0, 0.0) and np.allclose(source.std, 0.006)
