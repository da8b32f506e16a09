"""The map as other programs read it, compared with the tables of the run."""

import dataclasses
import json
import math

import networkx as nx
import polars as pl
import pytest

import omnieval
from omnieval.errors import ConfigError, ResultError
from omnieval.exports.geojson import geojson
from omnieval.exports.graph import Edge, MapGraph, Node, Place, map_graph
from omnieval.exports.graphml import graphml

ABOUT = {"run": "made", "source": "folder:/made", "sequence": "made", "mapper": "m", "descriptor": "d", "frames": 5}


def node(number, place, *, file="a.png", rooms=()):
    return Node(number, active=True, created=0, frames=(0, 1), representative_frame=0, representative_file=file,
                place=place, rooms=rooms, extent=None)  # fmt: skip


def triangle():
    """Three nodes on a 3-4-5 triangle, of which two sides were driven."""
    nodes = (node(1, Place(0.0, 0.0, 0.5)), node(4, Place(3.0, 0.0, None)), node(9, Place(3.0, 4.0, -1.0)))
    return MapGraph(ABOUT, nodes, (Edge(1, 4, 2, 3.0), Edge(4, 9, 1, 4.0)))


def test_the_graph_is_that_of_the_tables(run):
    graph = map_graph(run)
    steps, nodes = run.steps, run.nodes.filter(pl.col("merged").is_null())
    assert [one.id for one in graph.nodes] == nodes["id"].to_list()
    assert [len(one.frames) for one in graph.nodes] == nodes["images"].to_list()
    assert [(one.a, one.b, one.count) for one in graph.edges] == run.transitions.rows()
    places = {}
    for one in graph.nodes:
        x, y, yaw = steps.filter(frame=one.representative_frame).select("x", "y", "yaw").row(0)
        assert one.place == Place(x, y, yaw)
        assert set(one.frames) == set(steps.filter(node_final=one.id)["frame"])
        places[one.id] = (x, y)
    assert graph.edges
    assert all(one.length == pytest.approx(math.dist(places[one.a], places[one.b])) for one in graph.edges)


def test_networkx_reads_the_same_graph_with_typed_attributes(run, tmp_path):
    (file,) = omnieval.export(run, "graphml", out=tmp_path / "map.graphml").files
    read, graph = nx.read_graphml(file, node_type=int), map_graph(run)
    assert not read.is_directed()
    assert set(read.nodes) == {one.id for one in graph.nodes}
    assert {(min(edge), max(edge)) for edge in read.edges} == {(one.a, one.b) for one in graph.edges}
    for one in graph.nodes:
        found = read.nodes[one.id]
        assert one.place is not None
        assert (found["x"], found["y"], found["yaw"]) == (one.place.x, one.place.y, one.place.yaw)
        assert (found["images"], found["active"]) == (len(one.frames), one.active)
        assert isinstance(found["active"], bool)
        assert found["room"] == one.rooms[0][0]
    for edge in graph.edges:
        assert read.edges[edge.a, edge.b] == {"count": edge.count, "length": edge.length}
    assert read.graph["source"] == run.manifest["source"]


def test_names_that_no_xml_may_hold_are_written_all_the_same():
    rude = MapGraph(ABOUT, (node(1, None, file="a<&>\x07\ufffeé.png", rooms=(('"R\x00"', 1.0),)),), ())
    read = nx.parse_graphml(graphml(rude))
    assert read.nodes["1"]["representative_file"] == "a<&>\ufffd\ufffdé.png"
    assert read.nodes["1"]["room"] == '"R\ufffd"'


