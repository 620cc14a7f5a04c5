"""Receivers that tell their carrier solution: a source for each class, with the fixes that were written."""

import numpy as np
import pytest
from support import written_dataflash, written_nmea, written_rtklib, written_ubx, written_ulog

import strapdown as sd
from strapdown.io.decoding.carrier_classes import FLOAT_ERRORS, by_class
from strapdown.io.description.logs import join, open_logs
from strapdown.io.description.schema_source import SourcePart
from strapdown.io.reader import Section

pytestmark = pytest.mark.short
PATTERN = np.array(["single", "float", "fixed", "float", "fixed"])
T = np.datetime64("2024-06-01T12:00:00.000", "ms") + 250 * np.arange(60) * np.timedelta64(1, "ms")


def classes_of(many):
    """(many,) names of the class of each fix."""
    return PATTERN[np.arange(many) * len(PATTERN) // many]


def numbers(values):
    """(60,) the values of a format for each fix, by {class: value}."""
    return np.array([values[name] for name in classes_of(len(T))])


def ubx(path):
    ms = written_ubx.GPS + 250 * np.arange(len(T))
    flags = 1 | numbers({"single": 0, "float": 1, "fixed": 2}) << 6
    path.write_bytes(written_ubx.pvt(ms, flags=flags, lat=400000000).tobytes())


def nmea(path):
    quality = numbers({"single": 1, "float": 5, "fixed": 4})
    written = (
        written_nmea.gga(t, 40.0, -105.0, 1600.0, quality=q)
        + written_nmea.rmc(t, 40.0, -105.0, 0.1, 0.0)
        for t, q in zip(T, quality.tolist())
    )
    path.write_text("".join(written))


def rtklib(path):
    place, std = np.tile([40.0, -105.0, 1600.0], (len(T), 1)), np.full((len(T), 6), 0.01)
    lines = written_rtklib.pos(T, place, std).splitlines()
    told = iter(numbers({"single": 5, "float": 2, "fixed": 1}).tolist())
    rows = [
        line if line.startswith("%") else line.replace(" 1 9 ", f" {next(told)} 9 ")
        for line in lines
    ]
    path.write_text("\n".join(rows) + "\n")


FLOWN = {"duration": 20.0, "imu": "consumer", "seed": 3, "rate": 200.0}


def px4(path):
    flown = sd.simulate("multicopter", gnss="single-point", **FLOWN)
    topics = written_ulog.topics_of(flown)
    many = len(topics["sensor_gps", 0]["timestamp"][1])
    types = {"single": 3, "float": 5, "fixed": 6}
    told = np.array([types[name] for name in classes_of(many)])
    topics["sensor_gps", 0]["fix_type"] = "uint8_t", told
    path.write_bytes(written_ulog.ulog(topics, {}))


def ardupilot(path):
    flown = sd.simulate("multicopter", gnss="single-point", **FLOWN)
    messages = written_dataflash.messages_of(flown)
    gps = messages["GPS"][1]
    types = {"single": 3, "float": 5, "fixed": 6}
    gps["Status"] = np.array([types[name] for name in classes_of(len(gps["TimeUS"]))])
    path.write_bytes(written_dataflash.dataflash(messages))


WRITERS = {"a.ubx": ubx, "a.nmea": nmea, "a.pos": rtklib, "a.ulg": px4, "a.bin": ardupilot}


@pytest.mark.parametrize("name", WRITERS)
def test_each_class_is_a_source_of_its_own(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path)
    log = open_logs([path])[path]
    found = [each for each in log.sections if each.keys.get("kind") == "position" and not each.left]
    assert [each.keys["name"] for each in found] == [
        f"GNSS position {own}" for own in ("fixed", "float", "single")
    ]
    for each in found:
        (condition,) = each.keys["where"]
        cells = log.tables[each.keys["table"]].cells(condition["column"])
        own = np.isin(cells, condition["equals"])
        assert (own == (classes_of(len(cells)) == each.keys["name"].split()[-1])).all()
        assert each.keys["receiver"] == "GNSS"
    assert [each.keys.get("correlated") for each in found] == [None, FLOAT_ERRORS, None]


def test_the_sections_are_read_as_written(tmp_path):
    """By a draft and back: the classes hold all fixes, and each those of its rows."""
    path = tmp_path / "a.ulg"
    px4(path)
    recording = sd.read(path)
    (tmp_path / "recording.toml").write_text(join(open_logs([path])).text(tmp_path))
    again = sd.read(tmp_path / "recording.toml")
    for one, other in zip(recording.sources, again.sources):
        assert one.name == other.name and np.array_equal(one.t, other.t)
    fixed, float_, single, velocity = recording.sources
    many = len(velocity.t)
    assert [len(a.t) for a in (fixed, float_, single)] == [
        np.count_nonzero(classes_of(many) == name) for name in ("fixed", "float", "single")
    ]
    assert float_.correlated.std == (0.2, 0.2, 0.4) and fixed.correlated is None
    assert velocity.receiver == "" and not any(
        "left out" in line for line in recording.meta["notes"]
    )
    path = tmp_path / "kept.nc"
    recording.save(path)
    assert [a.receiver for a in sd.read(path).sources] == ["GNSS"] * 3 + [""]


SECTION = Section("source", "gnss", {"kind": "position"})


def test_one_class_alone_stays_one_source():
    values = {"fixed": (2,), "float": (1,), "single": (0,)}
    for cell in (0, 2):
        assert by_class(SECTION, np.full(9, cell), "carrSoln", values) == [SECTION]
    (found,) = by_class(SECTION, np.full(9, 1), "carrSoln", values)
    assert found.keys == {"kind": "position", "correlated": FLOAT_ERRORS} and found.assumed


def test_a_velocity_has_no_classes():
    keys = {"kind": "velocity", "file": "a.csv", "columns": ["a", "b", "c"], "unit": "m/s"}
    keys |= {"time": {"column": "t", "unit": "s"}, "std": 0.1}
    SourcePart.model_validate(keys)
    with pytest.raises(ValueError, match="receiver: velocity takes none"):
        SourcePart.model_validate(keys | {"receiver": "GNSS"})


def test_a_class_that_another_log_lacks_is_empty(tmp_path):
    """One description serves several logs; without `receiver` a condition of no row is refused."""
    path = tmp_path / "a.ulg"
    px4(path)
    text = join(open_logs([path])).text(tmp_path)
    (tmp_path / "recording.toml").write_text(text.replace("equals = [5]", "equals = [7]"))
    recording = sd.read(tmp_path / "recording.toml")
    fixed, none, single, _ = recording.sources
    assert len(none.t) == 0 and none.y.shape == (0, 3) and none.correlated is not None
    assert "GNSS position float: the log has no fix of this class" in recording.meta["notes"]
    solution = sd.fuse(recording, "closed-loop")
    assert len(solution) and len(fixed.t) + len(single.t) < len(recording.sources[3].t)
    (tmp_path / "recording.toml").write_text(
        text.replace("equals = [5]", "equals = [7]").replace('receiver = "GNSS"\n', "")
    )
    with pytest.raises(sd.DataError, match="none of its .* rows has fix_type"):
        sd.read(tmp_path / "recording.toml")
