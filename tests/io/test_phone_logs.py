"""Logs of phones, written by the pages of their formats and read back, and the samples."""

import numpy as np
import pytest
from written_phones import (
    START,
    folder,
    gnsslogger,
    phyphox,
    sensor_logger,
    signals,
    zipped,
)

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io import registry
from strapdown.io.inspection import inspect
from strapdown.io.registry import find
from strapdown.io.tables.table_file import head_of, read_bytes

FRD = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
"""Body axes of the phone's: forward is its top."""
NATIVE = "native"


@pytest.fixture(scope="module")
def walk():
    return signals()


def same(recording, s, fixes=slice(None), height_error=1e-4, android=False):
    """That the recording has these signals: IMU, fixes of position and of velocity."""
    expected = sd.Recording.from_arrays(s.t, s.gyro @ FRD.T, s.accel @ FRD.T)
    imu = recording.imu
    assert np.allclose(imu.t - imu.t[0], expected.imu.t - expected.imu.t[0], atol=2e-6)
    assert np.allclose(imu.dtheta, expected.imu.dtheta, atol=1e-7)
    assert np.allclose(imu.dv, expected.imu.dv, atol=1e-6)
    position = next(each for each in recording.sources if each.kind == "position")
    wanted = s.fixes[fixes] * [np.pi / 180, np.pi / 180, 1.0]
    assert np.allclose(position.y, wanted, rtol=0, atol=[1e-10, 1e-10, height_error])
    assert np.allclose(position.t - imu.t[0], s.fix_t[fixes] - expected.imu.t[0], atol=2e-6)
    # of normal errors along two axes 68 % lie in Android's radius
    north = 3.0 / np.sqrt(-2 * np.log(0.32)) if android else 3.0
    assert np.allclose(position.std, [north, north, 5.0], rtol=1e-3)
    velocity = next(each for each in recording.sources if each.kind == "velocity")
    north = s.speed[fixes] * np.cos(np.radians(s.course[fixes]))
    known = np.isin(np.round(position.t, 3), np.round(velocity.t, 3))
    assert np.allclose(velocity.y[:, 0], north[known], atol=1e-5)
    assert np.isnan(velocity.y[:, 2]).all()


def said(path, **instances):
    return sd.read(path, **instances).meta["read"]


@pytest.mark.parametrize(
    "platform, standardised", [("android", "false"), ("ios", "false"), ("ios", "true")]
)
def test_sensor_logger_of_both_platforms(tmp_path, walk, platform, standardised):
    files = sensor_logger(walk, platform, standardised)
    one = sd.read(folder(tmp_path / "walk", files))
    same(one, walk, android=platform == "android")
    assert one.meta["name"] == "walk" and one.meta["epoch"] == "2024-05-01T00:00:00Z"
    assert one.imu.t[0] == pytest.approx(0.25 + walk.t[1] - walk.t[0], abs=0.02)
    other = sd.read(zipped(tmp_path / "walk.zip", files, inside="2024-05-01 walk/"))
    assert np.array_equal(one.imu.dv, other.imu.dv)
    assert np.array_equal(one.sources[0].y, other.sources[0].y)


@pytest.mark.parametrize("standardised, sign", [("false", -1.0), ("true", 1.0)])
def test_the_signs_of_a_total_acceleration_are_those_of_the_platform(
    tmp_path, walk, standardised, sign
):
    turned = walk._replace(accel=sign * walk.accel)
    files = sensor_logger(walk, "ios", standardised)
    files["TotalAcceleration.csv"] = sensor_logger(turned)["TotalAcceleration.csv"]
    same(sd.read(folder(tmp_path / "walk", files)), walk)


def test_a_location_that_android_fused_is_named_so(tmp_path, walk):
    files = sensor_logger(walk)
    assert "(FLP)" in "\n".join(said(folder(tmp_path / "a", files)))
    files["LocationGps.csv"] = files["Location.csv"]
    assert "(FLP)" not in "\n".join(said(folder(tmp_path / "b", files)))
    files = sensor_logger(walk, "ios")
    assert "(FLP)" not in "\n".join(said(folder(tmp_path / "c", files)))