def test_nav2_finds_every_edge_in_both_directions_under_a_number_of_its_own():
    made = geojson(triangle())
    nodes = {one["properties"]["id"]: one for one in made["features"] if one["geometry"]["type"] == "Point"}
    edges = [one for one in made["features"] if one["geometry"]["type"] == "MultiLineString"]
    assert {number: one["geometry"]["coordinates"] for number, one in nodes.items()} == {
        1: [0, 0],
        4: [3, 0],
        9: [3, 4],
    }
    assert {one["properties"]["frame"] for one in nodes.values()} == {"map"}
    asked = ("startid", "endid", "cost", "overridable")
    assert [tuple(one["properties"][name] for name in asked) for one in edges] == [
        (1, 4, 3.0, True),
        (4, 1, 3.0, True),
        (4, 9, 4.0, True),
        (9, 4, 4.0, True),
    ]
    assert edges[3]["geometry"]["coordinates"] == [[[3.0, 4.0], [3.0, 0.0]]]
    numbers = [one["properties"]["id"] for one in made["features"]]
    assert len(numbers) == len(set(numbers))
    # Its loader ends with an exception at a null in the metadata.
    assert "null" not in json.dumps(made)


def test_json_holds_the_map_and_its_version(run, tmp_path):
    (file,) = omnieval.export(run.folder, "json", out=f"{tmp_path}/").files
    assert file == tmp_path / "three.json"
    read = json.loads(file.read_text("utf-8"))
    assert (read["schema_version"], read["kind"], read["run"]) == (1, "omnieval-map", "three")
    images = [frame for one in read["nodes"] for frame in one["frames"]]
    assert sorted(images) == run.steps.drop_nulls("node_final")["frame"].to_list()
    assert [tuple(one[name] for name in ("a", "b", "count")) for one in read["edges"]] == run.transitions.rows()


def test_without_poses_graphs_have_no_coordinates_and_geojson_is_refused(unposed, tmp_path):
    (file,) = omnieval.export(unposed, "graphml", out=tmp_path / "map.graphml").files
    read = nx.read_graphml(file)
    assert len(read) == unposed.metrics["nodes"]
    assert not any({"x", "y", "yaw", "extent"} & set(found) for _, found in read.nodes(data=True))
    (file,) = omnieval.export(unposed, "json", out=tmp_path / "map.json").files
    assert {(one["x"], one["y"]) for one in json.loads(file.read_text())["nodes"]} == {(None, None)}
    with pytest.raises(ResultError, match=r"have no true position; export graphml or json"):
        omnieval.export(unposed, "geojson", out=tmp_path / "map.geojson")
    assert not (tmp_path / "map.geojson").exists()


def test_a_map_of_one_node_is_a_graph_and_nav2_is_warned_of(panoramas, tmp_path):
    alone = omnieval.replay(panoramas, mapper="leader", radius=1e6, limit=20, out=tmp_path / "one", recording=None)
    assert len(alone.nodes) == 1
    (file,) = omnieval.export(alone, "graphml", out=tmp_path / "map.graphml").files
    assert (len(nx.read_graphml(file)), nx.read_graphml(file).size()) == (1, 0)
    made = omnieval.export(alone, "geojson", out=tmp_path / "map.geojson")
    assert len(json.loads(made.files[0].read_text())["features"]) == 1
    assert "no edge" in made.notes[0]


def test_what_cannot_be_exported_is_refused_before_anything_is_written(run, tmp_path):
    with pytest.raises(ConfigError, match="nothing to export"):
        omnieval.export(run)
    with pytest.raises(ConfigError, match="no export format gpx"):
        omnieval.export(run, "gpx")
    (tmp_path / "mine.json").write_text("mine")
    with pytest.raises(ResultError, match=r"mine.json exists; .*--overwrite"):
        omnieval.export(run, "json", out=tmp_path / "mine.json")
    assert (tmp_path / "mine.json").read_text() == "mine"
    omnieval.export(run, "json", out=tmp_path / "mine.json", overwrite=True)
    assert (tmp_path / "mine.json").read_text() != "mine"
    half = dataclasses.replace(run, manifest=run.manifest | {"status": "interrupted"})
    with pytest.raises(ResultError, match="no final map: the replay is interrupted"):
        omnieval.export(half, "graphml", out=tmp_path / "map.graphml")
