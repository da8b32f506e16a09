"""A map as GraphML, the XML form of graphs (http://graphml.graphdrawing.org), with typed attributes.

Undirected. What is not known of a node or an edge has no element, as the format wants it.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping

from omnieval.exports.graph import Edge, MapGraph, Node

_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no XML document may hold, however written; names of files may."""

Value = bool | int | float | str | None

_KINDS: dict[type, str] = {bool: "boolean", int: "int", float: "double", str: "string"}
_GRAPH: dict[str, type] = {
    "run": str,
    "source": str,
    "sequence": str,
    "mapper": str,
    "descriptor": str,
    "identity": str,
    "dataset_fingerprint": str,
    "frames": int,
}
_NODE: dict[str, type] = {
    "active": bool,
    "created": int,
    "images": int,
    "representative_frame": int,
    "representative_file": str,
    "x": float,
    "y": float,
    "yaw": float,
    "room": str,
    "room_share": float,
    "extent": float,
}
_EDGE: dict[str, type] = {"count": int, "length": float}


def graphml(graph: MapGraph) -> str:
    """Return the document. Nodes are called by their numbers."""
    root = ET.Element("graphml", xmlns=_NAMESPACE)
    for domain, names in {"graph": _GRAPH, "node": _NODE, "edge": _EDGE}.items():
        for name, kind in names.items():
            keys = {"id": f"{domain}-{name}", "for": domain, "attr.name": name, "attr.type": _KINDS[kind]}
            ET.SubElement(root, "key", keys)
    drawn = ET.SubElement(root, "graph", id="map", edgedefault="undirected")
    _add_data(drawn, "graph", {name: graph.about.get(name) for name in _GRAPH})
    for node in graph.nodes:
        _add_data(ET.SubElement(drawn, "node", id=str(node.id)), "node", _node_values(node))
    for edge in graph.edges:
        element = ET.SubElement(drawn, "edge", source=str(edge.a), target=str(edge.b))
        _add_data(element, "edge", _edge_values(edge))
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _node_values(node: Node) -> dict[str, Value]:
    room, share = node.rooms[0] if node.rooms else (None, None)
    place = node.place
    return {
        "active": node.active,
        "created": node.created,
        "images": len(node.frames),
        "representative_frame": node.representative_frame,
        "representative_file": node.representative_file,
        "x": place.x if place else None,
        "y": place.y if place else None,
        "yaw": place.yaw if place else None,
        "room": room,
        "room_share": share,
        "extent": node.extent,
    }


def _edge_values(edge: Edge) -> dict[str, Value]:
    return {"count": edge.count, "length": edge.length}


def _add_data(parent: ET.Element, domain: str, values: Mapping[str, Value]) -> None:
    for name, value in values.items():
        if value is not None:
            ET.SubElement(parent, "data", key=f"{domain}-{name}").text = _text(value)


def _text(value: bool | float | str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return _NOT_XML.sub("\ufffd", value) if isinstance(value, str) else repr(value)
