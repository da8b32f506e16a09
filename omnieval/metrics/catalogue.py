"""Every metric of a map, declared once: what it means, how it is computed, whose it is, and which way is better.

Tables, reports, checks and the documentation take names and words from here. A new metric is a file of this folder with
a `Metric` that computes itself (`Metric.compute`), and one line in `CATALOGUE`.
"""

from __future__ import annotations

from collections.abc import Callable

from omnieval.metrics.counts import labelled_images, nodes, posed_images
from omnieval.metrics.ground import THETAS
from omnieval.metrics.metric import Better, Judged, Metric

THETA = 2.0
"""The distance within which two images are taken at one place in ``run.json`` and in tables of results, metres."""
COVERED_M = (1.0, 2.0)
SCALES_M = (2.0, 5.0, 10.0)
"""The distances of `coverage` and the scales of the edges, metres."""

_ROUSSEEUW = "Rousseeuw 1987, doi 10.1016/0377-0427(87)90125-7"
_PAPER = "Román et al. 2020, doi 10.3390/app10186480"
_ENTROPIES = "Rosenberg and Hirschberg 2007, aclanthology.org/D07-1043"
_TOPO = "after TOPO-Bench, arXiv 2510.04100, in our reading"


def _quality(name: str, group: str, meaning: str, formula: str, at: float | None = None, **more: object) -> Metric:
    return Metric(name, group, meaning, formula, of=name, at=at, **more)  # type: ignore[arg-type]


def _share(name: str, meaning: str, better: Better | None = None) -> Metric:
    return Metric(name, "placement", meaning, "images so placed / all images", better=better)


def _count(name: str, meaning: str, compute: Callable[[Judged], int]) -> Metric:
    return Metric(name, _SIZE, meaning, "count", better=None, whole=True, compute=compute)


_PAIR, _EVENT, _GRAPH, _BORDER, _SIZE = "partition", "loop closures", "graph", "borders", "size"

