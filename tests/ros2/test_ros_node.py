"""The node on a double of rclpy: what it publishes and says, and how it copes with what goes wrong."""

import ast
import re
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from ros_double import as_rosbags, run_node, store
from ros_made import fix, imu, odometry
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.engine import verdict_process

ROOT = Path(__file__).resolve().parents[2]
SECOND = 10**9
START = 1_714_550_400 * SECOND
AT = {("base_link", "imu_link"): ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])}
AT |= {("base_link", "gps"): ([0.5, -0.1, 1.5], [0.0, 0.0, 0.0, 1.0])}
PARAMETERS = {
    "imu.topic": "/imu",
    "imu.grade": "consumer",
    "sources": ["gnss", "wheels"],
    "gnss.topic": "/fix",
    "gnss.kind": "position",
    "wheels.topic": "/odom",
    "wheels.kind": "speed",
    "heading": 90.0,
    "lag": 0.0,
    "rate": 10.0,
}


def stamped(message, stamp, frame):
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    message.header.frame_id = frame
    return message


def wheels(stamp, speed=0.0):
    message = odometry((speed, 0.0, 0.0), (0.01,) * 6)
    message.child_frame_id = "base_link"
    return stamped(message, stamp, "odom")


class Vehicle:
    """A node, and a vehicle that stands, with the IMU at 50 Hz and fixes and speeds at 5 Hz."""

    def __init__(self, monkeypatch, transforms=AT, **given):
        given = {name.replace("__", "."): value for name, value in given.items()}
        known = {"imu", "lag", *given.get("sources", PARAMETERS["sources"])}
        usual = {name: x for name, x in PARAMETERS.items() if name.partition(".")[0] in known}
        parameters = {**PARAMETERS, **given} if "sources" not in given else {**usual, **given}
        self.ros, self.code = run_node(monkeypatch, parameters, transforms)
        self.count = 0

    @property
    def navigator(self):
        return self.ros.node.navigator

    def stand(self, seconds, shift=0, sends=("/imu", "/fix", "/odom")):
        """Send what comes meanwhile; `shift` s are added to the stamps."""
        for _ in range(round(50 * seconds)):
            self.count += 1
            now = START + self.count * SECOND // 50
            stamp = now + round(shift * SECOND)
            if self.count % 10 == 0:
                if "/fix" in sends:
                    self.ros.send("/fix", stamped(fix(), stamp, "gps"), now)
                if "/odom" in sends:
                    self.ros.send("/odom", wheels(stamp), now)
            if "/imu" in sends:
                self.ros.send("/imu", stamped(imu(), stamp, "imu_link"), now)
            self.ros.now = now
        self.ros.tick()

    def diagnosis(self):
        """Level, message and values of the last diagnostics."""
        (status,) = self.ros.published["/diagnostics"][-1].status
        return status.level[0], status.message, {each.key: each.value for each in status.values}

    def shown(self):
        return self.ros.published["odometry/filtered"]


@pytest.fixture
def vehicle(monkeypatch):
    return lambda **given: Vehicle(monkeypatch, **given)


def test_a_vehicle_that_stands_is_shown_where_it_is(vehicle):
    it = vehicle()
    it.stand(12)
    level, message, values = it.diagnosis()
    assert (it.code, level, message) == (0, 0, "valid")
    assert int(values["gnss: accepted"]) > 50 and int(values["wheels: accepted"]) > 50
    odom, first = it.shown()[-1], it.shown()[0]
    assert odom.header.frame_id == "map" and odom.child_frame_id == "base_link"
    assert abs(odom.pose.pose.position.x) < 1 and abs(odom.twist.twist.linear.x) < 0.1
    assert odom.pose.pose.orientation.w == pytest.approx(1.0, abs=0.02)  # to the east
    np.testing.assert_allclose(vars(first.pose.pose.position)["z"], -1.5, atol=1.5)
    (transform, *_), (position, *_) = (it.ros.published[n] for n in ("/tf", "fix/filtered"))
    assert transform.child_frame_id == "base_link" and len(it.ros.published["/tf"]) == len(
        it.shown()
    )
    assert position.latitude == pytest.approx(47.0, abs=1e-4)
    assert position.altitude == pytest.approx(400.0 - 1.5, abs=3.0)  # of base_link, not the antenna
    times = [each.header.stamp.sec + each.header.stamp.nanosec * 1e-9 for each in it.shown()]
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-6)


def test_everything_published_is_of_the_definitions(vehicle):
    it = vehicle()
    it.stand(11)
    for messages in it.ros.published.values():
        assert messages
        made = as_rosbags(messages[-1])
        assert store().serialize_cdr(made, messages[-1].of)


