"""Bags of ROS 1 and 2, and what of a recording their messages are. `rosbags` and the simulation are
the oracles."""

import lzma
import sqlite3
import struct

import numpy as np
import pytest
import zstandard
from scipy.spatial.transform import Rotation
from written_ros import (
    FLU,
    START,
    Written,
    bare_twist,
    drive,
    field,
    fixes,
    imu,
    odometry,
    pressure,
    transform,
    twist,
    types,
    write_bag,
    write_bag2,
    write_mcap,
)

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.decoding.robots.bag_records import read_bag
from strapdown.io.decoding.robots.ros_messages import RosTopic
from strapdown.io.decoding.robots.ros_transforms import RosFrames
from strapdown.io.description.logs import join, open_logs
from strapdown.io.inspection import draft
from strapdown.io.readers.rosbag2 import messages_of
from strapdown.io.tables.table_file import map_file

SAMPLES = "native/rosbag1/jackal_sim_imu_odom_61s.bag", "native/rosbag2/jackal_sim_imu_odom_61s.db3"
N = 400
T = START + 5_000_000 * np.arange(N)
UP = np.tile([0.0, 0.0, 9.8], (N, 1))
SLOW = 0.1 * np.sin(np.arange(3 * N) / 50).reshape(N, 3)
LLA = np.c_[47 + 1e-6 * np.arange(N), np.full(N, 8.5), np.full(N, 410.0)]
IMU, FIX = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"
STAMPED = "geometry_msgs/msg/TwistStamped"


@pytest.fixture(scope="module")
def driven():
    """20 s of a simulated drive at 100 Hz, its fixes at 5 Hz."""
    return sd.simulate("car", duration=20.0, seed=3)


@pytest.fixture
def bag(tmp_path):
    """Function of topics as (name, type, payloads, times = T) -> path of a bag."""
    return lambda *topics: write_bag(
        tmp_path / "log.bag", [Written(*(each if len(each) > 3 else (*each, T))) for each in topics]
    )


def still(**options):
    return ("/imu", IMU, imu("ros1", T, SLOW, UP, **options))


def log_of(path):
    return open_logs([path])[path]


def keys(path, role, instance=0):
    """Keys of a section."""
    found = [
        each for each in log_of(path).sections if (each.role, each.instance) == (role, instance)
    ]
    return found[0].keys


def oracle(path, encoding):
    """{topic: [message]} as rosbags reads it."""
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag2 import Reader as Reader2

    store, found = types(encoding), {}
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    with (Reader if encoding == "ros1" else Reader2)(path) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(read(raw, connection.msgtype))
    return found


def value(message, name):
    """A field of rosbags' message by our name of it."""
    if name in ("sec", "nanosec", "frame_id"):
        message = message.header
        message = message if name == "frame_id" else message.stamp
    elif name == "seq":
        message = message.header
    for part in name.split("."):
        message = getattr(message, part)
    if isinstance(message, str):
        return message.encode()
    axes = [getattr(message, axis) for axis in "xyzw" if hasattr(message, axis)]
    return np.array(axes) if axes else message


def same_fields(topic, decoded, messages):
    assert decoded.wrong == 0 and len(messages) == len(decoded.record)
    for name, column in decoded.columns.items():
        expected = np.array([value(each, name) for each in messages])
        np.testing.assert_array_equal(column, expected, err_msg=f"{topic.name} {name}")


def every_type(encoding, order="<"):
    """A topic of each type that is read."""
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=(N, 4)), rng.normal(size=(N, 3))
    h = encoding, T
    more = {"order": order}
    return [
        Written("/a", IMU, imu(*h, v, v + 1, frame="a frame", q=q, **more), T),
        Written("/b", FIX, fixes(*h, LLA, np.abs(v), status=-1, frame="", **more), T),
        Written("/c", STAMPED, twist(*h, v, frame="gps_"), T),
        Written(
            "/d", "geometry_msgs/msg/TwistWithCovarianceStamped", twist(*h, v, variance=2.0), T
        ),
        Written("/e", "geometry_msgs/msg/Twist", bare_twist(encoding, v), T),
        Written("/f", "nav_msgs/msg/Odometry", odometry(*h, v[:, 0], child="abcdefg"), T),
        Written("/g", "sensor_msgs/msg/MagneticField", field(*h, v, frame="xyz"), T),
        Written("/h", "sensor_msgs/msg/FluidPressure", pressure(*h, v[:, 0]), T),
    ]


