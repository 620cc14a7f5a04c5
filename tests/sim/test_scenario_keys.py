"""Every key of a scenario changes what is simulated, or is refused: none does nothing."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.sensor_models.receiver import GNSS_KEYS
from strapdown.sim.scenario_file import (
    ATTITUDE_KEYS,
    BAROMETER_KEYS,
    MAGNETOMETER_KEYS,
    SENSOR_KEYS,
    TOP_KEYS,
)

pytestmark = pytest.mark.short
FIELD = "field_uT = [21, 1, 43]"
SECTIONS = {
    "gnss": (
        GNSS_KEYS | {"receiver": None},
        ["position_std_m = 1", "velocity_std_m_s = 0.1"],
        {
            "interval_s": "2",
            "position_std_m": "3",
            "velocity_std_m_s": "0.3",
            "lever_arm_m": "[1, 0, 0]",
            "outages_s": "[[5, 10]]",
            "latency_s": "0.2",
            "position_correlated": "{ std_m = 1, time_s = 60 }",
            "velocity_correlated": "{ std_m_s = 0.1, time_s = 60 }",
            "stated": "false",
            "receiver": '"sbas"',
        },
    ),
    "magnetometer": (
        MAGNETOMETER_KEYS,
        [FIELD],
        {
            "rate_hz": "5",
            "std_uT": "2",
            "hard_iron_uT": "[3, 0, 0]",
            "soft_iron": "[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]",
            "scale": "[0.1, 0, 0]",
            "saturation_uT": "10",
            "field_uT": "[20, 1, 40]",
            "disturbances": "[{ start_s = 2, stop_s = 5, field_uT = [9, 0, 0] }]",
        },
    ),
    "barometer": (
        BAROMETER_KEYS,
        [],
        {
            "rate_hz": "5",
            "std_Pa": "9",
            "bias_Pa": "100",
            "drift_Pa": "30",
            "drift_time_s": "5",
            "zero_m": "30",
            "lever_arm_m": "[0, 0, -3]",
            "quantity": '"height"',
        },
    ),
    "attitude": (ATTITUDE_KEYS, [], {"rate_hz": "5", "std_deg": "3"}),
}
SENSOR = {
    "kind": '"speed"',
    "std": "2",
    "rate_hz": "4",
    "parameters": "[1, 0, 0]",
    "states": "[80.0]",
    "name": '"wheel"',
}
TOP = {
    "rate_hz": "40",
    "duration_s": "15",
    "imu": '"consumer"',
    "accel_offset_m_s2": "0.3",
    "accel_offset_decays": "true",
    "gate": "3",
    "gravity": '"latitude"',
    "date": '"2020-01-01"',
}
LABELS = {"name", "about"}
"""Top keys that only name the scenario."""
ELSEWHERE = {"motion", *SECTIONS, "sensors", "start"}


def made(path, lines=(), rest=()):
    """What is simulated, as bytes, without its name."""
    keys = {line.partition(" =")[0]: line for line in ("duration_s = 20", "rate_hz = 50", *lines)}
    text = [*keys.values(), '[motion]\nkind = "demo"', *rest]
    path.write_text("\n".join(text) + "\n")
    found = sd.simulate(path, seed=1)
    sources = [
        (a.kind, a.name, a.gate, a.parameters, a.correlated, a.t.tobytes(), a.y.tobytes())
        + (a.std.tobytes(),)
        for a in found.sources
    ]
    meta = {key: value for key, value in found.meta.items() if key != "name"}
    return repr(([np.asarray(c).tobytes() for c in found.imu], sources, meta))


def works(path, base, changed):
    """Whether one is refused in a line, or differs from the other."""
    try:
        return made(path, *changed) != made(path, *base)
    except sd.DataError as error:
        return len(str(error).splitlines()) == 1


@pytest.mark.parametrize(
    ("section", "key", "alone"),
    [(name, key, alone) for name in SECTIONS for key in SECTIONS[name][0] for alone in (0, 1)],
)
def test_a_key_of_a_section_does_something(section, key, alone, tmp_path):
    _, base, values = SECTIONS[section]
    lines = [line for line in base if not alone and not line.startswith(f"{key} ")]
    rest = [f"[{section}]", *lines]
    changed = [*rest, f"{key} = {values[key]}"]
    whole = [f"[{section}]", *([] if alone else base)]
    without = rest if section != "magnetometer" else [f"[{section}]", FIELD]
    assert works(tmp_path / "a.toml", ((), without if alone else whole), ((), changed))


@pytest.mark.parametrize("key", SENSOR_KEYS)
def test_a_key_of_a_sensor_does_something(key, tmp_path):
    # a barometer brings a bias along
    base = {"kind": '"pressure-altitude"' if key == "states" else '"altitude"', "std": "1"}
    first, second = (
        ((), ["[[sensors]]", *(f"{name} = {value}" for name, value in each.items())])
        for each in (base, base | {key: SENSOR[key]})
    )
    assert works(tmp_path / "a.toml", first, second)


@pytest.mark.parametrize("key", sorted(TOP_KEYS.keys() - LABELS - ELSEWHERE))
def test_a_key_at_the_top_does_something(key, tmp_path):
    assert works(tmp_path / "a.toml", (), ([f"{key} = {TOP[key]}"],))


def test_a_receiver_that_measures_nothing_is_refused(tmp_path):
    (tmp_path / "a.toml").write_text(
        'duration_s = 20\n[motion]\nkind = "demo"\n[gnss]\ninterval_s = 0.5\n'
    )
    with pytest.raises(sd.DataError, match=r"\[gnss\] measures nothing: give position_std_m, vel"):
        sd.scenario(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text('duration_s = 20\n[motion]\nkind = "demo"\n[gnss]\n')
    assert sd.scenario(tmp_path / "a.toml").gnss.position_std is None