def test_an_origin_and_frames_of_ones_own(vehicle):
    place = dict(origin__latitude=47.0, origin__longitude=8.5, origin__height=300.0)
    it = vehicle(world_frame="odom", publish_tf=False, **place)
    it.stand(11)
    odom = it.shown()[-1]
    assert odom.header.frame_id == "odom" and "/tf" not in it.ros.published
    assert odom.pose.pose.position.z == pytest.approx(98.5, abs=3.0)


def test_with_an_odometry_tf_leads_from_the_world_to_its_frame(vehicle):
    turned = [0.0, 0.0, np.sin(0.3), np.cos(0.3)]
    it = vehicle(
        transforms=AT | {("odom", "base_link"): ([3.0, 4.0, 0.5], turned)}, odom_frame="odom"
    )
    it.stand(11)
    transform, odom = it.ros.published["/tf"][-1], it.shown()[-1].pose.pose
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    of_odom = Rotation.from_quat([getattr(transform.transform.rotation, axis) for axis in "xyzw"])
    of_base = Rotation.from_quat([getattr(odom.orientation, axis) for axis in "xyzw"])
    assert (of_odom * Rotation.from_quat(turned) * of_base.inv()).magnitude() < 1e-9
    place = [getattr(transform.transform.translation, axis) for axis in "xyz"]
    np.testing.assert_allclose(
        of_odom.apply([3.0, 4.0, 0.5]) + place, [getattr(odom.position, axis) for axis in "xyz"]
    )


def test_without_the_transform_of_the_odometry_one_line_says_so(vehicle):
    it = vehicle(odom_frame="odom")
    it.stand(11)
    assert it.shown() and "/tf" not in it.ros.published
    assert "no transform odom -> base_link: no tf is sent" in it.ros.told


def test_before_the_first_message_it_says_what_it_waits_for(vehicle):
    it = vehicle()
    it.ros.tick()
    assert it.diagnosis()[:2] == (3, "no IMU message on /imu")
    it.stand(1, sends=("/imu",))
    assert it.diagnosis()[:2] == (
        1,
        "waiting: gnss: a message on /fix with its frame (or gnss.frame)",
    )
    it.stand(11)
    assert it.ros.told[-1] == "valid" or "valid" in it.ros.told
    it.ros.now += 6 * SECOND
    it.ros.tick()
    assert it.diagnosis()[:2] == (3, "no IMU message on /imu") and not it.shown() == []


def test_the_imu_waits_for_its_transform(vehicle):
    it = vehicle(transforms={})
    it.stand(12)
    assert it.diagnosis()[1] == "waiting: the transform base_link -> imu_link"
    it.ros.transforms |= AT
    it.stand(1)
    assert it.diagnosis()[1] == "valid"  # what came before was kept


def test_an_imu_that_names_no_frame_needs_a_parameter(vehicle):
    it = vehicle()
    it.ros.send("/imu", stamped(imu(), START, ""), START)
    it.ros.tick()
    assert "imu.frame or imu.lever_arm" in it.diagnosis()[1]


def test_an_imu_without_stamps_is_told(vehicle):
    it = vehicle()
    for _ in range(3):
        it.ros.send("/imu", stamped(imu(), 0, "imu_link"), START)
    it.ros.tick()
    assert it.diagnosis()[2]["imu: unused, without stamp"] == "3"
    remedy = "; let its driver stamp it, or give imu.stamp: arrival"
    assert it.ros.told[0] == f"imu: message without stamp not used{remedy}"


@pytest.mark.parametrize(
    "given, sends, said",
    [
        ({"transforms": {k: v for k, v in AT.items() if k[1] != "gps"}}, "/imu /fix /odom",
         "gnss: the transform base_link -> gps: missing for 2 s; begun without it"),
        ({}, "/imu /fix", "wheels: a message on /odom with its frame (or wheels.frame): missing"),
        ({"wheels__frame": "odom"}, "/imu /fix /odom", "wheels.frame, since odom is fixed to the ground: missing"),
    ],
)  # fmt: skip
def test_a_source_without_a_mounting_is_left_out_and_counted(vehicle, given, sends, said):
    it = vehicle(tf_within=2.0, **given)
    it.stand(3, sends=sends.split())
    it.stand(1)
    assert any(said in line for line in it.ros.told)
    assert any(key.endswith("of a source that is left out") for key in it.diagnosis()[2])
    assert len(it.navigator.live.counts()) == 1


