"""A bag through the node equals the batch over the same bag, bit for bit."""

import numpy as np
import pytest
from ros_bags import IMU_TOPIC, ODOM_TOPIC, messages_of, unpacked_jackal
from ros_double import run_node
from scipy.spatial.transform import Rotation
from written_ros import (
    FLU,
    START,
    Written,
    drive,
    field,
    fixes,
    imu,
    odometry,
    pressure,
    transform,
    write_bag2,
)

import strapdown as sd
from strapdown.io.inspection import draft

PLACE = {"latitude": 47.0, "longitude": 8.5, "height": 400.0}
OF_JACKAL = {
    "imu.topic": IMU_TOPIC,
    "imu.grade": "consumer",
    "sources": ["speed"],
    "speed.topic": ODOM_TOPIC,
    "speed.kind": "speed",
    "heading": 90.0,
    **{f"place.{name}": value for name, value in PLACE.items()},
}


def described(path, folder, take=None):
    """The recording of the draft of a description, without the test of slip, which needs the whole
    log."""
    text = draft([path], take or {}, folder)
    assert 'kind = "speed"' in text
    text = text.replace('kind = "speed"', 'kind = "speed"\nslip_test = false')
    (folder / "recording.toml").write_text(text, encoding="utf-8")
    return sd.read(folder / "recording.toml")


def replay(ros, messages):
    """Send messages to the node; return its stream when all are used."""
    for topic, message, time in messages:
        ros.send(topic, message, time)
    live = ros.node.navigator.live
    live.finish()
    return live


def check_equal(live, batch):
    """That every number of the two solutions is the same."""
    found = live.solution
    for name in ("t", "lla", "v_n", "q_nb", "std"):
        one, other = (getattr(each.trajectory, name) for each in (found, batch))
        np.testing.assert_array_equal(one, other, name)
    np.testing.assert_array_equal(found.status, batch.status)
    assert found.events == batch.events


@pytest.mark.parametrize("replays", [True, False])
def test_the_bag_through_the_node_equals_the_batch(data_folder, tmp_path, monkeypatch, replays):
    bag = unpacked_jackal(data_folder, tmp_path)
    ros, code = run_node(monkeypatch, {**OF_JACKAL, "replay": replays})
    live = replay(ros, messages_of(bag))
    assert code == 0 and live.counts()[0][0] > 2000
    recording = described(bag / "jackal_sim_imu_odom_61s.db3", tmp_path)
    batch = sd.fuse(recording, "closed-loop", start=live.stream.start)
    check_equal(live, batch)


TURNED = Rotation.from_euler("ZYX", [70, -20, 160], degrees=True)
"""Of the IMU in base_link."""
MOUNTED = {
    "imu_link": ([1.2, 0.3, 0.9], TURNED.as_quat()),
    "gps": ([0.5, -0.1, 1.5], [0.0, 0.0, 0.0, 1.0]),
    "wheels": ([0.1, 0.0, -0.3], Rotation.from_euler("Z", 2, degrees=True).as_quat()),
    "mag": ([0.0, 0.0, 0.5], Rotation.from_euler("ZYX", [90, 5, 0], degrees=True).as_quat()),
}
OF_DRIVE = {
    "imu.topic": "/imu/data",
    "imu.grade": "consumer",
    "sources": ["position", "velocity", "magnetic-field", "pressure", "speed"],
    "position.topic": "/gps/fix",
    "velocity.topic": "/gps/vel",
    "velocity.message": "TwistWithCovarianceStamped",
    "magnetic-field.topic": "/mag",
    "magnetic-field.std": 2.5e-6,
    "pressure.topic": "/baro",
    "pressure.std": 1.0,
    "speed.topic": "/wheels/odom",
}
OF_DRIVE |= {f"{name}.kind": name for name in OF_DRIVE["sources"]}


@pytest.fixture(scope="module")
def driven():
    """A drive with a magnetometer, a barometer and wheels, at stamps between whole ms; IMU messages and
    fixes are missing."""
    recording = sd.simulate("car", duration=40.0, seed=3)
    stamps = START + 123_456 + np.round(recording.imu.t * 1e9).astype(np.int64)
    forces = (recording.imu.dtheta, recording.imu.dv)
    rates = [TURNED.inv().apply(each / recording.imu.dt[:, None] * FLU) for each in forces]
    path = recording.reference
    at = np.interp(recording.imu.t, path.t, np.arange(len(path.t))).astype(int)
    turn = Rotation.from_quat(path.q_nb[at][:, [1, 2, 3, 0]])
    speed = turn.inv().apply(path.v_n[at])[:, 0]
    earth = np.array(sd.geomagnetic_field("2024-05-01", *path.lla[0]).field)
    of_mag = Rotation.from_quat(MOUNTED["mag"][1])
    fields = of_mag.inv().apply(turn.inv().apply(earth) * FLU)
    air = 101325.0 * (1 - 2.25577e-5 * path.lla[at, 2]) ** 5.25588
    slow = slice(4, None, 5)
    odom = odometry("cdr", stamps[slow], speed[slow] / np.cos(np.radians(2)), child="wheels")
    first, fix, velocity = drive("cdr", recording)
    of_fix = fix.times - 60_000_000
    lla = recording.sources[0].y * [*np.degrees([1.0, 1.0]), 1.0]
    there = np.setdiff1d(np.arange(len(stamps)), [1500, 1501, 1502, 2500])  # two gaps
    samples = imu("cdr", stamps[there], *(each[there] for each in rates))
    some = np.arange(len(lla))
    std = np.c_[1.0 + 0.01 * some, 1.1 + 0.02 * some, 2.0 + 0.03 * some]
    status = np.where(some % 7 == 3, -1, 0)
    topics = [
        first._replace(payloads=samples, times=stamps[there]),
        fix._replace(payloads=fixes("cdr", of_fix, lla, std, status)),
        velocity,
        Written("/mag", "sensor_msgs/msg/MagneticField", field("cdr", stamps[slow], fields[slow], "mag"), stamps[slow]),
        Written("/baro", "sensor_msgs/msg/FluidPressure", pressure("cdr", stamps[slow], air[slow]), stamps[slow]),
        Written("/wheels/odom", "nav_msgs/msg/Odometry", odom, stamps[slow]),
    ]  # fmt: skip
    mounts = [transform("cdr", "base_link", frame, *pose) for frame, pose in MOUNTED.items()]
    when = np.full(len(mounts), START)
    return [*topics, Written("/tf_static", "tf2_msgs/msg/TFMessage", mounts, when)]


def test_a_mounted_drive_through_the_node_equals_the_batch(driven, tmp_path, monkeypatch):
    bag = write_bag2(tmp_path / "bag", driven)
    recording = described(bag, tmp_path, {"magnetometer": 0})
    names = [a.name for a in recording.sources]
    (earth,) = [a.parameters for a in recording.sources if a.kind == "magnetic-field"]
    transforms = {("base_link", frame): pose for frame, pose in MOUNTED.items()}
    parameters = {**OF_DRIVE, "sources": names, "magnetic-field.field": [*earth]}
    ros, code = run_node(monkeypatch, parameters, transforms)
    live = replay(ros, messages_of(bag))
    assert code == 0 and all(accepted > 160 for accepted, _ in live.counts())
    check_equal(live, sd.fuse(recording, "closed-loop", start=live.stream.start))
