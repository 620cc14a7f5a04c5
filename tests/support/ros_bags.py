"""Bags of ROS 2 as rosbags reads them, message by message."""

import lzma

import written_ros
from rosbags.rosbag2 import Reader

JACKAL = "native/rosbag2/jackal_sim_imu_odom_61s.db3"
IMU_TOPIC, ODOM_TOPIC = "/imu/data", "/jackal_velocity_controller/odom"


def messages_of(folder):
    """[(topic, message, time of recording in ns)] of the folder of a bag, but transforms."""
    with Reader(folder) as reader:
        return [
            (connection.topic, written_ros.types("cdr").deserialize_cdr(raw, connection.msgtype), t)
            for connection, t, raw in reader.messages()
            if "TFMessage" not in connection.msgtype
        ]


def unpacked_jackal(data_folder, folder):
    """The folder of the bag of the data folder, unpacked."""
    packed = data_folder / f"{JACKAL}.xz"
    path = folder / packed.stem
    path.write_bytes(lzma.decompress(packed.read_bytes()))
    metadata = packed.parent / f"{packed.stem}.metadata.yaml"
    text = metadata.read_text(encoding="utf-8").replace("rl2-sqlite3.db3", path.name)
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    return folder