def test_messages_that_cannot_be_used_are_counted_and_told_once(vehicle):
    it = vehicle()
    it.stand(1)
    now = it.ros.now
    for each in (fix(status=-1), fix(status=-1), fix(kind=0)):
        it.ros.send("/fix", stamped(each, now, "gps"))
    it.ros.send("/fix", stamped(fix(), 0, "gps"))
    it.ros.send("/fix", stamped(fix(), 47 * SECOND, "gps"))
    it.ros.send("/imu", stamped(imu(angular_velocity_covariance=-np.ones(9)), now, "imu_link"))
    it.ros.tick()
    values = it.diagnosis()[2]
    found = {key: n for key, n in values.items() if ": unused" in key}
    assert found == {
        "gnss: unused, no fix": "2",
        "gnss: unused, without covariance": "1",
        "gnss: unused, without stamp": "1",
        "gnss: unused, on another clock": "1",
        "imu: unused, without rates or forces": "1",
    }
    told = [line for line in it.ros.told if "not used" in line]
    assert len(told) == 5 and any(line.endswith("give gnss.std") for line in told)
    assert any(line.endswith("or give gnss.stamp: arrival") for line in told)


def test_numbers_that_are_none_do_not_end_it(vehicle):
    it = vehicle()
    it.stand(11)
    nan = float("nan")
    for each in (imu((nan, 0.0, 0.0)), imu(accel=(1e300, 0.0, 0.0))):
        it.ros.now += SECOND // 50
        it.ros.send("/imu", stamped(each, it.ros.now, "imu_link"))
    it.ros.send("/fix", stamped(fix(lat=nan), it.ros.now, "gps"))
    it.ros.send("/fix", stamped(fix(lat=4700.0), it.ros.now, "gps"))
    it.ros.send("/odom", wheels(it.ros.now, float("inf")))
    it.ros.tick()
    values = it.diagnosis()[2]
    assert (
        int(values["dropped, invalid"]) == 2 and values["wheels: unused, without a number"] == "1"
    )


def test_arrival_stands_for_a_stamp_where_it_is_asked_for(vehicle):
    it = vehicle(wheels__stamp="arrival")
    it.stand(1)
    it.ros.send("/odom", wheels(0))
    assert not it.navigator.unused


def test_a_source_that_falls_silent_is_named(vehicle):
    it = vehicle()
    it.stand(11)
    it.stand(7, sends=("/imu", "/fix"))
    level, message, values = it.diagnosis()
    assert (level, message) == (1, "valid; wheels is silent") and "wheels: silent, s" in values


def test_time_that_jumps_back_begins_anew(vehicle):
    """As where a bag is played again."""
    it = vehicle()
    it.stand(12)
    before = len(it.shown())
    it.ros.jump(-12.0)
    it.count = 0
    assert it.ros.told[-2:] == ["tf cleared", "ROS time jumped by -12.0 s: beginning anew"]
    it.stand(12)
    assert it.diagnosis()[1] == "valid" and it.diagnosis()[2]["restarts"] == "1"
    assert len(it.shown()) > before and it.shown()[-1].header.stamp.sec == START // SECOND + 11


@pytest.mark.parametrize("shift", [30, 1000])
def test_stamps_of_the_imu_that_go_back_for_good_align_anew(vehicle, shift):
    it = vehicle()
    it.stand(11)
    it.stand(13, shift=-shift)
    back = [re.search(r"(\d+\.\d) s back in the time", line) for line in it.ros.told]
    assert [float(each[1]) for each in back if each] == [pytest.approx(shift, abs=0.15)]
    values = it.diagnosis()[2]
    assert (values["alignments"], values["restarts"]) == ("1", "0")
    assert "heading unknown" in it.diagnosis()[1]  # the vehicle may have turned


def test_stamps_of_the_imu_that_step_ahead_for_good_align_anew(vehicle):
    it = vehicle()
    it.stand(11)
    it.stand(13, shift=1000)
    values = it.diagnosis()[2]
    assert (values["alignments"], values["restarts"]) == ("1", "0")
    assert "heading unknown" in it.diagnosis()[1]


def test_a_single_stamp_of_another_time_does_no_harm(vehicle):
    it = vehicle()
    it.stand(11)
    for shift in (-30, 30, -1000, 1000):
        it.ros.send("/imu", stamped(imu(), it.ros.now + shift * SECOND, "imu_link"))
        it.stand(0.5)
    assert it.diagnosis()[:2] == (0, "valid") and it.diagnosis()[2]["restarts"] == "0"


