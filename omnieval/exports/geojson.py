"""A map as GeoJSON (RFC 7946) in the form that Nav2's Route Server loads as its graph.

Nodes are Points with ``id`` and ``frame``. The Route Server's edges have a direction, so each edge of the map is two
MultiLineStrings, there and back, with ``id``, ``startid``, ``endid``, ``cost`` (metres) and ``overridable``. The
numbers of edges follow those of nodes. What else is known stands in ``metadata``, which may hold no null.
"""

from __future__ import annotations

from itertools import count
from typing import Any

from omnieval.errors import ResultError
from omnieval.exports.graph import Edge, MapGraph, Node, Place

FRAME = "map"
"""The frame of the coordinates, by the name that Nav2 gives to its global frame."""
_METRES = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
"""Plane coordinates in metres, not degrees: said as Nav2's own graphs say it, and as geographic programs read it."""


def geojson(graph: MapGraph) -> dict[str, Any]:
    """Return the document.

    Raises
    ------
    ResultError
        If the place of a node is not known.
    """
    if missing := graph.unplaced:
        raise ResultError(
            f"GeoJSON needs the place of every node, {len(missing)} of {len(graph.nodes)} nodes of "
            f"{graph.about['run']} have no true position; export graphml or json, which do without"
        )
    places = {node.id: node.place for node in graph.nodes if node.place}
    features = [_node_feature(node, places[node.id]) for node in graph.nodes]
    numbers = count(max(places, default=-1) + 1)
    for edge in graph.edges:
        features.append(_edge_feature(next(numbers), edge, edge.a, edge.b, places))
        features.append(_edge_feature(next(numbers), edge, edge.b, edge.a, places))
    return {"type": "FeatureCollection", "name": graph.about["run"], "crs": _METRES, "features": features}


def _node_feature(node: Node, place: Place) -> dict[str, Any]:
    room = {"room": node.rooms[0][0], "room_share": node.rooms[0][1]} if node.rooms else {}
    yaw = {} if place.yaw is None else {"yaw": place.yaw}
    metadata = {
        "active": node.active,
        "images": len(node.frames),
        "representative_frame": node.representative_frame,
        "representative_file": node.representative_file,
        **yaw,
        **room,
    }
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [place.x, place.y]},
        "properties": {"id": node.id, "frame": FRAME, "metadata": metadata},
    }


def _edge_feature(number: int, edge: Edge, start: int, end: int, places: dict[int, Place]) -> dict[str, Any]:
    line = [[places[node].x, places[node].y] for node in (start, end)]
    return {
        "type": "Feature",
        "geometry": {"type": "MultiLineString", "coordinates": [line]},
        "properties": {
            "id": number,
            "startid": start,
            "endid": end,
            "cost": edge.length,
            "overridable": True,
            "metadata": {"count": edge.count},
        },
    }
