"""Messages of ROS to samples and measurements, states to messages: axes, units, covariances, times."""

import ast
from pathlib import Path

import numpy as np
import pytest
from ros_double import as_rosbags, message_class, store
from ros_made import fix, imu, message, odometry, of_receiver
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

import strapdown as sd
import strapdown_ros2
from strapdown.core.loop.contract import INVALID, VALID, FilterState
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown_ros2 import conversions
from strapdown_ros2.conversions import (
    Increments,
    LocalFrame,
    RosClock,
    UnusedMessage,
    reading_of,
    shown_state,
)
from strapdown_ros2.mounts import FLU, Mount, imu_mount_at, mount_at, pose_of_transform

pytestmark = pytest.mark.short
NONE = Mount.none()
YEAR_2024 = 1_714_550_400_123_456_789
USED = (
    *("sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/MagneticField"),
    *("sensor_msgs/msg/FluidPressure", "nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped"),
    *("geometry_msgs/msg/TwistWithCovarianceStamped", "geometry_msgs/msg/TransformStamped"),
    *("diagnostic_msgs/msg/DiagnosticArray", "diagnostic_msgs/msg/DiagnosticStatus"),
    *("diagnostic_msgs/msg/KeyValue", "std_msgs/msg/Header", "sensor_msgs/msg/NavSatStatus"),
)


def test_the_definitions_are_those_of_each_distribution():
    for name in (Stores.ROS2_JAZZY, Stores.ROS2_KILTED):
        other = get_typestore(name)
        for each in USED:
            assert other.fielddefs[each][1] == store().fielddefs[each][1], each


def test_only_the_node_needs_ros():
    folder = Path(strapdown_ros2.__file__).parent
    found = {}
    for file in folder.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            found.setdefault(file.stem, set()).update(name.split(".")[0] for name in names)
    ours = {"numpy", "strapdown", "collections", "math", "typing"}
    assert all(names <= ours for stem, names in found.items() if stem != "node")
    assert "rclpy" in found["node"]


# ---- times


def test_times_count_from_midnight_to_the_nanosecond():
    clock = RosClock(YEAR_2024)
    assert clock.absolute
    for stamp in (YEAR_2024, YEAR_2024 + 1, YEAR_2024 + 86_400_000_000_001):
        t = clock.time("/imu", stamp)
        assert t == pytest.approx((stamp - 1_714_521_600_000_000_000) * 1e-9, abs=1e-10)
        assert abs(clock.stamp(t) - stamp) <= 20  # what a float of a day holds


def test_stamps_that_are_missing_or_of_another_clock_are_not_used():
    simulated = RosClock(47_580_000_000)
    assert not simulated.absolute and simulated.time("/imu", 47_600_000_000) == 47.6
    assert simulated.stamp(47.6) == 47_600_000_000
    for clock, stamp, why in (
        (simulated, 0, "without stamp"),
        (simulated, YEAR_2024, "another clock"),
        (RosClock(YEAR_2024), 47_580_000_000, "another clock"),
    ):
        with pytest.raises(UnusedMessage, match=why):
            clock.time("/fix", stamp)


# ---- the IMU


def test_rates_and_forces_become_increments_forward_right_down():
    increments = Increments(NONE)
    assert increments.sample(10.0, imu()) is None
    sample = increments.sample(10.01, imu((0.1, 0.2, 0.3), (1.0, 2.0, 9.8)))
    dt = 10.01 - 10.0
    assert sample == (
        10.01,
        dt,
        (0.1 * dt, -0.2 * dt, -0.3 * dt),
        (1.0 * dt, -2.0 * dt, -9.8 * dt),
    )


def test_a_sample_after_a_gap_or_a_late_one_counts_over_the_median():
    increments = Increments(NONE)
    times = [0.0, 0.01, 0.02, 0.03, 0.06, 0.05, 0.07]
    found = [increments.sample(t, imu()) for t in times]
    assert found[0] is None
    assert [round(each.dt, 9) for each in found[1:]] == [0.01] * 6


@pytest.mark.parametrize("name", ["angular_velocity", "linear_acceleration"])
def test_an_imu_without_rates_or_forces_is_not_used(name):
    """Element 0 of a covariance is -1 where there is no such data."""
    covariance = np.array([-1.0, *np.zeros(8)])
    with pytest.raises(UnusedMessage, match="without rates or forces"):
        Increments(NONE).sample(1.0, imu(**{f"{name}_covariance": covariance}))


def test_zero_covariances_of_an_imu_mean_unknown_and_are_used():
    increments = Increments(NONE)
    increments.sample(1.0, imu())
    assert increments.sample(1.01, imu()) is not None


def test_a_turned_imu_is_turned_by_its_transform():
    turn = Rotation.from_euler("ZYX", [70, -20, 160], degrees=True)
    transform = message_class("geometry_msgs/msg/Transform")()
    for axis, value in zip("xyzw", turn.as_quat()):
        setattr(transform.rotation, axis, float(value))
    transform.translation.x, transform.translation.y = 1.0, 0.5
    mount = imu_mount_at(pose_of_transform(transform))
    np.testing.assert_allclose(mount.matrix, FLU @ turn.as_matrix(), atol=1e-8)
    np.testing.assert_array_equal(mount.arm, [1.0, -0.5, 0.0])
    np.testing.assert_allclose(
        mount_at(pose_of_transform(transform)).matrix, mount.matrix, atol=1e-8
    )


