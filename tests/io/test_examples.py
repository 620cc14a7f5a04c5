"""The recordings that come with the project, and every description in the documentation, are
read as they stand."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from strapdown.io import read, write_recording
from strapdown.io.inspection import inspect

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "recordings"
PAGE = ROOT / "docs" / "reference" / "recording-format.md"
DESCRIBED = (
    "time",
    "angle",
    "angular rate",
    "acceleration",
    "velocity increment",
    "length",
    "speed",
    "magnetic field",
    "pressure",
)
"""Dimensions of what a description names; the others are those of IMU errors."""


@pytest.mark.parametrize(
    "name, samples, fixes, rest",
    [
        ("thor75", 34811, {"position": 673, "velocity": 673}, [1.925, -0.708, -9.702]),
        ("drive0708", 54858, {"position": 2197, "velocity": 2197}, [-0.007, 0.202, -9.932]),
        (
            "drive0708-vehicle",
            54858,
            {
                "position": 2197,
                "velocity": 2197,
                "zero-lateral-velocity": 5487,
                "zero-vertical-velocity": 5487,
                "zero-velocity": 562,
            },
            [-0.007, 0.202, -9.932],
        ),
        (
            "drive0708-kit",
            54858,
            {
                "position": 2197,
                "velocity": 2197,
                "zero-lateral-velocity": 5487,
                "zero-vertical-velocity": 5487,
                "zero-velocity": 562,
                "zero-angular-rate": 562,
            },
            [-0.007, 0.202, -9.932],
        ),
    ],
)
def test_example_recordings(data_folder, name, samples, fixes, rest):
    recording = read(EXAMPLES / f"{name}.toml")
    assert len(recording.imu.t) == samples
    assert {a.kind: len(a.t) for a in recording.sources} == fixes
    still = recording.imu.t < 34
    np.testing.assert_allclose(
        recording.imu.dv[still].sum(axis=0) / recording.imu.dt[still].sum(), rest, atol=0.01
    )
    found = inspect(EXAMPLES / f"{name}.toml")
    assert found.problems == () and any("turns of the gyro" in line for line in found.facts)
    assert recording.meta["grade"] and recording.meta["date"] and len(recording.reference) > 2000


def test_drive0708_lever_arms_and_axes(data_folder):
    recording = read(EXAMPLES / "drive0708-vehicle.toml")
    arms = {a.kind: a.parameters for a in recording.sources}
    np.testing.assert_allclose(arms["position"], [0, -0.05, 0], atol=1e-12)
    np.testing.assert_allclose(arms["zero-lateral-velocity"], [0, 0, 0.65])
    position, velocity = recording.sources[:2]
    # the vertical velocity has the sign that the height says
    down = -np.gradient(position.y[:, 2], position.t)
    assert np.corrcoef(down, velocity.y[:, 2])[0, 1] > 0.9
    assert recording.sources[4].t[0] < 4 and recording.imu.t[0] == pytest.approx(3.854 - 0.20)


BLOCKS = re.findall(r"```toml\n# (\S+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)


@pytest.fixture
def tables(tmp_path):
    """A folder with the tables that the page's descriptions name."""
    rng = np.random.default_rng(3)
    save = lambda name, columns, header=True: pd.DataFrame(columns).to_csv(
        tmp_path / name, index=False, header=header
    )
    t = 0.01 * np.arange(1, 3001)
    save(
        "imu.csv",
        {"t": t}
        | {name: rng.normal(0, 0.1, 3000) for name in ("gx", "gy", "gz", "ax", "ay")}
        | {"az": rng.normal(-1, 0.005, 3000)},
    )
    s = np.arange(1.0, 29)
    fix = {
        "t": s,
        "lat": 48 + 0 * s,
        "lon": 11 + 0 * s,
        "alt": 500 + 0 * s,
        "ve": 1.0,
        "vn": 2.0,
        "vu": 0.1,
        "hdg": 26.0,
        "std_h": 0.5,
        "std_v": 80,
    }
    save("gnss.csv", fix)
    save("odometer.csv", {"ms": 1000 * s, "speed": 80}, header=False)
    save(
        "truth.csv",
        {
            "t": s,
            "lat": 48,
            "lon": 11,
            "alt": 500,
            "vn": 2,
            "ve": 1,
            "vd": 0,
            "roll": 0,
            "pitch": 0,
            "heading": 26,
        },
    )
    for name, text in BLOCKS:
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    "number", [i for i, (name, _) in enumerate(BLOCKS) if name == "recording.toml"]
)
def test_every_description_of_the_page_reads(tables, number):
    text = BLOCKS[number][1]
    (tables / "recording.toml").write_text(text, encoding="utf-8")
    recording = read(tables / "recording.toml")
    assert len(recording.imu.t) == 3000 and recording.meta["notes"] in (
        [],
        ["zero-velocity: no rest was found, so it never applies"],
    )
    assert len(recording.sources) == text.count("[[source]]") and (
        recording.reference is not None
    ) == ("[reference]" in text)
    write_recording(recording, tables / "recording.nc")
    assert [a.name for a in read(tables / "recording.nc").sources] == [
        a.name for a in recording.sources
    ]


def test_the_complete_description_means_what_the_page_says(tables):
    (tables / "recording.toml").write_text(
        max((text for name, text in BLOCKS if name == "recording.toml"), key=len), encoding="utf-8"
    )
    recording = read(tables / "recording.toml")
    sources = {a.name: a for a in recording.sources}
    np.testing.assert_allclose(sources["position"].std[0], [0.5, 0.5, 0.8])
    np.testing.assert_allclose(sources["position"].parameters, [0, -0.05, 0])
    np.testing.assert_allclose(sources["velocity"].y[0], [2, 1, -0.1])
    np.testing.assert_allclose(sources["dual antenna"].std[0], np.radians(2))
    np.testing.assert_allclose(sources["speed"].y[0], 8 / 3.6)
    np.testing.assert_allclose(sources["speed"].parameters, [0, 0, 0.65])
    np.testing.assert_allclose(sources["speed"].t[0], 1.0)
    np.testing.assert_allclose(np.degrees(recording.reference.rph[0]), [0, 0, 26], atol=1e-9)


def test_the_page_names_every_key_unit_and_kind():
    from strapdown.aiding import names
    from strapdown.io.description.schema import Description, ImuPart, ReferencePart, SourcePart
    from strapdown.units.conversion import UNITS

    page = PAGE.read_text(encoding="utf-8")
    words = {
        key
        for part in (Description, ImuPart, SourcePart, ReferencePart)
        for key in part.model_fields
    } - {"imu", "source", "reference"}
    words |= {unit for name in DESCRIBED for unit in UNITS[name]} | set(names())
    assert [word for word in sorted(words) if f"`{word}`" not in page] == []
