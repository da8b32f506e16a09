"""What a grid has lost against an earlier one; what it has more is growth, and allowed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Lost = tuple[str, tuple[Any, Any]]
"""The name of something, what it was, and what it is now."""


def lost(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return what a grid had that another has not or has otherwise, as it was and as it is now, by name.

    Parameters
    ----------
    before, now
        Two grids (`Plan.grid`).

    Examples
    --------
    >>> rest = {"sources": [], "cuts": [], "components": {}, "exact": None}
    >>> before = {**rest, "axes": {"omega": [2, 3]}, "parameters": {"gamma": 5.0}}
    >>> lost(before, {**rest, "axes": {"omega": [1, 2, 3], "gamma": [4.0, 5.0]}, "parameters": {}})
    {}
    >>> lost(before, {**rest, "axes": {"omega": [1, 2]}, "parameters": {"gamma": 6.0}})
    {'grid.axes.omega': ([2, 3], [1, 2]), 'grid.parameters.gamma': (5.0, 6.0)}
    """
    found = [*_sources(before, now), *_components(before, now)] or [*_values(before, now)]
    if before["exact"] != now["exact"]:
        found.append(("exact", (before["exact"], now["exact"])))
    return {f"grid.{name}": both for name, both in found}


def _sources(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Lost]:
    kept = [source for source in before["sources"] if source in now["sources"]]
    if len(kept) < len(before["sources"]):
        yield "sources", (before["sources"], now["sources"])
    cuts, cuts_now = (dict(zip(grid["sources"], grid["cuts"], strict=True)) for grid in (before, now))
    for source in kept:
        for name, one, other in (
            ("cuts", cuts, cuts_now),
            *((name, before.get(name, {}), now.get(name, {})) for name in ("localize", "skipped")),
        ):
            if one.get(source) != other.get(source):
                yield f"{name}.{source}", (one.get(source), other.get(source))


def _components(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Lost]:
    for kind, ones in before["components"].items():
        others = {one["name"]: one for one in now["components"].get(kind, [])}
        if {one["name"] for one in ones} - others.keys():
            yield f"components.{kind}", ([one["name"] for one in ones], list(others))
        for one in ones:
            other = others.get(one["name"], one)
            for what in one:
                if one[what] != other.get(what):
                    yield f"components.{kind}.{one['name']}.{what}", (one[what], other.get(what))


def _values(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[Lost]:
    """Find values of parameters that are gone; one that was the same in all jobs may be varied now."""
    axes, fixed = now["axes"], now["parameters"]
    for name, values in before["axes"].items():
        have = axes.get(name, [fixed[name]] if name in fixed else [])
        if any(value not in have for value in values):
            yield f"axes.{name}", (values, axes.get(name, fixed.get(name)))
    for name, value in before["parameters"].items():
        if value != fixed.get(name) and value not in axes.get(name, []):
            yield f"parameters.{name}", (value, axes.get(name, fixed.get(name)))
