"""The node: parameters, topics, tf and timers of rclpy around a `Navigator`."""

import importlib
import sys
from typing import Any

import rclpy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import Imu, NavSatFix

from strapdown.checks import DataError
from strapdown.io.decoding.robots.ros_transforms import Pose

from .conversions import BaseState, fill_fix, fill_header, fill_odometry, fill_transform, odom_state
from .mounts import pose_of_transform
from .navigator import Navigator
from .parameters import config_of

PACKAGES = {
    "Odometry": "nav_msgs",
    "TwistStamped": "geometry_msgs",
    "TwistWithCovarianceStamped": "geometry_msgs",
}
"""Packages of messages that are not of sensor_msgs."""
QUEUE = 200
"""Messages of a topic that wait for the node, at most."""
JUMP = 1.0
"""s by which ROS time must jump back before the filter begins anew."""


class StrapdownNode(Node):  # type: ignore[misc]
    """A node that runs a filter on messages and publishes its state."""

    def __init__(self) -> None:
        super().__init__(
            "strapdown",
            allow_undeclared_parameters=True,
            automatically_declare_parameters_from_overrides=True,
        )
        given = {name: each.value for name, each in self.get_parameters_by_prefix("").items()}
        self.config = config = config_of(given)
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, self)
        self._tf = tf2_ros.TransformBroadcaster(self)
        self._odometry = self.create_publisher(Odometry, "odometry/filtered", 10)
        self._fix = self.create_publisher(NavSatFix, "fix/filtered", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.navigator = Navigator(config, self._pose, self.get_logger().warning, self._publish)
        self._subscribe()
        self._timer = self.create_timer(1.0, self._diagnose)
        back = JumpThreshold(
            min_forward=None, min_backward=Duration(seconds=-JUMP), on_clock_change=False
        )
        self._jumps = self.get_clock().create_jump_callback(back, post_callback=self._on_jump)

    def destroy_node(self) -> None:
        """End the process that makes verdicts, and all that ROS knows of the node."""
        self.navigator.close()
        super().destroy_node()

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _subscribe(self) -> None:
        # what drivers send as best effort and as reliable both reaches it
        quality = QoSProfile(depth=QUEUE, reliability=ReliabilityPolicy.BEST_EFFORT)
        navigator = self.navigator
        self.create_subscription(
            Imu,
            self.config.imu.topic,
            lambda message: navigator.take_imu(message, self._now()),
            quality,
        )
        for k, each in enumerate(self.config.sources):
            package = importlib.import_module(f"{PACKAGES.get(each.message, 'sensor_msgs')}.msg")
            self.create_subscription(
                getattr(package, each.message),
                each.topic,
                lambda message, k=k: navigator.take(k, message, self._now()),
                quality,
            )

    def _pose(self, frame: str) -> Pose | None:
        """Return the pose of a frame in the base frame; None where tf does not know it."""
        return self._pose_in(self.config.base_frame, frame, 0)

    def _pose_in(self, other: str, frame: str, stamp: int) -> Pose | None:
        """Return the pose of a frame in another one at a stamp, ns, or the newest one at 0."""
        try:
            found = self._buffer.lookup_transform(other, frame, Time(nanoseconds=stamp))
        except tf2_ros.TransformException:
            return None
        return pose_of_transform(found.transform)

    def _publish(self, it: BaseState) -> None:
        world, base, odom = self.config.world_frame, self.config.base_frame, self.config.odom_frame
        self._odometry.publish(fill_odometry(Odometry(), it, world, base))
        self._fix.publish(fill_fix(NavSatFix(), it, base))
        if not self.config.publish_tf:
            return
        if not odom:
            self._tf.sendTransform(fill_transform(TransformStamped(), it, world, base))
            return
        in_odom = self._pose_in(odom, base, it.stamp) or self._pose_in(odom, base, 0)
        if in_odom is None:
            self.get_logger().warning(f"no transform {odom} -> {base}: no tf is sent", once=True)
            return
        moved = odom_state(it, in_odom)
        self._tf.sendTransform(fill_transform(TransformStamped(), moved, world, odom))

    def _diagnose(self) -> None:
        now = self._now()
        level, text, values = self.navigator.diagnosis(now)
        levels = (DiagnosticStatus.OK, DiagnosticStatus.WARN)
        status = DiagnosticStatus()
        status.level = levels[level] if level < len(levels) else DiagnosticStatus.STALE
        status.name, status.message = f"{self.get_name()}: navigation", text
        for key, value in values:
            pair = KeyValue()
            pair.key, pair.value = key, value
            status.values.append(pair)
        array = DiagnosticArray()
        fill_header(array.header, now, "")
        array.status.append(status)
        self._diagnostics.publish(array)

    def _on_jump(self, jump: Any) -> None:
        self._buffer.clear()  # of what is now the future; fixed transforms stay
        self.navigator.restart(f"ROS time jumped by {jump.delta.nanoseconds * 1e-9:+.1f} s")


def main(arguments: list[str] | None = None) -> int:
    """Run the node until it is shut down; return the exit code.

    Parameters
    ----------
    arguments : list of str, optional
        Those of ROS; default: of the command.
    """
    rclpy.init(args=arguments)
    try:
        rclpy.spin(StrapdownNode())
    except DataError as error:
        print(f"strapdown: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0
