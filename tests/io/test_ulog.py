"""PX4's ULog: every field of the sample files against pyulog, logs written by the specification
against what they were written from, and what is wrong with such files."""

import struct
from dataclasses import replace

import numpy as np
import pytest
import written_ulog as written
from jumped import HOUR, check_jump, in_order, jumping
from multicopter import motion

import strapdown as sd
from strapdown.io.decoding.autopilots.ulog import ULog
from strapdown.io.description.logs import join, open_logs
from strapdown.io.inspection import inspect
from strapdown.io.tables.table_file import read_bytes
from strapdown.preprocessing.receiver_classes import join_classes
from strapdown.units.time_scales import gps_from_unix, iso

SAMPLES = (
    "px4_small.ulg.xz",
    "px4_sitl_events.ulg.xz",
    "px4_sitl_groundtruth.ulg.xz",
    "ulog/fmuv6c_2gps_topics_6s.ulg*",
    "ulog/sitl_quad_groundtruth_38s.ulg*",
)
EKF2 = {"MAV_TYPE": 2, "EKF2_GPS_DELAY": 110.0}


@pytest.fixture(scope="module")
def flown():
    return sd.simulate(motion(), duration=20, imu="consumer", seed=3, rate=200.0)


@pytest.fixture
def log(tmp_path):
    """Function that writes topics and gives the path."""

    def write(topics, parameters=None, **more):
        path = tmp_path / "flight.ulg"
        path.write_bytes(written.ulog(topics, EKF2 if parameters is None else parameters, **more))
        return path

    return write


def sample(data_folder, pattern):
    (path,) = (data_folder / "native").glob(pattern)
    return path


@pytest.mark.parametrize("pattern", SAMPLES)
def test_every_field_is_that_of_pyulog(data_folder, tmp_path, pattern):
    pyulog = pytest.importorskip("pyulog")
    content = read_bytes(sample(data_folder, pattern))
    (tmp_path / "plain.ulg").write_bytes(content)
    ours, theirs = ULog(content), pyulog.ULog(str(tmp_path / "plain.ulg"))
    found = {(each.name, each.multi_id): len(each.data["timestamp"]) for each in theirs.data_list}
    assert ours.topics == found
    for topic in theirs.data_list:
        columns = ours.columns(topic.name, topic.multi_id)
        expected = {key: value for key, value in topic.data.items() if "_padding" not in key}
        assert set(columns) == set(expected)
        for key, value in expected.items():
            np.testing.assert_array_equal(columns[key], value, err_msg=f"{topic.name} {key}")
    parameters = {**theirs.initial_parameters}
    parameters |= {name: value for _, name, value in theirs.changed_parameters}
    assert {k: np.float32(v) for k, v in ours.parameters.items()} == {
        k: np.float32(v) for k, v in parameters.items()
    }
    assert sum(ours.dropouts) == sum(each.duration for each in theirs.dropouts)


