"""A simulated flight with a sensor of each kind that measures a speed in the body, a depth or a range."""

import strapdown as sd

SCENARIO = """
duration_s = 30
imu = "tactical"
rate_hz = 50
[motion]
kind = "demo"
"""
SENSORS = {
    "body-velocity": "[0.5, 0.1, 0.2]",
    "beam-velocity": "[0.5, 0.1, 0.2, 0.6, 0.0, 0.8]",
    "depth": "[0.5, 0.1, 0.2]",
    "water-pressure": "[0.5, 0.1, 0.2]",
    "range": "[0.5, 0.1, 0.2, {lat:.12f}, {lon:.12f}, {h:.3f}]",
}
"""{kind: parameters}, the beacon some 640 m north of the start and 100 m below it."""


def recording(folder):
    """It, from a scenario in that folder."""
    path = folder / "mine.toml"
    path.write_text(SCENARIO)
    lat, lon, h = sd.simulate(path).reference.lla[0]
    sensors = [
        f'[[sensors]]\nkind = "{kind}"\nstd = 0.2\nrate_hz = 2\n'
        f"parameters = {parameters.format(lat=lat + 1e-4, lon=lon, h=h - 100)}\n"
        for kind, parameters in SENSORS.items()
    ]
    path.write_text(SCENARIO + "".join(sensors))
    return sd.simulate(path)
