"""The parameters of the node: each is in the page and the example, and wrong ones end in one line."""

import re
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from strapdown.checks import DataError
from strapdown_ros2 import parameters
from strapdown_ros2.parameters import config_of

pytestmark = pytest.mark.short
ROOT = Path(__file__).resolve().parents[2]
LEAST = {
    "imu.topic": "/imu/data",
    "imu.grade": "consumer",
    "sources": ["gnss"],
    "gnss.topic": "/fix",
    "gnss.kind": "position",
}


def flat(table, prefix=""):
    """Parameters by name, as ROS hands them to a node."""
    found = {}
    for key, value in table.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


def test_what_is_not_given_has_its_default():
    config = config_of(LEAST)
    assert (config.filter, config.lag, config.replay) == ("closed-loop", 1.0, True)
    assert (config.world_frame, config.base_frame, config.publish_tf) == ("map", "base_link", True)
    (gnss,) = config.sources
    assert (gnss.message, gnss.stamp, gnss.mount, gnss.std) == ("NavSatFix", "header", None, None)


def test_a_mounting_is_that_of_a_description():
    turned = {"imu.mounting.roll": 180.0, "imu.axes": "FRD", "imu.lever_arm": [1.0, 2.0, 3.0]}
    mount = config_of({**LEAST, **turned}).imu.mount
    np.testing.assert_allclose(mount.matrix, np.diag([1.0, -1.0, -1.0]), atol=1e-15)
    np.testing.assert_array_equal(mount.arm, [1.0, 2.0, 3.0])


def test_places_are_in_degrees_and_frames_without_a_slash():
    place = {"place.latitude": 47.0, "place.longitude": 8.5, "place.height": 400.0}
    config = config_of({**LEAST, **place, "base_frame": "/base", "use_sim_time": True})
    assert config.place == pytest.approx((np.radians(47.0), np.radians(8.5), 400.0))
    assert config.base_frame == "base"


@pytest.mark.parametrize(
    "given, said",
    [
        ({"filtre": "ukf"}, "unknown key 'filtre' (did you mean 'filter'?)"),
        ({"imu.topics": "/a"}, "imu: unknown key 'topics' (did you mean 'topic'?)"),
        ({"imu": "/imu"}, "imu"),
        ({"sources": "gnss"}, "sources is 'gnss'; it must be a list of texts"),
        ({"sources": ["gnss", "odom"]}, "'odom' has no parameters; give odom.topic and .kind"),
        ({"sources": ["gnss", "lag"]}, "'lag' is taken"),
        ({"gnss.kind": "positon"}, "gnss.kind is 'positon' (did you mean 'position'?)"),
        ({"gnss.message": "Odometry"}, "gnss.message is 'Odometry'; it must be one of NavSatFix"),
        ({"gnss.kind": "pressure"}, "gnss.std is missing; give it in m of height"),
        ({"gnss.kind": "magnetic-field"}, "gnss.std is missing; give it in T"),
        ({"gnss.std": [1.0, 2.0]}, "gnss.std has 2 numbers; give one, or 3"),
        ({"gnss.std": [1.0, 2.0, 0.0]}, "gnss.std"),
        ({"gnss.field": [0.0, 0.0, 1.0]}, "gnss.field is of the kind magnetic-field"),
        ({"gnss.lever_arm": [1.0, 2.0]}, "gnss.lever_arm"),
        ({"gnss.axes": "FLX"}, "gnss.axes: unknown axes 'FLX'"),
        ({"gnss.stamp": "now"}, "gnss.stamp is 'now'; it must be one of header, arrival"),
        ({"lag": -1.0}, "lag is -1.0 s"),
        ({"rate": 0.0}, "rate is 0.0 Hz"),
        ({"publish_tf": 1}, "publish_tf is 1; it must be True or False"),
        ({"place.latitude": 91.0, "place.longitude": 8.0}, "place.latitude is 91"),
        ({"place.latitude": 47.0}, "place.longitude is None"),
        ({"place.latitude": 47.0, "place.unit": "m"}, "m"),
        ({"heading": "north"}, "heading is 'north' deg"),
        ({"vehicle": 3}, "vehicle is 3; it must be text"),
        ({"lag.s": 1.0, "lag": 1.0}, "lag"),
        ({"imu.mounting.yaw": 3.0}, "imu.mounting: unknown key 'yaw'"),
    ],
)
def test_wrong_parameters_end_in_one_line(given, said):
    with pytest.raises(DataError) as error:
        config_of({**LEAST, **given})
    assert said in str(error.value) and len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("missing", ["imu.topic", "imu.grade", "gnss.topic", "gnss.kind"])
def test_what_must_be_given_is_named(missing):
    given = {name: value for name, value in LEAST.items() if name != missing}
    with pytest.raises(DataError, match=re.escape(missing)):
        config_of(given)


def of_page():
    """The parameter file of the page."""
    page = (ROOT / "docs" / "how-to" / "ros2.md").read_text(encoding="utf-8")
    return page.partition("```text\nstrapdown:")[2].partition("```")[0]


@pytest.mark.parametrize("where", ["page", "folder"])
def test_the_example_is_complete(where):
    file = ROOT / "ros2" / "config" / "example.yaml"
    text = file.read_text(encoding="utf-8") if where == "folder" else "strapdown:" + of_page()
    given = YAML(typ="safe").load(text)["strapdown"]["ros__parameters"]
    assert [each.name for each in config_of(flat(given)).sources] == given["sources"]


def test_every_parameter_is_in_the_page():
    page = (ROOT / "docs" / "how-to" / "ros2.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w.]+)`", page))
    of_tables = (
        *parameters.TOP,
        *(f"imu.{name}" for name in parameters.OF_IMU),
        *(f"NAME.{name}" for name in parameters.OF_SOURCE),
    )
    assert {*of_tables} - {"imu"} <= named
    kinds = {*parameters.MESSAGES, *(m for each in parameters.MESSAGES.values() for m in each)}
    assert kinds <= set(re.findall(r"`([\w-]+)`", page))
