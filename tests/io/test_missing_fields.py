"""Logs in which one field has another name, as of firmware of another version: each ends in a recording
or in one line."""

import re

import given_files
import looks
import numpy as np
import pytest
import written_dataflash
import written_phones
import written_ulog

import strapdown as sd

pytestmark = pytest.mark.short


def ulog():
    """A log of all topics that are read."""
    flown = given_files.car().between(20.0, 25.0)
    topics = written_ulog.topics_of(flown)
    t = topics["sensor_combined", 0]["timestamp"]
    n = len(flown.imu.t)
    dt = ("uint16_t", written_ulog.microseconds(flown.imu.dt))
    topics["vehicle_imu", 0] = {
        "timestamp": t,
        "timestamp_sample": t,
        "delta_angle": ("float", flown.imu.dtheta),
        "delta_velocity": ("float", flown.imu.dv),
        "delta_angle_dt": dt,
        "delta_velocity_dt": dt,
    }
    one = np.ones(n)
    topics["vehicle_magnetometer", 0] = {
        "timestamp": t,
        "magnetometer_ga": ("float", np.ones((n, 3))),
    }
    topics["vehicle_air_data", 0] = {"timestamp": t, "baro_pressure_pa": ("float", 95e3 * one)}
    for suffix in ("", "_groundtruth"):
        place = {name: ("double", value * one) for name, value in (("lat", 47.0), ("lon", 8.0))}
        place |= {"alt": ("float", 500 * one), "alt_ellipsoid": ("float", 547 * one)}
        topics[f"vehicle_global_position{suffix}", 0] = {"timestamp": t, **place}
        q = np.tile([1.0, 0, 0, 0], (n, 1))
        topics[f"vehicle_attitude{suffix}", 0] = {"timestamp": t, "q": ("float", q)}
        v = {name: ("float", 0 * one) for name in ("vx", "vy", "vz")}
        topics[f"vehicle_local_position{suffix}", 0] = {"timestamp": t, **v}
    return written_ulog.ulog(topics), {name for each in topics.values() for name in each}


def dataflash():
    """A log of IMU and receiver."""
    messages = written_dataflash.messages_of(given_files.car().between(20.0, 25.0))
    content = written_dataflash.dataflash(messages)
    return content, {name for _, columns in messages.values() for name in columns}


LOGS = {"flight.ulg": ulog(), "flight.bin": dataflash()}


def renamed(content, name):
    """The content in which a field of this name, between other signs, begins with another letter."""
    whole = rb"(?<![\w])" + re.escape(name.encode()) + rb"(?![\w])"
    found, many = re.subn(whole, b"x" + name.encode()[1:], content)
    assert many
    return found


@pytest.mark.parametrize(
    ("file", "name"), [(file, name) for file in LOGS for name in sorted(LOGS[file][1])]
)
def test_a_field_of_another_name_ends_in_a_recording_or_in_one_line(file, name, tmp_path):
    path = tmp_path / file
    path.write_bytes(renamed(LOGS[file][0], name))
    assert not looks.judged(looks.recording, [path], True)


@pytest.mark.parametrize("make", [written_phones.sensor_logger, written_phones.phyphox])
def test_a_column_of_another_name_of_a_phone_does_so_too(make, tmp_path):
    files = make(written_phones.signals(6.0))
    for number, (name, text) in enumerate(files.items()):
        for place, column in enumerate(re.split(b"[,;\t]", text.partition(b"\n")[0])):
            changed = {**files, name: text.replace(column, b"x" + column[1:], 1)}
            folder = tmp_path / f"{number}-{place}"
            written_phones.folder(folder, changed)
            assert not looks.judged(looks.recording, [folder], False), (name, column)


def test_a_receiver_without_a_velocity_is_left_and_the_rest_is_read(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(renamed(LOGS["flight.ulg"][0], "vel_d_m_s"))
    recording = sd.read(path)
    assert len(recording.imu.t) and not any(a.kind == "position" for a in recording.sources)
    left = "left: flight.ulg: sensor_gps 0: it has no vel_d_m_s; it is not taken"
    assert left in recording.meta["read"]