@pytest.mark.parametrize("maker, android", [("Google", True), ("Apple", False)])
def test_the_maker_of_the_phone_tells_phyphox_what_accuracies_are(tmp_path, walk, maker, android):
    files = phyphox(walk)
    device = f'"property","value"\n"deviceModel","x"\n"deviceManufacturer","{maker}"\n'
    files["meta/device.csv"] = device.encode()
    recording = sd.read(folder(tmp_path / "walk", files))
    same(recording, walk, fixes=slice(1, None), height_error=2.0, android=android)


def test_what_tells_an_iphone(tmp_path, walk):
    """Without Metadata.csv: heights above the sea, which only an iPhone writes; nothing at all is
    said."""
    files = sensor_logger(walk, "ios", metadata=False)
    same(sd.read(folder(tmp_path / "a", files)), walk)
    del files["Location.csv"]
    lines = inspect(folder(tmp_path / "b", files)).facts
    assert any(
        "assumed: imu accel" in line and "an iPhone's are opposite" in line for line in lines
    )


def test_an_uncalibrated_accelerometer_in_g_is_an_iphones(tmp_path, walk):
    files = sensor_logger(walk, "ios", metadata=False)
    table = files.pop("Accelerometer.csv"), files.pop("Gravity.csv")
    assert all(table)
    t = START + np.round(walk.t * 1e9).astype(np.int64)
    rows = [
        f"{a},{b},{z!r},{y!r},{x!r}"
        for a, b, (x, y, z) in zip(t, walk.t, (-walk.accel / 9.80665).tolist())
    ]
    text = "\n".join(["time,seconds_elapsed,z,y,x", *rows])
    files["AccelerometerUncalibrated.csv"] = text.encode()
    same(sd.read(folder(tmp_path / "a", files)), walk)


def test_gravity_at_other_times_is_interpolated(tmp_path, walk):
    files = sensor_logger(walk, "ios")
    lines = files["Gravity.csv"].splitlines()
    files["Gravity.csv"] = b"\n".join([lines[0], *lines[1::7], lines[-1]])
    same(sd.read(folder(tmp_path / "a", files)), walk)


@pytest.mark.parametrize("separator, decimal", [(",", "."), (";", ","), ("\t", ","), ("\t", ".")])
def test_phyphox_in_every_way_it_writes(tmp_path, walk, separator, decimal):
    path = folder(tmp_path / "walk", phyphox(walk, separator, decimal))
    recording = sd.read(path)
    fixes = slice(1, None)  # the first has an accuracy of 669 m
    same(recording, walk, fixes=fixes, height_error=2.0)
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"
    assert recording.imu.t[-1] == pytest.approx(0.25 + walk.t[-1], abs=1e-5)
    lines = recording.meta["read"]
    assert any("1 fixes with an accuracy worse than 100 m" in line for line in lines)
    assert any("Linear Accelerometer: acceleration without gravity" in line for line in lines)
    velocity = next(each for each in recording.sources if each.kind == "velocity")
    assert len(velocity.t) == len(walk.fix_t) - 2  # and the second says -1


def test_pauses_of_phyphox_take_time(tmp_path, walk):
    """The experiment's own times leave pauses out; the clock of the recording does not."""
    files = phyphox(walk, pause=(8.0, 3.0))
    recording = sd.read(zipped(tmp_path / "walk.zip", files))
    t = recording.imu.t
    assert t[-1] - t[0] == pytest.approx(walk.t[-1] - walk.t[1], abs=0.02)
    assert not np.any((t > 8.27) & (t < 11.24))


def test_files_of_phyphox_one_by_one(tmp_path, walk):
    path = folder(tmp_path / "walk", phyphox(walk))
    names = ("Accelerometer", "Gyroscope", "Location")
    same(
        sd.read(*(path / f"{name}.csv" for name in names)),
        walk,
        fixes=slice(1, None),
        height_error=2.0,
    )


@pytest.mark.parametrize(
    "name, words",
    [
        ("Accelerometer", "no gyroscope in Accelerometer.csv; .*Accelerometer.csv Gyroscope.csv"),
        ("Gyroscope", "no accelerometer in Gyroscope.csv; .*Gyroscope.csv Accelerometer.csv"),
    ],
)
def test_the_file_that_is_missing_is_named(tmp_path, walk, name, words):
    path = folder(tmp_path / "walk", phyphox(walk)) / f"{name}.csv"
    with pytest.raises(DataError, match=words):
        sd.read(path)
    (problem,) = inspect(path).problems
    assert "name the file that has it too" in problem