def test_a_transform_of_zeros_is_none():
    transform = message_class("geometry_msgs/msg/Transform")()
    transform.rotation.w = 0.0
    assert pose_of_transform(transform) is None


# ---- sources


def test_a_fix_is_latitude_longitude_height_with_std_north_east_down():
    y, std = reading_of("position", fix(), NONE, None)
    np.testing.assert_allclose(y, [np.radians(47.0), np.radians(8.5), 400.0], rtol=1e-15)
    assert std == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("given", [fix(status=-1), fix(lat=0.0, lon=0.0)])
def test_a_message_without_a_fix_is_not_used(given):
    with pytest.raises(UnusedMessage, match="no fix"):
        reading_of("position", given, NONE, None)


@pytest.mark.parametrize(
    "given", [fix(kind=0), fix(variances=(0.0, 0.0, 0.0)), fix(variances=(4.0, -1.0, 9.0))]
)
def test_an_unknown_covariance_needs_a_std(given):
    with pytest.raises(UnusedMessage, match="without covariance"):
        reading_of("position", given, NONE, None)
    assert reading_of("position", given, NONE, (1.0, 2.0, 3.0)).std == (1.0, 2.0, 3.0)


def test_a_std_replaces_the_covariance():
    assert reading_of("position", fix(), NONE, (5.0, 5.0, 5.0)).std == (5.0, 5.0, 5.0)


def test_a_fix_without_a_height_measures_the_rest():
    given = fix(height=float("nan"), variances=(4.0, 1.0, 0.0))
    assert np.isnan(reading_of("position", given, NONE, None).y[2])


def test_the_velocity_of_a_receiver_is_north_east_down():
    given = of_receiver((1.0, 2.0, 3.0), (1.0, 4.0, 9.0, 0, 0, 0))
    assert reading_of("velocity", given, NONE, None) == ((2.0, 1.0, -3.0), (2.0, 1.0, 3.0))
    flat = reading_of("velocity", of_receiver((1.0, 2.0, 0.0), (1.0,) * 6), NONE, None)
    assert np.isnan(flat.y[2])  # a receiver that has none sends 0


def test_the_velocity_of_a_vehicle_is_forward_right_down():
    turned = Mount(FLU @ Rotation.from_euler("Z", 90, degrees=True).as_matrix(), np.zeros(3))
    given = odometry((1.0, 2.0, 3.0), (1.0, 4.0, 9.0, 0, 0, 0))
    y, std = reading_of("body-velocity", given, turned, None)
    np.testing.assert_allclose(y, [-2.0, -1.0, -3.0], atol=1e-12)
    np.testing.assert_allclose(std, [2.0, 1.0, 3.0])
    assert reading_of("speed", given, NONE, None) == ((1.0,), (1.0,))


def test_a_twist_without_covariance_needs_a_std():
    given = message("geometry_msgs/msg/TwistStamped", twist__linear=(3.0, 0.0, 0.0))
    with pytest.raises(UnusedMessage, match="without covariance"):
        reading_of("speed", given, NONE, None)
    assert reading_of("speed", given, NONE, (0.1,)) == ((3.0,), (0.1,))


def test_magnetic_field_and_pressure():
    given = message("sensor_msgs/msg/MagneticField", magnetic_field=(2e-5, 1e-6, -4e-5))
    assert reading_of("magnetic-field", given, NONE, (1e-6,) * 3).y == (2e-5, -1e-6, 4e-5)
    air = message("sensor_msgs/msg/FluidPressure", fluid_pressure=96_300.0, variance=4.0)
    assert reading_of("pressure", air, NONE, (1.0,)) == ((96_300.0,), (1.0,))


# ---- states

ORIGIN = np.array([np.radians(47.0), np.radians(8.5), 400.0])
ARM = np.array([0.5, -0.3, 0.8])


def a_state(lla=ORIGIN, rph=(0.1, -0.2, 0.7), v=(3.0, -2.0, 0.5), omega=(0.1, 0.2, -0.3)):
    root = np.random.default_rng(1).normal(size=(15, 15)) * 1e-2
    C = Rotation.from_euler("ZYX", rph[::-1]).as_matrix()
    three = np.zeros(3)
    return FilterState(np.array(lla), np.array(v), C, three, three, root @ root.T, np.array(omega),
                       three, np.zeros(0), np.zeros(0))  # fmt: skip


def shown_at(state, frame=None, arm=ARM):
    return shown_state(1, VALID, state, arm, frame or LocalFrame(ORIGIN))