def test_the_verdict_is_in_the_diagnostics_where_it_is_asked_for(vehicle):
    it = vehicle(verdict_every=60.0)
    it.stand(12)
    _ = it.navigator.live.verdict  # compiles what the other process needs, which has a low priority
    end = time.monotonic() + 300.0
    while "verdict" not in it.diagnosis()[2]:
        assert time.monotonic() < end and "verdict: failed" not in it.diagnosis()[2]
        time.sleep(0.02)
        it.ros.tick()
    stream = it.navigator.live.stream
    assert it.diagnosis()[2]["verdict"] == stream.verdict.line
    assert it.diagnosis()[2]["verdict: on"].startswith(
        f"{stream.start.t:.1f} to {stream.t:.1f} s, "
    )
    process = it.navigator._verdicts._process
    it.ros.node.destroy_node()
    assert process.wait(60.0) != 0


def test_a_verdict_that_fails_is_in_the_diagnostics(vehicle, monkeypatch):
    def none(module):
        raise OSError

    monkeypatch.setattr(verdict_process, "start_process", none)
    it = vehicle(verdict_every=60.0)
    it.stand(12)
    it.navigator._verdicts._thread.join(0.1)
    it.ros.tick()
    assert it.diagnosis()[:2] == (0, "valid")
    assert it.diagnosis()[2]["verdict: failed"] == "no process could be started"


def test_nobody_who_asks_for_verdicts_no_process(vehicle):
    it = vehicle()
    it.stand(12)
    assert it.navigator._verdicts._thread is None


@pytest.mark.parametrize(
    "given, said",
    [
        ({"filter": "closed-lop"}, "closed-loop"),
        ({"filter": "attitude-mekf"}, "filter: attitude-mekf has no position"),
        ({"imu__grade": "tacticl"}, "tactical"),
        ({"options": 3}, "options"),
        ({"options__error_mode": "literal"}, "error_mode"),
        ({"estimate": ["clocks"]}, "clock"),
        ({"vehicle": "cart"}, "car"),
        ({"replay": True}, "replay needs a lag"),
        ({"mag": 1}, "unknown key 'mag'"),
    ],
)
def test_wrong_parameters_end_the_node_in_one_line(vehicle, capsys, given, said):
    it = vehicle(**given)
    error = capsys.readouterr().err
    assert it.code == 2 and said in error and len(error.splitlines()) == 1
    assert error.startswith("strapdown: ")


def of_magnetometer(**more):
    given = {"sources": ["mag"], "mag.topic": "/mag", "mag.kind": "magnetic-field", "mag.std": 1e-6}
    return {**given, **more}


def test_the_field_of_the_earth_is_that_of_place_and_date(vehicle, capsys):
    assert vehicle(**of_magnetometer()).code == 2
    assert (
        "mag.field is missing; give it in T north, east, down, or give place"
        in capsys.readouterr().err
    )
    place = {"place.latitude": 47.0, "place.longitude": 8.5, "mag.axes": "FLU"}
    it = vehicle(**of_magnetometer(**place))
    it.stand(0.2, sends=("/imu",))
    (source,) = it.navigator.live.stream.used
    field = sd.geomagnetic_field("2024-05-01", *np.radians([47.0, 8.5]))
    assert source.parameters == pytest.approx(field.field, rel=1e-9)


def test_without_a_date_the_field_must_be_given(vehicle):
    place = {"place.latitude": 47.0, "place.longitude": 8.5, "mag.axes": "FLU"}
    it = vehicle(**of_magnetometer(**place))
    with pytest.raises(sd.DataError, match="mag.field is missing; stamps without a date"):
        it.ros.send("/imu", stamped(imu(), SECOND, "imu_link"), SECOND)


def test_the_package_is_what_colcon_builds():
    """Versions agree, and every file that it installs is there."""
    folder = ROOT / "ros2"
    text = (folder / "setup.py").read_text(encoding="utf-8")
    package = ElementTree.parse(folder / "package.xml").getroot()
    assert package.findtext("version") == sd.__version__ and f'version="{sd.__version__}"' in text
    assert f"strapdown=={sd.__version__}" in text
    files = re.findall(r'\["((?:package|launch|config)[\w./]+)"\]', text)
    assert len(files) == 3 and all((folder / file).is_file() for file in files)
    assert (folder / "resource" / package.findtext("name")).is_file()
    ast.parse((folder / "launch" / "strapdown.launch.py").read_text(encoding="utf-8"))
    node = (folder / "strapdown_ros2" / "node.py").read_text(encoding="utf-8")
    needed = set(re.findall(r"^(?:from|import) (\w+?)(?:\.\w+)* ?(?:import|$)", node, re.M))
    listed = {each.text for each in package.findall("exec_depend")}
    there = {"rclpy", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs"}
    assert there <= needed & listed and "tf2_ros_py" in listed
