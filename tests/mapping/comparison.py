"""Holds a `Mapper` against the reference, step by step and field by field."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.mapper import Mapper
from omnieval.mapping.step import FinalMap, Step
from tests.reference.mapper import NOTHING, ReferenceMapper

RTOL = 1e-6
TINY = 1e-12
"""Absolute tolerance: some quantities are exactly 0 in one order of summation and rounding noise in another."""

EXACT = (
    *("verdict", "node", "nodes", "candidates", "frames", "slots", "map_size", "shifts"),
    *("best_node", "best_frame", "shift", "peaks", "run", "events", "active", "pending"),
)
CLOSE = (
    *("x", "position_similarities", "orientation_similarities", "similarities"),
    *("position_similarity", "orientation_similarity", "similarity"),
    *("prominence", "prominence_mean", "centroid_shift", "centroid_bound"),
)


@dataclass
class Tally:
    """What happened in a compared replay."""

    verdicts: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    placements: Counter[str] = field(default_factory=Counter)


def assert_agreement(config: MapperConfig, descriptions: Sequence[Description]) -> Tally:
    """Replay the sequence with both mappers; fail at the first field of the first step that differs."""
    tally = Tally()
    mapper, reference = Mapper(config), ReferenceMapper(config)
    for description in descriptions:
        step = mapper.step(description)
        expected = reference.step(description.position, description.orientation)
        assert_step(fields_of(step), expected, f"frame {step.frame}")
        tally.verdicts[step.verdict] += 1
        tally.events.update(event.kind for event in step.events)
    final, expected = mapper.finish(), reference.finish()
    assert_final(final, expected)
    tally.placements.update(final.placements)
    return tally


def assert_step(found: dict[str, Any], expected: dict[str, Any], where: str) -> None:
    """Compare one step; decisions exactly, measurements to rounding."""
    assert set(found) == set(expected) == {*EXACT, *CLOSE, "ratios", "ratio_scales"}
    for name in EXACT:
        assert found[name] == expected[name], f"{where}: {name}"
    for name in CLOSE:
        assert (found[name] is None) == (expected[name] is None), f"{where}: {name}"
        if found[name] is not None:
            np.testing.assert_allclose(found[name], expected[name], rtol=RTOL, atol=TINY, err_msg=f"{where}: {name}")
    assert_ratios(found["ratios"], expected, where)


def assert_ratios(found: NDArray[np.float64] | None, expected: dict[str, Any], where: str) -> None:
    """Compare Delta and mu_ns, relative to themselves, in units of sigma_ns.

    A ratio may have fewer digits than they: where duplicates are held out sigma_ns is at its floor of 1e-9 mu_ns.
    """
    assert (found is None) == (expected["ratios"] is None), f"{where}: ratios"
    if found is not None:
        errors = np.abs(found - np.array(expected["ratios"]))
        assert (errors <= RTOL * np.array(expected["ratio_scales"])).all(), f"{where}: ratios {errors}"


def assert_final(found: FinalMap, expected: dict[str, Any]) -> None:
    """Compare the final partition."""
    assert found.labels.tolist() == expected["labels"]
    assert [str(placement) for placement in found.placements] == expected["placements"]
    assert list(found.nodes) == expected["nodes"]
    assert sorted(found.active) == expected["active"]
    np.testing.assert_allclose(found.representatives, expected["representatives"], rtol=RTOL, atol=TINY)


def fields_of(step: Step) -> dict[str, Any]:
    """The step as the reference writes it."""
    fields = NOTHING | {
        "verdict": str(step.verdict),
        "node": step.node,
        "run": step.run,
        "events": [(str(event.kind), event.node, event.into, event.frames) for event in step.events],
        "active": step.active,
        "pending": step.pending,
    }
    if step.gate is not None:
        fields |= {
            "x": step.gate.x,
            "nodes": step.gate.nodes.tolist(),
            "ratios": step.gate.ratios,
            "candidates": step.gate.candidates.tolist(),
        }
    if step.match is not None:
        fields |= _match_fields(step)
    if step.centroid is not None:
        fields |= {"centroid_shift": step.centroid.shift, "centroid_bound": step.centroid.bound}
    return fields


def _match_fields(step: Step) -> dict[str, Any]:
    match = step.match
    assert match is not None
    return {
        "frames": match.frames.tolist(),
        "slots": match.slots.tolist(),
        "map_size": match.map_size,
        "position_similarities": match.position,
        "orientation_similarities": match.orientation,
        "similarities": match.similarity,
        "shifts": match.shifts.tolist(),
        "best_node": match.node,
        "best_frame": match.best_frame,
        "shift": match.shift,
        "position_similarity": match.position[match.best],
        "orientation_similarity": match.orientation[match.best],
        "similarity": match.similarity[match.best],
        "prominence": match.prominence,
        "prominence_mean": match.prominence_mean,
        "peaks": match.peaks,
    }
