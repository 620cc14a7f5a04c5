"""Start the node: `ros2 launch strapdown_ros2 strapdown.launch.py config:=robot.yaml`."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Return the node with its parameter file."""
    example = Path(get_package_share_directory("strapdown_ros2"), "config", "example.yaml")
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=str(example)),
            Node(
                package="strapdown_ros2",
                executable="navigator",
                name="strapdown",
                parameters=[LaunchConfiguration("config")],
                output="screen",
            ),
        ]
    )
