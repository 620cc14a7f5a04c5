"""The node on rclpy itself, where that is installed: parameters, topics, messages and the clock of ROS.

The transforms are those of the double where tf2_ros is missing.
"""

import importlib
import importlib.util
import sys
import time
from pathlib import Path

import pytest
from ros_double import Ros

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed: the double stands for it")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # those of ROS itself
SECOND = 10**9
START = 1_714_550_400 * SECOND
ARGUMENTS = [
    *("--ros-args", "-p", "imu.topic:=/imu", "-p", "imu.grade:=consumer", "-p", "heading:=90.0"),
    *("-p", "sources:=[gnss]", "-p", "gnss.topic:=/fix", "-p", "gnss.kind:=position"),
    *("-p", "gnss.lever_arm:=[0.5, 0.1, -1.5]", "-p", "lag:=0.0", "-p", "rate:=10.0"),
]
PATIENCE = 30.0
"""s of this machine for which a message may be on its way."""


@pytest.fixture
def node_module(monkeypatch):
    """The module of the node, on what is installed of ROS."""
    if importlib.util.find_spec("tf2_ros") is None:
        monkeypatch.setitem(sys.modules, "tf2_ros", Ros({}).modules()["tf2_ros"])
    monkeypatch.delitem(sys.modules, "strapdown_ros2.node", raising=False)
    yield importlib.import_module("strapdown_ros2.node")
    rclpy.try_shutdown()
    monkeypatch.delitem(sys.modules, "strapdown_ros2.node", raising=False)


def messages(k):
    """(IMU message, fix or None) of a vehicle that stands, number k at 50 Hz."""
    from sensor_msgs.msg import Imu, NavSatFix

    sample, fix = Imu(), NavSatFix()
    sample.linear_acceleration.z = 9.8
    fix.latitude, fix.longitude, fix.altitude = 47.0, 8.5, 400.0
    fix.status.status = fix.status.STATUS_FIX
    fix.position_covariance = [4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 9.0]
    fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    for each, frame in ((sample, "base_link"), (fix, "gps")):
        each.header.frame_id = frame
        each.header.stamp.sec, each.header.stamp.nanosec = divmod(START + k * SECOND // 50, SECOND)
    return sample, fix if k % 10 == 0 else None


def spin_until(executor, holds):
    """Let the nodes run until something holds."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, "no message came"
        executor.spin_once(timeout_sec=0.1)


def test_the_node_runs_on_rclpy(node_module):
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import Imu, NavSatFix

    rclpy.init(args=ARGUMENTS)
    node, other = (
        node_module.StrapdownNode(),
        rclpy.create_node("driver", use_global_arguments=False),
    )
    odometry, diagnostics = [], []
    other.create_subscription(Odometry, "odometry/filtered", odometry.append, 10)
    other.create_subscription(DiagnosticArray, "/diagnostics", diagnostics.append, 10)
    of_imu, of_fix = (
        other.create_publisher(Imu, "/imu", 10),
        other.create_publisher(NavSatFix, "/fix", 10),
    )
    executor = SingleThreadedExecutor()
    for each in (node, other):
        executor.add_node(each)
    spin_until(
        executor, lambda: of_imu.get_subscription_count() and of_fix.get_subscription_count()
    )
    came = node.navigator
    for k in range(600):
        sample, fix = messages(k)
        if fix is not None:
            of_fix.publish(fix)
        of_imu.publish(sample)
        executor.spin_once(timeout_sec=0.01)
    spin_until(executor, lambda: came.live is not None and came.live.started and odometry)
    spin_until(executor, lambda: diagnostics and diagnostics[-1].status[0].message == "valid")
    state = odometry[-1]
    assert (state.header.frame_id, state.child_frame_id) == ("map", "base_link")
    assert abs(state.pose.pose.position.x) < 1 and state.pose.covariance[0] > 0
    assert diagnostics[-1].status[0].level == b"\0" and not came.unused


def test_ros_time_that_jumps_back_reaches_the_node(node_module):
    from rclpy.clock import ROSClock
    from rclpy.time import Time

    rclpy.init(args=[*ARGUMENTS, "-p", "use_sim_time:=true"])
    node = node_module.StrapdownNode()
    clock = node.get_clock()
    assert isinstance(clock, ROSClock)
    for seconds in (100, 101, 90, 89.5):
        clock.set_ros_time_override(Time(seconds=seconds, clock_type=clock.clock_type))
    assert node.navigator.restarts == 1


def test_the_example_starts_the_node(node_module):
    example = Path(__file__).resolve().parents[2] / "ros2" / "config" / "example.yaml"
    rclpy.init(args=["--ros-args", "--params-file", str(example)])
    assert [each.name for each in node_module.StrapdownNode().config.sources] == ["gnss", "wheels"]


@pytest.mark.parametrize("given", ["filtre:=ukf", "gnss.std:=[1.0, 2.0]", "lag:=-1.0"])
def test_a_wrong_parameter_ends_the_node(node_module, capsys, given):
    assert node_module.main([*ARGUMENTS, "-p", given]) == 2
    error = capsys.readouterr().err
    assert error.startswith("strapdown: ") and len(error.splitlines()) == 1
