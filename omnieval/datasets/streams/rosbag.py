"""Bags of ROS 1 and ROS 2 (SQLite, MCAP), read with rosbags: topics, and messages as objects with the fields of ROS.

The only file that imports rosbags, which comes with ``omnieval[bag]``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from omnieval.datasets.streams.names import BAG_OF_ROS1, METADATA, STORAGES, bag_files
from omnieval.errors import ConfigError, DatasetError


class Reader(Protocol):
    """What all readers of rosbags have in common."""

    @property
    def connections(self) -> list[Any]:
        """What holds the messages of a topic and their type; several may be of one topic."""

    @property
    def topics(self) -> Mapping[str, Any]:
        """Type and number of messages by topic."""

    def open(self) -> None:
        """Read topics and indices."""

    def close(self) -> None:
        """Close the files."""

    def messages(self, connections: Collection[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield connection, time (nanoseconds) and bytes of every message, in the order of times."""


@dataclass(frozen=True)
class Message:
    """A message: its topic, when it was recorded (nanoseconds since the epoch), and its content."""

    topic: str
    recorded_ns: int
    content: Any


@dataclass(frozen=True)
class Topic:
    """A topic: the type of its messages, e.g. ``sensor_msgs/Image``, and how many there are."""

    name: str
    kind: str
    count: int


@dataclass(frozen=True)
class Bag:
    """A bag that is open."""

    reader: Reader
    ros2: bool

    @property
    def topics(self) -> Mapping[str, Topic]:
        """The topics by name, in its order."""
        return {
            name: Topic(name, (one.msgtype or "several types").replace("/msg/", "/"), one.msgcount)
            for name, one in sorted(self.reader.topics.items())
        }

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of some topics, in the order in which they were recorded.

        Raises
        ------
        DatasetError
            If the bag is damaged.
        """
        connections = [one for one in self.reader.connections if one.topic in topics]
        try:
            store = self._types(connections)
            read = store.deserialize_cdr if self.ros2 else store.deserialize_ros1
            messages = self.reader.messages(connections=connections)
        except Exception as error:
            raise _damaged(error) from error
        while True:
            try:
                connection, time, data = next(messages)
                content = read(data, connection.msgtype)
            except StopIteration:
                return
            except Exception as error:  # whatever rosbags and the decompressors below it stumble over
                raise _damaged(error) from error
            yield Message(connection.topic, time, content)

    def _types(self, connections: Collection[Any]) -> Any:
        """Return the types of messages: as the bag defines them, else as ROS does."""
        from rosbags.interfaces import MessageDefinitionFormat
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        defined = [one for one in connections if one.msgdef.format == MessageDefinitionFormat.MSG]
        types: dict[str, Any] = {}
        if len(defined) < len(connections):
            types |= get_typestore(Stores.ROS2_HUMBLE if self.ros2 else Stores.ROS1_NOETIC).fielddefs
        for one in defined:
            types |= get_types_from_msg(one.msgdef.data, one.msgtype)
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        return store


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Give the bag at `path`: a ``.bag``, a ``.mcap`` or ``.db3``, or the folder of a ROS 2 recording.

    Raises
    ------
    ConfigError
        If rosbags is not installed.
    DatasetError
        If it is not a bag, or damaged.
    """
    if not path.is_dir() and path.suffix.casefold() not in {BAG_OF_ROS1, *STORAGES}:
        raise DatasetError(f"is not a bag; expected .bag (ROS 1), .mcap, .db3, or a folder with {METADATA}")
    file = path if not path.is_dir() or (path / METADATA).is_file() else _only_storage(path)
    ros2 = file.suffix.casefold() != BAG_OF_ROS1 or file.is_dir()
    try:
        reader = _open(file, ros2=ros2)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"{path} is a bag, and reading bags needs the package rosbags; install it with: pip install 'omnieval[bag]'"
        ) from error
    except Exception as error:
        raise _damaged(error) from error
    try:
        yield Bag(reader, ros2)
    finally:
        reader.close()


def _open(path: Path, *, ros2: bool) -> Reader:
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    reader = cast("Reader", Reader2(path) if ros2 else Reader1(path))
    reader.open()
    return reader


def _only_storage(folder: Path) -> Path:
    """Return the file of a recording that was interrupted, and so has no metadata.

    Raises
    ------
    DatasetError
        If there is not one of them.
    """
    storages = [file for file in bag_files(folder) if file.suffix.casefold() in STORAGES]
    if len(storages) != 1:
        raise DatasetError(
            f"has no {METADATA}, and {len(storages)} files of a recording; name one of them, or write the metadata "
            "with: ros2 bag reindex"
        )
    return storages[0]


def _damaged(error: Exception) -> DatasetError:
    if isinstance(error, OSError) and error.strerror:
        return DatasetError(f"cannot be read: {error.strerror}")
    reason = " ".join(str(error).split()) or type(error).__name__
    return DatasetError(
        f"cannot be read as a bag: it is cut off or damaged ({reason}); copy it again, or repair it with: rosbag "
        "reindex (ROS 1), ros2 bag reindex (ROS 2), mcap recover (MCAP)"
    )
