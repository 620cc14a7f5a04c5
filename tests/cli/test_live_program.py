"""`strapdown live` and `sd.Live`: what is replayed, sent or written to it gives the states of `fuse`, and its log
read back gives them bit for bit; faults on the wire are counted."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import written_nmea
import written_ubx
from recordings import events_of, flight

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.live.config import OutputPart, config_of
from strapdown.cli.live.ports import address_of
from strapdown.cli.live.program import _StatePort
from strapdown.data.solution import INVALID
from strapdown.data.vehicle import find as find_vehicle
from strapdown.engine.stream import Sample
from strapdown.geometry.geodesy import displacement
from strapdown.io.readers import live_log

pytestmark = pytest.mark.short

SOURCES = [
    {"kind": "position", "name": "GNSS position", "lever_arm": [0.3, -0.2, -0.5]},
    {"kind": "velocity", "name": "GNSS velocity", "lever_arm": [0.3, -0.2, -0.5]},
]


def config(tmp_path, *inputs, **more):
    """A configuration with these inputs, the sources of the flight, and a log."""
    return {
        "imu": "tactical",
        "source": SOURCES,
        "input": [*inputs],
        "log": str(tmp_path / "log.jsonl"),
        "lag": 0.5,
    } | more


def json_lines(recording):
    """The recording as JSON lines, in the order of its events."""
    lines = []
    for event in events_of(recording):
        if type(event) is Sample:
            table = {"t": event.t, "dt": event.dt, "dtheta": event.dtheta, "dv": event.dv}
        else:
            table = {"t": event.t, "y": event.y, "std": event.std}
            table["source"] = recording.sources[event.source].name
        lines.append((json.dumps(table) + "\n").encode())
    return lines


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def turn_until(live, done, seconds=20.0):
    """Turn until it is so."""
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, (live.stream.t, live.bad, live.stream.dropped_by)
        if not live.turn():
            time.sleep(0.001)


def assert_reproduced(live, path):
    """The log, read back, gives the states of the stream bit for bit."""
    solution = sd.fuse(sd.read(path), covariance=True)
    assert np.array_equal(solution.trajectory.lla[-1], live.stream.stream._live.belief.lla)
    assert np.array_equal(solution.covariance[-1], live.stream.stream._live.belief.P)
    assert np.array_equal(solution.trajectory.lla, live.stream.solution.trajectory.lla)
    assert np.array_equal(solution.status, live.stream.solution.status)
    return solution


def expected(recording):
    """The states of a stream on the recording."""
    stream = sd.Stream("closed-loop", imu="tactical", sources=recording.sources, lag=0.5)
    for event in events_of(recording):
        stream.step(event)
    return stream.finish()


# ---- inputs


def test_a_replayed_recording_is_reproduced_from_its_log(tmp_path):
    recording = flight(40.0)
    sd.write_recording(recording, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    asked = config(tmp_path, part)
    del asked["source"], asked["imu"]  # both are the recording's
    live = sd.Live(asked)
    live.run()
    assert np.array_equal(live.stream.belief.P, expected(recording).P)
    solution = assert_reproduced(live, tmp_path / "log.jsonl")
    assert solution.counts() == {"GNSS position": (39, 0), "GNSS velocity": (39, 0)}
    assert sd.fuse(sd.read(tmp_path / "log.jsonl").between(20.0, 40.0)).t[0] >= 20.0


def test_at_its_own_speed_it_takes_as_long(tmp_path):
    sd.write_recording(flight(2.0), tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": 4.0}
    live, begin = sd.Live(config(tmp_path, part)), time.monotonic()
    live.run()
    assert 0.45 < time.monotonic() - begin < 3.0


def test_datagrams_give_the_states_of_the_batch(tmp_path):
    recording, port = flight(), free_port()
    live = sd.Live(config(tmp_path, {"port": f"udp:{port}"}))
    live.turn()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for line in json_lines(recording):
            sender.sendto(line.rstrip(), ("127.0.0.1", port))
            live.turn()
    turn_until(live, lambda: live.stream.t > 19.99)
    live.close()
    assert np.array_equal(live.stream.belief.P, expected(recording).P) and live.bad == 0
    assert_reproduced(live, tmp_path / "log.jsonl")


def test_a_connection_that_breaks_is_made_again(tmp_path):
    recording = flight()
    lines = json_lines(recording)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            for some in (lines[:250], lines[250:]):
                connection, _ = server.accept()
                with connection:
                    for k in range(0, len(some), 7):  # half lines on the way
                        text = b"".join(some[k : k + 7])
                        connection.sendall(text[: len(text) // 3])
                        connection.sendall(text[len(text) // 3 :])

        thread = threading.Thread(target=serve)
        thread.start()
        live = sd.Live(config(tmp_path, {"port": f"tcp:127.0.0.1:{server.getsockname()[1]}"}))
        turn_until(live, lambda: live.stream.t > 19.99)
        thread.join()
    live.close()
    assert live.inputs[0].port.lost >= 1
    assert np.array_equal(live.stream.belief.P, expected(recording).P)


@pytest.mark.parametrize("kind", ["file", "tcp", "-"])
@pytest.mark.parametrize("cut", [1, 9])
def test_a_last_line_without_its_end_is_used_where_it_is_whole(kind, cut, tmp_path, monkeypatch):
    """At the end of the input, or of the program where a file grows."""
    text, path = b"".join(json_lines(flight())[:50])[:-cut], tmp_path / "lines"
    path.write_bytes(text)
    address, server = f"file:{path}" if kind == "file" else "-", None
    if kind == "tcp":
        server = socket.create_server(("127.0.0.1", 0))
        address = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    with path.open("rb") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        live = sd.Live(config(tmp_path, {"port": address}))
        live.turn()
        if server is not None:
            connection, _ = server.accept()
            connection.sendall(text)
            connection.close()
            turn_until(live, lambda: live.inputs[0].port.lost == 1)
        turn_until(live, lambda: not live.turn())
        live.close()
    if server is not None:
        server.close()
    assert live.bad == (cut > 1)
    assert sum(live.stream.dropped_by.values()) == 50 - (cut > 1)


def test_a_last_line_of_csv_without_its_end_is_counted():
    from strapdown.cli.live import decoders, input_formats

    reader = decoders.decoder("csv", "own", input_formats.Clock(), [], "", CSV)
    assert len(reader.feed(b"1,0.1,0,0,0,0,0,-0.98\n1.1,0.1,0,0,0,0,0,-0.9")) == 1
    assert reader.end() == [] and reader.bad == 1 and "has no end" in reader.why
    assert reader.end() == [] and reader.bad == 1


def test_a_restart_reads_the_line_that_was_cut(tmp_path):
    lines, path = json_lines(flight()), tmp_path / "lines"
    path.write_bytes(b"".join(lines[:300])[:-9])
    asked = config(tmp_path, {"port": f"file:{path}"}, state=str(tmp_path / "state"))
    for text in (None, b"".join(lines)):
        if text:
            path.write_bytes(text)
        with sd.Live(asked) as live:
            turn_until(live, lambda: not live.turn())
        assert live.bad == 0
    assert np.allclose(live.stream.now.lla, expected(flight()).lla, rtol=0, atol=1e-9)


def test_a_serial_line_passes_bytes_on_as_they_are(tmp_path):
    recording = flight()
    ours, theirs = os.openpty()
    live = sd.Live(config(tmp_path, {"port": f"serial:{os.ttyname(theirs)}:115200"}))
    live.turn()
    for line in json_lines(recording):
        os.write(ours, line)
        live.turn()
    turn_until(live, lambda: live.stream.t > 19.99)
    live.close()
    os.close(ours)
    os.close(theirs)
    assert np.array_equal(live.stream.belief.P, expected(recording).P) and live.bad == 0


def test_a_file_that_grows_and_is_not_there_at_first(tmp_path):
    recording, path = flight(), tmp_path / "input.jsonl"
    live = sd.Live(config(tmp_path, {"port": "file:" + str(path)}))
    live.turn()
    lines = json_lines(recording)
    with path.open("wb") as file:
        for k in range(0, len(lines), 50):
            file.write(b"".join(lines[k : k + 50]))
            file.flush()
            live.turn()
        turn_until(live, lambda: live.stream.t > 19.99)
    live.close()
    assert np.array_equal(live.stream.belief.P, expected(recording).P)


def test_rates_become_increments(tmp_path):
    port = free_port()
    live = sd.Live(config(tmp_path, {"port": f"udp:{port}"}, lag=0.0))
    live.turn()
    taken = []
    live.stream.step = taken.append
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for t in (1.0, 1.01, 1.02, 9.0, 9.01):
            table = {"t": t, "gyro": [0.1, 0.2, 0.3], "accel": [0.0, 1.0, -9.8]}
            sender.sendto(json.dumps(table).encode(), ("127.0.0.1", port))
    turn_until(live, lambda: len(taken) == 3)
    live.close()
    assert [event.t for event in taken] == [1.01, 1.02, 9.01]
    assert taken[0].dtheta == pytest.approx((0.001, 0.002, 0.003)) and taken[0].dt == pytest.approx(
        0.01
    )
    assert taken[0].dv[2] == pytest.approx(-0.098)


CSV = ["t", "dt", *(f"{name}_{axis}" for name in ("dtheta", "dv") for axis in "xyz")]


@pytest.mark.parametrize("header", [True, False])
def test_csv_gives_the_samples_of_its_lines(tmp_path, header):
    """With a header, or with columns of which one is skipped; restarted in the middle."""
    recording, path, fixes = flight(), tmp_path / "imu.csv", tmp_path / "fixes"
    rows = [[e.t, e.dt, *e.dtheta, *e.dv] for e in events_of(recording) if type(e) is Sample]
    names, first = (CSV, []) if header else (["", *CSV], [0])
    lines = [",".join(map(repr, [*first, *row])) for row in rows]
    if header:
        lines = ['"' + '", "'.join(CSV) + '"', *lines]
    fixes.write_bytes(b"".join(line for line in json_lines(recording) if b"source" in line))
    part = {"port": f"file:{path}", "format": "csv"} | ({} if header else {"columns": names})
    asked = config(tmp_path, {"port": f"file:{fixes}"}, part, state=str(tmp_path / "state"))
    for share in (0.6, 1.0):
        text = "\r\n".join(lines) + "\r\n"
        path.write_text(text[: int(len(text) * share)], newline="")
        with sd.Live(asked) as live:
            turn_until(live, lambda: not live.turn())
            assert live.bad == 0
    assert np.allclose(live.stream.now.lla, expected(recording).lla, rtol=0, atol=1e-9)
    assert sum(live.stream.dropped_by.values()) == live.stream.dropped_by["before the start"]


def test_csv_that_cannot_be_read_is_counted():
    from strapdown.cli.live import decoders, input_formats

    clock = input_formats.Clock()
    reader = decoders.decoder("csv", "own", clock, [], "")
    assert reader.feed(b"1,0.1,0,0,0,0,0,0\n") == [] and "name the columns" in reader.why
    assert reader.feed(b"t,gyro_x,gyro_y,gyro_z\n") == [] and reader.bad == 2
    header = "t,x,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n"
    rows = "0.1,,0,0,0,1,2,3\n0.2,7,0,0,0,1,2,3\n0.3,7,0,0,0,1,2\n0.4,7,a,0,0,1,2,3\n"
    (sample,) = reader.feed((header + rows + header).encode())
    assert reader.bad == 4 and sample.dv == pytest.approx((0.1, 0.2, 0.3))
    reader = decoders.decoder("csv", "own", clock, [], "")
    reader.feed(header.replace("x,gyro", "t,gyro", 1).encode())
    assert "each must be named once" in reader.why


# ---- receivers


FIRST = written_ubx.GPS + 10_000
"""ms of GPS time of the first epoch."""


def moved(count):
    """Latitude and longitude (deg), and height (m), of a receiver that moves north-east."""
    k = np.arange(count)
    return 47.0 + 1e-5 * k, 8.0 + 2e-5 * k, 500.0 + 0.1 * k


def ubx_bytes(count=40):
    """A receiver that moves, 5 Hz, with NMEA and noise between its messages."""
    lat, lon, height = moved(count)
    values = {"lat": np.round(lat * 1e7), "lon": np.round(lon * 1e7)}
    values |= {"height": np.round(height * 1e3), "velN": 5500, "velE": 7600, "velD": -500}
    each = written_ubx.pvt(FIRST + 200 * np.arange(count), **values)
    return b"".join(row.tobytes() + b"$GNTXT,hello*00\r\n\xb5\x00" for row in each)


def nmea_bytes(count=40):
    """The same as NMEA: RMC, GGA and GST of each epoch."""
    lat, lon, height = moved(count)
    found = ""
    for k in range(count):
        moment = np.datetime64("2024-05-17T16:53:12.00") + np.timedelta64(200 * k, "ms")
        found += written_nmea.rmc(moment, lat[k], lon[k], 18.0, 54.0)
        found += written_nmea.gga(moment, lat[k], lon[k], height[k])
        found += written_nmea.gst(moment, 1.5, 1.4, 2.5)
    return found.encode()


@pytest.mark.parametrize("format, made", [("ubx", ubx_bytes), ("nmea", nmea_bytes)])
@pytest.mark.parametrize("size", [7, 100, 5000])
def test_a_receiver_is_read_as_its_log_would_be(format, made, size, tmp_path):
    """Epoch by epoch in pieces of any size: the measurements of the reader of logs, bit for bit."""
    from strapdown.cli.live import decoders, input_formats
    from strapdown.io.description.fix_columns import Whereabouts, read_fixes
    from strapdown.io.description.schema_source import SourcePart
    from strapdown.io.description.source_files import Files
    from strapdown.io.registry import ask, readers

    data = made()
    (tmp_path / f"log.{format}").write_bytes(data)
    path = tmp_path / f"log.{format}"
    log = ask(readers()[format], "open", path)
    files, batch = Files(path, None, ".", {path: log}), {}
    for section in log.sections:
        if section.of == "source" and not section.left:
            part = SourcePart.model_validate({**section.keys, "file": str(path)})
            found = read_fixes(part, files, Whereabouts((), None), "log")
            batch[part.kind] = list(zip(found.t.tolist(), found.y.tolist(), found.std.tolist()))
    clock = input_formats.Clock()
    kinds = ["position", "velocity", "heading"]
    reader = decoders.decoder(format, "gps", clock, kinds, "receiver")
    taken = []
    for k in range(0, len(data), size):
        taken += reader.feed(data[k : k + size])
    time.sleep(input_formats.QUIET)
    taken += reader.idle()
    assert reader.idle() == [] and clock.epoch == files.epoch
    for s, kind in enumerate(kinds):
        rows = [(fix.t, [*fix.y], [*fix.std]) for fix in taken if fix.source == s]
        assert len(rows) == len(batch.get(kind, []))
        for (t, y, std), (t1, y1, std1) in zip(rows, batch.get(kind, [])):
            assert t == t1 and np.array_equal(y, y1, equal_nan=True), (kind, t)
            assert np.array_equal(std, std1, equal_nan=True)
    assert len(batch["position"]) == 40


@pytest.mark.parametrize("format, made", [("ubx", ubx_bytes), ("nmea", nmea_bytes)])
@pytest.mark.parametrize("wrong", [0, 17])
@pytest.mark.parametrize("hours", [-1, 1, 5])
def test_an_epoch_with_a_wrong_time_is_dropped_alone(format, made, wrong, hours, monkeypatch):
    from strapdown.cli.live import decoders, input_formats

    monkeypatch.setattr(input_formats, "QUIET", 0.0)
    data, size = made(), len(made()) // 40
    if format == "ubx":
        (row,) = written_ubx.pvt(np.array([FIRST + 3_600_000 * hours]), lat=4.7e8, lon=8e7)
        other = row.tobytes()
    else:
        moment = np.datetime64("2024-05-17T16:53:12.00") + np.timedelta64(hours, "h")
        other = written_nmea.rmc(moment, 47.0, 8.0, 18.0, 54.0)
        other += written_nmea.gga(moment, 47.0, 8.0, 500.0)
        other = (other + written_nmea.gst(moment, 1.5, 1.4, 2.5)).encode()
    clock, kinds = input_formats.Clock(0.0), ["position", "velocity"]
    reader, plain = (decoders.decoder(format, "gps", clock, kinds, "receiver") for _ in range(2))
    taken, expected_ones = [], []
    for k in range(40):
        piece = data[k * size : (k + 1) * size]
        expected_ones += plain.feed(piece) + plain.idle()
        if k == wrong:
            taken += reader.feed(other) + reader.idle()
        taken += reader.feed(piece) + reader.idle()
    assert repr(taken) == repr(expected_ones) and len(taken) == 80
    assert reader.bad == plain.bad + 1


def test_a_receiver_and_an_imu_on_one_clock(tmp_path):
    """The receiver is a UBX log that grows, the IMU JSON lines with UNIX times."""
    from strapdown.units.time_scales import unix_from_gps

    recording = flight(30.0)
    p, v = recording.sources
    gps = FIRST + np.round(1000 * p.t).astype(int)
    moved_by = {"lat": np.round(np.degrees(p.y[:, 0]) * 1e7), "height": np.round(p.y[:, 2] * 1e3)}
    moved_by |= {"lon": np.round(np.degrees(p.y[:, 1]) * 1e7)}
    for name, values in zip(("velN", "velE", "velD"), v.y.T):
        moved_by[name] = np.round(values * 1e3)
    each = [row.tobytes() for row in written_ubx.pvt(gps, **moved_by)]
    receiver, imu = tmp_path / "gnss.ubx", tmp_path / "imu.jsonl"
    receiver.write_bytes(each[0])
    live = sd.Live(
        config(
            tmp_path,
            {"port": f"file:{receiver}", "format": "ubx"},
            {"port": f"file:{imu}", "clock": "unix"},
            lag=1.5,
        )
    )
    live.turn()
    base = float(unix_from_gps(FIRST / 1e3))
    samples = [event for event in events_of(recording) if type(event) is Sample]
    for k, fix in enumerate(each):
        with receiver.open("ab") as file:
            file.write(fix if k else b"")
        with imu.open("ab") as file:
            for one in samples[20 * k : 20 * k + 20]:
                table = one._asdict() | {"t": base + one.t}
                file.write((json.dumps(table) + "\n").encode())
        live.turn()
        time.sleep(0.04)
        live.turn()
    turn_until(live, lambda: live.stream.t > base % 86400.0 + 29.9)
    live.close()
    truth = recording.reference.lla[-1]
    assert np.abs((live.stream.belief.lla - truth)[:2] * 6.4e6).max() < 6.0
    assert live.stream.counts()[0][0] >= 28 and live.bad == 0
    assert_reproduced(live, tmp_path / "log.jsonl")


# ---- MAVLink


def mavlink(system=1):
    """A writer of MAVLink messages; `bytes_of(message)`."""
    common = pytest.importorskip("pymavlink.dialects.v20.common")
    writer = common.MAVLink(None, srcSystem=system)
    return common, lambda message: message.pack(writer)


def gps_raw(common, t, y, v, accuracies=(1500, 2500, 100), fix_type=3):
    """GPS_RAW_INT of a position (rad, m) and a velocity (m/s)."""
    speed, course = float(np.hypot(*v[:2])), float(np.degrees(np.arctan2(v[1], v[0])) % 360.0)
    h_acc, v_acc, vel_acc = accuracies
    return common.MAVLink_gps_raw_int_message(
        round(1e6 * t), fix_type, round(np.degrees(y[0]) * 1e7), round(np.degrees(y[1]) * 1e7),
        round(y[2] * 1e3) - 47_000, 80, 120, round(100 * speed), round(100 * course) % 36000, 12,
        round(y[2] * 1e3), h_acc, v_acc, vel_acc,
    )  # fmt: skip


def test_mavlink_is_read_in_si(tmp_path):
    from strapdown.cli.live.decoders import decoder
    from strapdown.cli.live.input_formats import Clock

    common, bytes_of = mavlink()
    clock = Clock()
    reader = decoder("mavlink", "own", clock, ["position", "velocity"], "")
    scaled = [
        common.MAVLink_scaled_imu_message(ms, 100, -200, -1000, 10, 20, -30, 0, 0, 0)
        for ms in (1000, 1010)
    ]
    taken = reader.feed(b"".join(map(bytes_of, scaled)))
    (sample,) = taken
    assert sample.t == pytest.approx(1.01) and sample.dt == pytest.approx(0.01)
    assert sample.dtheta == pytest.approx((1e-4, 2e-4, -3e-4))
    assert sample.dv == pytest.approx((9.80665e-3, -2 * 9.80665e-3, -9.80665e-2))
    fix = gps_raw(common, 1.2, (0.8, 0.2, 300.0), (3.0, 4.0, 0.0))
    position, velocity = reader.feed(bytes_of(fix))
    assert position.y == pytest.approx((0.8, 0.2, 300.0), abs=2e-9 + 1e-3) and position.source == 0
    assert position.std == (1.5, 1.5, 2.5) and position.t == pytest.approx(1.2)
    assert velocity.y[:2] == pytest.approx((3.0, 4.0), abs=1e-3) and np.isnan(velocity.y[2])
    # UNIX times need SYSTEM_TIME, which also gives the epoch
    unix = 1_700_000_000.0
    late = gps_raw(common, unix + 1.5, (0.8, 0.2, 300.0), (3.0, 4.0, 0.0))
    assert reader.feed(bytes_of(late)) == [] and clock.epoch is None
    reader.feed(bytes_of(common.MAVLink_system_time_message(round(unix * 1e6), 0)))
    assert reader.feed(bytes_of(late))[0].t == pytest.approx(1.5, abs=1e-5)
    assert clock.epoch == pytest.approx(unix - 315964800 + 18)
    assert reader.bad == 1 and reader.why == "GPS_RAW_INT has UNIX time, and no SYSTEM_TIME came"
    # what cannot be used
    reader.bad, reader.why = 0, ""
    assert reader.feed(bytes_of(gps_raw(common, 2.0, (0.8, 0.2, 9.0), (1, 0, 0), (0, 0, 0)))) == []
    assert reader.bad == 1 and reader.why == "GPS_RAW_INT has no accuracies; send MAVLink 2"
    assert reader.feed(bytes_of(gps_raw(common, 2.0, (0.8, 0.2, 9.0), (1, 0, 0), fix_type=1))) == []
    _, of_another = mavlink(system=9)
    assert reader.feed(of_another(gps_raw(common, 2.0, (0.8, 0.2, 9.0), (1, 0, 0)))) == []
    reader.feed(b"noise" * 20)
    assert reader.bad > 2
    # HIGHRES_IMU takes the place of SCALED_IMU
    high = [
        common.MAVLink_highres_imu_message(
            us, 1.0, 2.0, -9.8, 0.1, 0.2, 0.3, *(0.0,) * 7, fields_updated=63
        )
        for us in (3_000_000, 3_005_000)
    ]
    (sample,) = reader.feed(b"".join(map(bytes_of, high)))
    assert sample.dv == pytest.approx((0.005, 0.01, -0.049)) and sample.dt == pytest.approx(0.005)
    assert reader.feed(bytes_of(scaled[1])) == []
    reader.bad, reader.why = 0, ""
    assert reader.feed(bytes_of(high[1])) == [] and reader.bad == 1
    assert reader.why.startswith("HIGHRES_IMU 0 s after the one before")


def test_an_autopilot_by_datagrams(tmp_path):
    recording, port = sd.simulate("demo", 30.0, seed=4, rate=100.0), free_port()
    common, bytes_of = mavlink()
    live = sd.Live(config(tmp_path, {"port": f"udp:{port}", "format": "mavlink"}))
    live.turn()
    p, v = recording.sources
    fixes = [gps_raw(common, t, y, speed) for t, y, speed in zip(p.t, p.y, v.y)]
    due = p.t.tolist()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for t, dt, dtheta, dv in zip(*recording.imu):
            rates = [*(dv / dt).tolist(), *(dtheta / dt).tolist(), *(0.0,) * 7]
            high = common.MAVLink_highres_imu_message(round(1e6 * t), *rates, fields_updated=63)
            sender.sendto(bytes_of(high), ("127.0.0.1", port))
            if due and t >= due[0] - 1e-6:
                due.pop(0)
                sender.sendto(bytes_of(fixes.pop(0)), ("127.0.0.1", port))
            live.turn()
    turn_until(live, lambda: live.stream.t > 29.98)
    live.close()
    off = (live.stream.belief.lla - recording.reference.lla[-1]) * [6.4e6, 4.3e6, 1.0]
    assert np.abs(off).max() < 6.0 and live.bad == 0
    assert_reproduced(live, tmp_path / "log.jsonl")


# ---- outputs


def test_outputs_come_at_their_rate_and_can_be_read(tmp_path):
    recording = flight(40.0)
    sd.write_recording(recording, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        port = receiver.getsockname()[1]
        outputs = [
            {"port": f"file:{tmp_path}/out.nmea", "format": "nmea", "rate": 2.0},
            {"port": f"udp:127.0.0.1:{port}", "format": "json", "rate": 5.0},
        ]
        live = sd.Live(config(tmp_path, part, output=outputs, epoch="2024-05-17T00:00:00Z"))
        live.run()
        receiver.setblocking(False)
        shown = []
        while True:
            try:
                shown.append(json.loads(receiver.recv(65536)))
            except BlockingIOError:
                break
    assert 147 <= len(shown) <= 149 and np.diff([each["t"] for each in shown]) == pytest.approx(0.2)
    last, truth = shown[-1], recording.reference
    row = int(np.argmin(np.abs(truth.t - last["t"])))
    assert last["status"] == "valid" and last["utc"].startswith("2024-05-17T00:00:")
    assert last["lat"] == pytest.approx(np.degrees(truth.lla[row, 0]), abs=1e-4)
    assert last["rph"][0] == pytest.approx(np.degrees(truth.rph[row, 0]), abs=1.0)
    # by the library's own reader of NMEA
    log = live_nmea(tmp_path / "out.nmea")
    assert {part.kind for part in log} == {"position", "velocity", "heading"}
    position = next(part for part in log if part.kind == "position")
    assert np.diff(position.t) == pytest.approx(0.5)
    at = np.searchsorted(truth.t, position.t + 1e-6) - 1
    assert np.abs(position.y[:, 2] - truth.lla[at, 2]).max() < 5.0
    assert np.degrees(np.abs(position.y[:, :2] - truth.lla[at, :2])).max() < 1e-4


def live_nmea(path):
    """Sources of a log of NMEA, at s of the day."""
    from strapdown.io.description.fix_columns import Whereabouts, read_fixes
    from strapdown.io.description.schema_source import SourcePart
    from strapdown.io.description.source_files import Files
    from strapdown.io.registry import ask, readers

    log = ask(readers()["nmea"], "open", path)
    files, found = Files(path, None, ".", {path: log}), []
    for section in log.sections:
        part = SourcePart.model_validate({**section.keys, "file": str(path)})
        rows = read_fixes(part, files, Whereabouts((), None), "log")
        found.append(sd.Source(part.kind, rows.t, rows.y, rows.std))
    return found


def test_mavlink_goes_out_as_an_autopilot_takes_it(tmp_path):
    common = pytest.importorskip("pymavlink.dialects.v20.common")
    recording = flight(40.0)
    sd.write_recording(recording, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    messages = ["ODOMETRY", "VISION_POSITION_ESTIMATE", "GPS_INPUT"]
    output = {"port": f"file:{tmp_path}/out", "format": "mavlink", "rate": 5.0}
    lines = {"port": f"file:{tmp_path}/lines", "rate": 5.0}
    both = [output | {"messages": messages}, lines]
    live = sd.Live(config(tmp_path, part, output=both, epoch="2024-05-17T00:00:00Z"))
    live.run()
    found = common.MAVLink(None).parse_buffer((tmp_path / "out").read_bytes())
    by_type = {}
    for message in found:
        by_type.setdefault(message.get_type(), []).append(message)
    shown = [json.loads(line) for line in (tmp_path / "lines").read_bytes().splitlines()]
    assert {
        name: len(each) for name, each in by_type.items() if name != "HEARTBEAT"
    } == dict.fromkeys(messages, len(shown))
    assert 28 <= len(by_type["HEARTBEAT"]) <= 31
    odometry, vision, gps = (by_type[name][-1] for name in messages)
    last = shown[-1]
    lla = [np.radians([each["lat"], each["lon"]]).tolist() + [each["height"]] for each in shown]
    away = displacement(lla[-1], lla[0])
    assert [odometry.x, odometry.y, odometry.z] == pytest.approx(away, abs=1e-2)
    assert [vision.x, vision.y, vision.z] == [odometry.x, odometry.y, odometry.z]
    C = live.stream.belief.C_nb
    assert [odometry.vx, odometry.vy, odometry.vz] == pytest.approx(C.T @ last["v_n"], abs=0.5)
    rph = np.degrees([vision.roll, vision.pitch, vision.yaw])
    assert rph % 360 == pytest.approx(np.array(last["rph"]) % 360, abs=1e-3)
    std = np.array(last["std"])
    assert np.sqrt([odometry.pose_covariance[k] for k in (0, 6, 11)]) == pytest.approx(
        std[:3], rel=1e-3
    )
    assert np.sqrt(odometry.pose_covariance[20]) == pytest.approx(std[8], rel=0.05)
    assert odometry.frame_id == 1 and odometry.child_frame_id == 12 and odometry.quality == 100
    assert [gps.lat, gps.lon] == [round(last["lat"] * 1e7), round(last["lon"] * 1e7)]
    assert gps.vn == pytest.approx(last["v_n"][0], abs=1e-3) and gps.fix_type == 3
    assert gps.yaw == pytest.approx(100 * last["rph"][2], abs=1)
    assert gps.horiz_accuracy == pytest.approx(np.hypot(*std[:2]), rel=1e-3)
    # 2024-05-17 was the Friday of week 2314
    assert gps.time_week == 2314 and gps.time_week_ms == round(1e3 * (5 * 86400 + 18 + last["t"]))
    assert gps.time_usec == odometry.time_usec == round(1e6 * (1715904000 + last["t"]))


def test_the_pose_covariance_is_that_of_small_turns():
    """Against finite differences of roll, pitch and heading; no message without a state."""
    from strapdown.cli.live.encoders import encoder
    from strapdown.cli.live.output_formats import state_at
    from strapdown.core.mathematics.rotation import matrix_to_euler, rotate_left
    from strapdown.data.solution import INVALID

    common = pytest.importorskip("pymavlink.dialects.v20.common")
    encode = encoder("mavlink", ["VISION_POSITION_ESTIMATE"])
    state = sd.align(flight(), "tactical").belief(np.zeros(1))
    generator = np.random.default_rng(2)
    root = generator.normal(size=(15, 15)) * 1e-2
    state.P[:15, :15] = root @ root.T
    rotate_left(0.4, -0.3, 1.0, state.C_nb)
    before, columns = np.array(matrix_to_euler(state.C_nb)), []
    for k in range(3):
        turned = state.C_nb.copy()
        rotate_left(*np.eye(3)[k] * 1e-7, turned)
        columns.append((np.array(matrix_to_euler(turned)) - before) / 1e-7)
    turn = np.eye(6)
    turn[3:, 3:] = np.array(columns).T
    rows = [0, 1, 2, 6, 7, 8]
    wanted = turn @ state.P[np.ix_(rows, rows)] @ turn.T
    *_, message = common.MAVLink(None).parse_buffer(encode(state_at(5.0, None, 0, state)))
    assert message.covariance == pytest.approx(wanted[np.triu_indices(6)], rel=1e-4, abs=1e-8)
    assert message.usec == 5_000_000
    assert encode(state_at(5.1, None, INVALID, state)) == b""


def test_without_a_state_nmea_says_so():
    from strapdown.cli.live.output_formats import nmea_lines, state_at
    from strapdown.data.solution import INVALID

    state = sd.Stream("closed-loop", imu="tactical").belief
    lines = nmea_lines(state_at(3.0, None, INVALID, state)).splitlines()
    assert lines[0].startswith("$INGGA,000003.000,,,,,0,") and lines[1].startswith(
        "$INRMC,000003.000,V,"
    )
    assert len(lines) == 2


# ---- faults


def test_whatever_is_sent_is_counted_and_the_rest_used(tmp_path):
    recording, port = flight(), free_port()
    live = sd.Live(config(tmp_path, {"port": f"udp:{port}"}))
    live.turn()
    generator = np.random.default_rng(3)
    bad = [b"", b"{", b"[1,2]", b'{"t":1}', b'{"t":"x","source":0}', b"\xff\xfe\x00", b"3", b"null"]
    bad += [b'{"t":1,"dt":1,"dtheta":[1],"dv":[2]}', b'{"t":1e999,"gyro":[0,0,0],"accel":[0,0,0]}']
    bad += [generator.bytes(300).replace(b"\n", b"") for _ in range(20)] + [b"[" * 5000]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k, line in enumerate(json_lines(recording)):
            sender.sendto(line, ("127.0.0.1", port))
            if k % 5 == 0:
                sender.sendto(bad[k // 5 % len(bad)], ("127.0.0.1", port))
            live.turn()
    turn_until(live, lambda: live.stream.t > 19.99)
    live.close()
    assert np.array_equal(live.stream.belief.P, expected(recording).P) and live.bad > 50


@pytest.mark.parametrize("size", [5, 64, 4000])
def test_bytes_between_the_messages_of_a_receiver_are_counted(size):
    """A message with an incorrect byte, another one cut short and a binary line, not the others'."""
    from strapdown.cli.live.stray_pieces import StrayPieces

    good = [row.tobytes() for row in written_ubx.pvt(FIRST + 200 * np.arange(6), lat=4.7e8)]
    sentence = written_nmea.gga(np.datetime64("2024-05-17T16:53:12"), 47.0, 8.0, 500.0).encode()
    rtcm = b"\xd3\x00\x04" + b"\x01\x02\x03\x04" + b"abc"
    between = [b"\r\n", sentence, rtcm + sentence + rtcm + rtcm, b"", b"\n"]
    clean = sentence[20:] + b"".join(a + b for a, b in zip(good, [*between, b""]))
    between[0] = sentence.replace(b"4700", b"4800")
    between[1] = good[0][:-7]
    between[3] = b"\x00\xff\x81"
    dirty = b"".join(a + b for a, b in zip(good, [*between, b""]))
    for data, wanted in ((clean, 0), (dirty, 3)):
        strays = StrayPieces()
        pieces = [data[k : k + size] for k in range(0, len(data), size)]
        assert sum(strays.count(piece) for piece in pieces) == wanted
    assert strays.count(b"\xfe" * 40_000) == 1