CATALOGUE: tuple[Metric, ...] = (
    _count("nodes", "nodes of the final map, pending ones included", nodes),
    _count("posed", "images with a true position, over which the map is judged", posed_images),
    _count("labelled", "images with a room label, which agreement is over", labelled_images),
    _share("share_assigned", "placed by loop closure at their own step: what the method does", "higher"),
    _share("share_pending", "taken by a pending node"),
    _share("share_founding", "of which nodes were made"),
    _share("share_retest", "left over, and accepted by the final map"),
    _share("share_forced", "left over, refused again, and put to the most similar image", "lower"),
    _share("share_unassigned", "without a node", "lower"),
    Metric(
        "silhouette",
        "silhouettes",
        "how much nearer images are to their node than to the nearest other, over nodes",
        "mean over nodes of the mean of s_j",
        f"{_ROUSSEEUW}; {_PAPER}, Eq. 12",
    ),
    Metric("silhouette_image", "silhouettes", "the same, over images", "mean of s_j", _ROUSSEEUW),
    Metric(
        "silhouette_literal",
        "silhouettes",
        "the same against all other nodes together",
        "b_j over all other nodes, as printed",
        f"{_PAPER}, Eq. 13",
    ),
    Metric("silhouette_sq", "silhouettes", "the same of squared distances", "as MATLAB's default", _ROUSSEEUW),
    Metric(
        "silhouette_time_slices",
        "silhouettes",
        "what equal slices of time score: beat this",
        "silhouette of as many equal slices of time as there are nodes",
        better=None,
    ),
    Metric(
        "silhouette_positions",
        "silhouettes",
        "what k-means on the true positions scores: about the best there is",
        "silhouette of k-means with as many clusters as there are nodes",
        better=None,
    ),
    Metric(
        "rooms_ari",
        "rooms",
        "pairs of images on which nodes and rooms agree, adjusted for chance",
        "(S − E) / (½ (A + B) − E)",
        "Hubert and Arabie 1985, doi 10.1007/BF01908075",
    ),
    Metric(
        "rooms_nmi",
        "rooms",
        "information that nodes and rooms share",
        "2 I(rooms; nodes) / (H(rooms) + H(nodes))",
        "Vinh et al. 2010, jmlr.org/papers/v11/vinh10a.html",
    ),
    Metric(
        "rooms_homogeneity",
        "rooms",
        "1 when every node lies in one room",
        "1 − H(rooms | nodes) / H(rooms)",
        _ENTROPIES,
    ),
    Metric(
        "rooms_completeness",
        "rooms",
        "1 when every room lies in one node",
        "1 − H(nodes | rooms) / H(nodes)",
        _ENTROPIES,
    ),
    Metric(
        "rooms_purity",
        "rooms",
        "share of images whose room is the commonest of their node",
        "Σ_i max_j n_ij / n",
        "Manning et al. 2008, section 16.3",
    ),
    _quality(
        "pair_precision",
        _PAIR,
        "of the pairs of images in one node, the share taken within theta of each other",
        "pairs of one node and within theta / pairs of one node; more than 10 s apart",
        THETA,
    ),
    _quality(
        "pair_recall",
        _PAIR,
        "of the pairs of images taken within theta of each other, the share in one node",
        "pairs of one node and within theta / pairs within theta; more than 10 s apart",
        THETA,
    ),
    _quality("pair_f1", _PAIR, "both at once", "2 P R / (P + R)", THETA),
    _quality(
        "false_merge_share",
        _PAIR,
        "nodes that lie in two or more places",
        "nodes whose images fall into two or more groups of at least 5, linked at theta / nodes",
        THETA,
        better="lower",
    ),
    _quality(
        "false_merge_images",
        _PAIR,
        "images in nodes that lie in two or more places",
        "images of such nodes / images",
        THETA,
        better="lower",
    ),
    _quality(
        "nodes_per_place",
        _PAIR,
        "nodes that share a place which was seen again: 1 when it is known again",
        "mean number of nodes over the groups that pairs within theta, more than 10 s apart, link together",
        THETA,
        better="lower",
    ),
    *(
        _quality(f"reentry_{what}{end}", _EVENT, meaning + words, formula, THETA)
        for end, words in (("", ", as known at the time"), ("_final", ", in the final map"))
        for what, meaning, formula in (
            (
                "precision",
                "of the re-entries of a node, the share that are right",
                "re-entries whose first image lies within theta of an earlier visit of the node / re-entries",
            ),
            (
                "recall",
                "of the visits of places that were seen more than 10 s before, the share that are right re-entries",
                "right re-entries with an opportunity / visits with an opportunity",
            ),
            ("f1", "both at once", "2 P R / (P + R)"),
        )
    ),
    _quality("components", _GRAPH, "parts that no edge connects", "count", better="lower", whole=True),
    _quality("loops", _GRAPH, "independent loops of the graph", "edges − nodes + components", better=None, whole=True),
    *(
        Metric(
            f"coverage_{at:g}m",
            _GRAPH,
            f"images within {at:g} m of a node",
            f"images within {at:g} m of the true position of a representative / images",
            of="coverage",
            at=at,
        )
        for at in COVERED_M
    ),
    *(
        _quality(
            f"stretch_{what}",
            _GRAPH,
            f"way over the map / true way, {words} over pairs of nodes; below 1 through a wall, above 1 an open loop",
            "shortest path over transitions, each as long as from representative to representative / shortest path "
            "through the images, linked when successive or within 0.5 m",
            better=None,
        )
        for what, words in (("median", "median"), ("p5", "5th percentile"), ("p95", "95th percentile"))
    ),
    *(
        Metric(
            f"edge_{what}_{at:g}m",
            _GRAPH,
            f"{meaning} at a scale of {at:g} m",
            formula.format(scale=f"{at:g} m"),
            _TOPO,
            of=f"edge_{what}",
            at=at,
        )
        for what, meaning, formula in (
            (
                "precision",
                "of the nodes near in the map, the share near in truth,",
                "of pairs within ceil({scale} / median edge) edges, those whose true way is at most 1.5 times {scale}",
            ),
            (
                "recall",
                "of the nodes near in truth, the share near in the map,",
                "of pairs whose true way is at most {scale}, those within ceil({scale} / median edge) edges",
            ),
        )
        for at in SCALES_M
    ),
    _quality(
        "boundary_precision",
        _BORDER,
        "of the changes of node, the share at a change of room",
        "changes matched one to one, at most 3 s apart / changes of node",
    ),
    _quality(
        "boundary_recall",
        _BORDER,
        "of the changes of room, the share at a change of node",
        "changes matched one to one, at most 3 s apart / changes of room",
    ),
    _quality(
        "map_bytes",
        _SIZE,
        "size of the topology alone, without images",
        "4 × nodes × d + 12 × edges, d values in a position descriptor",
        better="lower",
        unit="bytes",
        whole=True,
    ),
    _quality(
        "map_bytes_full",
        _SIZE,
        "size of all that images are compared with",
        "map_bytes + 4 × images with a node × values in their descriptions",
        better="lower",
        unit="bytes",
        whole=True,
    ),
)

METRICS = tuple(metric.name for metric in CATALOGUE)
"""The names of all metrics, in their order."""
BY_NAME = {metric.name: metric for metric in CATALOGUE}
TELLING = ("nodes", "pair_f1", "reentry_f1", "false_merge_share", "stretch_median", "silhouette")
"""What to look at first."""
UPKEEP = ("upkeep_ms_mean", "upkeep_ms_median", "upkeep_ms_p99")
"""Time of the mapper for an image, milliseconds, without describing it: what only the clock says."""


def scales(name: str) -> tuple[float | None, ...]:
    """Return the distances at which a metric of ``quality.parquet`` is taken there, metres."""
    own = tuple(metric.at for metric in CATALOGUE if metric.of == name)
    return THETAS if own == (THETA,) else own
