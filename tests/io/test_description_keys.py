"""Every key of a source in `recording.toml` changes the recording, or is refused for its kind."""

import re

import given_files
import numpy as np
import pandas as pd
import pytest
from described import TOML, described

import strapdown as sd
from strapdown.io.description.schema_source import SourcePart

pytestmark = pytest.mark.short
SOURCES = {
    "position": 'columns = ["a", "b", "c"]\nunit = ["rad", "rad", "m"]\nstd = 1.0\n',
    "velocity": 'columns = ["a", "b", "c"]\nunit = "m/s"\nstd = 0.1\n',
    "speed": 'columns = ["a"]\nunit = "m/s"\nstd = 0.1\n',
    "altitude": 'columns = ["a"]\nunit = "m"\nstd = 1.0\n',
    "heading": 'columns = ["a"]\nunit = "rad"\nstd = 0.1\n',
    "attitude": 'columns = ["a", "b", "c"]\nunit = "rad"\nstd = 0.1\n',
    "baseline": 'columns = ["a", "b", "c"]\nunit = "m"\nstd = 0.1\nbaseline = [1.0, 0.0, 0.0]\n',
    "beam-velocity": 'columns = ["a"]\nunit = "m/s"\nstd = 0.1\ndirection = [1.0, 0.0, 0.0]\n',
    "indicated-airspeed": 'columns = ["a"]\nunit = "m/s"\nstd = 1.0\n',
    "range": 'columns = ["a"]\nunit = "m"\nstd = 1.0\nbeacon = { lat = 47, lon = 8, height = 0 }\n',
    "zero-velocity": "rate = 10\nstd = 0.1\n",
    "zero-lateral-velocity": "rate = 10\nstd = 0.1\n",
}
VALUES = {
    "table": '"other"',
    "where": '[{ column = "t", most = 20 }]',
    "form": '"speed-course"',
    "scale": "1.5",
    "axes": '"ENU"',
    "quaternion": '"wxyz"',
    "geoid": '"EGM96"',
    "lever_arm": "[1.0, 0.0, 0.0]",
    "calibration": '"mag.toml"',
    "field": '"record"',
    "declination": '{ value = 2.0, unit = "deg" }',
    "rate": "7.0",
    "level": "3.0",
    "estimate": '["clock"]',
    "slip_test": "false",
    "slip": "0.05",
    "correlated": "{ std = 0.5, time = 60 }",
    "robust": "true",
    "adaptive": "60.0",
    "gate": "5.0",
    "atmosphere": "{ pressure = 950, temperature = 31, height = 250 }",
    "baseline": "[0.0, 1.0, 0.0]",
    "drag": "0.4",
    "beacon": "{ lat = 47.001, lon = 8, height = 0 }",
    "direction": "[0.0, 2.0, 0.0]",
    "receiver": '"GNSS"',
    "name": '"mine"',
}
GIVEN = {"kind", "file", "time", "columns", "unit", "std"}
"""Keys of every source above; what they do is tested with the readers."""
NO_SLIP = {("speed", "slip_test")}
"""Of wheels that do not slip."""


def content(recording):
    """What reading gives, as text."""
    sources = [
        (*a.__dict__.items(),) if hasattr(a, "__dict__") else tuple(a) for a in recording.sources
    ]
    with np.printoptions(threshold=10**6, precision=17):
        return repr(([np.asarray(c).tobytes() for c in recording.imu], sources, recording.meta))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Tables of all kinds of sources."""
    folder = tmp_path_factory.mktemp("keys")
    drive = given_files.car().between(5.0, 40.0)
    described(drive, folder)
    truth, t = drive.reference, np.arange(5.5, 39.5, 0.5)
    at = np.searchsorted(truth.t, t)
    speed = truth.rotation.inv().apply(truth.v_n.copy())[at, :1]
    for kind, values in (
        ("speed", speed),
        ("beam-velocity", speed),
        ("indicated-airspeed", speed),
        ("range", 100 + speed),
        ("altitude", truth.lla[at, 2:]),
        ("heading", truth.rph[at, 2:]),
        ("attitude", truth.rph[at]),
        ("baseline", truth.rotation.as_matrix()[at, :, 0]),
    ):
        names = ["t", *"abc"[: values.shape[1]]]
        pd.DataFrame(np.c_[t, values], columns=names).to_csv(folder / f"{kind}.csv", index=False)
    return folder


def read(folder, kind, more=""):
    """The recording of the IMU, positions and a source of a kind with more keys."""
    own = f'file = "{kind}.csv"\ntime = {{ column = "t", unit = "s" }}\n'
    lines = SOURCES[kind]
    if more.startswith("rate") and "rate" in lines:
        lines = lines.replace("rate = 10\n", "")
    if more.startswith(("baseline", "direction", "beacon")):
        lines = re.sub(f"{more.partition(' ')[0]} = .*\n", "", lines)
    source = f'[[source]]\nkind = "{kind}"\n{"" if kind.startswith("zero") else own}{lines}{more}\n'
    path = folder / "keys.toml"
    path.write_text(TOML.partition("[[source]]")[0] + source)
    return content(sd.read(path))


def test_all_keys_are_tried():
    assert SourcePart.model_fields.keys() == VALUES.keys() | GIVEN


@pytest.mark.parametrize("kind", SOURCES)
def test_every_key_of_a_source_does_something_or_is_refused(folder, kind):
    base, idle = read(folder, kind), []
    assert base == read(folder, kind)
    for key, value in VALUES.items():
        try:
            if read(folder, kind, f"{key} = {value}") == base and (kind, key) not in NO_SLIP:
                idle.append(key)
        except sd.DataError as error:
            assert len(str(error).splitlines()) == 1
    assert not idle, f"{kind}: {', '.join(idle)} change nothing"