def test_a_written_flight_comes_back(flown, tmp_path):
    path = tmp_path / "flight.ulg"
    arm = {f"EKF2_GPS_POS_{axis}": value for axis, value in zip("XYZ", (0.1, 0.0, -0.2))}
    arm |= {f"EKF2_IMU_POS_{axis}": value for axis, value in zip("XYZ", (0.03, 0.0, 0.0))}
    written.write(path, flown, {**EKF2, **arm}, later=0.11)
    found = sd.read(path)
    np.testing.assert_allclose(found.imu.t, flown.imu.t, atol=1e-6)
    np.testing.assert_allclose(found.imu.dtheta[1:], flown.imu.dtheta[1:], rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(found.imu.dv[1:], flown.imu.dv[1:], rtol=1e-3, atol=1e-7)
    for ours, theirs in zip(found.sources, flown.sources, strict=True):
        np.testing.assert_allclose(ours.t, theirs.t, atol=1e-6)  # the delay is taken off
        np.testing.assert_allclose(ours.y, theirs.y, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(ours.std[:, 0], theirs.std[:, 0], rtol=1e-6)
        np.testing.assert_allclose(ours.parameters, [0.07, 0.0, -0.2], atol=1e-7)
    assert found.meta["vehicle"] == "multicopter"
    zero = iso(float(gps_from_unix(written.EPOCH * 1e-6)))
    assert found.meta["epoch"] == zero
    assert "EKF2_GPS_DELAY of the log is 110 ms" in " ".join(found.meta["read"])


def increments_of(imu, every=1):
    """The topic vehicle_imu of samples, of which only every so-many-th is logged."""
    return {
        "timestamp": ("uint64_t", written.microseconds(imu.t)[::every] + 300),
        "timestamp_sample": ("uint64_t", written.microseconds(imu.t)[::every]),
        "delta_angle": ("float", imu.dtheta[::every]),
        "delta_velocity": ("float", imu.dv[::every]),
        "delta_angle_dt": ("uint16_t", written.microseconds(imu.dt)[::every]),
        "delta_velocity_dt": ("uint16_t", written.microseconds(imu.dt)[::every]),
    }


def test_each_vehicle_imu_at_full_rate_can_be_taken(flown, log):
    topics = written.topics_of(flown)
    other = flown.imu._replace(dtheta=flown.imu.dtheta * 1.25)
    topics["vehicle_imu", 0], topics["vehicle_imu", 1] = map(increments_of, (flown.imu, other))
    path = log(topics)
    first, second = sd.read(path), sd.read(path, imu=1)
    np.testing.assert_allclose(first.imu.dtheta[1:], flown.imu.dtheta[1:], atol=1e-8)
    np.testing.assert_allclose(second.imu.dtheta[1:], other.dtheta[1:], atol=1e-8)
    np.testing.assert_allclose(first.imu.t, flown.imu.t, atol=1e-6)  # the sample's time
    assert any("sensor_combined" in line and "same sensors" in line for line in first.meta["read"])


def test_the_imu_that_px4_selected_is_named(flown, log):
    many = len(flown.imu.t)
    topics = {
        ("vehicle_imu", each): {
            **increments_of(flown.imu),
            "accel_device_id": ("uint32_t", np.full(many, 10 + each)),
            "gyro_device_id": ("uint32_t", np.full(many, 20 + each)),
        }
        for each in (0, 1)
    }
    topics["sensor_selection", 0] = {
        "timestamp": ("uint64_t", [5, 9]),
        "accel_device_id": ("uint32_t", [10, 11]),
        "gyro_device_id": ("uint32_t", [20, 21]),
    }
    titles = [each.title for each in open_logs([log(topics)]).popitem()[1].sections[:2]]
    assert ["PX4 selected" in title for title in titles] == [False, True]


def test_increments_of_which_few_are_logged_are_mean_rates(flown, log):
    """Of 200 Hz every fourth is logged: 5 ms of each 20 ms."""
    topics = {("vehicle_imu", 0): increments_of(flown.imu, 4)}
    found = sd.read(log(topics)).imu
    assert np.isclose(np.median(found.dt), 0.02)
    expected = flown.imu.dtheta[::4] / flown.imu.dt[::4, None]
    np.testing.assert_allclose(found.dtheta / found.dt[:, None], expected, rtol=1e-4, atol=1e-6)


def test_a_slow_copy_of_the_increments_is_left(flown, log):
    topics = written.topics_of(flown)
    topics["vehicle_imu", 0] = increments_of(flown.imu, 100)
    found = sd.read(log(topics))
    assert np.isclose(np.median(found.imu.dt), 0.005)
    assert any("vehicle_imu 0, 2 Hz: too slow" in line for line in found.meta["read"])


def test_raw_sensors_where_there_is_nothing_better(flown, log):
    imu, topics = flown.imu, written.topics_of(flown)
    topics["sensor_combined", 0] = {
        key: (kind, values[::25]) for key, (kind, values) in topics["sensor_combined", 0].items()
    }
    for name, values in (("sensor_gyro", imu.dtheta), ("sensor_accel", imu.dv)):
        rates = values / imu.dt[:, None]
        late = 0 if name == "sensor_gyro" else 1000
        topics[name, 0] = {
            "timestamp": ("uint64_t", written.microseconds(imu.t) + late),
            **{axis: ("float", rates[:, k]) for k, axis in enumerate("xyz")},
        }
    found = sd.read(log(topics))
    same = np.searchsorted(imu.t, found.imu.t - 1e-6)  # the accelerometer begins 1 ms later
    assert len(imu.t) - len(same) <= 1
    np.testing.assert_allclose(found.imu.dtheta[1:], imu.dtheta[same][1:], atol=1e-8)
    read = " ".join(found.meta["read"])
    assert "raw sensors" in read and "sensor_combined 0, 8 Hz: too slow" in read


@pytest.mark.parametrize("every, said", [(25, "8 Hz is too slow"), (8, "25 Hz is slow"), (1, None)])
def test_the_rate_of_the_imu(flown, log, every, said):
    topics = written.topics_of(flown)
    topics["sensor_combined", 0] = {
        key: (kind, values[::every]) for key, (kind, values) in topics["sensor_combined", 0].items()
    }
    path = log(topics)
    if every == 25:
        with pytest.raises(sd.DataError, match=said) as refused:
            sd.read(path)
        assert "SDLOG_PROFILE" in str(refused.value) and "20 Hz are needed" in str(refused.value)
    else:
        notes = [line for line in sd.read(path).meta["read"] if line.startswith("note")]
        assert bool(notes) == bool(said) and all(said in line for line in notes)


def old_fixes(topic, **changes):
    """A topic of fixes as older versions write it: whole numbers of 1e-7 deg and mm."""
    named = {key: each for key, each in topic.items() if "itude" not in key}
    degrees = [topic[f"{key}_deg"][1] for key in ("latitude", "longitude")]
    heights = topic["altitude_msl_m"][1], topic["altitude_ellipsoid_m"][1]
    old = {
        "lat": ("int32_t", np.round(degrees[0] * 1e7)),
        "lon": ("int32_t", np.round(degrees[1] * 1e7)),
        "alt": ("int32_t", np.round(heights[0] * 1e3)),
        "alt_ellipsoid": ("int32_t", np.round(heights[1] * 1e3)),
    }
    return {**named, **old, **changes}


NEW = {"SENS_GPS0_DELAY": 80, "SENS_GPS1_DELAY": 110, "SENS_GPS0_ID": 0, "SENS_GPS1_ID": 0}
NEW |= {f"SENS_GPS{n}_OFF{axis}": 0.1 * n - 0.2 * i for n in (0, 1) for i, axis in enumerate("XYZ")}


@pytest.mark.parametrize("slot, late", [(0, 0.08), (1, 0.11)])
def test_delay_and_antenna_of_each_receiver(flown, log, slot, late):
    """As PX4 of 2026 names them: by the id of the device, else by the instance."""
    topics = written.topics_of(flown, late)
    fixes = topics.pop(("sensor_gps", 0))
    number = np.full(len(fixes["timestamp"][1]), 0xA5000001)
    identity = int(np.int32(np.uint32(0xA5000001)))
    by_instance = log({**topics, ("sensor_gps", slot): fixes}, NEW)
    found = [sd.read(by_instance)]
    topics["sensor_gps", 0] = {**fixes, "device_id": ("uint32_t", number)}
    found += [sd.read(log(topics, {**NEW, f"SENS_GPS{slot}_ID": identity}))]
    for each in found:
        position = each.sources[0]
        np.testing.assert_allclose(position.t, flown.sources[0].t, atol=1e-6)
        arm = np.array([0.0, -0.2, -0.4]) + 0.1 * slot * np.array([1, 1, 1])
        np.testing.assert_allclose(position.parameters, arm, atol=1e-7)
        assert f"SENS_GPS{slot}_DELAY of the log is" in " ".join(each.meta["read"])


def test_a_delay_that_px4_has_taken_off_already(flown, log):
    topics = written.topics_of(flown, 0.3)
    fixes = topics["sensor_gps", 0]
    sampled = np.asarray(fixes["timestamp"][1]) - 300_000
    fixes["timestamp_sample"] = "uint64_t", sampled
    found = sd.read(log(topics, NEW))
    np.testing.assert_allclose(found.sources[0].t, flown.sources[0].t, atol=1e-6)
    assert found.meta["epoch"] == iso(float(gps_from_unix(written.EPOCH * 1e-6)))
    assert "taken the receiver's delay off" in " ".join(found.meta["read"])
    # what the driver does not say, and what earlier versions did not use
    for values, parameters, late in ((0 * sampled, NEW, 0.08), (sampled, EKF2, 0.11)):
        fixes["timestamp_sample"] = "uint64_t", values
        found = sd.read(log(topics, parameters)).sources[0]
        np.testing.assert_allclose(found.t, flown.sources[0].t + 0.3 - late, atol=1e-6)


def test_a_delay_that_no_parameter_says_is_assumed(flown, log):
    found = sd.read(log(written.topics_of(flown), {"MAV_TYPE": 2}))
    np.testing.assert_allclose(found.sources[0].t, flown.sources[0].t, atol=1e-6)
    assert any("no delay of the receiver: 0 s" in line for line in found.meta["read"])
    known = sd.read(log(written.topics_of(flown), {"EKF2_GPS_DELAY": 0.0})).meta["read"]
    assert not any("delay" in line for line in known)


def test_older_fixes_are_whole_numbers(flown, log):
    topics = written.topics_of(flown)
    topics["vehicle_gps_position", 0] = old_fixes(topics.pop(("sensor_gps", 0)))
    found, expected = sd.read(log(topics)).sources[0], flown.sources[0]
    np.testing.assert_allclose(found.y[:, :2], expected.y[:, :2], atol=1e-9)
    np.testing.assert_allclose(found.y[:, 2], expected.y[:, 2], atol=1e-3)


def test_one_receiver_in_two_topics_is_taken_once(flown, log):
    topics = written.topics_of(flown)
    fixes = topics["sensor_gps", 0]
    slow = {key: (kind, np.asarray(values)[::5]) for key, (kind, values) in fixes.items()}
    topics["vehicle_gps_position", 0], topics["sensor_gps", 0] = fixes, slow
    found = sd.read(log(topics))
    assert len(found.sources) == 2 and len(found.sources[0].t) == len(fixes["timestamp"][1])
    assert any("sensor_gps" in line and "same receiver" in line for line in found.meta["read"])


def test_rows_without_a_3d_fix_are_not_used(flown, log):
    topics = written.topics_of(flown)
    many = len(topics["sensor_gps", 0]["timestamp"][1])
    types = np.full(many, 3)
    types[:6] = 0, 1, 2, 2, 8, 6  # 8 is extrapolated
    topics["sensor_gps", 0]["fix_type"] = "uint8_t", types
    found = sd.read(log(topics))
    assert [len(each.t) for each in join_classes(found.sources)] == [many - 5] * 2
    assert any("5 of" in line and "3D" in line for line in found.meta["read"])
    topics["sensor_gps", 0]["fix_type"] = "uint8_t", 0 * types
    assert sd.read(log(topics)).sources == ()


def test_what_the_receiver_does_not_say_is_assumed(flown, log):
    topics = written.topics_of(flown)
    fixes = topics["sensor_gps", 0]
    zero = np.zeros(len(fixes["timestamp"][1]))
    fixes |= {"eph": ("float", zero), "altitude_ellipsoid_m": ("double", zero)}
    fixes |= {"vel_ned_valid": ("bool", zero), "time_utc_usec": ("uint64_t", zero)}
    found = sd.read(log(topics, {**EKF2, "EKF2_GPS_P_NOISE": 0.7}))
    (position,) = found.sources
    assert np.all(position.std == 0.7)
    # EGM96 at 47.4 N 8.5 E is 47.3 m, and the file was written with 47 m
    np.testing.assert_allclose(position.y[:, 2] - flown.sources[0].y[:, 2], 0.3, atol=0.3)
    assert "epoch" not in found.meta
    read = " ".join(found.meta["read"])
    assert "EKF2_GPS_P_NOISE of the log" in read and "vel_ned_valid is 0" in read
    assert len(sd.read(log(topics), gnss=0).sources) == 2


@pytest.mark.parametrize("old", [False, True])
def test_ellipsoid_heights_that_are_those_above_sea_level(flown, log, old):
    """As PX4's simulators write them."""
    topics = written.topics_of(flown)
    fixes = topics["sensor_gps", 0]
    fixes["altitude_ellipsoid_m"] = fixes["altitude_msl_m"]
    if old:
        topics["vehicle_gps_position", 0] = old_fixes(topics.pop(("sensor_gps", 0)))
    found = sd.read(log(topics))
    # EGM96 at 47.4 N 8.5 E is 47.3 m, and the file was written with 47 m
    height = found.sources[0].y[:, 2]
    np.testing.assert_allclose(height - flown.sources[0].y[:, 2], 0.3, atol=0.3)
    assert any("are equal in all rows" in line for line in found.meta["read"])


def test_true_heights_of_a_simulator_are_above_sea_level_as_its_fixes(flown, log):
    topics, degrees = written.topics_of(flown), np.degrees(flown.reference.lla)
    t = written.microseconds(flown.reference.t)
    height = flown.reference.lla[:, 2] - 47
    topics["vehicle_global_position_groundtruth", 0] = {
        "timestamp": ("uint64_t", t),
        "lat": ("double", degrees[:, 0]),
        "lon": ("double", degrees[:, 1]),
        "alt": ("float", height),
        "alt_ellipsoid": ("float", height),
    }
    q = np.tile([1.0, 0, 0, 0], (len(t), 1))
    topics["vehicle_attitude_groundtruth", 0] = {
        "timestamp": ("uint64_t", t),
        "q": ("float", q),
    }
    found = sd.read(log(topics))
    assert np.allclose(found.reference.lla[:, 2] - flown.reference.lla[:, 2], 0.3, atol=0.3)
    assert any("truth; heights above" in line for line in found.meta["read"])


def test_magnetometer_and_barometer(flown, log):
    t = written.microseconds(flown.imu.t[::10])
    topics = written.topics_of(flown)
    field = np.tile([0.21, 0.02, 0.43], (len(t), 1)) + 1e-4 * np.sin(np.arange(len(t)))[:, None]
    topics["vehicle_magnetometer", 0] = {
        "timestamp": ("uint64_t", t + 5000),
        "timestamp_sample": ("uint64_t", t),
        "magnetometer_ga": ("float", field),
    }
    pressure = 95000 + np.arange(len(t))
    topics["vehicle_air_data", 0] = {
        "timestamp": ("uint64_t", t),
        "baro_pressure_pa": ("float", pressure),
    }
    path = log(topics, {**EKF2, "EKF2_BARO_NOISE": 2.5})
    found = {each.kind: each for each in sd.read(path).sources}
    np.testing.assert_allclose(found["magnetic-field"].y, 1e-4 * field, rtol=1e-6)
    np.testing.assert_allclose(found["magnetic-field"].std, 5e-6)
    np.testing.assert_allclose(found["magnetic-field"].t, flown.imu.t[::10], atol=1e-6)
    np.testing.assert_allclose(found["pressure"].y[:, 0], pressure)
    assert np.all(found["pressure"].std == 2.5)
    assert "magnetic-field" not in {
        each.kind for each in sd.read(path, magnetometer=None, barometer=None).sources
    }


def test_a_vector_between_two_antennas_is_left_until_asked_for(flown, log):
    """Rows without a carrier solution to an antenna that moves along are counted."""
    t = written.microseconds(flown.imu.t[::10])
    vectors = np.tile([0.8, -0.6, 0.03125], (len(t), 1)) + np.arange(len(t))[:, None] / 1024
    flags = np.ones((len(t), 5))
    flags[0, 1], flags[1, 2], flags[2, 3:] = 0, 0, 0
    names = (
        "gnss_fix_ok relative_position_valid moving_base_mode carrier_solution_fixed "
        "carrier_solution_floating"
    ).split()
    topics = written.topics_of(flown)
    topics["sensor_gnss_relative", 0] = {
        "timestamp": ("uint64_t", t),
        "position": ("float", vectors),
        "position_accuracy": ("float", np.full((len(t), 3), 0.0078125)),
        **{name: ("bool", column) for name, column in zip(names, flags.T)},
    }
    path = log(topics, EKF2)
    joined = join(open_logs([path]))
    assert "baseline" not in {each.section.role for each in joined.taken}
    (opened,) = open_logs([path]).values()
    assert any(f"3 of {len(t)} rows without a carrier" in line for line in opened.left)
    (source,) = (a for a in sd.read(path, baseline=0).sources if a.kind == "baseline")
    np.testing.assert_allclose(source.y, vectors[3:], rtol=1e-6)
    assert np.all(source.std == 0.0078125)
    assert abs(source.t[0] - (flown.imu.t[30] - 1e-3 * EKF2.get("EKF2_GPS_DELAY", 0.0))) < 1e-3


@pytest.mark.parametrize("topic", ["airspeed", "airspeed_validated"])
def test_airspeed_is_that_of_a_sensor(flown, log, topic):
    """Not ground speed less wind, which PX4 puts in its place where a sensor fails."""
    t = written.microseconds(flown.imu.t[::10])
    airspeed, index = 20.0 + np.arange(len(t)) / 8, np.arange(len(t)) % 3
    topics = written.topics_of(flown)
    topics[topic, 0] = {
        "timestamp": ("uint64_t", t),
        "true_airspeed_m_s": ("float", airspeed),
        "selected_airspeed_index": ("int32_t", index),
    }
    if topic == "airspeed":
        del topics[topic, 0]["selected_airspeed_index"]
        index = index + 1
    (found,) = (
        each
        for each in sd.read(log(topics, {**EKF2, "EKF2_EAS_NOISE": 1.2})).sources
        if each.kind == "true-airspeed"
    )
    np.testing.assert_allclose(found.y[:, 0], airspeed[index > 0])
    assert np.all(found.std == 1.2)


def test_a_log_whose_airspeed_is_of_no_sensor_has_none(flown, log):
    t = written.microseconds(flown.imu.t[::10])
    topics = written.topics_of(flown)
    topics["airspeed_validated", 0] = {
        "timestamp": ("uint64_t", t),
        "true_airspeed_m_s": ("float", np.full(len(t), 20.0)),
        "selected_airspeed_index": ("int32_t", np.where(np.arange(len(t)) % 2, 0, -1)),
    }
    assert "true-airspeed" not in {each.kind for each in sd.read(log(topics)).sources}


def test_the_truth_is_the_reference_and_the_estimate_is_left(data_folder):
    path = sample(data_folder, SAMPLES[4])
    joined = join(open_logs([path]))
    taken = {(each.section.role, each.section.instance) for each in joined.taken}
    assert ("reference", 0) in taken
    recording = sd.read(path)
    rows = ULog(read_bytes(path)).columns("vehicle_global_position_groundtruth")
    np.testing.assert_allclose(np.degrees(recording.reference.lla[:, 0]), rows["lat"], atol=1e-12)
    solution = sd.fuse(recording)
    error = sd.rms(sd.errors(solution, recording.reference))
    assert max(error.position[:2]) < 0.4  # the file's true heights are those of a mirrored flight
    assert np.degrees(max(error.rph[:2])) < 1.5 and np.degrees(error.rph[2]) < 5


def test_the_clock_of_a_simulator_that_counts_from_1970(data_folder):
    recording = sd.read(sample(data_folder, SAMPLES[1]))
    assert recording.meta["epoch"].startswith("2024-03-18T00:00:00")
    assert 0 < recording.imu.t[0] < 86400
    assert np.isclose(np.median(recording.imu.dt), 0.004, atol=1e-9)


def test_a_parameter_that_is_changed_on_the_way_is_said(flown, log):
    later = written.parameter("EKF2_GPS_DELAY", 150.0)
    found = sd.read(log(written.topics_of(flown), between=later))
    assert any("was changed during the log, from 110 to 150" in line for line in found.meta["read"])


def test_nested_types_arrays_and_padding():
    """A type within a type, an array of them, and padding that is not logged at the end."""
    bytes_of = written.message
    head = written.ulog({})
    head += bytes_of("F", b"point:float x;uint8_t[2] flags;uint8_t[2] _padding0;")
    head += bytes_of("F", b"both:uint64_t timestamp;point[2] at;uint8_t last;uint8_t[7] _padding1;")
    head += bytes_of("A", struct.pack("<BH", 3, 7) + b"both")
    body = struct.pack("<HQ", 7, 99)
    body += struct.pack("<fBB2x", 1.5, 4, 5) + struct.pack("<fBB2x", 2.5, 6, 7) + b"\x09"
    found = ULog(head + bytes_of("D", body)).columns("both", 3)
    assert {key: value[0] for key, value in found.items()} == {
        "timestamp": 99,
        "at[0].x": 1.5,
        "at[0].flags[0]": 4,
        "at[0].flags[1]": 5,
        "at[1].x": 2.5,
        "at[1].flags[0]": 6,
        "at[1].flags[1]": 7,
        "last": 9,
    }


def test_a_format_that_contains_itself_is_left():
    bytes_of = written.message
    head = written.ulog({}) + bytes_of("F", b"knot:uint64_t timestamp;knot[65535] inside;")
    head += bytes_of("A", struct.pack("<BH", 0, 1) + b"knot")
    log = ULog(head + bytes_of("D", struct.pack("<HQ", 1, 5)))
    assert log.topics == {}


def test_a_format_that_has_a_field_twice_is_left_and_said(flown, log):
    topics = written.topics_of(flown)
    path = log(topics)
    path.write_bytes(path.read_bytes().replace(b"float eph;", b"float epv;"))
    assert [each.kind for each in sd.read(path).sources] == []
    remark = "1 topic not read: the format is missing or inconsistent"
    assert remark in str(inspect(path))


def test_dropouts_and_unknown_messages_are_passed(flown, log):
    between = written.message("O", struct.pack("<H", 30))
    between += written.message("S", bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12]))
    between += written.message("Q", b"\x01\x0cfloat ABSENT" + struct.pack("<f", 1.0))
    between += written.message("L", b"6" + struct.pack("<Q", 5) + b"armed")
    found = sd.read(log(written.topics_of(flown), between=between))
    assert len(found.imu.t) == len(flown.imu.t)
    assert any("1 dropout of the logger, 30 ms" in line for line in found.meta["read"])


