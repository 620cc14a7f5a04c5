"""Logs of phones written by the formats' own pages from signals that are known: what a reader must
give back."""

import io
import zipfile
from typing import NamedTuple

import numpy as np
import pandas as pd

START = 1_714_521_600_250_000_000
"""2024-05-01 00:00:00.25 UTC, POSIX ns."""
BOOT = 16_000_000_000_000
"""The phone's clock at START, ns."""


class Signals(NamedTuple):
    """A phone that turns and sways while it is carried north-east, in its axes (x right, y top, z
    out of the screen)."""

    t: np.ndarray  # s since START
    gyro: np.ndarray  # rad/s
    accel: np.ndarray  # specific force, m/s^2
    fix_t: np.ndarray
    fixes: np.ndarray  # latitude, longitude in deg, height in m above the ellipsoid
    speed: np.ndarray
    course: np.ndarray  # deg


def signals(seconds=20.0, rate=100.0, fix_rate=1.0, seed=5):
    """Signals; the noise is that of a phone, the fixes have none."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * rate)) / rate
    gyro = 0.2 * np.sin(np.outer(t, [0.7, 1.1, 0.5])) + rng.normal(0, 2e-3, (len(t), 3))
    sway = 0.8 * np.sin(np.outer(t, [3.1, 2.7, 4.1]))
    accel = sway + [0.5, 4.0, 8.9] + rng.normal(0, 0.02, (len(t), 3))
    fix_t = 0.5 + np.arange(int((seconds - 0.5) * fix_rate)) / fix_rate
    speed, course = 1.2 + 0.1 * np.sin(fix_t), np.full(len(fix_t), 45.0)
    path = np.cumsum(speed) / fix_rate * np.sqrt(0.5)
    latitude = 43.565 + np.degrees(path / 6.37e6)
    longitude = 1.39 + np.degrees(path / 6.38e6 / np.cos(np.radians(43.565)))
    fixes = np.stack([latitude, longitude, 205.0 + 0.1 * fix_t], axis=1)
    return Signals(t, gyro, accel, fix_t, fixes, speed, course)


def stamps(t):
    return START + np.round(t * 1e9).astype(np.int64)


def _csv(columns, separator=",", decimal=".", quoted=False):
    """Text of a table."""
    frame = pd.DataFrame(columns)
    if len(frame) > 10_000:  # an hour: pandas would take half a minute
        import pyarrow
        from pyarrow import csv

        out = io.BytesIO()
        csv.write_csv(pyarrow.Table.from_pandas(frame, preserve_index=False), out)
        return out.getvalue()
    quoting = {"quoting": 2} if quoted else {}
    text = frame.to_csv(index=False, sep=separator, decimal=decimal, header=False)
    head = frame.iloc[:0].to_csv(index=False, sep=separator, **quoting)
    return (head + text).encode()


def sensor_logger(s, platform="android", standardised="false", metadata=True):
    """{name: content} of a recording of Sensor Logger (UNITS.md, COORDINATES.md): an iPhone has
    gravity apart and everything of acceleration with the opposite sign."""
    time = {"time": stamps(s.t), "seconds_elapsed": s.t}

    def vector(values):
        return _csv(time | dict(zip("zyx", values.T[::-1])))

    sign = -1.0 if platform == "ios" and standardised == "false" else 1.0
    gravity = np.tile(sign * np.array([0.5, 4.0, 8.9]), (len(s.t), 1))
    files = {
        "Accelerometer": vector(sign * s.accel - gravity),
        "Gyroscope": vector(s.gyro),
        "Gravity": vector(gravity),
        "Magnetometer": vector(np.tile([5.0, 20.0, -40.0], (len(s.t), 1))),
    }
    if platform == "android":
        files["TotalAcceleration"] = vector(s.accel)
    fix = {"time": stamps(s.fix_t), "seconds_elapsed": s.fix_t, "bearingAccuracy": 10.0}
    fix |= {"speedAccuracy": 0.3, "verticalAccuracy": 5.0, "horizontalAccuracy": 3.0}
    fix |= {"speed": s.speed, "bearing": s.course, "altitude": s.fixes[:, 2]}
    if platform == "ios":
        fix["altitudeAboveMeanSeaLevel"] = s.fixes[:, 2] - 49.0
    fix |= {"longitude": s.fixes[:, 1], "latitude": s.fixes[:, 0]}
    files["Location"] = _csv(fix)
    pressure = 1000.0 - 0.1 * s.t[::10]
    files["Barometer"] = _csv(
        {"time": stamps(s.t[::10]), "seconds_elapsed": s.t[::10]}
        | {"relativeAltitude": 0.0 * pressure, "pressure": pressure}
    )
    if metadata:
        files["Metadata"] = (
            "version,device name,platform,appVersion,standardisation\n"
            f"3,Phone,{platform},1.64,{standardised}\n"
        ).encode()
    return {f"{name}.csv": content for name, content in files.items()}


def phyphox(s, separator=",", decimal=".", pause=None, geoid=49.0):
    """{name: content} of an export of phyphox; with `pause` (at, for) in s the experiment stood
    still for a while. Its heights are the phone's less the geoid."""
    at, long = pause or (np.inf, 0.0)

    def table(t, names, values):
        t = np.where(t > at, t - long, t)
        return _csv({"Time (s)": t} | dict(zip(names, values.T)), separator, decimal, quoted=True)

    running = (s.t <= at) | (s.t > at + long)
    fixing = (s.fix_t <= at) | (s.fix_t > at + long)
    files = {
        "Accelerometer": table(
            s.t[running], [f"{axis} (m/s^2)" for axis in "XYZ"], s.accel[running]
        ),
        "Gyroscope": table(s.t[running], [f"{axis} (rad/s)" for axis in "XYZ"], s.gyro[running]),
        "Magnetometer": table(
            s.t[running],
            [f"{axis} (µT)" for axis in "XYZ"],
            np.tile([5.0, 20.0, -40.0], (running.sum(), 1)),
        ),
        "Linear Accelerometer": table(
            s.t[running], [f"{axis} (m/s^2)" for axis in "XYZ"], s.accel[running] - [0.5, 4.0, 8.9]
        ),
    }
    names = ["Latitude (°)", "Longitude (°)", "Height (m)", "Velocity (m/s)", "Direction (°)"]
    names += ["Horizontal Accuracy (m)", "Vertical Accuracy (°)"]
    accuracy = np.tile([3.0, 5.0], (len(s.fix_t), 1))
    values = np.c_[s.fixes - [0, 0, geoid], s.speed, s.course, accuracy]
    values[0, 5:], values[1, 3:5] = 669.0, -1.0
    files["Location"] = table(s.fix_t[fixing], names, values[fixing])
    files["meta/time"] = times(at, long, s.t[-1])
    return {f"{name}.csv": content for name, content in files.items()}


