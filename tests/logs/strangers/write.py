"""Writes bags in every form by the packages of others, and prints their names: write.py <folder>"""
import pathlib
import sys

import numpy
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

START, STEP, COUNT = 1_700_000_000_000_000_000, 50_000_000, 100
STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types


def header(k, frame):
    time = START + k * STEP
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9), frame)


def quaternion():
    return T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)


def vector(x, y, z):
    return T["geometry_msgs/msg/Vector3"](x, y, z)


def messages(k):
    zeros, large = numpy.zeros(9), numpy.zeros(36)
    numbers = numpy.array
    point = T["geometry_msgs/msg/Point"](2.0 * k, -1.0 * k, 0.0)
    north = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.5**0.5, 0.5**0.5)
    # Straight to the north at 1.112 m/s, while wheels of 0.14 m turn at 10 rad/s: they slip by a fifth.
    yield "/fix", T["sensor_msgs/msg/NavSatFix"](header(k, "gps"), T["sensor_msgs/msg/NavSatStatus"](0, 1), 48.0 + 5e-7 * k, 11.0, 520.0, zeros, 0)
    yield "/imu", T["sensor_msgs/msg/Imu"](header(k, "imu_frame"), north, zeros, vector(0.0, 0.0, -1e-6 * k), zeros, vector(0.0, 0.0, 9.8), zeros)
    yield "/joint_states", T["sensor_msgs/msg/JointState"](header(k, ""), ["left_wheel", "right_wheel"], numbers([0.5 * k, 0.0]), numbers([10.0, 10.0]), numbers([]))
    yield "/odom", T["nav_msgs/msg/Odometry"](
        header(k, "odom"), "base", T["geometry_msgs/msg/PoseWithCovariance"](T["geometry_msgs/msg/Pose"](point, quaternion()), large),
        T["geometry_msgs/msg/TwistWithCovariance"](T["geometry_msgs/msg/Twist"](vector(0.5 * k, 0.0, 0.0), vector(0.0, 0.0, 0.0)), large))


def write_rosbag2(path, plugin, mode):
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for k in range(COUNT):
            for topic, message in messages(k):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=STORE)
                writer.write(connections[topic], START + k * STEP, STORE.serialize_cdr(message, message.__msgtype__))


def write_mcap(path, little_endian=True, encoding="ros2msg", slash="/", **options):
    with open(path, "wb") as stream:
        writer = McapWriter(stream, chunk_size=10000, **options)
        writer.start(profile="ros2", library="")
        channels = {}
        for k in range(COUNT):
            for topic, message in messages(k):
                name = message.__msgtype__
                if topic not in channels:
                    definition, _ = STORE.generate_msgdef(name, ros_version=2)
                    schema = writer.register_schema(name, encoding, definition.encode())
                    channels[topic] = writer.register_channel(topic.replace("/", slash), "cdr", schema)
                data = bytes(STORE.serialize_cdr(message, name, little_endian=little_endian))
                writer.add_message(channels[topic], log_time=START + k * STEP, publish_time=START + k * STEP, data=data)
        writer.finish()


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir()
    for plugin in (StoragePlugin.SQLITE3, StoragePlugin.MCAP):
        for mode in (None, CompressionMode.FILE, CompressionMode.MESSAGE):
            name = f"rosbag2_{plugin.name.lower()}_{mode.name.lower() if mode else 'plain'}"
            write_rosbag2(folder / name, plugin, mode)
            print(name)
    kinds = {"zstd": {"compression": CompressionType.ZSTD}, "lz4": {"compression": CompressionType.LZ4}, "none": {"compression": CompressionType.NONE},
             "unchunked": {"use_chunking": False}, "unindexed": {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False,
                                                                 "repeat_schemas": False, "use_summary_offsets": False},
             "big_endian": {"little_endian": False}}
    for name, options in kinds.items():
        write_mcap(folder / f"{name}.mcap", **options)
        print(f"{name}.mcap")
    # What has names that the robot of the tutorial does not expect is mapped by a proposal.
    write_mcap(folder / "no_slash.mcap", slash="")
    print("no_slash.mcap")


main()
