"""The numbers that V. Román, S. Cebollada, L. Payá and O. Reinoso published, to stand beside ours.

*Creating Incremental Models of Indoor Environments through Omnidirectional Imaging*, Appl. Sci. 2020, 10(18), 6480.
They are maxima over the sweep of y and omega, picked with the ground truth (section 6.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omnieval.report.sources import Replay

DOI = "https://doi.org/10.3390/app10186480"
PAPER = "Román et al. 2020"


@dataclass(frozen=True)
class Published:
    """One route with one descriptor: Tables 2 and 3 of the paper.

    Attributes
    ----------
    route
        The route as the paper calls it.
    descriptor
        Name of the descriptor.
    silhouette, nodes
        Of the best map of the sweep.
    merge_y, omega
        The parameters of that map.
    batch_silhouette
        Of batch spectral clustering with as many clusters.
    """

    route: str
    descriptor: str
    silhouette: Decimal
    nodes: int
    merge_y: Decimal
    omega: Decimal
    batch_silhouette: Decimal


def _published(
    route: str, descriptor: str, silhouette: str, nodes: int, merge_y: str, omega: str, batch_silhouette: str
) -> Published:
    """Return a published row with as many decimals as were printed."""
    best, y, floor, batch = map(Decimal, (silhouette, merge_y, omega, batch_silhouette))
    return Published(route, descriptor, best, nodes, y, floor, batch)


PUBLISHED = (
    _published("INNOVA", "hog", "0.3973", 6, "2.25", "1.7", "0.13"),
    _published("Saarbrücken", "hog", "0.2756", 16, "1.25", "1.85", "0.15"),
    _published("Freiburg", "hog", "-0.1526", 30, "0.75", "1.7", "0.13"),
    _published("INNOVA", "gist", "0.2556", 6, "1.5", "2.15", "0.38"),
    _published("Saarbrücken", "gist", "0.1262", 19, "1.5", "1.85", "0.25"),
    _published("Freiburg", "gist", "-0.1449", 34, "1.5", "2.3", "0.15"),
)

MAPPER = "roman2020"
"""The mapper that is the paper's method."""

_ROUTES = (
    ("cold:", "freiburg", "seq2_cloudy3", "Freiburg"),
    ("cold:", "saarbr", "seq4_cloudy1", "Saarbrücken"),
)
"""How the source of a route begins, what its path names, and the route: probable, for the paper names no sequence."""


def is_papers(replay: Replay) -> bool:
    """Whether a replay is one of the paper's method, so that its figures correspond to the paper's."""
    return replay.mapper == MAPPER


def route_of(source: str) -> str | None:
    """Return the route of the paper that a source probably is, None if it is another dataset.

    Examples
    --------
    >>> route_of("cold:/data/cold-freiburg/part_a/seq2_cloudy3")
    'Freiburg'
    >>> route_of("synthetic:cloudy") is None
    True
    """
    if source.startswith("innova:"):
        return "INNOVA"
    path = source.casefold()
    for scheme, place, sequence, route in _ROUTES:
        if path.startswith(scheme) and place in path and sequence in path:
            return route
    return None
