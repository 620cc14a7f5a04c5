"""`python loads_of_live.py INPUT OUTPUT FOLDER`: a simulated flight through `Live`, the IMU as JSON and the fixes
by this format. Prints as JSON which files and modules were opened after the constructor returned."""

import json
import socket
import sys
import time

import numpy as np
import written_nmea
import written_ubx

import strapdown as sd

BEGIN = 10
"""s of the first sample after the first epoch of `written_ubx`."""
OPENED = []
IS_READY = False


def hook(name, arguments):
    if IS_READY and name in ("import", "open"):
        OPENED.append(str(arguments[0]))


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def epoch(format, k, position, velocity):
    """The bytes of an epoch, in datagrams."""
    t, (lat, lon), height = position.t[k], np.degrees(position.y[k, :2]), position.y[k, 2]
    v_n = velocity.y[k]
    if format == "ubx":
        ms = np.array([written_ubx.GPS + 1000 * BEGIN + round(1e3 * t)])
        place = {"lat": round(lat * 1e7), "lon": round(lon * 1e7), "height": round(height * 1e3)}
        speeds = dict(zip(("velN", "velE", "velD"), np.round(v_n * 1e3)))
        return [row.tobytes() for row in written_ubx.pvt(ms, **place, **speeds)]
    if format == "nmea":
        moment = np.datetime64("2024-05-17T16:53:02.00") + np.timedelta64(
            1000 * BEGIN + round(1e3 * t), "ms"
        )
        course = np.degrees(np.arctan2(v_n[1], v_n[0])) % 360.0
        found = written_nmea.rmc(moment, lat, lon, np.hypot(*v_n[:2]) * 3600 / 1852, course)
        found += written_nmea.gga(moment, lat, lon, height - 47.2)
        return [(found + written_nmea.gst(moment, 1.5, 1.4, 2.5)).encode()]
    rows = [(position.kind, position.y, position.std), (velocity.kind, velocity.y, velocity.std)]
    since = written_ubx.GPS / 1e3 + BEGIN + t
    tables = [{"t": since, "source": kind, "y": [*y[k]], "std": [*std[k]]} for kind, y, std in rows]
    return [json.dumps(table).encode() for table in tables]


def program(format, output, folder):
    """(Live, port of the samples, port of the fixes)."""
    samples, fixes = free_port(), free_port()
    receiver = [{"port": f"udp:127.0.0.1:{fixes}", "format": format}]
    table = {
        "imu": "tactical",
        "lag": 0.5,
        "log": f"{folder}/log.jsonl",
        "source": [{"kind": "position"}, {"kind": "velocity"}],
        "input": [
            {"port": f"udp:127.0.0.1:{samples}", "clock": "gps"},
            *(receiver if format != "json" else []),
        ],
        "output": [{"port": f"udp:127.0.0.1:{free_port()}", "format": output}],
    }
    return sd.Live(table), samples, fixes if receiver and format != "json" else samples


def main():
    global IS_READY
    format, output, folder = sys.argv[1:]
    flight = sd.simulate("demo", 13.0, seed=3, rate=100.0)
    position, velocity = flight.sources[:2]
    sys.addaudithook(hook)
    live, samples, fixes = program(format, output, folder)
    IS_READY = True
    sender, k = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), 0
    live.turn()
    for t, dt, dtheta, dv in zip(*(column.tolist() for column in flight.imu)):
        while k < len(position.t) and position.t[k] + 0.2 < t:
            for data in epoch(format, k, position, velocity):
                sender.sendto(data, ("127.0.0.1", fixes))
            live.turn()
            if format != "json":
                time.sleep(0.035)  # after which the epoch is whole
            k += 1
        sample = {"t": written_ubx.GPS / 1e3 + BEGIN + t, "dt": dt, "dtheta": dtheta, "dv": dv}
        sender.sendto(json.dumps(sample).encode(), ("127.0.0.1", samples))
        live.turn()
    IS_READY = False
    used = [count for count, _ in live.stream.counts()]
    live.close()
    print(json.dumps({"opened": OPENED, "used": used, "bad": live.bad}))


if __name__ == "__main__":
    main()
