"""ArduPilot's DataFlash logs: every field of the sample files against pymavlink, logs written by
ArduPilot's own tables against what they were written from, and what is wrong with such files."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
import written_dataflash as written
from jumped import HOUR, check_jump, in_order, jumping
from multicopter import motion

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.decoding.autopilots.dataflash import DataFlash
from strapdown.io.tables.table_file import read_bytes
from strapdown.units.time_scales import WEEK, iso

SAMPLES = (
    "copter_flight_dgps_51s.BIN",
    "sitl_copter410_25s.BIN",
    "sitl_copter410_gps_attack_64s.BIN",
)
EKF3 = {"AHRS_EKF_TYPE": 3.0, "GPS_DELAY_MS": 150.0}


@pytest.fixture(scope="module")
def flown():
    return sd.simulate(motion(), duration=20, imu="consumer", seed=3, rate=200.0)


@pytest.fixture
def log(tmp_path):
    """Function that writes messages and gives the path."""

    def write(messages, parameters=None, **more):
        path = tmp_path / "flight.bin"
        path.write_bytes(written.dataflash(messages, parameters or EKF3, **more))
        return path

    return write


def sample(data_folder, name):
    (path,) = (data_folder / "native" / "dataflash").glob(f"{name}*")
    return path


@pytest.mark.parametrize("name", [*SAMPLES[:2], pytest.param(SAMPLES[2], marks=pytest.mark.deep)])
def test_every_field_is_that_of_pymavlink(data_folder, tmp_path, name):
    readers = pytest.importorskip("pymavlink.DFReader")
    content = read_bytes(sample(data_folder, name))
    (tmp_path / "plain.BIN").write_bytes(content)
    theirs = readers.DFReader_binary(str(tmp_path / "plain.BIN"))
    found = defaultdict(lambda: defaultdict(list))
    while (message := theirs.recv_msg()) is not None:
        for field in message._fieldnames:
            found[message.get_type()][field].append(getattr(message, field))
    theirs.data_map.close()
    theirs.filehandle.close()
    ours = DataFlash(content)
    assert ours.counts == {name: len(next(iter(each.values()))) for name, each in found.items()}
    for message, columns in found.items():
        own = ours.columns(message)
        assert list(own) == list(columns)
        for field, values in columns.items():
            if own[field].dtype.kind == "S":
                texts = [each.decode("latin1") for each in own[field].tolist()]
                assert texts == [
                    each if isinstance(each, str) else each.decode("latin1") for each in values
                ]
            else:  # pymavlink multiplies by 1e-7 where we divide by 1e7
                np.testing.assert_allclose(own[field], values, rtol=3e-16, err_msg=field)


def test_a_written_flight_comes_back(flown, tmp_path):
    path = tmp_path / "flight.BIN"
    arms = {"GPS_POS1_X": 0.1, "GPS_POS1_Y": 0.0, "GPS_POS1_Z": -0.2}
    arms |= {"INS_POS1_X": 0.03, "INS_POS1_Y": 0.0, "INS_POS1_Z": 0.0}
    written.write(path, flown, {**EKF3, **arms}, later=0.15)
    found = sd.read(path)
    np.testing.assert_allclose(found.imu.t, flown.imu.t, atol=1e-6)
    np.testing.assert_allclose(found.imu.dtheta[1:], flown.imu.dtheta[1:], rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(found.imu.dv[1:], flown.imu.dv[1:], rtol=1e-3, atol=1e-7)
    position, velocity = found.sources
    expected, theirs = flown.sources
    np.testing.assert_allclose(position.t, expected.t, atol=1e-3)  # stamps of 1 ms
    np.testing.assert_allclose(position.y[:, :2], expected.y[:, :2], atol=1e-9)
    # EGM96 at 47.4 N 8.5 E
    np.testing.assert_allclose(position.y[:, 2] - expected.y[:, 2], 47.3, atol=0.3)
    np.testing.assert_allclose(velocity.y, theirs.y, atol=2e-5)
    np.testing.assert_allclose(position.std[:, 2], expected.std[:, 2], atol=0.005)
    np.testing.assert_allclose(position.parameters, [0.07, 0.0, -0.2], atol=1e-7)
    assert found.meta["vehicle"] == "multicopter"
    zero = iso(written.WEEK * WEEK + written.DAY)
    assert found.meta["epoch"][:18] == zero[:18]  # to the ms of its stamps
    assert "GPS_DELAY_MS of the log" in " ".join(found.meta["read"])


@pytest.mark.parametrize(
    "text, delay",
    [
        ("u-blox 1 HW: 00080000 SW: ROM CORE 3.01 (107888)", 0.12),
        ("u-blox 1 HW: 000A0000 SW: ROM SPG 5.10", 0.12),
        ("u-blox 1 HW: 00040007 SW: 7.03", 0.2),
        ("u-blox 2 HW: 00080000 SW: ROM CORE 3.01 (107888)", 0.2),
        ("GPS 1: detected as u-blox at 230400 baud", 0.2),
    ],
)
def test_the_delay_that_the_driver_knows(flown, log, text, delay):
    path = log(written.messages_of(flown, delay), {"GPS_DELAY_MS": 0.0}, texts=[text])
    found = sd.read(path)
    np.testing.assert_allclose(found.sources[0].t, flown.sources[0].t, atol=1e-3)
    read = " ".join(found.meta["read"])
    assert ("own value for u-blox HW 000" in read) == (delay == 0.12) and "names none" in read


def test_the_undulation_of_the_receiver_makes_heights_ellipsoidal(flown, log):
    messages = written.messages_of(flown)
    letters, columns = messages["GPA"]
    columns["Und"] = np.full(len(columns["TimeUS"]), -47.5)
    messages["GPA"] = letters + "f", columns
    position = sd.read(log(messages)).sources[0]
    np.testing.assert_allclose(position.y[:, 2] - flown.sources[0].y[:, 2], 47.5, atol=0.006)


def test_instances_by_column_and_by_name(flown, log):
    new = written.messages_of(flown, instances=2)
    letters, columns = new["IMU"]
    names = {0: "IMU", 1: "IMU2"}
    old = {
        name: (
            letters[0] + letters[2:],
            {key: each[columns["I"] == k] for key, each in columns.items() if key != "I"},
        )
        for k, name in names.items()
    }
    for messages in (new, old):
        path = log(messages)
        first, second = sd.read(path), sd.read(path, imu=1)
        assert len(first.imu.t) == len(second.imu.t) == len(flown.imu.t)
        np.testing.assert_allclose(first.imu.dv[1:], flown.imu.dv[1:], rtol=1e-3, atol=1e-7)
        np.testing.assert_allclose(second.imu.dv[1:], 1.1 * flown.imu.dv[1:], rtol=1e-3, atol=1e-6)
        with pytest.raises(sd.DataError, match="there is no IMU 2"):
            sd.read(path, imu=2)


def test_rows_without_a_fix_count_for_nothing(flown, log):
    """Such rows carry a wrong week, which must not set the clock."""
    messages = written.messages_of(flown)
    gps = messages["GPS"][1]
    many = len(gps["TimeUS"])
    none = np.arange(many) < many * 0.7
    gps["Status"] = np.where(none, 1, 3)
    gps["GWk"] = np.where(none, 1023, written.WEEK)
    found = sd.read(log(messages))
    assert len(found.sources[0].t) == many - none.sum()
    assert found.meta["epoch"].startswith(iso(written.WEEK * WEEK + written.DAY)[:18])
    assert any("rows without a 3D fix" in line for line in found.meta["read"])


def test_what_the_log_does_not_say_is_assumed(flown, log):
    messages = written.messages_of(flown)
    del messages["GPA"]
    found = sd.read(log(messages, {"AHRS_EKF_TYPE": 3.0, "EK3_VELNE_M_NSE": 0.4}))
    position, velocity = found.sources
    assert np.all(position.std == 0.5) and np.all(velocity.std == 0.4)
    np.testing.assert_allclose(position.t, flown.sources[0].t - 0.2, atol=1e-3)
    read = " ".join(found.meta["read"])
    assert "the default of EK3_POSNE_M_NSE" in read and "ArduPilot's default" in read


def test_the_older_filter_states_the_delay(flown, log):
    found = sd.read(log(written.messages_of(flown), {"AHRS_EKF_TYPE": 2.0, "EK2_GPS_DELAY": 220.0}))
    np.testing.assert_allclose(found.sources[0].t, flown.sources[0].t - 0.22, atol=1e-3)


def test_the_trim_is_the_mounting(flown, log):
    found = sd.read(log(written.messages_of(flown), {**EKF3, "AHRS_TRIM_Y": np.radians(2.0)}))
    np.testing.assert_allclose(np.degrees(found.meta["imu_mounting"]), [0, 2, 0], atol=1e-4)


@pytest.mark.parametrize(
    "every, said", [(20, "10 Hz is too slow"), (8, "25 Hz is slow"), (1, None)]
)
def test_the_rate_of_the_imu(flown, log, every, said):
    messages = written.messages_of(flown)
    letters, columns = messages["IMU"]
    messages["IMU"] = letters, {key: each[::every] for key, each in columns.items()}
    path = log(messages)
    if every == 20:
        with pytest.raises(sd.DataError, match=said) as refused:
            sd.read(path)
        assert "LOG_BITMASK" in str(refused.value)
    else:
        notes = [line for line in sd.read(path).meta["read"] if line.startswith("note")]
        assert bool(notes) == bool(said) and all(said in line for line in notes)


def test_samples_in_bad_health_are_not_used(flown, log):
    messages = written.messages_of(flown, instances=2)
    letters, columns = messages["IMU"]
    gyro, accel = np.ones((2, len(columns["TimeUS"])), int)
    gyro[200:220:2] = accel[210:224:2] = 0  # of the first
    columns["GyrX"][gyro == 0] = 30.0
    messages["IMU"] = letters + "BB", {**columns, "GH": gyro, "AH": accel}
    found = sd.read(log(messages))
    assert len(found.imu.t) == len(flown.imu.t) - 12
    assert np.abs(found.imu.dtheta / found.imu.dt[:, None]).max() < 20
    assert any("IMU 0: 12 of" in line and "health" in line for line in found.meta["read"])
    gyro[::2] = 0
    messages["IMU"] = letters + "BB", {**columns, "GH": gyro, "AH": accel}
    second = sd.read(log(messages))
    np.testing.assert_allclose(
        second.imu.dtheta[1:], 1.1 * flown.imu.dtheta[1:], rtol=1e-3, atol=1e-8
    )


def test_raw_samples_are_left(flown, log):
    messages = written.messages_of(flown)
    t = messages["IMU"][1]["TimeUS"]
    messages["GYR"] = "QBQfff", {key: t for key in ("TimeUS", "I", "SampleUS", "X", "Y", "Z")}
    read = sd.read(log(messages)).meta["read"]
    assert any("GYR: raw samples" in line for line in read)


def test_magnetometer_and_barometer(flown, log):
    t = written.microseconds(flown.imu.t[::20])
    messages = written.messages_of(flown)
    field = np.round([210, 20, 430] + 30 * np.sin(np.arange(len(t)))[:, None])
    good = np.arange(len(t)) % 5 > 0
    mag = dict(zip(("MagX", "MagY", "MagZ"), field.T, strict=True))
    messages["MAG"] = "QBhhhB", {"TimeUS": t, "I": 0 * t, **mag, "Health": good}
    messages["BARO"] = "QBf", {"TimeUS": t, "I": 0 * t, "Press": 95000 + np.arange(len(t))}
    found = {each.kind: each for each in sd.read(log(messages)).sources}
    np.testing.assert_allclose(found["magnetic-field"].y, 1e-7 * field[good], rtol=1e-9)
    np.testing.assert_allclose(found["magnetic-field"].std, 5e-6)
    np.testing.assert_allclose(found["pressure"].y[:, 0], 95000 + np.arange(len(t)))


def test_airspeed(flown, log):
    t = written.microseconds(flown.imu.t[::20])
    messages = written.messages_of(flown)
    good, airspeed = np.arange(len(t)) % 5 > 0, 20.0 + np.arange(len(t)) / 8
    messages["ARSP"] = "QBfB", {"TimeUS": t, "I": 0 * t, "Airspeed": airspeed, "H": good}
    (found,) = (
        each for each in sd.read(log(messages, EKF3)).sources if each.kind == "indicated-airspeed"
    )
    np.testing.assert_allclose(found.y[:, 0], airspeed[good])
    assert np.all(found.std == 1.4)


@pytest.mark.parametrize(
    "texts, parameters, vehicle",
    [
        (["ArduPlane V4.3"], {}, "aircraft"),
        (["ArduRover V4.3"], {}, "car"),
        (["ArduRover V4.3"], {"FRAME_CLASS": 2.0}, "ship"),
        ([], {"LAND_SPEED": 50.0}, "multicopter"),
        (["Blimp"], {}, None),
    ],
)
def test_the_vehicle(flown, log, texts, parameters, vehicle):
    path = log(written.messages_of(flown), {**EKF3, **parameters}, texts=texts)
    assert sd.read(path).meta.get("vehicle") == vehicle


def test_simulated_flights_score_against_their_truth(data_folder):
    for name in SAMPLES[1:]:
        recording = sd.read(sample(data_folder, name))
        truth = DataFlash(read_bytes(sample(data_folder, name))).columns("SIM")
        assert len(recording.reference.t) == len(truth["TimeUS"])
        error = sd.rms(sd.errors(sd.fuse(recording), recording.reference))
        assert max(error.position) < 0.3
        assert np.degrees(max(error.rph)) < 1


def test_the_real_flight_against_its_own_estimate(data_folder):
    """25 Hz of point samples under vibration: some degrees, and it says that it is in doubt."""
    recording = sd.read(sample(data_folder, SAMPLES[0]), reference=1)
    solution = sd.fuse(recording)
    error = sd.rms(sd.errors(solution, recording.reference))
    assert max(error.position) < 1.5 and np.degrees(max(error.rph)) < 8
    assert solution.verdict.word != "trusted"
    assert recording.meta["epoch"].startswith("2017-09-10T10:42:4")


def test_a_damaged_place_is_passed_over(flown):
    content = bytearray(written.dataflash(written.messages_of(flown), EKF3))
    whole, middle = DataFlash(bytes(content)), len(content) // 2
    content[middle : middle + 200] = np.random.default_rng(4).bytes(200)
    log = DataFlash(bytes(content))
    lost = sum(whole.counts.values()) - sum(log.counts.values())
    assert 1 <= lost <= 12 and log.damages >= 1 and log.unread < 500


def test_a_log_that_is_cut_anywhere_gives_its_beginning(flown):
    content = written.dataflash(written.messages_of(flown), EKF3)
    whole = DataFlash(content).columns("IMU")["TimeUS"]
    for end in [*range(3, 1500, 7), *range(4000, 4300)]:
        log = DataFlash(content[:end])
        rows = log.columns("IMU").get("TimeUS", np.array([]))
        np.testing.assert_array_equal(rows, whole[: len(rows)])
        assert log.unread == 0


def test_what_is_none_is_one_line(flown, tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(bytes(300))
    with pytest.raises(sd.DataError, match="flight.bin"):
        sd.read(path)
    path.write_bytes(written.dataflash({}, EKF3))
    with pytest.raises(sd.DataError, match="no IMU"):
        sd.read(path)


def test_a_declaration_that_contradicts_itself_is_left():
    content = bytearray(written.dataflash({"BAD": ("Qf", {"TimeUS": [1], "X": [2.0]})}))
    at = bytes(content).index(b"BAD\0")
    content[at + 4 : at + 6] = b"QQ"
    log = DataFlash(bytes(content))
    assert log.counts["BAD"] == 1 and log.columns("BAD") == {}


@pytest.mark.parametrize("jump", [HOUR, -HOUR])
def test_a_clock_that_jumps(flown, log, monkeypatch, jump):
    """By an hour on the way: forward it is a gap, which is said; back it is refused in one line."""
    messages = written.messages_of(flown)
    for _, columns in messages.values():
        columns["TimeUS"] = jumping(columns["TimeUS"], jump)
    messages["GPA"][1]["SMS"] = messages["GPA"][1]["TimeUS"] // 1000
    in_order(monkeypatch, written)
    check_jump(log(messages), flown, jump)


def test_the_temperature_of_the_imu_is_kept(flown, log):
    """The column T, where it is not the zeros of a simulator."""
    letters, imu = written.messages_of(flown)["IMU"]
    t = imu["TimeUS"] * 1e-6
    for of_none in (0 * t, 0 * t + np.nan, 0 * t - 273):
        path = log({"IMU": (letters + "f", imu | {"T": of_none})})
        assert "temperature" not in sd.read(path).meta
    path = log({"IMU": (letters + "f", imu | {"T": 25 + t})})
    degrees = sd.read(path).meta["temperature"]
    assert np.diff(degrees[:, 1]) == pytest.approx(np.diff(degrees[:, 0]), rel=1e-4)


@pytest.mark.parametrize("letters", ["Iffffff", "IffffffII"])
def test_a_log_with_times_in_ms(flown, tmp_path, letters):
    """Logs of 2013 to 2015, of which GPS has the boot clock as T."""
    path = tmp_path / "2014.bin"
    path.write_bytes(written.log_of_2014(flown, later=0.2, letters=letters))
    found = sd.read(path)
    np.testing.assert_allclose(found.imu.t, flown.imu.t, atol=0.6e-3)
    np.testing.assert_allclose(
        found.imu.dv / found.imu.dt[:, None], flown.imu.dv / flown.imu.dt[:, None], rtol=1e-6
    )
    position, velocity = found.sources
    expected, theirs = flown.sources
    np.testing.assert_allclose(position.t, expected.t, atol=1.1e-3)
    np.testing.assert_allclose(position.y[:, :2], expected.y[:, :2], atol=1e-9)
    np.testing.assert_allclose(velocity.y, theirs.y, atol=2e-2)
    assert found.meta["vehicle"] == "multicopter"
    assert found.meta["epoch"][:18] == iso(written.WEEK * WEEK + written.DAY)[:18]


def test_no_fix_of_an_old_log_is_no_fix(flown, tmp_path):
    path = tmp_path / "2014.bin"
    fixes = len(flown.sources[0].t)
    status = np.array([0, 1, 2, 3])[np.arange(fixes) % 4]
    path.write_bytes(written.log_of_2014(flown, status=status))
    found = sd.read(path)
    assert [len(a.t) for a in found.sources] == [np.count_nonzero(status == 3)] * 2
    lost = np.count_nonzero(status < 3)
    assert f"{lost} of {fixes} rows without a 3D fix" in " ".join(found.meta["read"])


@pytest.mark.parametrize(("every", "refused"), [(20, True), (12, True), (8, False)])
def test_an_old_log_is_refused_for_its_rate(flown, tmp_path, every, refused):
    """10, 16.7 and 25 Hz of point samples."""
    path = tmp_path / "2014.bin"
    slow = replace(flown, imu=type(flown.imu)(*(column[::every] for column in flown.imu)))
    path.write_bytes(written.log_of_2014(slow))
    if not refused:
        assert len(sd.read(path).imu.t) == len(slow.imu.t)
        return
    with pytest.raises(DataError, match=r"Hz is too slow .*20 Hz are needed.*IMU_FAST") as error:
        sd.read(path)
    assert "\n" not in str(error.value)
