"""Bags: the images of one topic, and where they were taken as another topic tells."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import Scan, exists
from omnieval.datasets.sequence import Frame, Pose
from omnieval.datasets.source import Address, parse
from omnieval.datasets.streams.encodings import Raw, pixels
from omnieval.datasets.streams.image import as_file, file_name, png
from omnieval.datasets.streams.names import bag_files
from omnieval.datasets.streams.rosbag import Bag, Message, Topic, opened
from omnieval.datasets.streams.scan import NO_POSES, scan_stream
from omnieval.datasets.streams.store import Contents
from omnieval.datasets.streams.trajectory import BY_DEFAULT, Track, Tree, poses_at
from omnieval.datasets.trajectory.between import Joining
from omnieval.errors import DatasetError
from omnieval.wording import counted, shown

_RAW, _COMPRESSED = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
_IMAGES = {_RAW, _COMPRESSED}
_DEPTH = "/compressedDepth"
"""How topics end whose compressed images are distances."""

_TRANSFORMS = {"tf2_msgs/TFMessage", "tf/tfMessage"}
_STATIC = "_static"
"""How the topic ends that holds what never changes, beside one of transforms."""
_POSES: Mapping[str, Callable[[Any], Any]] = {
    "geometry_msgs/Pose": lambda content: content,
    "geometry_msgs/PoseStamped": lambda content: content.pose,
    "geometry_msgs/PoseWithCovariance": lambda content: content.pose,
    "geometry_msgs/PoseWithCovarianceStamped": lambda content: content.pose.pose,
    "nav_msgs/Odometry": lambda content: content.pose.pose,
    "geometry_msgs/TransformStamped": lambda content: content.transform,
}
"""Where a message of each type holds its pose."""

_RECORDED = "times-of-recording"
"""The finding that images have no time of their own."""

_Sample = tuple[int, tuple[float, ...], tuple[float, ...]]


def scan_bag(rest: str) -> Scan:
    """Read the images of a bag (``PATH[#topic=...,pose-topic=...]``), decoding them into the cache if need be."""
    address = parse("bag", rest)
    if "pose-frame" in address.options and "pose-topic" not in address.options:
        hint = "--pose-frame says whose pose to take of a topic of transforms; name that with --pose-topic"
        raise DatasetError(f"{address.source}: {hint}")
    files = bag_files(address.path) if exists(address.path) else []
    return scan_stream(address, files, lambda folder: _decode(address, folder), lambda images: _locate(address, images))


def _decode(address: Address, folder: Path) -> Contents:
    """Write the images of a bag into a folder."""
    with opened(address.path) as bag:
        topic = _image_topic(bag, address.options.get("topic"))
        frames, recorded = _write_images(bag, topic, address.every, folder)
        findings = [_no_poses(bag)]
    if not all(frame.time_ns for frame in frames):
        message = f"images of {topic.name} without a time of their own: those of recording are taken"
        findings.append(Finding("info", _RECORDED, ROOT, message))
        frames = [replace(frame, time_ns=time) for frame, time in zip(frames, recorded, strict=True)]
    return Contents(tuple(frames), tuple(findings))


def _locate(address: Address, images: Contents) -> Contents:
    """Return where images of a bag were taken, at their times."""
    times = [frame.time_ns for frame in images.frames if frame.time_ns is not None]
    stamped = all(finding.code != _RECORDED for finding in images.findings)
    with opened(address.path) as bag:
        topic = _named(bag, address.options["pose-topic"], _pose_topics(bag), "poses", "--pose-topic")
        poses = _poses(bag, topic, address, times, stamped=stamped)
    return Contents(findings=tuple(_about(poses, topic, address.joining)), poses=tuple(poses))


def _image_topic(bag: Bag, name: str | None) -> Topic:
    """Return the topic of that name, or the only one that holds images."""
    images = {
        topic.name: topic
        for topic in bag.topics.values()
        if topic.kind in _IMAGES and topic.count and not topic.name.endswith(_DEPTH)
    }
    if name is not None:
        return _named(bag, name, images, "images", "--topic")
    if not images:
        raise DatasetError(f"there is no topic of images, only {_listed(bag.topics.values())}")
    if len(images) > 1:
        raise DatasetError(
            f"there are {len(images)} topics of images; choose one with --topic: {_listed(images.values())}"
        )
    return next(iter(images.values()))


def _pose_topics(bag: Bag) -> dict[str, Topic]:
    known = {*_POSES, *_TRANSFORMS}
    return {topic.name: topic for topic in bag.topics.values() if topic.kind in known and topic.count}


def _named(bag: Bag, name: str, suited: Mapping[str, Topic], what: str, option: str) -> Topic:
    for spelling in (name, f"/{name}"):
        if spelling in suited:
            return suited[spelling]
    if suited:
        there = f"topics of {what} are {_listed(suited.values())}"
    else:
        there = f"there is no topic of {what}, only {_listed(bag.topics.values())}"
    if name in bag.topics:
        raise DatasetError(f"topic {shown(name)} is of type {bag.topics[name].kind}, which holds no {what}; {there}")
    raise DatasetError(f"there is no topic '{shown(name)}' ({option}); {there}")


def _listed(topics: Any) -> str:
    listed = [f"{shown(topic.name)} ({topic.kind}, {topic.count})" for topic in topics]
    return ", ".join(listed) or "no topic at all"


def _write_images(bag: Bag, topic: Topic, every: int, folder: Path) -> tuple[list[Frame], list[int]]:
    """Write every N-th image of a topic; return frames with the time of their header (0: none), and when recorded."""
    frames: list[Frame] = []
    recorded: list[int] = []
    for number, message in enumerate(bag.messages({topic.name})):
        if number % every:
            continue
        try:
            data, suffix = _image(message.content, topic.kind)
        except DatasetError as error:
            raise DatasetError(f"image {number} of topic {topic.name} {error}") from error
        name = file_name(number, suffix)
        (folder / name).write_bytes(data)
        frames.append(Frame(folder / name, name, _stamp(message.content.header)))
        recorded.append(message.recorded_ns)
    if not frames:
        raise DatasetError(f"topic {topic.name} holds no message")
    return frames, recorded


def _image(content: Any, kind: str) -> tuple[bytes, str]:
    """Return an image as a file, and the ending of its name."""
    data = bytes(content.data)
    if kind == _RAW:
        raw = Raw(content.encoding, content.width, content.height, content.step, bool(content.is_bigendian), data)
        return png(pixels(raw)), ".png"
    found = as_file(data)
    if found is None:
        raise DatasetError(f"has format '{shown(content.format)}', which is not an image that OpenCV decodes")
    return found


def _stamp(header: Any) -> int:
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _no_poses(bag: Bag) -> Finding:
    topics = _pose_topics(bag)
    what_to_do = f"topics of poses are {_listed(topics.values())}; name one with --pose-topic" if topics else ""
    message = "; ".join(filter(None, ("no poses, position metrics will be null", what_to_do)))
    return Finding("info", NO_POSES, ROOT, message)


def _about(poses: Sequence[Pose | None], topic: Topic, how: Joining) -> list[Finding]:
    """Say how the poses of a topic came to the images, and how many have none."""
    how = how.or_else(BY_DEFAULT)
    known = sum(pose is not None for pose in poses)
    message = (
        f"{topic.name} ({topic.kind}), joined by time: between neighbours at most {how.interpolate_s:g} s apart, else "
        f"the nearest within {how.tolerance_s:g} s: {known} of {counted(len(poses), 'image')}"
    )
    lacking = f"{topic.name} has no pose near {len(poses) - known} of {len(poses)} images in time"
    findings = [Finding("info", "poses-read", ROOT, message)]
    return findings if known == len(poses) else [*findings, Finding("warning", "image-without-pose", ROOT, lacking)]


def _poses(bag: Bag, topic: Topic, address: Address, times: list[int], *, stamped: bool) -> list[Pose | None]:
    """Return the pose at each time; times are those of headers if `stamped`, else of recording."""
    frame = address.options.get("pose-frame")
    if topic.kind in _TRANSFORMS:
        tree = _tree(bag, topic, stamped=stamped)
        return tree.poses_at(_body(tree, frame, topic), times, address.joining)
    if frame is not None:
        raise DatasetError(f"--pose-frame is for topics of transforms; {topic.name} is of type {topic.kind}")
    place = _POSES[topic.kind]
    samples = [
        _sample(message, message.content, place(message.content), stamped=stamped)
        for message in bag.messages({topic.name})
    ]
    return poses_at(Track.of(samples), times, address.joining)


def _tree(bag: Bag, topic: Topic, *, stamped: bool) -> Tree:
    static = f"{topic.name}{_STATIC}"
    samples: defaultdict[tuple[str, str], list[_Sample]] = defaultdict(list)
    fixed: set[tuple[str, str]] = set()
    for message in bag.messages({topic.name, static} & set(bag.topics)):
        for transform in message.content.transforms:
            edge = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
            samples[edge].append(_sample(message, transform, transform.transform, stamped=stamped))
            if message.topic == static:
                fixed.add(edge)
    return Tree({edge: Track.of(found) for edge, found in samples.items()}, frozenset(fixed))


def _body(tree: Tree, frame: str | None, topic: Topic) -> str:
    """Return the frame whose pose is asked for: the one named, or the only one that may be the robot."""
    if frame is not None:
        if frame.strip("/") in tree.frames:
            return frame.strip("/")
        raise DatasetError(
            f"{topic.name} has no frame '{shown(frame)}' (--pose-frame); it has {', '.join(tree.frames)}"
        )
    bodies = tree.bodies
    if len(bodies) != 1:
        raise DatasetError(
            f"{topic.name} moves {len(bodies)} frames; name one with --pose-frame: {', '.join(tree.frames)}"
        )
    return bodies[0]


def _sample(message: Message, stamped_by: Any, pose: Any, *, stamped: bool) -> _Sample:
    header = getattr(stamped_by, "header", None)
    time = _stamp(header) if stamped and header is not None else message.recorded_ns
    place = getattr(pose, "position", None) or pose.translation
    turn = getattr(pose, "orientation", None) or pose.rotation
    return time, (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