@pytest.mark.parametrize("compression", [None, "lz4", "bz2"])
def test_every_field_of_a_bag_is_as_rosbags_reads_it(tmp_path, compression):
    path = write_bag(tmp_path / "all.bag", every_type("ros1"), compression)
    messages, expected = read_bag(map_file(path)), oracle(path, "ros1")
    found = list(messages.decode())
    assert len(found) == 8 and not messages.left
    for topic, decoded in found:
        same_fields(topic, decoded, expected[topic.name])


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("storage, compression", [("sqlite3", None), ("sqlite3", "message"), ("mcap", None)])  # fmt: skip
def test_every_field_of_a_bag_of_ros_2_is_as_rosbags_reads_it(
    tmp_path, storage, compression, order
):
    folder = write_bag2(tmp_path / "all", every_type("cdr", order), storage, compression)
    messages, expected = messages_of(folder), oracle(folder, "cdr")
    found = list(messages.decode())
    assert len(found) == 8 and not messages.left
    for topic, decoded in found:
        same_fields(topic, decoded, expected[topic.name])


@pytest.mark.parametrize("name", SAMPLES)
def test_every_field_of_the_samples_is_as_rosbags_reads_it(data_folder, tmp_path, name):
    packed = data_folder / f"{name}.xz"
    path = tmp_path / packed.stem
    path.write_bytes(lzma.decompress(packed.read_bytes()))
    if path.suffix == ".db3":
        metadata = (packed.parent / f"{packed.stem}.metadata.yaml").read_text(encoding="utf-8")
        text = metadata.replace("rl2-sqlite3.db3", path.name)
        (tmp_path / "metadata.yaml").write_text(text, encoding="utf-8")
    expected = oracle(*((path, "ros1") if path.suffix == ".bag" else (tmp_path, "cdr")))
    log = log_of(packed)
    table, messages = log.tables["/imu/data"].frame, expected["/imu/data"]
    columns = {
        "qx qy qz qw": "orientation",
        "wx wy wz": "angular_velocity",
        "fx fy fz": "linear_acceleration",
    }
    for ours, theirs in columns.items():
        values = np.array([value(each, theirs) for each in messages])
        np.testing.assert_array_equal(table[ours.split()], values)
    stamps = [value(each, "sec") * 10**9 + value(each, "nanosec") for each in messages]
    np.testing.assert_array_equal(table["stamp"], stamps)
    odom = log.tables["/jackal_velocity_controller/odom"].frame
    speeds = [each.twist.twist.linear.x for each in expected["/jackal_velocity_controller/odom"]]
    np.testing.assert_array_equal(odom["speed"], speeds)
    assert "clock" not in log.sections[0].keys["time"]  # a simulator's
    recording = sd.read(packed)
    assert len(recording.imu.t) == 3061 and recording.imu.t[0] == pytest.approx(47.58)