def test_a_receiver_counts_damaged_messages(monkeypatch):
    from strapdown.cli.live import decoders, input_formats

    monkeypatch.setattr(input_formats, "QUIET", 0.0)
    data = bytearray(nmea_bytes())
    data[data.index(b"GGA", 1000) + 20] ^= 1
    reader = decoders.decoder("nmea", "gps", input_formats.Clock(), ["position"], "receiver")
    for k in range(0, len(data), 100):
        reader.feed(bytes(data[k : k + 100]))
        reader.idle()
    assert reader.bad == 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"t": "5.0"},
        {"t": True},
        {"dt": "0.05"},
        {"dtheta": ["0", "0", "0"]},
        {"dv": [True, 0.0, 0.0]},
        {"source": True, "y": [0.8, 0.2, 300.0], "std": [1.0] * 3},
        {"source": 0, "y": ["0.8", 0.2, 300.0], "std": [1.0] * 3},
        {"source": 0, "y": [0.8, 0.2, 300.0], "std": [True, 1.0, 1.0]},
    ],
)
def test_what_is_no_number_is_counted(wrong):
    from strapdown.cli.live import decoders, input_formats

    reader = decoders.decoder("json", "own", input_formats.Clock(), ["position"], "")
    line = {"t": 5.0, "dt": 0.05, "dtheta": [0.0] * 3, "dv": [0.0] * 3} | wrong
    assert reader.feed(json.dumps(line).encode() + b"\n") == []
    assert reader.bad == 1 and ("is no number" in reader.why or "source is True" in reader.why)


