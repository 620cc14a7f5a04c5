"""The replays of recorded data that are kept as CSV: `python tests/golden/replay.py` writes them
anew after a wanted change of behaviour."""

from pathlib import Path

import strapdown as sd

FOLDER = Path(__file__).resolve().parent
DESCRIPTIONS = FOLDER.parents[1] / "examples" / "recordings"
REPLAYS = [
    (name, filter)
    for name in ("thor75", "drive0708", "drive0708-vehicle")
    for filter in ("closed-loop", "open-loop")
]
COLUMNS = [
    "lat",
    "lon",
    "alt",
    "VN",
    "VE",
    "VD",
    "roll",
    "pitch",
    "heading",
    "std_north",
    "std_down",
    "std_rotation_down",
    "accel_bias_x",
    "gyro_bias_z",
]
STEP = 5.0
"""Seconds between the rows that are kept."""


def replay(name, filter):
    """A table of the solution every STEP seconds, units as in `strapdown.data.solution.UNITS`."""
    recording = sd.read(DESCRIPTIONS / f"{name}.toml")
    table = sd.fuse(recording, filter).table()[COLUMNS]
    return table.iloc[:: round(STEP / float(table.index.to_series().diff().median()))].round(9)


if __name__ == "__main__":
    for name, filter in REPLAYS:
        replay(name, filter).round(
            {column: 9 if column in ("lat", "lon") else 5 for column in COLUMNS}
        ).to_csv(FOLDER / f"{name}-{filter}.csv")
        print(name, filter)