def check_drive(path, driven):
    """That what is read is what was written."""
    recording = sd.read(path)
    np.testing.assert_allclose(recording.imu.dtheta, driven.imu.dtheta, atol=1e-9)
    np.testing.assert_allclose(recording.imu.dv, driven.imu.dv, atol=1e-7)
    offset = recording.imu.t[0] - driven.imu.t[0]
    assert offset == pytest.approx(8 * 3600)
    assert [each.kind for each in recording.sources] == ["position", "velocity"]
    for read, written in zip(recording.sources, driven.sources):
        np.testing.assert_allclose(read.t - offset, written.t, atol=1e-6)
        np.testing.assert_allclose(read.y, written.y, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(read.std, written.std, rtol=1e-5)


def test_a_drive_comes_back_from_every_bag(tmp_path, driven):
    check_drive(write_bag(tmp_path / "a.bag", drive("ros1", driven), "lz4"), driven)
    folder = write_bag2(tmp_path / "two", drive("cdr", driven))
    check_drive(folder, driven)
    check_drive(folder / "two.db3", driven)
    check_drive(write_bag2(tmp_path / "b", drive("cdr", driven), compression="file"), driven)
    check_drive(write_bag2(tmp_path / "c", drive("cdr", driven), "mcap"), driven)
    packed = write_bag2(tmp_path / "d", drive("cdr", driven), "mcap", compression="file")
    check_drive(packed, driven)
    check_drive(packed / "d.mcap.zstd", driven)
    for suffix, name in ((".bag", "a.bag"), (".db3", "two/two.db3")):
        path = tmp_path / f"packed{suffix}.zst"
        path.write_bytes(zstandard.compress((tmp_path / name).read_bytes()))
        check_drive(path, driven)


def test_the_parts_of_a_folder_are_one_log(tmp_path, driven):
    topics = drive("cdr", driven)
    folder = write_bag2(tmp_path / "two", [each._replace(payloads=each.payloads[:50], times=each.times[:50]) for each in topics])  # fmt: skip
    rest = [each._replace(payloads=each.payloads[50:], times=each.times[50:]) for each in topics]
    (folder / "two.db3").rename(folder / "two_9.db3")
    write_mcap(folder / "two_10.mcap", rest[::-1])
    check_drive(folder, driven)


def test_the_draft_says_the_same(tmp_path, driven):
    path = write_bag(tmp_path / "a.bag", drive("ros1", driven))
    (tmp_path / "recording.toml").write_text(draft([path], {}, tmp_path), encoding="utf-8")
    check_drive(tmp_path / "recording.toml", driven)


def test_a_rotated_imu_is_mounted_as_the_transforms_say(tmp_path, driven):
    C = Rotation.from_euler("ZYX", [70, -20, 160], degrees=True)  # of the IMU in base_link
    topics = drive("ros1", driven)
    stamps = START + np.round(driven.imu.t * 1e9).astype(np.int64)
    turned = [
        C.inv().apply(each / driven.imu.dt[:, None] * FLU)
        for each in (driven.imu.dtheta, driven.imu.dv)
    ]
    q = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    q[::2] = Rotation.from_euler("Z", 30, degrees=True).as_quat()
    topics[0] = topics[0]._replace(payloads=imu("ros1", stamps, *turned, frame="/imu_link", q=q))
    static = [
        transform("ros1", "base_link", "plate", [1.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]),
        transform("ros1", "plate", "imu_link", [0.2, 0.3, 0.4], C.as_quat()),
        transform("ros1", "base_link", "gps", [0.5, -0.1, 1.5], [0.0, 0.0, 0.0, 1.0]),
    ]
    when = np.full(3, START)
    topics.append(Written("/tf_static", "tf2_msgs/msg/TFMessage", static, when))
    path = write_bag(tmp_path / "a.bag", topics)
    recording = sd.read(path)
    np.testing.assert_allclose(recording.imu.dtheta, driven.imu.dtheta, atol=1e-8)
    np.testing.assert_allclose(recording.imu.dv, driven.imu.dv, atol=1e-7)
    np.testing.assert_allclose(keys(path, "imu")["lever_arm"], [1.2, -0.3, -0.9])
    np.testing.assert_allclose(keys(path, "gnss")["lever_arm"], [0.5, 0.1, -1.5])
    table = log_of(path).tables["/imu/data"].frame
    of_base = Rotation.from_quat(q) * C.inv()
    found = Rotation.from_quat(table[["qx", "qy", "qz", "qw"]])
    assert np.max((found * of_base.inv()).magnitude()) < 1e-7


def test_a_transform_that_changes_mounts_nothing(bag):
    moving = [
        transform("ros1", "odom", "base_link", [0.1 * k, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
        for k in range(5)
    ]
    fixed = [transform("ros1", "base_link", "gps", [0.0, 0.0, 2.0], [0.0, 0.0, 0.0, 1.0])] * 5
    path = bag(
        still(frame="base_link"),
        ("/fix", FIX, fixes("ros1", T, LLA, frame="odom")),
        ("/fix2", FIX, fixes("ros1", T, LLA)),
        ("/tf", "tf2_msgs/msg/TFMessage", moving + fixed, T[:10]),
    )
    assert keys(path, "gnss")["lever_arm"] == [0.0, 0.0, 0.0]
    assert keys(path, "gnss", 1)["lever_arm"] == [0.0, 0.0, -2.0]


def asked(path):
    with pytest.raises(DataError) as error:
        sd.read(path)
    assert len(str(error.value).splitlines()) == 1
    return str(error.value)


@pytest.mark.parametrize(
    "accel, said",
    [
        (UP * [1, 1, -1], "perhaps forward, right, down"),
        (UP[:, [2, 1, 0]], "9.8 m/s^2 its median specific force points forward"),
        (UP * 0.02, "without gravity"),
        (UP / 9.8, "it is probably in g"),
        (UP * 0.0, "no accelerometer"),
    ],
)
def test_an_imu_whose_axes_or_gravity_are_not_known_is_asked_about(bag, accel, said):
    path = bag(("/imu", IMU, imu("ros1", T, SLOW, accel)), ("/fix", FIX, fixes("ros1", T, LLA)))
    assert said in asked(path)


def test_the_imu_that_can_be_taken_is(bag):
    path = bag(
        ("/camera/imu", IMU, imu("ros1", T, SLOW, UP[:, [0, 2, 1]], frame="camera")),
        ("/imu", IMU, imu("ros1", T, 2 * SLOW, UP)),
    )
    joined = join(open_logs([path]))
    assert "imu 1 of log.bag: /imu, 200 Hz" in joined.told[0]
    assert any("left: imu 0" in line and "not forward, left, up" in line for line in joined.told)
    np.testing.assert_allclose(sd.read(path).imu.dtheta[:, 0], 2 * SLOW[:, 0] * 0.005)


def test_times(bag, tmp_path):
    zero, own = np.zeros(N, np.int64), T - START + 10**10
    late = imu("ros1", T, SLOW, UP)
    late[10] = late[10][:4] + bytes(8) + late[10][12:]
    path = bag(
        ("/imu", IMU, late),
        ("/fix_zero", FIX, fixes("ros1", zero, LLA), T + 7),
        ("/fix_own", FIX, fixes("ros1", own, LLA), T + 10**9),
        ("/odom", "nav_msgs/msg/Odometry", odometry("ros1", T, LLA[:, 0])),
    )
    log = log_of(path)
    assert any("1 of 400 messages of /imu have no stamp" in line for line in log.left)
    assert len(log.tables["/imu"].frame) == N - 1
    np.testing.assert_array_equal(log.tables["/fix_zero"].frame["stamp"], T + 7)
    np.testing.assert_array_equal(log.tables["/fix_own"].frame["stamp"], T + 10**9)
    assumed = {each.keys["table"]: each.assumed for each in log.sections}
    assert "stamps of zero" in assumed["/fix_zero"]["time"]
    assert "clock of their own" in assumed["/fix_own"]["time"]
    assert all(each.keys["time"]["clock"] == "unix" for each in log.sections)
    simulated = write_bag(
        tmp_path / "sim.bag", [Written("/imu", IMU, imu("ros1", own, SLOW, UP), own)]
    )
    assert sd.read(simulated).imu.t[0] == pytest.approx(10.0)


def test_a_clock_that_is_set_back_is_refused(bag):
    back = T.copy()
    back[200:] -= 10**12
    assert "clock" in asked(bag(("/imu", IMU, imu("ros1", back, SLOW, UP))))


def test_what_topics_are_for(bag):
    v = np.c_[np.full(N, 1.5), np.zeros((N, 2))]
    linear = np.c_[np.full(N, 1.0), np.full(N, 2.0), np.zeros(N)]
    path = bag(
        still(),
        ("/a/fix", FIX, fixes("ros1", T, LLA, frame="left")),
        ("/b/fix", FIX, fixes("ros1", T, LLA, np.full((N, 3), [1.0, 2.0, 3.0]), frame="right")),
        ("/odometry/gps_filtered", FIX, fixes("ros1", T, LLA)),
        ("/b/vel", STAMPED, twist("ros1", T, linear, frame="gps")),
        ("/cmd_vel", "geometry_msgs/msg/Twist", bare_twist("ros1", v)),
        ("/wheels", "geometry_msgs/msg/Twist", bare_twist("ros1", v)),
        ("/mag", "sensor_msgs/msg/MagneticField", field("ros1", T, v * 20)),
        ("/baro", "sensor_msgs/msg/FluidPressure", pressure("ros1", T, v[:, 0] * 0 + 963.0)),
    )
    joined = join(open_logs([path]))
    left = {each.section.keys["table"]: why for each, why in joined.left}
    assert set(left) == {"/b/fix", "/b/vel", "/odometry/gps_filtered", "/cmd_vel", "/mag"}
    assert "estimate" in left["/odometry/gps_filtered"] and "command" in left["/cmd_vel"]
    assert "calibrated" in left["/mag"]
    of_b = sd.read(path, gnss=1)
    assert [each.kind for each in of_b.sources] == ["position", "velocity", "pressure", "speed"]
    np.testing.assert_allclose(of_b.sources[0].std[0], [2.0, 1.0, 3.0])
    np.testing.assert_allclose(of_b.sources[1].y[0], [2.0, 1.0, np.nan])
    np.testing.assert_allclose(of_b.sources[2].y[0, 0], 96300.0)
    assert keys(path, "magnetometer")["unit"] == "uT"
    assert "times are those of recording" in " ".join(joined.told)


@pytest.mark.parametrize("of", ["/mavros", "/uav1/mavros"])
def test_what_an_autopilot_estimated_is_no_measurement(bag, of):
    """MAVROS: the receiver is below `raw`, all else of a position is the autopilot's filter."""
    linear = np.c_[np.full(N, 1.0), np.full(N, 2.0), np.full(N, 0.1)]
    speeds = odometry("ros1", T, linear[:, 0])
    path = bag(
        (f"{of}/imu/data", IMU, imu("ros1", T, SLOW, UP, frame="base_link")),
        (f"{of}/global_position/global", FIX, fixes("ros1", T, LLA, frame="base_link")),
        (f"{of}/global_position/raw/fix", FIX, fixes("ros1", T, LLA + 1e-5, frame="base_link")),
        (f"{of}/global_position/raw/gps_vel", STAMPED, twist("ros1", T, linear, "base_link")),
        (f"{of}/global_position/gp_vel", STAMPED, twist("ros1", T, linear, "base_link")),
        (f"{of}/global_position/local", "nav_msgs/msg/Odometry", speeds),
        (f"{of}/local_position/odom", "nav_msgs/msg/Odometry", speeds),
        (f"{of}/local_position/velocity_body", STAMPED, twist("ros1", T, linear, "base_link")),
    )
    joined = join(open_logs([path]))
    taken = [each.section.keys["table"] for each in joined.taken]
    names = "imu/data", "global_position/raw/fix", "global_position/raw/gps_vel"
    assert sorted(taken) == sorted(f"{of}/{name}" for name in names)
    reasons = [why for each, why in joined.left if each.section.role != "attitude"]
    assert len(reasons) == 5 and all("autopilot's filter" in why for why in reasons)
    recording = sd.read(path)
    np.testing.assert_allclose(np.degrees(recording.sources[0].y[:, :2]), LLA[:, :2] + 1e-5)
    by_name = sd.read(path, gnss=0)
    np.testing.assert_allclose(np.degrees(by_name.sources[0].y[:, :2]), LLA[:, :2])


@pytest.mark.parametrize(
    "frame, said",
    [
        *(
            (each, "is fixed to the ground")
            for each in ("map", "/odom", "robot1/world", "t265_odom_frame")
        ),
        *((each, "is fixed to the ground") for each in ("earth", "enu", "NED", "local_origin_ned")),
        ("elsewhere", "no transform from base_link to its frame elsewhere"),
        *((each, "") for each in ("base_link", "", "wheels", "robot1/base_footprint")),
    ],
)
def test_a_twist_is_a_speed_in_a_frame_of_the_vehicle_only(bag, frame, said):
    linear = np.c_[np.full(N, 3.0), np.full(N, 4.0), np.full(N, 0.1)]
    mounted = transform("ros1", "base_link", "wheels", [0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0])
    path = bag(
        still(frame="base_link"),
        ("/twist", STAMPED, twist("ros1", T, linear, frame)),
        ("/tf_static", "tf2_msgs/msg/TFMessage", [mounted], T[:1]),
    )
    joined = join(open_logs([path]))
    left = {each.section.role: why for each, why in joined.left}
    assert said in left["speed"] if said else "speed" not in left


def test_a_vehicle_that_is_parked_is_not_fixed_to_the_ground(bag):
    """As far as the log is looked at: what comes later is not seen."""
    parked = [transform("ros1", "odom", "base_link", [3.0, 4.0, 0.0], [0.0, 0.0, 0.0, 1.0])] * N
    path = bag(
        still(frame="base_link"),
        ("/fix", FIX, fixes("ros1", T, LLA, frame="odom")),
        ("/tf", "tf2_msgs/msg/TFMessage", parked, T),
    )
    assert keys(path, "gnss")["lever_arm"] == [0.0, 0.0, 0.0]


def test_fixes_without_a_fix_are_missing(bag):
    status = np.where(np.arange(N) < 100, -1, 0)
    lla = LLA.copy()
    lla[100:150] = 0.0
    path = bag(still(), ("/fix", FIX, fixes("ros1", T, lla, status=status)))
    assert len(sd.read(path).sources[0].t) == N - 150
    none = fixes("ros1", T, lla, status=-1)
    path.unlink()
    path = bag(still(), ("/fix", FIX, none))
    assert "never has a fix" in " ".join(join(open_logs([path])).told)


def test_other_definitions_and_types_are_left(tmp_path):
    from rosbags.rosbag1 import Writer

    path, payload = tmp_path / "log.bag", imu("ros1", T, SLOW, UP)
    text, md5 = types("ros1").generate_msgdef(IMU)
    with Writer(path) as writer:
        mine = writer.add_connection("/imu", IMU, msgdef=text, md5sum=md5)
        other = writer.add_connection(
            "/mine", IMU, msgdef=text.replace("angular_velocity\n", "rate\n"), md5sum="0" * 32
        )
        custom = writer.add_connection(
            "/custom", "my_msgs/msg/Rate", msgdef="float64 x\n", md5sum="1" * 32
        )
        for time, each in zip(T.tolist(), payload):
            writer.write(mine, time, each)
            writer.write(other, time, each)
            writer.write(custom, time, bytes(8))
        writer.write(mine, int(T[-1]) + 1, payload[0][:-1])
    log = log_of(path)
    assert list(log.tables) == ["/imu"]
    said = "\n".join(log.left)
    assert "1 of 401 messages of /imu do not fit" in said
    assert "/mine: its definition differs" in said
    assert "my_msgs/Rate on /custom: messages of this type are not read" in said


def test_a_bag_without_anything_that_is_read(tmp_path):
    path = write_bag(tmp_path / "a.bag", [])
    assert "no topics" in asked(path)
    path.write_bytes(b"#ROSBAG V1.2\n" + bytes(100))
    assert "rosbag migrate" in asked(path)
    path = tmp_path / "a.db3"
    path.write_bytes(b"SQLite format 3\0" + bytes(2000))
    assert "not a readable database of ROS 2" in asked(path)
    only = [Written("/fix", FIX, fixes("ros1", T, LLA), T)]
    assert "no IMU in it" in asked(write_bag(tmp_path / "b.bag", only))


def test_a_bag_that_was_cut_short_is_read_as_far_as_it_goes(tmp_path, driven):
    whole = write_bag(tmp_path / "a.bag", drive("ros1", driven), "lz4")
    content, expected = whole.read_bytes(), log_of(whole).tables["/imu/data"].frame
    path, rng = tmp_path / "cut.bag", np.random.default_rng(4)
    read = []
    for cut in [0, 5, 13, 20, *rng.integers(4000, len(content), 25).tolist()]:
        path.write_bytes(content[:cut])
        try:
            log = log_of(path)
        except DataError:
            continue
        rows = log.tables["/imu/data"].frame
        np.testing.assert_array_equal(rows, expected[: len(rows)])
        assert any("cut short" in line for line in log.left)
        read.append(len(rows))
    assert 0 < max(read) <= len(expected)


def test_a_bag_that_is_still_written_is_read(tmp_path):
    """The head of its last chunk says nothing of its size."""
    path = write_bag(tmp_path / "a.bag", [Written(*still(), T)])
    content = path.read_bytes()
    at = content.index(b"compression=none")
    size_at = content.index(b"size=", at) + 5
    size = struct.unpack_from("<I", content, size_at)[0]
    data_at = content.index(struct.pack("<I", size), size_at + 4)
    active = content[:data_at] + struct.pack("<I", 0) + content[data_at + 4 : data_at + 4 + size]
    path.write_bytes(active)
    assert len(log_of(path).tables["/imu"].frame) == N


@pytest.mark.parametrize("suffix", [".bag", ".db3"])
def test_damaged_bytes_end_in_one_line_at_most(tmp_path, suffix):
    topics = "ros1" if suffix == ".bag" else "cdr"
    several = [each._replace(payloads=each.payloads[:30], times=each.times[:30]) for each in every_type(topics)]  # fmt: skip
    if suffix == ".bag":
        path = write_bag(tmp_path / "a.bag", several)
    else:
        path = write_bag2(tmp_path / "a", several) / "a.db3"
    content, rng = path.read_bytes(), np.random.default_rng(5)
    other = tmp_path / f"damaged{suffix}"
    for _ in range(60):
        damaged = bytearray(content)
        for at in rng.integers(0, len(content), rng.integers(1, 30)):
            damaged[at] = rng.integers(256)
        other.write_bytes(damaged)
        try:
            sd.read(other)
        except DataError as error:
            assert len(str(error).splitlines()) == 1 and "report this to its author" not in str(
                error
            )


@pytest.mark.parametrize("data, said", [("zeroblob(300)", "longer than the file"), ("n", "interrupted")])  # fmt: skip
def test_a_database_without_end_is_left(tmp_path, data, said):
    path = tmp_path / "endless.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics (id INTEGER, name, type, serialization_format)")
        database.execute("INSERT INTO topics VALUES (1, '/imu', 'sensor_msgs/msg/Imu', 'cdr')")
        database.execute(
            f"CREATE VIEW messages AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) "
            f"SELECT 1 AS topic_id, n AS timestamp, {data} AS data FROM c"
        )
    database.close()
    messages = messages_of(path)
    assert any(said in line for line in messages.left)


def test_frames_that_meet_in_a_third_one():
    rotations = Rotation.random(3, rng=np.random.default_rng(2))
    places = np.array([[0.1, 0.2, 0.3], [1.0, -2.0, 0.5], [0.0, 0.4, -0.7]])
    names = [("chassis", "base_link"), ("chassis", "mast"), ("mast", "gps")]
    topic, whole = RosTopic("/tf_static", "tf2_msgs/TFMessage", "cdr"), []
    for rotation, place in zip(rotations, places):
        whole.append(np.eye(4))
        whole[-1][:3, :3], whole[-1][:3, 3] = rotation.as_matrix(), place
    messages = [
        (topic, transform("cdr", *name, place, rotation.as_quat()))
        for name, place, rotation in zip(names, places, rotations)
    ]
    pose = RosFrames(messages).pose("gps", "base_link")
    expected = np.linalg.inv(whole[0]) @ whole[1] @ whole[2]
    np.testing.assert_allclose(np.c_[pose.C, pose.t], expected[:3], atol=1e-12)
    assert RosFrames(messages).pose("gps", "elsewhere") is None