def test_rates_that_come_late_are_counted_until_their_clock_has_stepped_back():
    from strapdown.cli.live import decoders, input_formats

    reader = decoders.decoder("json", "own", input_formats.Clock(), [], "")

    def taken(*times):
        lines = [json.dumps({"t": t, "gyro": [0] * 3, "accel": [0] * 3}) + "\n" for t in times]
        return [(each.t, pytest.approx(each.dt)) for each in reader.feed("".join(lines).encode())]

    assert taken(1.0, 1.1, 1.3, 1.2, 1.4) == [(1.1, 0.1), (1.3, 0.2), (1.4, 0.1)]
    assert reader.bad == 1 and "came late" in reader.why
    assert taken(1.25, 1.15, 1.35, 1.5) == [(1.5, 0.1)] and reader.bad == 4
    back = (np.arange(20) / 10 - 3.0).tolist()
    assert [t for t, _ in taken(*back)] == back[6:] and reader.bad == 9


@pytest.mark.parametrize("format", ["json", "csv"])
@pytest.mark.parametrize("unit, factor", [("ms", 1e3), ("us", 1e6)])
def test_rates_with_stamps_in_another_unit_are_counted_and_said(format, unit, factor):
    from strapdown.cli.live import decoders, input_formats

    names = ["t", *(f"{name}_{axis}" for name in ("gyro", "accel") for axis in "xyz")]
    reader = decoders.decoder(format, "own", input_formats.Clock(), [], "", names)
    for k in range(20):
        t, rates = factor * (5.0 + 0.01 * k), [0.0, 0.0, 0.0, 0.0, 0.0, -9.8]
        line = ",".join(map(repr, [t, *rates]))
        if format == "json":
            line = json.dumps({"t": t, "gyro": rates[:3], "accel": rates[3:]})
        assert reader.feed(line.encode() + b"\n") == []
    assert reader.bad == 19 and "s apart, so this one's length is unknown" in reader.why
    (text,) = reader.news
    assert text.endswith(f"are their stamps in {unit}?")


