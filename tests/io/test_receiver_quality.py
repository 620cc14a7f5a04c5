"""Satellites, age of corrections and protection levels of a receiver: columns by which a description parts its
fixes into classes."""

import numpy as np
import pytest
import written_ubx as ubx

import strapdown as sd
from strapdown.io.description.logs import join, open_logs
from strapdown.io.readers.nmea import READER as NMEA
from strapdown.io.readers.ubx import open_ubx

pytestmark = pytest.mark.short
GPS = 1_300_000_000_000 // 1000 * 1000  # ms of GPS time
MANY = 60
AGES = {0: np.nan, 1: 1, 3: 5, 11: 120, 12: np.inf, 15: np.inf}
"""s, of the numbers of lastCorrectionAge (u-blox F9 interface description, NAV-PVT)."""


def log_of(path, satellites, ages, levels, valid=1):
    """A u-blox log whose fixes have these satellites, numbers of ages, and protection levels, m."""
    moments = GPS + 200 * np.arange(MANY)
    flags3 = np.asarray(ages) << 1
    data = ubx.pvt(moments, numSV=satellites, flags3=flags3).tobytes()
    path.write_bytes(data + ubx.protection(moments, levels, valid).tobytes())
    return moments


def test_the_columns_are_those_that_were_written(tmp_path):
    satellites = 4 + np.arange(MANY) % 9
    ages = np.array(list(AGES))[np.arange(MANY) % len(AGES)]
    levels = np.c_[np.arange(MANY), np.arange(MANY) + 0.5, 2.0 * np.arange(MANY)]
    log_of(tmp_path / "a.ubx", satellites, ages, levels)
    frame = open_ubx(tmp_path / "a.ubx").tables["NAV-PVT"].frame
    assert np.array_equal(frame["numSV"], satellites)
    np.testing.assert_array_equal(frame["correctionAge"], [AGES[each] for each in ages.tolist()])
    for k in range(3):
        np.testing.assert_allclose(frame[f"plPos{k + 1}"], levels[:, k])
    log_of(tmp_path / "a.ubx", satellites, ages, levels, valid=0)
    assert np.isnan(open_ubx(tmp_path / "a.ubx").tables["NAV-PVT"].frame["plPos1"]).all()


@pytest.mark.parametrize(
    "good, poor",
    [
        ('column = "numSV", least = 6', 'column = "numSV", most = 5'),
        ('column = "correctionAge", most = 30', 'column = "correctionAge", least = 31'),
        ('column = "plPos1", most = 10', 'column = "plPos1", least = 10.001'),
    ],
    ids=["satellites", "age", "protection"],
)
def test_a_description_parts_them_into_classes_of_one_receiver(tmp_path, good, poor):
    """Each with its own noise; what asks where the receiver was has all of them."""
    few = np.arange(MANY) % 3 == 0
    levels = np.where(few, 50.0, 2.0)[:, None] * np.ones(3)
    log_of(tmp_path / "a.ubx", np.where(few, 4, 9), np.where(few, 11, 1), levels)
    t = 0.01 * np.arange(1300)
    rows = np.c_[GPS / 1e3 + t, np.zeros((1300, 5)), np.full(1300, -9.81)]
    np.savetxt(tmp_path / "imu.csv", rows, delimiter=",", header="t,p,q,r,x,y,z", comments="")
    text = """[imu]
file = "imu.csv"
time = { column = "t", unit = "s", clock = "gps" }
gyro = { columns = ["p", "q", "r"], unit = "rad/s" }
accel = { columns = ["x", "y", "z"], unit = "m/s^2" }
"""
    for name, where, std in (("good", good, 1.0), ("poor", poor, 8.0)):
        text += f"""[[source]]
kind = "position"
file = "a.ubx"
table = "NAV-PVT"
time = {{ column = "gps_ms", unit = "ms", clock = "gps" }}
columns = ["lat", "lon", "height"]
unit = ["deg", "deg", "m"]
std = {std}
where = [{{ {where} }}]
receiver = "GNSS"
name = "GNSS position {name}"
"""
    (tmp_path / "recording.toml").write_text(text)
    one, other = sd.read(tmp_path / "recording.toml").sources
    assert (len(one.t), len(other.t)) == (40, 20)
    assert (one.std == 1.0).all() and (other.std == 8.0).all()
    assert one.receiver == other.receiver == "GNSS"


def test_the_draft_says_how_to_part_them(tmp_path):
    """In a line that holds as it stands: without the other classes, fixes with few satellites."""
    few = np.arange(MANY) % 3 == 0
    moments = log_of(tmp_path / "a.ubx", np.where(few, 4, 9), 0 * few, np.ones((MANY, 3)))
    rows = np.c_[moments[0] / 1e3 + 315964800 - 18 + 0.01 * np.arange(1300), np.zeros((1300, 5))]
    rows = np.c_[rows, np.full(1300, -9.81)]
    names = "unix_s,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2"
    np.savetxt(tmp_path / "imu.csv", rows, delimiter=",", header=names, comments="", fmt="%.4f")
    joined = join(open_logs([tmp_path / "imu.csv", tmp_path / "a.ubx"]))
    text = joined.text(tmp_path)
    (line,) = (each for each in text.splitlines() if "fewer satellites" in each)
    (tmp_path / "recording.toml").write_text(text.replace(line, line.lstrip("# "), 1))
    position = next(a for a in sd.read(tmp_path / "recording.toml").sources if a.kind == "position")
    assert len(position.t) == 40


def test_nmea_has_satellites_and_age(tmp_path):
    def sentence(body):
        check = 0
        for byte in body.encode():
            check ^= byte
        return f"${body}*{check:02X}\r\n"

    lines = [
        sentence(
            f"GPGGA,1200{k:02d}.00,4800.0000,N,01100.0000,E,4,{5 + k:02d},1.0,500.0,M,47.0,M,{k}.5,0001"
        )
        for k in range(5)
    ]
    (tmp_path / "a.nmea").write_text("".join(lines))
    frame = NMEA.open(tmp_path / "a.nmea").tables["GGA"].frame
    assert list(frame["satellites"]) == [5, 6, 7, 8, 9] and list(frame["age"]) == [
        0.5,
        1.5,
        2.5,
        3.5,
        4.5,
    ]
