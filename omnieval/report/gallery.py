"""Pictures of the nodes of a replay, small enough to stand in the page."""

from __future__ import annotations

from omnieval.exports.graph import Node, map_graph
from omnieval.exports.node_pictures import NodePicture, node_pictures, pictures_of
from omnieval.imaging.encode import jpeg
from omnieval.report.figure import Gallery, Photo, Skipped
from omnieval.report.sources import Replay
from omnieval.wording import counted, sentences

TITLE = "The nodes"
MOST = 60
"""Nodes that are shown; some 8 kB each."""
_WIDTH, _QUALITY = 320, 70


def gallery(replay: Replay) -> Gallery | Skipped:
    """Return the panorama of the representative image of every node.

    Raises
    ------
    ConfigError, DatasetError, ResultError
        If the images are not there any more, or are others.
    """
    if replay.run is None:
        return Skipped(TITLE, "only the steps of this run were kept, which do not say which image stands for a node")
    nodes = map_graph(replay.run).nodes
    shown = nodes[:MOST]
    with pictures_of(replay.run) as pictures:
        drawn = list(node_pictures(pictures, [(node.id, node.representative_frame) for node in shown]))
    return Gallery(
        key="nodes",
        title=TITLE,
        caption=sentences(
            [
                "The panorama of each node's representative image: the one whose position descriptor is nearest to the "
                "mean of the node.",
                f"The first {len(shown)} of {len(nodes)} nodes; omnieval export RUN --images DIR writes all."
                if len(shown) < len(nodes)
                else "",
            ]
        ),
        photos=tuple(_photo(node, one) for node, one in zip(shown, drawn, strict=True)),
    )


def _photo(node: Node, drawn: NodePicture) -> Photo:
    height, width = drawn.panorama.shape[:2]
    room = f", {node.rooms[0][0]}" if node.rooms else ""
    pending = "" if node.active else ", pending"
    label = f"Node {node.id}: {counted(len(node.frames), 'image')}{room}{pending}"
    wide = min(width, _WIDTH)
    return Photo(
        jpeg(drawn.panorama, _QUALITY, width=_WIDTH),
        wide,
        max(1, round(height * wide / width)),
        label,
        f"Panorama of image {drawn.frame}, which stands for node {node.id}",
    )