def test_rates_without_a_time_are_counted_and_a_dt_in_ms_is_refused_by_the_filter():
    from strapdown.cli.live import decoders, input_formats

    reader = decoders.decoder("json", "own", input_formats.Clock(), [], "")
    rates = '"gyro": [0, 0, 0], "accel": [0, 0, -9.8]}\n'
    for t in (1.0, 1.01, "NaN", 1.02):
        found = reader.feed(f'{{"t": {t}, {rates}'.encode())
    assert reader.bad == 1 and found[0].dt == pytest.approx(0.01)
    live = sd.LiveStream("closed-loop", imu="tactical")
    for each in reader.feed(f'{{"t": 2.0, "dt": 10.0, {rates}'.encode()):
        live.step(each)
    assert live.dropped_by["invalid"] == 1 and "is it in ms?" in live.events[-1][1]


def test_increments_with_stamps_in_ms_are_said():
    live = sd.LiveStream("closed-loop", imu="tactical")
    for k in range(20):
        live.step(Sample(10.0 * k, 0.01, (0.0, 0.0, 0.0), (0.0, 0.0, -0.098)))
    (text,) = [text for _, text in live.events]
    assert live.dropped_by["at another time"] == 18 and text.endswith("are stamps in ms?")


def test_two_senders_of_samples_are_said_but_not_one_that_begins_again(tmp_path, monkeypatch):
    from strapdown.cli.live import program

    monkeypatch.setattr(program, "LOOK", 0.0)
    port, said = free_port(), []
    live = sd.Live(
        config(tmp_path, {"port": f"udp:{port}"}), on_event=lambda t, text: said.append(text)
    )
    live.turn()
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3)]
    samples = [line for line in json_lines(flight()) if b"dtheta" in line]
    fixes = [line for line in json_lines(flight()) if b"source" in line]

    def send(number, line):
        senders[number].sendto(line, ("127.0.0.1", port))
        live.turn()

    for k, line in enumerate(samples[:40]):
        send(k // 20, line)
        send(2, fixes[k % 10])  # a receiver has its own
    assert not [text for text in said if "samples come from" in text]
    for line in samples[40:60]:
        send(0, line)
        send(1, line)
    (text,) = [text for text in said if "samples come from" in text]
    names = [f"127.0.0.1:{sender.getsockname()[1]}" for sender in senders]
    assert names[0] in text and names[1] in text and text.endswith("; stop one")
    for sender in senders:
        sender.close()
    live.close()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not count them")
def test_datagrams_that_the_system_drops_are_counted(tmp_path, monkeypatch):
    from strapdown.cli.live import ports, program

    monkeypatch.setattr(program, "LOOK", 0.0)
    monkeypatch.setattr(ports, "BUFFER", 4096)
    port, said = free_port(), []
    live = sd.Live(
        config(tmp_path, {"port": f"udp:{port}"}), on_event=lambda t, text: said.append(text)
    )
    live.turn()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(100):
            sender.sendto(b"{}" + b" " * 1000, ("127.0.0.1", port))
        turn_until(live, lambda: live.missed[f"udp:127.0.0.1:{port}"] + live.bad == 100)
    assert live.missed[f"udp:127.0.0.1:{port}"] > 50
    live.close()
    assert any("the system dropped" in text for text in said)
    assert live.missed[f"udp:127.0.0.1:{port}"] > 50


def test_a_flood_is_bounded(tmp_path):
    port = free_port()
    live = sd.Live(config(tmp_path, {"port": f"udp:{port}"}))
    live.turn()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(40):
            for _ in range(500):
                sender.sendto(b"x" * 1000, ("127.0.0.1", port))
            live.turn()
    live.close()
    assert 40 < live.bad <= 41 * 256
    line = sd.Live(config(tmp_path, {"port": f"file:{tmp_path}/long"}))
    (tmp_path / "long").write_bytes(b"y" * 1_000_000)
    for _ in range(30):
        line.turn()
    line.close()
    assert line.bad >= 7 and len(line.inputs[0].decoder._rest) <= 1 << 16


IMPOSSIBLE = [1.7e12, 1e17, -1e12, 1e300, float("nan"), float("inf")]


@pytest.mark.parametrize("scale", ["unix", "gps", "own"])
def test_impossible_times_spoil_nothing(tmp_path, scale):
    """Milliseconds given as seconds, at first and later; with outputs, which show dates."""
    recording, path = flight(), tmp_path / "lines"
    lines = by_unix(recording, {"unix": 1.7e9, "gps": 1.38e9, "own": 0.0}[scale])
    bad = [json.dumps({**json.loads(lines[0]), "t": t}).encode() + b"\n" for t in IMPOSSIBLE]
    path.write_bytes(b"".join(bad + lines[:200] + bad + lines[200:]))
    outputs = [
        {"port": f"file:{tmp_path}/{format}", "format": format} for format in ("json", "nmea")
    ]
    part = {"port": f"file:{path}", "clock": scale}
    more = {"epoch": "2024-05-17T00:00:00Z"} if scale == "own" else {}
    with sd.Live(config(tmp_path, part, output=outputs, **more)) as live:
        turn_until(live, lambda: live.stream.counts()[0][0] >= 18)
        newest = live.stream.stream.newest
        turn_until(live, lambda: not live.turn())
    dropped = live.stream.dropped_by
    assert live.bad + sum(dropped.values()) - dropped["before the start"] == 12
    assert newest < 2e5 and live.stream.alignments == 0
    assert len((tmp_path / "json").read_bytes().splitlines()) > 150


def test_angles_are_those_of_a_solution():
    """Also of an unknown attitude, and with the nose up."""
    from strapdown.cli.live.output_formats import json_line, state_at
    from strapdown.core.mathematics.rotation import euler_to_matrix

    state = sd.align(flight(), "tactical").belief(np.zeros(1))
    for rph in ((-170.0, -80.0, 359.0), (10.0, 5.0, 0.0), (0.0, 90.0, 40.0)):
        euler_to_matrix(*np.radians(rph), state.C_nb)
        shown = json.loads(json_line(state_at(1.0, None, 0, state)))["rph"]
        assert shown[1] == pytest.approx(rph[1], abs=1e-6)
        assert abs(rph[1]) == 90.0 or shown == pytest.approx(rph, abs=1e-9)
    state.C_nb[:] = np.nan
    assert json.loads(json_line(state_at(1.0, None, 2, state)))["rph"] == [None] * 3


def test_a_state_at_a_time_of_no_calendar_has_no_date():
    from strapdown.cli.live.output_formats import LINES, state_at

    state = sd.align(flight(), "tactical").belief(np.zeros(1))
    for t in (1e15, -1e15, 1e30):
        for line in LINES.values():
            assert line(state_at(t, 0.0, 0, state))


def test_an_output_to_a_pipe_that_nobody_reads_waits_for_nothing(tmp_path):
    from strapdown.cli.live.ports import Port
    from strapdown.cli.live.sinks import Sink

    os.mkfifo(tmp_path / "pipe")
    address = address_of(f"file:{tmp_path}/pipe", "output")
    sink = Sink(address)
    sink.write(b"one\n")
    assert sink.dropped == 1 and "No such device" in sink.error
    port = Port(address)  # which reads regular files
    assert port.read() == [] and port.error == "it is no regular file"


def test_silence_and_a_port_that_is_not_there_are_said(tmp_path, monkeypatch):
    from strapdown.cli.live import program

    monkeypatch.setattr(program, "IMU_SILENT", 0.2)
    monkeypatch.setattr(program, "LOOK", 0.0)
    said = []
    path = tmp_path / "lines"
    live = sd.Live(
        config(tmp_path, {"port": "serial:/dev/none:9600"}, {"port": f"file:{path}"}),
        on_event=lambda t, text: said.append(text),
    )
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        live.turn()
    path.write_bytes(json_lines(flight())[0])
    turn_until(live, lambda: said[-1] == f"file:{path}: goes on")
    assert said == [
        "serial:/dev/none:9600: No such file or directory; it is tried again each 1 s",
        f"file:{path}: No such file or directory; it is tried again each 1 s",
        "IMU: no sample of use for 0.2 s",
        "IMU: samples come again",
        f"file:{path}: goes on",
    ]
    live.close()


@pytest.mark.parametrize("change", ["frozen", "NaN"])
def test_samples_that_are_dropped_keep_no_state_valid(change, tmp_path, monkeypatch):
    from strapdown.cli.live import program

    monkeypatch.setattr(program, "IMU_SILENT", 0.2)
    path, out, said = tmp_path / "lines", tmp_path / "out", []
    asked = config(tmp_path, {"port": f"file:{path}"}, output=[{"port": f"file:{out}"}])
    path.write_bytes(b"".join(json_lines(flight())))
    live = sd.Live(asked, on_event=lambda t, text: said.append(text))
    turn_until(live, lambda: live.stream.stream.newest > 19.99 and not live.turn())
    t, count = live.stream.stream.newest, len(out.read_bytes().splitlines())
    end = time.monotonic() + program.BRIDGE + 0.2
    while time.monotonic() < end:
        wrong = {"t": t, "dt": 0.01, "dtheta": [0, 0, 0], "dv": [0, 0, -0.098]}
        if change == "NaN":
            wrong |= {"t": (t := t + 0.01), "dv": [0, None, -0.098]}
        with path.open("a") as file:
            file.write(json.dumps(wrong) + "\n")
        live.turn()
        time.sleep(0.01)
    assert live.is_stale and live.status == INVALID
    assert "IMU: no sample of use for 0.2 s" in said
    assert len(out.read_bytes().splitlines()) == count
    live.close()


def test_a_callback_that_raises_ends_nothing(tmp_path):
    calls = []

    def callback(t, text):
        calls.append(text)
        raise RuntimeError("no disk")

    with sd.Live(config(tmp_path, {"port": "serial:/dev/none:9600"}), on_event=callback) as live:
        shown = live.watch()
        live.turn()
        live.turn()
    said = "on_event raised RuntimeError: no disk; the callback is not called again"
    assert len(calls) == 1 and [text for _, text in live.stream.events] == [said]
    assert said in [text for _, text in shown.since(0)[1]["events"]]


def test_a_state_of_before_the_first_sample_goes_on(tmp_path):
    state, said = tmp_path / "state", []
    asked = config(tmp_path, {"port": f"udp:{free_port()}"}, state=str(state))
    sd.Live(asked).close()
    sd.Live(asked, on_event=lambda t, text: said.append(text)).close()
    assert said == [f"{state}: goes on before its first state"]


def test_the_command_says_clocks_as_the_page_does(tmp_path, command):
    (tmp_path / "lines").write_bytes(
        b"".join(line for line in json_lines(flight(3.0)) if b"velocity" not in line)
    )
    (tmp_path / "live.toml").write_text(
        'imu = "tactical"\n[[source]]\nkind = "position"\nname = "GNSS position"\n[[input]]\n'
        f'port = "file:{tmp_path}/lines"\nclock = "arrival"\n'
    )
    code, said, _ = command("live", tmp_path / "live.toml", "--seconds", 0.2)
    assert code == 0 and " ppm, delays beyond" in said
    assert f"file:{tmp_path}/lines: clock: offset " in said
    _, said, _ = command("live", tmp_path / "live.toml", "--seconds", 0.2, "--json")
    told = json.loads(said)
    assert {*told["clocks"][f"file:{tmp_path}/lines"]} >= {"offset", "drift", "delay"}


def test_it_says_once_which_ports_are_open(tmp_path):
    """From then on no datagram is lost."""
    ports, said = [f"udp:127.0.0.1:{free_port()}" for _ in range(2)], []
    pending = "tcp:10.255.255.1:7001"
    inputs = [{"port": port} for port in (*ports, f"file:{tmp_path}/none", pending)]
    live = sd.Live(config(tmp_path, *inputs), on_event=lambda t, text: said.append(text))
    assert said == []
    live.turn()
    assert said[0] == f"ports open: {', '.join(ports)}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(json_lines(flight())[0], ("127.0.0.1", int(ports[0].split(":")[2])))
    turn_until(live, lambda: live.stream.stream.newest > 0)
    live.close()
    assert sum(text.startswith("ports open") for text in said) == 1


def test_an_output_that_fails_is_said_until_it_goes_on(tmp_path, monkeypatch):
    """Its folder vanishes at first, then the disk is full within a line."""
    from strapdown.cli.live import program, sinks

    monkeypatch.setattr(program, "LOOK", 0.0)
    monkeypatch.setattr(sinks, "RETRY", 0.0)
    sd.write_recording(flight(), tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    path, said = tmp_path / "late" / "out", []
    path.parent.mkdir()
    live = sd.Live(
        config(tmp_path, part, output=[{"port": f"file:{path}"}]),
        on_event=lambda t, text: said.append(text),
    )
    path.parent.rmdir()
    monkeypatch.setattr(program, "BATCH", 1)
    written, full = os.write, [""]

    def write(file, data):
        if full[0] == "cut" and len(data) > 99:
            full[0] = "no more"
            return written(file, data[: len(data) // 3])
        if full[0] == "no more" and len(data) > 99:
            full[0] = "cut"
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        return written(file, data)

    monkeypatch.setattr(os, "write", write)
    turn_until(live, lambda: live.unsent[f"file:{path}"] > 5)
    path.parent.mkdir()
    path.write_bytes(b'{"half": 1')  # by one that was killed
    for full[0] in ("", "cut", ""):
        before = live.stream.t
        turn_until(live, lambda: live.stream.t > before + 2.0)
    live.close()
    about = [text.removeprefix(f"file:{path}: ") for text in said if text.startswith("file:")]
    lost = live.unsent[f"file:{path}"]
    assert about[0] == "No such file or directory; it is tried again each 1 s"
    assert about[1].startswith("goes on; lost: ")
    assert about[2].startswith(f"{os.strerror(errno.EFBIG)}; it is") and len(about) == 4
    assert about[3] == f"goes on; lost: {lost} states" and lost > 40
    half, *lines = path.read_bytes().splitlines()
    assert half == b'{"half": 1' and len([json.loads(line) for line in lines]) > 80


def test_standard_output_that_nobody_reads_keeps_nothing_waiting(tmp_path):
    """The command, with standard input at its end and a receiver's port beside it."""
    sd.write_recording(flight(40.0), tmp_path / "flight.nc")
    (tmp_path / "live.toml").write_text(
        'log = "log.jsonl"\n[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = inf\n'
        f'[[input]]\nport = "-"\n[[input]]\nport = "udp:{free_port()}"\n'
        '[[output]]\nport = "-"\n'
    )
    words = [sys.executable, "-m", "strapdown", "live", "live.toml", "--seconds", "4"]
    process = subprocess.Popen(
        words,
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.wait(60.0)
    said = process.stderr.read().decode()
    lines = process.stdout.read().splitlines()
    process.stdout.close()
    process.stderr.close()
    assert process.returncode == 0, said
    assert "-: its reader is too slow" in said
    assert len(sd.read(tmp_path / "log.jsonl").imu.t) > 500
    assert "-: " in said and " states not written" in said
    assert said.splitlines()[-1] == "wrote log.jsonl"
    assert [json.loads(line) for line in lines]


def test_standard_streams_that_are_closed_fail_as_other_ports(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    monkeypatch.setattr(sys, "stdout", None)
    said = []
    live = sd.Live(
        config(tmp_path, {"port": "-"}, output=[{"port": "-"}]),
        on_event=lambda t, text: said.append(text),
    )
    live.outputs[0].sink.write(b"{}\n")
    live.turn()
    live.close()
    assert said == ["-: it is closed; it is tried again each 1 s"] * 2 and live.unsent["-"] == 1


def test_standard_input_at_its_end_is_not_waited_for(tmp_path, monkeypatch):
    reading, writing = os.pipe()
    os.close(writing)
    with os.fdopen(reading) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        live = sd.Live(config(tmp_path, {"port": "-"}, {"port": f"udp:{free_port()}"}))
        live.turn()
        begin = time.monotonic()
        for _ in range(20):
            live._wait()
        assert time.monotonic() - begin > 0.03 and live.inputs[0].ended
        live.close()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no full device")
@pytest.mark.parametrize("at", [0, 1])
def test_a_log_that_cannot_be_written_ends_and_the_stream_goes_on(at, tmp_path, monkeypatch):
    """Its folder vanishes before it begins, or the disk fills later."""
    from pathlib import Path

    recording, said = flight(40.0), []
    sd.write_recording(recording, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    path = tmp_path / "logs" / "log.jsonl"
    path.parent.mkdir()
    live = sd.Live(
        config(tmp_path, part) | {"log": str(path)}, on_event=lambda t, text: said.append(text)
    )
    if at:
        opened, full = Path.open, Path("/dev/full")

        def opens(of, mode="r", **more):
            return opened(full, "wb") if mode == "xb" else opened(of, mode, **more)

        monkeypatch.setattr(Path, "open", opens)
    else:
        path.parent.rmdir()
    live.run()
    why = "No space left on device" if at else "No such file or directory"
    cut = [text for text in said if text.startswith("log: ")]
    assert cut == [f"log: {path}: cannot be written ({why}); it ends here"]
    assert live.cut_logs == {str(path): why} and live.logs == [path] * at
    assert np.array_equal(live.stream.belief.P, expected(recording).P)


@pytest.mark.skipif(os.name == "nt", reason="needs ulimit")
def test_the_end_says_which_log_is_cut(tmp_path):
    """Log and output say the same where the system lets a file grow no further."""
    sd.write_recording(flight(60.0), tmp_path / "flight.nc")
    (tmp_path / "live.toml").write_text(
        'log = "log.jsonl"\n[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = inf\n'
        '[[output]]\nport = "file:states"\n'
    )
    words = f"ulimit -f 64; exec {sys.executable} -m strapdown live live.toml"
    done = subprocess.run(["bash", "-c", words], cwd=tmp_path, capture_output=True, text=True)
    *_, cut, wrote = done.stdout.splitlines()
    assert cut == "log.jsonl: ends too early: File too large" and wrote == "wrote log.jsonl"
    said = done.stderr.splitlines()
    assert [line for line in said if "file:states: File too large; it is tried" in line]
    assert done.returncode == 0 and done.stderr.count("log: log.jsonl: cannot be written") == 1


@pytest.mark.parametrize("key", ["log", "state", "output"])
@pytest.mark.parametrize("fault", ["missing", "read-only"])
def test_a_folder_that_cannot_be_written_is_refused_at_the_start(key, fault, tmp_path, monkeypatch):
    folder = tmp_path / "there"
    if fault == "read-only":
        folder.mkdir()
        monkeypatch.setattr(os, "access", lambda path, mode: False)
    path = str(folder / "file")
    with pytest.raises(DataError, match="there is no folder|cannot be written there") as error:
        sd.Live(
            config(tmp_path, {"port": "-"})
            | {"log": ""}
            | {key: [{"port": f"file:{path}"}] if key == "output" else path}
        )
    assert path in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("key", ["log", "state", "output"])
def test_where_a_file_is_there_an_output_needs_that_alone(key, tmp_path, monkeypatch):
    """The others are made anew in the folder."""
    path, needed = tmp_path / "file", []
    path.touch()
    monkeypatch.setattr(os, "access", lambda place, mode: needed.append(place) or True)
    given = [{"port": f"file:{path}"}] if key == "output" else str(path)
    config_of(config(tmp_path, {"port": "-"}) | {"log": ""} | {key: given})
    assert needed == [path if key == "output" else tmp_path]


def test_sources_of_one_name_in_a_recording_are_refused(tmp_path):
    recording = flight()
    sources = [replace(a, name="GNSS") for a in recording.sources]
    sd.write_recording(replace(recording, sources=sources), tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc")}
    with pytest.raises(DataError, match="source.. 1 and 2 are both named 'GNSS'"):
        sd.Live({"input": [part]})


def test_killed_at_any_moment_the_log_is_whole_and_the_state_goes_on(tmp_path):
    """kill -9 of the command while a recording is replayed in real time."""
    recording = flight(60.0)
    sd.write_recording(recording, tmp_path / "flight.nc")
    (tmp_path / "live.toml").write_text(
        'log = "log.jsonl"\nstate = "state"\nsave_every = 0.2\nlag = 0.5\n'
        '[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = 10.0\n'
    )
    words = [sys.executable, "-m", "strapdown", "live", "live.toml"]
    process = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60.0
    log = tmp_path / "log.jsonl"
    while not (log.exists() and log.stat().st_size > 40_000):
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    found = sd.read(log)
    assert len(found.imu.t) > 150
    assert np.isfinite(sd.fuse(found).trajectory.lla).all()
    said = []
    again = sd.Live(tmp_path / "live.toml", on_event=lambda t, text: said.append(text))
    assert any("goes on from" in text for text in said) and again.stream.started
    again.close()


@pytest.fixture
def replays(tmp_path):
    """Function that starts the command on a replayed flight with a log and a state that is due late, and
    returns it once the filter runs."""
    started = []

    def start(*words, more="", before=(), **streams):
        sd.write_recording(flight(60.0), tmp_path / "flight.nc")
        (tmp_path / "live.toml").write_text(
            'log = "log.jsonl"\nstate = "state"\nsave_every = 600.0\nlag = 0.5\n'
            '[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = 10.0\n' + more
        )
        run = [*before, sys.executable, "-m", "strapdown", "live", "live.toml", *words]
        started.append(subprocess.Popen(run, cwd=tmp_path, **streams))
        end, log = time.monotonic() + 60.0, tmp_path / "log.jsonl"
        while not (log.exists() and log.stat().st_size > 40_000):
            assert time.monotonic() < end and started[-1].poll() is None
            time.sleep(0.05)
        return started[-1]

    yield start
    for each in started:
        each.kill()
        each.communicate()


@pytest.mark.parametrize("name, code", [("SIGTERM", 0), ("SIGHUP", 0), ("SIGINT", 130)])
def test_told_to_end_it_saves_its_state_and_says_its_counts(name, code, replays, tmp_path):
    process = replays("--json", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.send_signal(getattr(signal, name))
    if name != "SIGINT":  # a second one, as of a service, spoils nothing
        process.send_signal(signal.SIGTERM)
    told, said = process.communicate(timeout=30.0)
    assert process.returncode == code
    assert (b"interrupted; files written so far are whole" in said) == (name == "SIGINT")
    assert (tmp_path / "state").stat().st_size > 1000
    (used, _), *_ = json.loads(told)["counts"].values()
    assert used > 5


def test_a_terminal_that_goes_ends_it_in_order(replays, tmp_path):
    """Neither its events nor its counts can be said any more."""
    ours, theirs = os.openpty()
    process = replays("--terminal", stdout=theirs, stderr=theirs)
    os.close(theirs)
    os.close(ours)
    time.sleep(1.2)
    assert process.poll() is None
    process.send_signal(signal.SIGHUP)
    assert process.wait(30.0) == 0
    assert (tmp_path / "state").stat().st_size > 1000


def test_a_signal_that_is_ignored_stays_so(replays):
    """As with nohup."""
    process = replays(before=["sh", "-c", 'trap "" HUP; exec "$@"', "sh"], stderr=subprocess.PIPE)
    process.send_signal(signal.SIGHUP)
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(1.0)


@pytest.mark.parametrize("more", ["", '[[output]]\nport = "-"\n'])
@pytest.mark.parametrize("numbers", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_standard_streams_that_are_closed_are_no_failure(numbers, more, replays, tmp_path):
    before = ["sh", "-c", f'exec "$@" {numbers}', "sh"]
    process = replays(more=more, before=before, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.terminate()
    _, said = process.communicate(timeout=30.0)
    assert process.returncode == 0 and b"Traceback" not in said
    assert (b"-: it is closed" in said) == (bool(more) and numbers == ">&-")
    assert (tmp_path / "state").stat().st_size > 1000


def test_standard_output_whose_reader_goes_is_no_failure(replays, tmp_path):
    process = replays(
        more='[[output]]\nport = "-"\n', stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.readline()
    process.stdout.close()
    time.sleep(0.5)
    process.terminate()
    said = process.stderr.read()
    assert process.wait(30.0) == 0 and b"-: Broken pipe" in said and b"Traceback" not in said
    assert (tmp_path / "state").stat().st_size > 1000


def test_after_a_step_back_of_the_clock_an_output_keeps_its_rate(tmp_path):
    """10 Hz of samples at 100 Hz, while the time steps back by 40 s."""
    port = _StatePort(OutputPart("json", address_of(f"file:{tmp_path}/out", "out"), 10.0))
    lines, begin = [], sd.align(flight(), "tactical")
    port.sink = SimpleNamespace(write=lines.append)
    belief = begin.belief(np.zeros(1))
    for t in np.r_[np.arange(100.0, 140.0, 0.01), np.arange(100.0, 140.0, 0.01)].tolist():
        port.show(SimpleNamespace(t=t, status=0, belief=belief, alignments=0), None)
    assert 780 <= len(lines) <= 820


# ---- the log as a file


def written_log(tmp_path):
    recording = flight()
    sd.write_recording(recording, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    live = sd.Live(config(tmp_path, part))
    live.run()
    return live, (tmp_path / "log.jsonl").read_bytes()


def test_the_log_holds_an_imu_and_a_vehicle_that_have_no_name(tmp_path):
    sd.write_recording(flight(), tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    own = replace(sd.imu("tactical"), name="mine"), replace(find_vehicle("aircraft"), speed=200.0)
    live = sd.Live(config(tmp_path, part, imu=own[0], vehicle=own[1]))
    live.run()
    log = sd.read(live.logs[0])
    assert sd.imu(log.meta["grade"]) == own[0] and find_vehicle(log.meta["vehicle"]) == own[1]
    assert np.array_equal(sd.fuse(log).trajectory.lla[-1], live.stream.belief.lla)


def test_a_cut_log_is_read_up_to_its_last_whole_line(tmp_path):
    _, content = written_log(tmp_path)
    whole = sd.read(tmp_path / "log.jsonl")
    cut = tmp_path / "cut.jsonl"
    for size in (len(content) - 1, len(content) - 40, len(content) // 2):
        cut.write_bytes(content[:size])
        part = sd.read(cut)
        n = len(part.imu.t)
        assert 0 < n < len(whole.imu.t) + 1
        assert np.array_equal(part.imu.dv, whole.imu.dv[:n])


@pytest.mark.parametrize(
    "old, new_text, said",
    [
        (b'"format": 1', b'"format": 7', "is a live log of format 7, this version reads 1"),
        (b'"kind": "position"', b'"kind": "none"', "unknown|none"),
        (b"\n[", b"\n[[", "line 2 is neither a sample nor a fix"),
        (b'"parameters": [', b'"parameters": ["a", ', "does not hold what a live log holds"),
        (b'"start": {"t"', b'"start": {"u"', "does not hold what a live log holds"),
    ],
)
def test_a_damaged_log_is_refused_in_one_line(tmp_path, old, new_text, said):
    _, content = written_log(tmp_path)
    assert old in content
    bad = tmp_path / "bad.jsonl"
    bad.write_bytes(content.replace(old, new_text, 1))
    with pytest.raises(DataError, match=said) as error:
        sd.read(bad)
    assert "\n" not in str(error.value)


def test_what_was_not_measured_is_kept():
    line = live_log.fix_line(0, 1.5, (1.0, np.nan, 3.0), (0.1, np.nan, 0.3))
    assert json.loads(line) == [0, 1.5, [1.0, None, 3.0], [0.1, None, 0.3]]
    assert json.loads(live_log.sample_line(1.0, 0.1, np.array([1, 2, 3]), (0.1, 0.2, 0.3))) == [
        1.0,
        0.1,
        [1.0, 2.0, 3.0],
        [0.1, 0.2, 0.3],
    ]


# ---- the configuration and the command


@pytest.mark.parametrize(
    "change, said",
    [
        ({"input": []}, "has no \\[\\[input\\]\\]"),
        ({"inputs": 3}, "unknown key 'inputs'"),
        ({"lag": -1}, "lag"),
        (
            {"input": [{"port": "udp:x"}]},
            "\\[\\[input\\]\\] 1: port is 'udp:x'; it must be udp:HOST",
        ),
        ({"input": [{"port": "usb:1:2"}]}, "port is 'usb:1:2'"),
        ({"input": [{"port": "udp:99999"}]}, "port 'udp:99999'"),
        ({"input": [{"port": "udp:7000", "format": "xml"}]}, "format is 'xml'"),
        ({"input": [{"format": "recording"}]}, "path is None"),
        ({"input": [{"port": "udp:1", "format": "ubx", "clock": "unix"}]}, "clock is 'unix'"),
        ({"input": [{"port": "udp:1", "latency": 0.1}]}, "latency is that of the clock .arrival."),
        ({"source": [{"kind": "nothing"}]}, "source.. 1: .*nothing"),
        ({"source": [{"kind": "position", "gate": "x"}]}, "gate"),
        ({"source": {"kind": "position"}}, "source must be given as \\[\\[source\\]\\]"),
        ({"output": [{"port": "udp:1", "rate": 0}]}, "rate"),
        (
            {"output": [{"port": "udp:1", "format": "mavlink", "messages": ["GPS"]}]},
            "messages is 'GPS'",
        ),
        ({"output": [{"port": "udp:1", "messages": ["GPS_INPUT"]}]}, "of the format .mavlink."),
        (
            {"output": [{"port": "udp:1", "format": "mavlink", "messages": "ODOMETRY"}]},
            "messages is 'ODOMETRY'; it must be a list",
        ),
        ({"input": [{"port": "udp:1", "columns": ["t"]}]}, "columns are those of the format"),
        ({"input": [{"port": "udp:1", "format": "csv", "columns": "t"}]}, "columns is 't'"),
        (
            {"input": [{"port": "udp:1", "format": "csv", "columns": ["t", "gyro_x"]}]},
            "1: columns are .'t', 'gyro_x'.; they must have t, and gyro_x to accel_z",
        ),
        ({"input": [{"port": "udp:1", "format": "csv", "clock": "none"}]}, "clock is 'none'"),
        ({"epoch": "soon"}, "^configuration: epoch: 'soon' is no time"),
        ({"epoch": 5}, "^configuration: epoch: it is 5; it must be text"),
        ({"imu": "best"}, "^configuration: .*'best'"),
        ({"options": {"none": 1}}, "^configuration: .*none"),
        ({"log": "a", "state": "a"}, "a is named twice among log, state, inputs and outputs"),
        ({"log": "a", "input": [{"port": "file:a"}]}, "a is named twice"),
        ({"output": [{"port": "file:a"}, {"port": "file:a"}]}, "a is named twice"),
        ({"options": 5}, "options is 5; it must be a table"),
        ({"options": [["a", 1]]}, "options is .*; it must be a table"),
        ({"log": "a\0b"}, "log is 'a.x00b'; it must be text"),
        ({"state": "a\0b"}, "state is 'a.x00b'; it must be text"),
        ({"log": "/dev/null"}, "log: /dev/null is no regular file"),
        ({"log": "/dev"}, "log: /dev is no regular file"),
        ({"state": "/dev/full"}, "state: /dev/full is no regular file"),
        ({"input": [{"port": "file:a\0b"}]}, "port is 'file:a.x00b'"),
        ({"input": [{"port": "serial:/dev/a\0b:9600"}]}, "port is 'serial:/dev/a.x00b:9600'"),
        ({"input": [{"port": f"udp:{'a' * 70}:7001"}]}, "port is 'udp:aaa"),
        ({"output": [{"port": "tcp:a\0b:7001"}]}, "port is 'tcp:a.x00b:7001'"),
        ({"input": [{"format": "recording", "path": "a\0b"}]}, "path is 'a.x00b'"),
        ({"source": [{"kind": "position", "name": 5}]}, "name is 5; it must be text"),
        ({"source": [{"kind": "position", "lever_arm": [1.0]}]}, "lever_arm is .1.0.; it must be"),
        ({"source": [{"kind": "position", "lever_arm": [1, 2]}]}, "1: lever_arm is .1, 2."),
        ({"source": [{"kind": "velocity", "parameters": [0.0] * 5}]}, "three numbers"),
        ({"source": [{"kind": "position", "lever_arm": [0, 0, True]}]}, "lever_arm is True"),
        (
            {"source": [{"kind": "position", "lever_arm": [0] * 3, "parameters": [0] * 3}]},
            "has lever_arm and parameters",
        ),
        ({"filter": "none"}, "none"),
        (
            {"source": [{"kind": "position"}, {"kind": "altitude"}, {"kind": "position"}]},
            "source.. 1 and 3 are both named 'position'; give each a `name`",
        ),
        (
            {"source": [{"kind": "position", "name": "a"}, {"kind": "altitude", "name": "a"}]},
            "source.. 1 and 2 are both named 'a'",
        ),
        (
            {"input": [{"port": "serial:/dev/x:123"}]},
            "1: port 'serial:/dev/x:123': 123 bit/s is no rate of this system; the nearest are 1",
        ),
        ({"output": [{"port": "serial:/dev/x:9601"}]}, "9601 bit/s is no rate .* 9600"),
    ],
)
def test_a_wrong_configuration_is_refused_in_one_line(tmp_path, change, said):
    with pytest.raises(DataError, match=said) as error:
        sd.Live(config(tmp_path, {"port": "udp:7001"}) | change)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seconds", [-1.0, float("nan")])
def test_a_wrong_time_to_run_is_refused(tmp_path, seconds, command):
    (tmp_path / "live.toml").write_text('imu = "tactical"\n[[input]]\nport = "udp:7001"\n')
    code, _, err = command("live", tmp_path / "live.toml", "--seconds", seconds)
    assert code == 2 and len(err) == 1 and "--seconds is" in err[0]
    with sd.Live(tmp_path / "live.toml") as live, pytest.raises(DataError, match="^seconds is"):
        live.run(seconds)


@pytest.mark.parametrize("given", [5, None, ["live.toml"], "a\0b.toml", b"live.toml"])
def test_what_is_no_configuration_is_refused_in_one_line(given):
    with pytest.raises(DataError, match="^config is ") as error:
        sd.Live(given)
    assert "\n" not in str(error.value)


def test_the_command(tmp_path, good, command, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sd.write_recording(flight(), tmp_path / "flight.nc")
    (tmp_path / "live.toml").write_text(
        'log = "log.jsonl"\n[[input]]\nformat = "recording"\npath = "flight.nc"\nspeed = inf\n'
    )
    said = good("live", "live.toml")
    assert "GNSS position: 19 used, 0 rejected" in said and "log.jsonl" in said
    fused = json.loads(good("fuse", "log.jsonl", "--json"))
    assert fused
    (tmp_path / "live.toml").write_text("[[input]]\nport = 3\n")
    code, _, err = command("live", "live.toml")
    assert code == 2 and len(err) == 1 and "live.toml: [[input]] 1: port is 3" in err[0]


# ---- restarts


def by_unix(recording, began):
    """The recording as JSON lines with UNIX time, from a moment on."""
    tables = [json.loads(line) for line in json_lines(recording)]
    return [(json.dumps(a | {"t": a["t"] + began}) + "\n").encode() for a in tables]


def growing(tmp_path, **more):
    """A configuration of a file that grows with UNIX times, and a state; and that file."""
    part = {"port": f"file:{tmp_path / 'lines'}", "clock": "unix"}
    return config(tmp_path, part, state=str(tmp_path / "state"), **more), tmp_path / "lines"


@pytest.mark.parametrize("later, alignments", [(86400.0 + 40.0, 1), (45.0, 0)])
def test_a_restart_counts_from_the_midnight_of_the_state(tmp_path, later, alignments):
    """A day later it aligns anew; a moment later, across midnight, it goes on."""
    asked, path = growing(tmp_path)
    began = 1_700_006_400.0 - 30.0  # s, before a midnight
    path.write_bytes(b"".join(by_unix(flight(), began)))
    with sd.Live(asked) as live:
        turn_until(live, lambda: live.stream.stream.newest > 86369.0 + 20.0)
    path.write_bytes(b"".join(by_unix(flight(), began + later)))
    with sd.Live(asked) as again:
        assert again.stream.started and again.stream.t > 86380.0
        turn_until(again, lambda: again.stream.stream.newest > 86369.0 + later + 20.0)
        assert again.stream.alignments == alignments


@pytest.mark.parametrize("change", [{"imu": "consumer"}, {"epoch": "2020-01-01T00:00:00Z"}])
def test_a_state_of_another_configuration_is_kept(tmp_path, change, monkeypatch):
    asked, path = growing(tmp_path)
    path.write_bytes(b"".join(by_unix(flight(), 1_700_006_400.0)))
    with sd.Live(asked) as live:
        turn_until(live, lambda: live.stream.started)
    before = (tmp_path / "state").read_bytes()
    with pytest.raises(DataError, match="with another .*name another one as `state`"):
        sd.Live(asked | change)
    # of another version: of the package, or of the file
    first, rest = before.split(b"\n", 1)
    (tmp_path / "state").write_bytes(first[:-1] + b"7\n" + rest)
    with pytest.raises(DataError, match="is of format 7.*name another one as `state`"):
        sd.Live(asked)
    (tmp_path / "state").write_bytes(before)
    with monkeypatch.context() as patch:
        patch.setattr("strapdown.engine.stream.__version__", "9.9")
        with pytest.raises(DataError, match="another strapdown: .*name another one as `state`"):
            sd.Live(asked)
    assert (tmp_path / "state").read_bytes() == before
    (tmp_path / "state").write_bytes(b"a thesis")
    with pytest.raises(DataError, match="is no saved stream"):
        sd.Live(asked)
    (tmp_path / "state").write_bytes(before[:-9])  # of no use to anyone
    sd.Live(asked).close()


def test_a_restored_state_is_stale_until_a_sample_comes(tmp_path):
    asked, path = growing(tmp_path)
    lines = by_unix(flight(), 1_700_006_400.0)
    path.write_bytes(b"".join(lines[:-100]))
    with sd.Live(asked) as live:
        turn_until(live, lambda: live.stream.started and not live.turn())
        assert live.status == live.stream.status != INVALID
    with sd.Live(asked) as again:
        again.turn()
        assert again.stream.started and again.is_stale and again.status == INVALID
        with path.open("ab") as file:
            file.write(b"".join(lines[-100:]))
        turn_until(again, lambda: not again.is_stale)
        assert again.status == again.stream.status != INVALID


def test_a_restart_goes_on_where_the_file_was_read_up_to(tmp_path):
    """In the middle of a line; a file that took its place is read from its beginning."""
    asked, path = growing(tmp_path)
    data, whole = b"".join(by_unix(flight(), 1.7e9)), expected(flight())
    path.write_bytes(data[: len(data) * 3 // 4 + 5])
    with sd.Live(asked) as live:
        turn_until(live, lambda: not live.turn())
    sd.Live(asked).close()  # reads nothing
    path.write_bytes(data)
    with sd.Live(asked) as again:
        turn_until(again, lambda: again.stream.stream.newest > 80000.0 + 19.9)
        at_the_end = again.stream.now
    assert np.allclose(at_the_end.lla, whole.lla, rtol=0, atol=1e-9)
    dropped = again.stream.dropped_by
    assert sum(dropped.values()) == dropped["before the start"] and again.bad == 0
    assert again.stream.alignments == 0
    path.write_bytes(b"".join(by_unix(flight(seed=8), 1.7e9 + 100.0)))
    with sd.Live(asked) as other:
        turn_until(other, lambda: other.stream.stream.newest > 80000.0 + 119.9)


@pytest.mark.parametrize("format, made", [("ubx", ubx_bytes), ("nmea", nmea_bytes)])
def test_a_restart_uses_each_epoch_of_a_receiver_once(tmp_path, format, made, monkeypatch):
    from strapdown.cli.live import input_formats, program

    for module in (input_formats, program):
        monkeypatch.setattr(module, "QUIET", 0.0)
    path, data, times = tmp_path / "log", made(200), []
    part = {"port": f"file:{path}", "format": format}
    asked = config(tmp_path, part, state=str(tmp_path / "state"))
    for share in (0.5, 1.0):
        path.write_bytes(data[: int(len(data) * share)])
        with sd.Live(asked) as live:
            live.stream.step = lambda event: times.append((event.source, event.t))
            turn_until(live, lambda: not live.turn())
    assert len(times) == len(set(times)) == 400
    assert np.diff(sorted(t for source, t in times if source == 0)) == pytest.approx(0.2)


def test_a_recording_fills_the_sources_of_its_names_and_kinds(tmp_path):
    recording, said = flight(), []
    p, v = recording.sources
    both = replace(recording, sources=(v, replace(p, name="other"), p))
    sd.write_recording(both, tmp_path / "flight.nc")
    part = {"format": "recording", "path": str(tmp_path / "flight.nc"), "speed": np.inf}
    live = sd.Live(config(tmp_path, part), on_event=lambda t, text: said.append(text))
    live.run()
    assert np.array_equal(live.stream.belief.P, expected(recording).P)
    assert said == [f"{tmp_path}/flight.nc: other is no [[source]]; it is left out"]
