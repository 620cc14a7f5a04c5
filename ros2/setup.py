"""The package as colcon builds it (ament_python)."""

from setuptools import setup

NAME = "strapdown_ros2"

setup(
    name=NAME,
    version="0.2.0",
    description="A node of ROS 2 that runs a filter of strapdown",
    license="MIT",
    packages=[NAME],
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/strapdown.launch.py"]),
        (f"share/{NAME}/config", ["config/example.yaml"]),
    ],
    python_requires=">=3.11",
    install_requires=["setuptools", "strapdown==0.2.0"],
    zip_safe=True,
    entry_points={"console_scripts": [f"navigator = {NAME}.node:main"]},
)