def test_a_table_with_other_columns_than_its_head_is_left(tmp_path, walk):
    files = phyphox(walk)
    name = next(name for name in files if name.startswith("Accelerometer"))
    files[name] = files[name].replace(b",", b", ")
    path = folder(tmp_path / "walk", files)
    with pytest.raises(DataError) as error:
        sd.read(path)
    assert "fails" not in str(error.value)


def test_gnsslogger(tmp_path, walk):
    """The clock is the phone's, its zero what the fixes of satellites say: not the phone's UTC,
    which is half a second ahead."""
    path = tmp_path / "log.txt"
    path.write_bytes(gnsslogger(walk))
    recording = sd.read(path)
    assert recording.meta["epoch"] == "2024-05-01T00:00:00Z"
    assert recording.imu.t[-1] == pytest.approx(0.2513 + walk.t[-1], abs=0.0101)
    position = next(each for each in recording.sources if each.kind == "position")
    assert np.allclose(position.t, 0.25 + walk.fix_t, atol=1e-4)
    assert np.allclose(position.y[:, 0], np.radians(walk.fixes[:, 0]), atol=1e-10)
    assert np.allclose(position.std[:, :2], 3.0 / np.sqrt(-2 * np.log(0.32)), rtol=1e-3)
    lines = recording.meta["read"]
    assert any(f"{len(walk.fix_t)} of the provider FLP" in line for line in lines)
    assert any("+0.477 s off" in fact for fact in inspect(path).facts)
    # the gyro is read 1.3 ms after the accelerometer, which is interpolated to it
    assert any("have different times" in note for note in recording.meta["notes"])


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda files: files.pop("TotalAcceleration.csv"), None),
        (
            lambda files: [files.pop(f"{each}.csv") for each in ("TotalAcceleration", "Gravity")],
            r"Accelerometer\.csv does not contain gravity \(its median is 0\.\d+ m/s\^2\), .* record Gravity",
        ),
        (
            lambda files: files.pop("Gyroscope.csv"),
            "there is no gyroscope beside TotalAcceleration",
        ),
        (
            lambda files: [files.pop(name) for name in list(files) if "cc" in name or "G" in name],
            "no IMU in it; name its file too",
        ),
        (
            lambda files: files.update({"Gyroscope.csv": b"time,seconds_elapsed,z,y,x\n"}),
            "there is no gyroscope beside",
        ),
        (
            lambda files: files.update(
                {"Gyroscope.csv": files["Gyroscope.csv"][:5000] + b"\0\xff,a"}
            ),
            r"Gyroscope.csv\], line \d+, column '\w+'.* is not a number",
        ),
    ],
)
def test_what_is_missing_is_said_in_one_line(tmp_path, walk, change, words):
    files = sensor_logger(walk)
    change(files)
    path = folder(tmp_path / "walk", files)
    if words is None:
        return same(sd.read(path), walk, android=True)
    with pytest.raises(DataError, match=words) as error:
        sd.read(path)
    assert "\n" not in str(error.value)


def test_a_log_whose_sensors_are_useless_still_has_its_fixes(tmp_path, walk):
    """A thinned log beside an IMU of its own time."""
    lines = gnsslogger(walk).split(b"\n")
    thin = b"\n".join(line for k, line in enumerate(lines) if line[:5] != b"Uncal" or k % 200 == 0)
    path = tmp_path / "log.txt"
    path.write_bytes(thin)
    with pytest.raises(DataError, match="UncalGyro .*: 0.505 Hz is too slow .* 20 Hz are needed"):
        sd.read(path)
    files = sensor_logger(walk)
    del files["Location.csv"]
    recording = sd.read(folder(tmp_path / "imu", files), path)
    assert len(recording.sources[0].t) > 0


def test_folders_that_no_reader_knows(tmp_path, command):
    for make in (lambda path: None, lambda path: (path / "a.bin").write_bytes(b"a")):
        path = tmp_path / f"folder{make.__hash__()}"
        path.mkdir()
        make(path)
        for run in (sd.read, inspect):
            with pytest.raises(
                DataError, match="is a folder without files that a reader recognises"
            ) as error:
                run(path)
            assert "\n" not in str(error.value)
    code, _, err = command("fuse", str(path))
    assert code == 2 and len(err) == 1
    code, _, err = command("inspect", str(tmp_path / "nowhere"))
    assert code in (2, 3) and len(err) <= 1


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"PK\x05\x06" + 18 * b"\0", b"no zip"])
def test_damaged_archives(tmp_path, content):
    path = tmp_path / "walk.zip"
    path.write_bytes(content)
    with pytest.raises(DataError) as error:
        sd.read(path)
    assert "\n" not in str(error.value) and "walk.zip" in str(error.value)


