"""A map as plain JSON, for programs of your own. Docs: docs/export.md."""

from __future__ import annotations

from typing import Any

from omnieval.exports.geojson import FRAME
from omnieval.exports.graph import Edge, MapGraph, Node

SCHEMA_VERSION = 1


def document(graph: MapGraph) -> dict[str, Any]:
    """Return the document; what is not known is null."""
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "omnieval-map",
        **graph.about,
        "coordinates": {"frame": FRAME, "position": "metre", "yaw": "radian"},
        "nodes": [_node(node) for node in graph.nodes],
        "edges": [_edge(edge) for edge in graph.edges],
    }


def _node(node: Node) -> dict[str, Any]:
    place = node.place
    return {
        "id": node.id,
        "active": node.active,
        "created": node.created,
        "representative_frame": node.representative_frame,
        "representative_file": node.representative_file,
        "x": place.x if place else None,
        "y": place.y if place else None,
        "yaw": place.yaw if place else None,
        "extent": node.extent,
        "rooms": [{"room": room, "share": share} for room, share in node.rooms],
        "frames": list(node.frames),
    }


def _edge(edge: Edge) -> dict[str, Any]:
    return {"a": edge.a, "b": edge.b, "count": edge.count, "length": edge.length}
