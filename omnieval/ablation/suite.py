"""The benchmark: every mapper with every descriptor on the synthetic buildings that nothing was tuned on."""

from __future__ import annotations

from collections.abc import Sequence

from omnieval.ablation.grid import Axis, make_axis
from omnieval.components.names import known
from omnieval.datasets.synthetic.facts import LIGHTS, Rendered, rendered

BENCHMARK = "benchmark"
"""Name of the preset."""
BUILDINGS = (2, 3, 4, 5, 6)
"""The first is drawn by hand, and defaults were chosen with it."""
_DESCRIPTORS = ("hog", "gist")


def benchmark_sources(buildings: Sequence[int] = BUILDINGS) -> list[str]:
    """Return the sequences: every building in every light."""
    return [Rendered(light, building).source for building in buildings for light in LIGHTS]


def benchmark_pairs(sources: Sequence[str]) -> dict[str, str]:
    """Return in the map of which sequence another is looked for, of those that are rendered: the first light's.

    Examples
    --------
    >>> benchmark_pairs(["synthetic:cloudy:2", "synthetic:night:2", "synthetic:night:3", "/data/house"])
    {'synthetic:night:2': 'synthetic:cloudy:2'}
    """
    named = [source for source in sources if source.split(":")[0] == "synthetic" and "#" not in source]
    ours = [rendered(source.partition(":")[2]) for source in named]
    maps = {one.building: one.source for one in ours if one.light == LIGHTS[0]}
    return {one.source: maps[one.building] for one in ours if one.light != LIGHTS[0] and one.building in maps}


def benchmark_axes(axes: Sequence[Axis]) -> list[Axis]:
    """Return all registered mappers and both built-in descriptors, and those that were asked for."""
    asked = {axis.name: axis for axis in axes}
    ours = {"mapper": known("mapper"), "descriptor": _DESCRIPTORS}
    found = []
    for kind, names in ours.items():
        more = asked.pop(kind).values if kind in asked else ()
        found.append(make_axis(kind, list(dict.fromkeys([*names, *more])), f"--preset {BENCHMARK}"))
    return [*found, *asked.values()]