def test_east_and_heading_are_those_of_ros():
    level = dict(omega=(0, 0, 0.0), v=(0.0, 10.0, 0.0), rph=(0.0, 0.0, np.pi / 2))
    it = shown_at(a_state(displace_lla(ORIGIN, [0.0, 100.0, -5.0]), **level), arm=np.zeros(3))
    np.testing.assert_allclose(it.place, [100.0, 0.0, 5.0], atol=2e-3)
    np.testing.assert_allclose(it.q, [0, 0, 0, 1], atol=1e-5)  # east is forward
    np.testing.assert_allclose(it.velocity, [10.0, 0.0, 0.0], atol=1e-12)


def test_the_base_frame_is_moved_from_the_imu():
    state = a_state()
    it, of_imu = shown_at(state), shown_at(state, arm=np.zeros(3))
    moved = displacement(it.lla, of_imu.lla)
    np.testing.assert_allclose(moved, -state.C_nb @ ARM, atol=1e-6)
    swing = np.cross(state.omega, -ARM) * [1, -1, -1]
    np.testing.assert_allclose(it.velocity - of_imu.velocity, swing, atol=1e-12)
    np.testing.assert_allclose(it.place, [1, 1, -1] * moved[[1, 0, 2]], atol=1e-5)


def changed(state, x):
    """The state with errors x (15,): true less estimated."""
    turn = Rotation.from_rotvec(x[6:9]).as_matrix()
    return state._replace(lla=displace_lla(state.lla, x[:3]), v_n=state.v_n + x[3:6],
                          C_nb=turn @ state.C_nb, omega=state.omega - x[12:15])  # fmt: skip


def test_covariances_are_those_of_the_base_frame():
    """The Jacobian by finite differences."""
    far = displace_lla(ORIGIN, [3e4, 4e4, 0.0])
    state, frame = a_state(far), LocalFrame(ORIGIN)
    here = shown_at(state, frame)

    def difference(x):
        there = shown_at(changed(state, x), frame)
        turn = Rotation.from_quat(there.q) * Rotation.from_quat(here.q).inv()
        pose = [*(there.place - here.place), *turn.as_rotvec()]
        return np.r_[pose, there.velocity - here.velocity, there.rate - here.rate]

    step = 1e-4
    of = [difference(step * row) - difference(-step * row) for row in np.eye(15)]
    J = np.array(of).T / (2 * step)
    np.testing.assert_allclose(J[:6] @ state.P @ J[:6].T, here.pose_covariance, atol=1e-6)
    np.testing.assert_allclose(J[6:] @ state.P @ J[6:].T, here.twist_covariance, atol=1e-6)


def test_a_state_that_is_not_known_is_not_shown():
    frame = LocalFrame(ORIGIN)
    assert shown_state(1, INVALID, a_state(), ARM, frame) is None
    assert shown_state(1, VALID, a_state(lla=[np.nan] * 3), ARM, frame) is None


@pytest.mark.parametrize(
    "name, fill, frames",
    [
        ("nav_msgs/msg/Odometry", conversions.fill_odometry, ("map", "base_link")),
        ("geometry_msgs/msg/TransformStamped", conversions.fill_transform, ("map", "base_link")),
        ("sensor_msgs/msg/NavSatFix", conversions.fill_fix, ("base_link",)),
    ],
)
def test_messages_out_are_those_of_the_definitions(name, fill, frames):
    """The double refuses wrong fields and types; rosbags writes and reads them."""
    it = shown_at(a_state())._replace(stamp=YEAR_2024)
    made = as_rosbags(fill(message_class(name)(), it, *frames))
    again = store().deserialize_cdr(store().serialize_cdr(made, name), name)
    assert conversions.stamp_of(again) == YEAR_2024
    assert again.header.frame_id == frames[0]


def test_a_fix_out_has_degrees_and_a_known_covariance():
    it = shown_at(a_state(), arm=np.zeros(3))
    made = conversions.fill_fix(message_class("sensor_msgs/msg/NavSatFix")(), it, "base_link")
    assert (made.latitude, made.altitude) == (pytest.approx(47.0), pytest.approx(400.0))
    P = np.array(made.position_covariance).reshape(3, 3)
    expected = a_state().P[np.ix_([1, 0, 2], [1, 0, 2])] * np.outer([1, 1, -1], [1, 1, -1])
    np.testing.assert_allclose(P, expected, atol=1e-9)
    assert made.position_covariance_type == 3 and made.status.status == 0


def test_the_pose_is_that_of_a_tum_file(tmp_path):
    """Another writer of the same frames."""
    recording = sd.simulate("car", duration=10.0, seed=3)
    solution = sd.fuse(recording)
    path, k = solution.trajectory, len(solution.t) - 1
    sd.write_solution(solution, tmp_path / "a.tum")
    row = np.loadtxt(tmp_path / "a.tum")[k]
    C = Rotation.from_quat(path.q_nb[k][[1, 2, 3, 0]]).as_matrix()
    state = a_state(path.lla[k])._replace(C_nb=C, v_n=path.v_n[k])
    it = shown_at(state, LocalFrame(path.lla[0]), np.zeros(3))
    np.testing.assert_allclose([*it.place, *it.q], row[1:], atol=2e-6)