def test_appended_data_are_read(flown):
    """Data that are appended after a crash: their place is in the flags, and the record before it
    may be cut short."""
    content = bytearray(written.ulog(written.topics_of(flown), EKF2))
    cut = len(content) - 40
    record = written.data_records(0, written.topics_of(flown)["sensor_combined", 0])[-1].tobytes()
    content = content[:cut] + record
    content[16 + 11] = 1
    content[16 + 19 : 16 + 27] = struct.pack("<Q", cut)
    log = ULog(bytes(content))
    assert log.columns("sensor_combined")["timestamp"][-1] == written.microseconds(flown.imu.t)[-1]
    assert log.unread == 0 and log.cut > 0


def test_a_damaged_place_is_passed_over(flown):
    whole = written.ulog(written.topics_of(flown), EKF2)
    clean = ULog(whole)
    content = bytearray(whole)
    middle = len(content) // 2
    content[middle : middle + 200] = np.random.default_rng(4).bytes(200)
    log = ULog(bytes(content))
    lost = sum(clean.topics.values()) - sum(log.topics.values())
    assert 1 <= lost <= 10 and log.damages >= 1 and log.unread < 500
    assert any("damaged place" in line for line in log.remarks)


def test_a_log_that_is_cut_anywhere_gives_its_beginning(flown):
    brief = replace(flown, imu=type(flown.imu)(*(each[:60] for each in flown.imu)), sources=())
    content = written.ulog(written.topics_of(brief), EKF2)
    whole = ULog(content).columns("sensor_combined")
    for end in range(16, len(content), 7):
        log = ULog(content[:end])
        rows = log.columns("sensor_combined").get("timestamp", np.array([]))
        np.testing.assert_array_equal(rows, whole["timestamp"][: len(rows)])
        assert log.unread == 0


