"""Recordings of replays for the Rerun viewer."""

from __future__ import annotations

from dataclasses import dataclass

from omnieval.errors import ConfigError


@dataclass(frozen=True)
class RecordingOptions:
    """How much to record, and which viewer shows it live.

    Attributes
    ----------
    images
        Whether pictures are recorded.
    every
        Pictures and similarity curves are recorded every so many steps; numbers and words always are.
    spawn
        Start a viewer on this machine, reachable from this machine only, and show the replay in it.
    connect
        URL of a running viewer that shows the replay, e.g. ``rerun+http://127.0.0.1:9876/proxy``.

    Raises
    ------
    ConfigError
        If `every` is not positive, or both `spawn` and `connect` are asked for.
    """

    images: bool = True
    every: int = 1
    spawn: bool = False
    connect: str | None = None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ConfigError(f"a recording logs every k-th picture with k at least 1, got {self.every}")
        if self.spawn and self.connect is not None:
            raise ConfigError("a replay is shown in a new viewer or in a running one: choose spawn or connect")
