"""What a robot can do with a map: know a place again, plan along its edges.

Every metric at every distance, with what it was counted over and its interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.partition import count_transitions
from omnieval.mapping.representative import cluster_means, representative_frames
from omnieval.mapping.step import FinalMap
from omnieval.metrics.catalogue import BY_NAME, CATALOGUE, scales
from omnieval.metrics.events import Reentries, borders, reentries
from omnieval.metrics.graph import Shape, Ways, coverage, shape
from omnieval.metrics.ground import APART_S, Clock, Ground
from omnieval.metrics.pairs import false_merges, nodes_per_place, pair_scores
from omnieval.metrics.proportion import Proportion

_BYTES, _BYTES_OF_EDGE = 4, 12
"""Of a number, and of an edge: two nodes and a count."""


@dataclass(frozen=True)
class Making:
    """How a map came about, which its partition does not tell.

    Attributes
    ----------
    online
        Node that each image had after its own step, 0 where none, shape (n,); None if images were not taken one by one.
    representatives
        The image that represents each node; None if not known.
    position_values
        Values of a position descriptor; None if there are none.
    image_values
        Values of all that is kept of an image; None if images are not compared with images.
    """

    online: NDArray[np.int64] | None = None
    representatives: Mapping[int, int] | None = None
    position_values: int | None = None
    image_values: int | None = None

    @classmethod
    def of_mapper(
        cls,
        final: FinalMap,
        online: NDArray[np.int64],
        descriptors: NDArray[np.float32],
        orientation_values: int,
        ground: Ground | None,
    ) -> Making:
        """Return how a mapper made a map.

        Parameters
        ----------
        final
            The map.
        online
            Node of each image after its own step, 0 where none, shape (n,).
        descriptors
            Position descriptors of all images, shape (n, d).
        orientation_values
            Values of an orientation descriptor.
        ground
            Where the images were taken; None if it is not known.
        """
        among = None if ground is None else ground.images
        values = descriptors.shape[1]
        representatives = representative_frames(final.labels, final.nodes, final.representatives, descriptors, among)
        return cls(online, representatives, values, values + orientation_values)

    @classmethod
    def of_partition(cls, labels: NDArray[np.int64], descriptors: NDArray[np.float32], ground: Ground | None) -> Making:
        """Return how a partition was made that sees all images at once; see `of_mapper`."""
        among = None if ground is None else ground.images
        nodes, means = cluster_means(labels, descriptors)
        representatives = representative_frames(labels, nodes, means, descriptors, among)
        return cls(representatives=representatives, position_values=descriptors.shape[1])


@dataclass(frozen=True, slots=True)
class Measure:
    """A metric at a distance.

    Attributes
    ----------
    metric
        `catalogue.Metric.of`.
    theta
        The distance, metres; None where it has none.
    value
        Its value; None where it has none, and `reason` says why.
    count
        Of what it is the share, or over how many it is taken; None where nothing is counted.
    low, high
        Wilson's 95 % interval of a share; None of what is not a share.
    """

    metric: str
    theta: float | None = None
    value: float | int | None = None
    count: int | None = None
    low: float | None = None
    high: float | None = None
    reason: str | None = None


def measure(
    labels: NDArray[np.int64],
    ground: Ground | str,
    rooms: Sequence[str | None] | None,
    clock: Clock,
    making: Making,
    thetas: Sequence[float],
) -> tuple[Measure, ...]:
    """Return all metrics of the quality of a map, in the order of the catalogue.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    ground
        Where the images were taken, or why that is not known.
    rooms
        Room of every image, None where it has none, length n; None if no image has one.
    clock
        When the n images were taken.
    making
        How the map came about.
    thetas
        Distances within which images lie at one place, metres.
    """
    found = {(one.metric, one.theta): one for one in _measures(labels, ground, rooms, clock, making, thetas)}
    names = dict.fromkeys(metric.of for metric in CATALOGUE if metric.of is not None)
    return tuple(found[name, at] for name in names for at in _taken(name, thetas))


def _taken(name: str, thetas: Sequence[float]) -> Sequence[float | None]:
    """Return at which distances a metric is taken."""
    known = BY_NAME.get(name)
    return thetas if known is not None and known.at is not None else scales(name)


def _measures(
    labels: NDArray[np.int64],
    ground: Ground | str,
    rooms: Sequence[str | None] | None,
    clock: Clock,
    making: Making,
    thetas: Sequence[float],
) -> Iterator[Measure]:
    nodes = np.unique(labels[labels > 0]).tolist()
    graph = shape(nodes, count_transitions(labels))
    yield Measure("components", value=graph.components)
    yield Measure("loops", value=graph.loops)
    yield from _sizes(graph, int((labels > 0).sum()), making)
    yield from _borders(labels, rooms, clock)
    if isinstance(ground, str):
        missing = dict.fromkeys(metric.of for metric in CATALOGUE if metric.of in _OVER_POSITIONS)
        for name in missing:
            yield from _null(str(name), _taken(str(name), thetas), ground)
        return
    known = labels[ground.images]
    yield from _partition(known, ground, thetas)
    yield from _events("_final", known, ground, thetas)
    if making.online is None:
        for name in _ONLINE:
            yield from _null(name, thetas, "the images were not placed one by one")
    else:
        yield from _events("", making.online[ground.images], ground, thetas)
    yield from _graph(known, ground, making)


_ONLINE = ("reentry_precision", "reentry_recall", "reentry_f1")
_OVER_GRAPH = ("stretch_median", "stretch_p5", "stretch_p95", "edge_precision", "edge_recall")
_OVER_POSITIONS = frozenset(
    {
        *("pair_precision", "pair_recall", "pair_f1", "false_merge_share", "false_merge_images", "nodes_per_place"),
        *_ONLINE,
        *(f"{name}_final" for name in _ONLINE),
        *("coverage", *_OVER_GRAPH),
    }
)


def _sizes(graph: Shape, placed: int, making: Making) -> Iterator[Measure]:
    if making.position_values is None:
        reason = "the size of a descriptor is not known"
        yield Measure("map_bytes", reason=reason)
        yield Measure("map_bytes_full", reason=reason)
        return
    topology = _BYTES * graph.nodes * making.position_values + _BYTES_OF_EDGE * graph.edges
    yield Measure("map_bytes", value=topology)
    if making.image_values is None:
        yield Measure("map_bytes_full", reason="the images were not placed one by one, by comparing them")
    else:
        yield Measure("map_bytes_full", value=topology + _BYTES * placed * making.image_values)


def _borders(labels: NDArray[np.int64], rooms: Sequence[str | None] | None, clock: Clock) -> Iterator[Measure]:
    names = "boundary_precision", "boundary_recall"
    if rooms is None or all(room is None for room in rooms):
        reason, found = "the sequence has no room labels", None
    else:
        reason, found = "the room never changes", borders(labels, rooms, clock)
    if found is None:
        for name in names:
            yield Measure(name, reason=reason)
        return
    yield _share(names[0], None, found.precision, "the node never changes")
    yield _share(names[1], None, found.recall, reason)


def _partition(labels: NDArray[np.int64], ground: Ground, thetas: Sequence[float]) -> Iterator[Measure]:
    pairs, merges = pair_scores(labels, ground, thetas), false_merges(labels, ground, thetas)
    apart = f"more than {APART_S:g} s apart"
    for theta in thetas:
        scores = pairs[theta]
        nothing = f"no two images are within {theta:g} m and {apart}"
        yield _share("pair_precision", theta, scores.precision, f"no node has two images {apart}")
        yield _share("pair_recall", theta, scores.recall, nothing)
        yield _value("pair_f1", theta, scores.f1, None, nothing)
        yield _share("false_merge_share", theta, merges[theta].nodes, "the map has no node")
        yield _share("false_merge_images", theta, merges[theta].images, "there is no image")
        mean, places = nodes_per_place(labels, ground, theta)
        yield _value("nodes_per_place", theta, mean, places, f"{nothing}, or none of them has a node")


def _events(end: str, labels: NDArray[np.int64], ground: Ground, thetas: Sequence[float]) -> Iterator[Measure]:
    found: dict[float, Reentries] = reentries(labels, ground, thetas)
    for theta, events in found.items():
        nothing = f"no node is visited where an image more than {APART_S:g} s older is within {theta:g} m"
        never = f"no node is entered again more than {APART_S:g} s after it was left"
        yield _share(f"reentry_precision{end}", theta, events.precision, never)
        yield _share(f"reentry_recall{end}", theta, events.recall, nothing)
        yield _value(f"reentry_f1{end}", theta, events.f1, None, nothing)


def _graph(labels: NDArray[np.int64], ground: Ground, making: Making) -> Iterator[Measure]:
    if making.representatives is None:
        for name in ("coverage", *_OVER_GRAPH):
            yield from _null(name, scales(name), "no image represents a node")
        return
    index = {int(image): number for number, image in enumerate(ground.images)}
    representatives = {node: index[image] for node, image in making.representatives.items() if image in index}
    edges = [edge for edge in count_transitions(labels) if edge[0] in representatives and edge[1] in representatives]
    ways = Ways(representatives, edges, ground)
    for at in scales("coverage"):
        assert at is not None
        yield _share("coverage", at, coverage(ways.places, ground, at), "there is no image")
    stretches, nowhere = ways.stretches, "the map connects no two nodes at different places"
    for name, percent in (("median", 50), ("p5", 5), ("p95", 95)):
        value = float(np.percentile(stretches, percent)) if len(stretches) else None
        yield _value(f"stretch_{name}", None, value, len(stretches), nowhere)
    for at in scales("edge_precision"):
        assert at is not None
        found = ways.edges(at)
        if found is None:
            yield Measure("edge_precision", at, reason="the map has no edge of any length")
            yield Measure("edge_recall", at, reason="the map has no edge of any length")
        else:
            yield _share("edge_precision", at, found.precision, f"no two nodes are within {at:g} m in the map")
            yield _share("edge_recall", at, found.recall, f"no two nodes are within {at:g} m of each other")


def _share(name: str, theta: float | None, share: Proportion, nothing: str) -> Measure:
    if share.value is None:
        return Measure(name, theta, count=0, reason=nothing)
    low, high = share.interval
    return Measure(name, theta, share.value, share.count, low, high)


def _value(name: str, theta: float | None, value: float | None, count: int | None, nothing: str) -> Measure:
    return Measure(name, theta, value, count, reason=nothing if value is None else None)


def _null(name: str, at: Sequence[float | None], reason: str) -> Iterator[Measure]:
    for theta in at:
        yield Measure(name, theta, reason=reason)
