"""Holds `Roman2020` against the reference, step by step and field by field."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.mapping.partition import Partition
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
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
MEASURED = {
    "position_similarity": "similarity_position",
    "orientation_similarity": "similarity_orientation",
    **{name: name for name in ("similarity", "prominence", "prominence_mean", "peaks", "run")},
    **{name: name for name in ("centroid_shift", "centroid_bound")},
}
"""What the reference calls the columns of the method."""


@dataclass
class Tally:
    """What happened in a compared replay."""

    verdicts: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    placements: Counter[str] = field(default_factory=Counter)


def assert_agreement(settings: Roman2020Settings, descriptions: Sequence[Description]) -> Tally:
    """Replay the sequence with both mappers; fail at the first field of the first step that differs."""
    tally, partition = Tally(), Partition()
    mapper, reference = Roman2020(settings), ReferenceMapper(settings)
    for description in descriptions:
        step = mapper.step(description)
        partition.apply(step)
        expected = reference.step(description.position, description.orientation)
        assert_step(fields_of(step, partition, mapper), expected, f"frame {step.frame}")
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


def fields_of(step: Step, partition: Partition, mapper: Roman2020) -> dict[str, Any]:
    """The step as the reference writes it; `partition` has taken it in."""
    fields = NOTHING | {
        "verdict": step.verdict,
        "node": step.node,
        "events": [(str(event.kind), event.node, event.into, event.frames) for event in step.events],
        "active": len(partition.active),
        "pending": partition.count - len(partition.active),
        **{name: step.measured.get(column) for name, column in MEASURED.items()},
    }
    if (gate := step.compared("node")) is not None:
        fields |= {
            "x": gate.threshold,
            "nodes": list(gate.of),
            "ratios": np.array(gate.values),
            "candidates": list(gate.passing),
        }
    if (centroid := step.compared("centroid")) is not None:
        assert (centroid.best, centroid.threshold) == (fields["centroid_shift"], fields["centroid_bound"])
    return fields | _match_fields(step, mapper)


def _match_fields(step: Step, mapper: Roman2020) -> dict[str, Any]:
    match, curves = step.match, step.curves
    assert (match is None) == (curves is None)
    if match is None or curves is None:
        return {}
    assert curves.frames[curves.best] == match.frame
    return {
        "frames": curves.frames.tolist(),
        "slots": curves.slots.tolist(),
        "map_size": curves.size,
        "position_similarities": curves.values["position"],
        "orientation_similarities": curves.values["orientation"],
        "similarities": curves.values["similarity"],
        # No evidence tells of the other images' shifts, but the best image was chosen by them.
        "shifts": mapper.images.compare(step.frame, curves.frames).shifts.tolist(),
        "best_node": match.node,
        "best_frame": match.frame,
        "shift": match.shift,
    }