def test_a_table_of_ones_own_is_no_phones(tmp_path):
    """Names that only begin like those of an app."""
    for head in ("Time (s),a,b", "time,gx,gy,gz", "# a table\nt,x"):
        path = tmp_path / "imu.csv"
        path.write_text(head + "\n1,2,3\n")
        assert find(path).name == "table"


def test_the_samples(data_folder):
    """Each is read or refused for what is known of it (native/README.md)."""
    phones = data_folder / NATIVE / "phone_csv"
    walk = sd.read(phones / "phyphox_pdr_105s")
    assert len(walk.imu.t) > 10_000
    (position,) = walk.sources
    assert len(position.t) == 33 and np.all(position.std[:, 0] <= 100)
    for name in ("sensorlogger_10s", "sensorlogger_tracker_24s"):
        with pytest.raises(DataError, match=r"Accelerometer\.csv does not contain gravity"):
            sd.read(phones / name)
    log = data_folder / NATIVE / "gnsslogger" / "pixel7_gnsslogger_v3.txt.xz"
    with pytest.raises(DataError, match="UncalGyro .*: 0.0177 Hz is too slow"):
        sd.read(log)
    assert any("94 fixes" in fact for fact in inspect(log).facts)


def test_the_rows_of_the_sample_field_by_field(data_folder):
    """Against the lines themselves, split by hand."""
    path = data_folder / NATIVE / "gnsslogger" / "pixel7_gnsslogger_v3.txt.xz"
    log = find(path).open(path)
    lines = read_bytes(path).decode().splitlines()
    for kind in ("UncalGyro", "UncalAccel", "UncalMag", "Fix"):
        rows = [line.split(",") for line in lines if line.startswith(f"{kind},")]
        if kind == "Fix":
            rows = [row for row in rows if row[1] == "GPS"]
        table = log.tables[kind]
        assert len(rows) == len(table.lines)
        names = next(line for line in lines if line.startswith(f"# {kind},"))[2:].split(",")
        for column, name in list(enumerate(names))[2:]:
            expected = [float(row[column] or "nan") for row in rows]
            assert np.array_equal(table.numbers(name), expected, equal_nan=True), (kind, name)
        assert [lines[number - 1].split(",")[0] for number in table.lines] == [kind] * len(rows)


@pytest.mark.parametrize("kind", [b"UncalGyro", b"UncalAccel"])
def test_the_least_rate_is_that_of_other_logs(tmp_path, walk, kind):
    """10 Hz, of either sensor, is refused as everywhere."""
    lines = gnsslogger(walk).split(b"\n")
    path = tmp_path / "log.txt"
    path.write_bytes(
        b"\n".join(line for k, line in enumerate(lines) if not line.startswith(kind) or k % 20 == 0)
    )
    with pytest.raises(
        DataError, match="Hz is too slow for samples of an IMU: at least 20 Hz are needed"
    ) as error:
        sd.read(path)
    assert "takes it" not in str(error.value)


def test_a_folder_is_looked_at_twice_and_no_more(tmp_path, walk, monkeypatch):
    """Whose it is is asked once by what is called and once where it is opened, not for each
    table."""
    asked = []
    real = registry._takes
    monkeypatch.setattr(
        registry, "_takes", lambda reader, path: asked.append(reader.name) or real(reader, path)
    )
    inspect(folder(tmp_path / "walk", phyphox(walk)))
    assert max(map(asked.count, asked)) == 2


def test_a_head_of_what_cannot_be_read_is_empty(tmp_path):
    (tmp_path / "a.ubx.xz").write_bytes(b"no xz")
    (tmp_path / "b.ubx").write_bytes(b"abcdef")
    for name, head in (("a.ubx.xz", b""), ("none", b""), ("", b""), ("b.ubx", b"abc")):
        assert head_of(tmp_path / name, 3) == head
