"""Small videos and bags, written as cameras, ROS 1 and ROS 2 write them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("ros1", "sqlite3", "mcap")
RATE = 10
START_NS = 1_700_000_000_000_000_000
STEP_NS = 100_000_000


TYPES = cache(get_typestore)


def read_image(path):
    """Return the pixels of an image file."""
    return np.asarray(cv2.imread(str(path)))


def make_video(path, images, rate=RATE):
    """Write BGR images, shape (height, width, 3), as an MP4."""
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), rate, (width, height))  # type: ignore[attr-defined]
    assert writer.isOpened()
    for image in images:
        writer.write(image)
    writer.release()
    return path


def with_variable_rate(path, first, second):
    """Make the first half of a video's frames last `first` and the others `second` times as long as they do."""
    data = path.read_bytes().replace(b"edts", b"free")  # which says how long all of it lasts
    at = data.index(b"stts") + 4
    _, entries, count, delta = struct.unpack(">IIII", data[at : at + 16])
    assert entries == 1
    half = count // 2
    table = struct.pack(">IIIIII", 0, 2, half, delta * first, count - half, delta * second)
    # Every box around it grows by eight bytes; the pictures lie before them.
    assert data.index(b"mdat") < data.index(b"moov")
    longer = bytearray(data[:at] + table + data[at + 16 :])
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts"):
        place = longer.index(box) - 4
        longer[place : place + 4] = struct.pack(">I", struct.unpack(">I", longer[place : place + 4])[0] + 8)
    path.write_bytes(longer)
    return path


@dataclass
class Maker:
    """Writes a bag of one of `KINDS`; times are in nanoseconds since the epoch."""

    path: Path
    kind: str

    def __post_init__(self):
        self.ros2 = self.kind != "ros1"
        self.store = TYPES(Stores.ROS2_HUMBLE if self.ros2 else Stores.ROS1_NOETIC)
        if "tf2_msgs/msg/TFMessage" not in self.store.types:
            self.store.register(
                get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
            )
        if self.ros2:
            plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
            self.writer: Any = Writer2(self.path, version=9, storage_plugin=plugin)
        else:
            self.writer = Writer1(self.path)
        self.connections: dict[str, Any] = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()

    def new(self, name, **fields):
        """Return a message of a type such as ``sensor_msgs/Image``."""
        return self.store.types[name.replace("/", "/msg/")](**fields)

    def header(self, time_ns, frame="camera"):
        stamp = self.new("builtin_interfaces/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return self.new("std_msgs/Header", stamp=stamp, frame_id=frame, **({} if self.ros2 else {"seq": 0}))

    def write(self, topic, message, recorded_ns):
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        data = self.store.serialize_cdr(message, kind) if self.ros2 else self.store.serialize_ros1(message, kind)
        self.writer.write(self.connections[topic], recorded_ns, data)

    def image(self, topic, time_ns, data, encoding, *, shape=None, step=None, big_endian=0, recorded_ns=None):
        """Write a raw image; `data` is an array, or bytes with the `shape` (height, width) and `step` they have."""
        height, width = shape or data.shape[:2]
        raw = np.frombuffer(data if isinstance(data, bytes) else data.tobytes(), np.uint8)
        message = self.new(
            "sensor_msgs/Image",
            header=self.header(time_ns),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=big_endian,
            step=step or len(raw) // height,
            data=raw,
        )
        self.write(topic, message, recorded_ns or time_ns or START_NS)

    def compressed(self, topic, time_ns, data, form):
        raw = np.frombuffer(data, np.uint8)
        header = self.header(time_ns)
        self.write(topic, self.new("sensor_msgs/CompressedImage", header=header, format=form, data=raw), time_ns)

    def pose(self, x, y, yaw):
        point = self.new("geometry_msgs/Point", x=x, y=y, z=0.0)
        return self.new("geometry_msgs/Pose", position=point, orientation=self.turn(yaw))

    def turn(self, yaw):
        return self.new("geometry_msgs/Quaternion", x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))

    def pose_stamped(self, topic, time_ns, x, y, yaw):
        header = self.header(time_ns, "map")
        self.write(topic, self.new("geometry_msgs/PoseStamped", header=header, pose=self.pose(x, y, yaw)), time_ns)

    def pose_with_covariance(self, topic, time_ns, x, y, yaw):
        certain = self.new("geometry_msgs/PoseWithCovariance", pose=self.pose(x, y, yaw), covariance=np.zeros(36))
        header = self.header(time_ns, "map")
        self.write(topic, self.new("geometry_msgs/PoseWithCovarianceStamped", header=header, pose=certain), time_ns)

    def odometry(self, topic, time_ns, x, y, yaw):
        certain = self.new("geometry_msgs/PoseWithCovariance", pose=self.pose(x, y, yaw), covariance=np.zeros(36))
        nothing = self.new("geometry_msgs/Vector3", x=0.0, y=0.0, z=0.0)
        still = self.new("geometry_msgs/Twist", linear=nothing, angular=nothing)
        twist = self.new("geometry_msgs/TwistWithCovariance", twist=still, covariance=np.zeros(36))
        header = self.header(time_ns, "odom")
        message = self.new("nav_msgs/Odometry", header=header, child_frame_id="base_link", pose=certain, twist=twist)
        self.write(topic, message, time_ns)

    def transform(self, topic, time_ns, parent, child, x, y, yaw):
        shift = self.new("geometry_msgs/Vector3", x=x, y=y, z=0.0)
        moved = self.new("geometry_msgs/Transform", translation=shift, rotation=self.turn(yaw))
        header = self.header(time_ns, parent)
        one = self.new("geometry_msgs/TransformStamped", header=header, child_frame_id=child, transform=moved)
        self.write(topic, self.new("tf2_msgs/TFMessage", transforms=[one]), time_ns)