def times(at, long, end):
    """`meta/time.csv`, whose times are seconds with three decimals."""
    rows = ['"event","experiment time","system time","system time text"']
    start = START * 1e-9
    events = [("START", 0.0, start)]
    if np.isfinite(at):
        events += [("PAUSE", at, start + at), ("START", at, start + at + long)]
    events.append(("PAUSE", end - long, start + end))
    rows += [f'"{event}",{t:.9E},{when:.3f},"then"' for event, t, when in events]
    return ("\n".join(rows) + "\n").encode()


HEADER = """#
# Header Description:
#
# Version: v3.0.6.4 Platform: 14 Manufacturer: Google Model: Pixel 7
#
# Raw,utcTimeMillis,TimeNanos
#
# UncalAccel,utcTimeMillis,elapsedRealtimeNanos,UncalAccelXMps2,UncalAccelYMps2,UncalAccelZMps2,BiasXMps2,BiasYMps2,BiasZMps2
# Accel,utcTimeMillis,elapsedRealtimeNanos,AccelXMps2,AccelYMps2,AccelZMps2
# UncalGyro,utcTimeMillis,elapsedRealtimeNanos,UncalGyroXRadPerSec,UncalGyroYRadPerSec,UncalGyroZRadPerSec,DriftXRadPerSec,DriftYRadPerSec,DriftZRadPerSec
# UncalMag,utcTimeMillis,elapsedRealtimeNanos,UncalMagXMicroT,UncalMagYMicroT,UncalMagZMicroT,BiasXMicroT,BiasYMicroT,BiasZMicroT
# OrientationDeg,utcTimeMillis,elapsedRealtimeNanos,yawDeg,rollDeg,pitchDeg
# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,elapsedRealtimeNanos,VerticalAccuracyMeters,MockLocation
#
"""


def gnsslogger(s, phone_ahead=0.477):
    """Content of a log of GnssLogger (LOGGING_FORMAT.md), rows in the order of time; the phone's own
    UTC is `phone_ahead` s ahead."""
    rows = []
    for kind, values, shift in (
        ("UncalAccel", s.accel, 0),
        ("UncalGyro", s.gyro, 1_300_000),
        ("UncalMag", np.tile([5.0, 20.0, -40.0], (len(s.t), 1)), 2_000_000),
    ):
        elapsed = BOOT + np.round(s.t * 1e9).astype(np.int64) + shift
        utc = (START + elapsed - BOOT + round(phone_ahead * 1e9)) // 1_000_000
        rows += [
            (e, f"{kind},{u},{e},{x!r},{y!r},{z!r},0.0,0.0,0.0")
            for u, e, (x, y, z) in zip(utc.tolist(), elapsed.tolist(), values.tolist())
        ]
    for t, (latitude, longitude, height), speed, course in zip(
        s.fix_t, s.fixes.tolist(), s.speed, s.course
    ):
        e, u = BOOT + round(t * 1e9), (START + round(t * 1e9)) // 1_000_000
        for provider, off in (("GPS", 0.0), ("FLP", 1e-4), ("NLP", 1e-3)):
            rows.append(
                (
                    e,
                    f"Fix,{provider},{latitude + off!r},{longitude!r},{height!r},{speed},3.0,{course},"
                    f"{u},0.3,10.0,{e},5.0,0",
                )
            )
    rows.sort(key=lambda row: row[0])
    return (HEADER + "\n".join(row for _, row in rows) + "\n").encode()


def folder(path, files):
    """The files in a folder."""
    for name, content in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(content)
    return path


def zipped(path, files, inside=""):
    """The files in a zip, in one folder of it where it is named."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(inside + name, content)
    return path
