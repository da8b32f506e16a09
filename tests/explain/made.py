"""Steps made by hand, compared as the method of the paper compares."""

from __future__ import annotations

from typing import Any

from omnieval.mapping.interface import Method
from omnieval.mapping.journal import Journal
from omnieval.mapping.roman2020.conditions import gate_floor
from omnieval.mapping.roman2020.evidence import ROLES, Verdict
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
from omnieval.mapping.step import Match, Step

SETTINGS = Roman2020Settings(gamma=5.0, omega=2.0, merge_y=1.5)
METHOD = Method.of(Roman2020, "roman2020", SETTINGS.model_dump())
BEST = Match(212, 4, 2)


def asked(
    node: dict[int, float] | None = None,
    *,
    x: float = 2.0,
    prominence: float | None = None,
    peaks: int | None = None,
    centroid: tuple[float, float] | None = None,
    merge: dict[int, float] | None = None,
    run: int | None = None,
) -> Journal:
    """Compare what is given, in the method's order: ratios by node, prominence, peaks, (shift, bound), ..."""
    journal = Journal()
    if node is not None:
        nodes, floor = list(node), gate_floor(len(node))
        journal.compare("node", list(node.values()), x, of=nodes, parameter="omega", floor=floor)
    if prominence is not None:
        journal.reach("prominence", prominence, SETTINGS.gamma, parameter="gamma")
    if peaks is not None:
        journal.reach("peaks", peaks, 2, counts=True)
    if centroid is not None:
        journal.compare("centroid", [centroid[0]], centroid[1])
    if run is not None:
        journal.reach("run", run, SETTINGS.n_new, parameter="n_new", counts=True)
    if merge is not None:
        journal.compare("merge", list(merge.values()), SETTINGS.merge_y, of=list(merge), parameter="merge_y")
    return journal


def decided(verdict: Verdict, journal: Journal | None = None, *, node: int | None = None, **changes: Any) -> Step:
    """A step that was decided after these comparisons."""
    comparisons = tuple(journal.comparisons) if journal else ()
    return Step(40, verdict.value, ROLES[verdict], node, comparisons=comparisons, **changes)