@pytest.mark.parametrize("end", [0, 5, 100, 300])
def test_a_log_without_samples_is_one_line(flown, tmp_path, end):
    path = tmp_path / "short.ulg"
    path.write_bytes(written.ulog(written.topics_of(flown), EKF2)[:end])
    with pytest.raises(sd.DataError) as refused:
        sd.read(path)
    assert "short.ulg" in str(refused.value) and len(str(refused.value).splitlines()) == 1


def test_what_is_no_ulog_and_what_is_too_new(flown, tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(b"ULug" + bytes(100))
    with pytest.raises(sd.DataError, match="is not a ULog"):
        sd.read(path)
    content = bytearray(written.ulog(written.topics_of(flown)))
    content[16 + 11] = 4
    path.write_bytes(bytes(content))
    with pytest.raises(sd.DataError, match="incompatible flags"):
        sd.read(path)


def test_late_and_stray_samples(flown, log):
    topics = written.topics_of(flown)
    order = np.arange(len(flown.imu.t))
    order[100:103] = 102, 100, 101
    topics["sensor_combined", 0] = {
        key: (kind, values[order]) for key, (kind, values) in topics["sensor_combined", 0].items()
    }
    content = [written.data_records(0, topics["sensor_combined", 0])]
    path = log({("sensor_combined", 0): topics["sensor_combined", 0]})
    head = path.read_bytes()[: -content[0].size]
    path.write_bytes(head + content[0].tobytes())
    np.testing.assert_allclose(sd.read(path).imu.t, flown.imu.t, atol=1e-6)
    t = topics["sensor_combined", 0]["timestamp"][1]
    topics["sensor_combined", 0]["timestamp"] = "uint64_t", np.where(order > 2000, t - 9_000_000, t)
    content = written.data_records(0, topics["sensor_combined", 0])
    path.write_bytes(head + content.tobytes())
    with pytest.raises(sd.DataError, match="time goes back"):
        sd.read(path)


@pytest.mark.parametrize("jump", [HOUR, -HOUR])
def test_a_clock_that_jumps(flown, log, monkeypatch, jump):
    """By an hour on the way: forward it is a gap, which is said; back it is refused in one line."""
    topics = written.topics_of(flown)
    for key, topic in topics.items():
        kind, t = topic["timestamp"]
        topics[key] = topic | {"timestamp": (kind, jumping(t, jump))}
    in_order(monkeypatch, written)
    check_jump(log(topics), flown, jump)


def thermometer(t, degrees):
    """A topic `sensor_accel` at times t (n,) s with a temperature."""
    return {
        "timestamp": ("uint64_t", written.microseconds(t)),
        "temperature": ("float", degrees),
    }


def test_the_temperature_of_the_imu_is_kept(flown, log):
    """Of the IMU that is read, where the log says which one that is; not the zeros of a
    simulator."""
    topics, t = written.topics_of(flown), np.arange(0.0, 20.0, 0.5)
    warm = {("sensor_accel", 0): thermometer(t, 30 + t)}
    degrees = sd.read(log(topics | warm)).meta["temperature"]
    assert degrees[:, 1] == pytest.approx(30 + degrees[:, 0]) and len(degrees) == 20
    cold = {("sensor_accel", 0): thermometer(t, 0 * t)}
    two = warm | {("sensor_accel", 1): thermometer(t, 20 + t)}
    for others in ({}, cold, two):
        assert "temperature" not in sd.read(log(topics | others)).meta
