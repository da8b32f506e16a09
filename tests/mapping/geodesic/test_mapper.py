"""The mapper against the plain one, on a circuit by hand, and on what is hard."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.mapping.geodesic.mapper import Geodesic
from omnieval.mapping.geodesic.motion import angle_of
from omnieval.mapping.geodesic.settings import GeodesicSettings
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import Role
from omnieval.testing import check_mapper
from tests.mapping.worlds import World
from tests.reference.geodesic import PlainGeodesic


def circuit(laps: float, length: int = 120, offset: float = 0.0, seed: int = 1) -> list[Description]:
    """Return what a robot sees on a circuit of so many frames a lap; every view fades over some frames."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(2, 12, 24)), rng.normal(size=(2, 12, 8 * 3))
    seen = []
    for at in np.arange(round(laps * length)) / length * 2 * np.pi + offset:
        phases = np.arange(1, 13) * at
        around = np.stack([np.cos(phases), np.sin(phases)])
        position, orientation = (np.tensordot(around, one, ([0, 1], [0, 1])) / 12 for one in waves)
        noise = rng.normal(0, 0.02, 24), rng.normal(0, 0.02, 24)
        seen.append(
            Description(
                (position + noise[0]).astype(np.float32), (orientation + noise[1]).reshape(8, 3).astype(np.float32)
            )
        )
    return seen


@pytest.mark.parametrize(
    ("descriptions", "settings"),
    [
        (circuit(1.7, length=80), {"gap": 30.0}),
        (circuit(1.6, length=70, seed=5), {"extent": 5.0, "reach": 12.0, "spacing": 1.0, "gap": 20.0, "sure": 0.6}),
        (World(seed=4, visits=4, spread=1.0).describe(), {"gap": 10.0, "likeness": 0.3, "sharpness": 0.2}),
        (World(seed=9, visits=4, repeats=0.3).describe(), {"extent": 5.0, "leave": 0.1, "enter": 0.05}),
    ],
)
def test_every_step_agrees_with_the_plain_mapper(descriptions: list[Description], settings: dict[str, float]) -> None:
    memory, rows, turns = ImageMemory(), [], []
    memory.expect(descriptions)
    for description in descriptions:
        compared = memory.compare(memory.append(description), np.arange(len(memory)))
        rows.append(np.sqrt(compared.position * compared.orientation).tolist())
        turns.append([angle_of(shift, memory.cells) for shift in compared.shifts.tolist()])
    mapper = Geodesic(GeodesicSettings(**settings))
    plain = PlainGeodesic(
        lambda one, other: rows[max(one, other)][min(one, other)], lambda one, other: turns[one][other], **settings
    )
    for frame, description in enumerate(descriptions):
        step = mapper.step(description)
        plain.step(frame)
        assert step.node == plain.nodes[-1]
        assert (step.match.frame if step.match else None) == plain.recognised[-1]
        belief = plain.beliefs[-1]
        assert step.measured.get("belief") == (None if belief is None else pytest.approx(belief, rel=1e-9))
        assert step.measured.get("travelled", 0.0) == pytest.approx(plain.travelled, rel=1e-9)
    assert mapper.finish().labels.tolist() == plain.nodes


def test_the_second_lap_of_a_circuit_is_recognised_where_it_is() -> None:
    mapper = Geodesic()
    steps = [mapper.step(description) for description in circuit(2)]
    first, second = steps[:120], steps[120:]
    assert not any(step.verdict == "recognised" for step in first)
    recognised = [step for step in second if step.match]
    assert len(recognised) > 100
    assert all(abs(step.match.frame - (step.frame - 120)) <= 3 for step in recognised if step.match)
    assert {step.node for step in recognised} <= {step.node for step in first}
    # Nodes are stretches of the circuit: each is one run of frames of about `extent`, the second lap makes no other.
    nodes = mapper.finish().labels[:120]
    changes = int(np.count_nonzero(np.diff(nodes)))
    assert len(set(nodes.tolist())) - 1 <= changes <= len(set(nodes.tolist()))


def test_a_place_never_seen_before_is_not_recognised() -> None:
    mapper = Geodesic()
    steps = [mapper.step(description) for description in [*circuit(1), *circuit(1, seed=8)]]
    assert not any(step.match for step in steps)


def test_standing_still_is_no_travel_and_makes_one_node() -> None:
    still = Description(np.full(4, 0.5, np.float32), np.eye(8, 2, dtype=np.float32))
    mapper = Geodesic()
    steps = [mapper.step(still) for _ in range(200)]
    assert mapper.finish().labels.tolist() == [1] * 200
    assert steps[-1].measured["travelled"] == pytest.approx(199 * 0.05)


def test_a_robot_that_turns_travels_no_farther() -> None:
    ahead = circuit(1)
    turned = [
        dataclasses.replace(one, orientation=np.roll(one.orientation, k % 8, axis=0)) for k, one in enumerate(ahead)
    ]
    straight, turning = Geodesic(), Geodesic()
    for one, other in zip(ahead, turned, strict=True):
        a, b = straight.step(one), turning.step(other)
        assert a.node == b.node
        assert a.measured.get("travelled", 0.0) == pytest.approx(b.measured.get("travelled", 0.0), rel=1e-6)


def test_without_an_orientation_part_the_position_level_decides_alone() -> None:
    whole = circuit(2)
    alone = [dataclasses.replace(one, orientation=np.ones((1, 1), np.float32)) for one in whole]
    mapper = Geodesic()
    steps = [mapper.step(one) for one in alone]
    recognised = [step for step in steps[120:] if step.match]
    assert len(recognised) > 80
    assert all(abs(step.match.frame - (step.frame - 120)) <= 3 for step in recognised if step.match)


def test_a_larger_extent_makes_no_more_nodes() -> None:
    counts = []
    for extent in (2.0, 10.0, 28.0):
        mapper = Geodesic(GeodesicSettings(extent=extent))
        for description in circuit(1.5):
            mapper.step(description)
        counts.append(len(mapper.finish().nodes))
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_what_is_recognised_says_so_in_comparisons() -> None:
    mapper = Geodesic()
    for step in [mapper.step(description) for description in circuit(1.5)]:
        belief = step.compared("belief")
        assert (belief is not None and belief.passed) == (step.verdict == "recognised")
        if step.verdict == "new node":
            assert step.role is Role.REFUSED
            extent = step.compared("extent")
            assert extent is None or not extent.passed


def test_it_keeps_the_contract() -> None:
    check_mapper(Geodesic, circuit(1.5))


def test_an_image_is_found_at_its_place_of_the_map_which_stays_as_it_is() -> None:
    mapper, seen = Geodesic(), circuit(1.5)
    for description in seen:
        mapper.step(description)
    before = mapper.finish()
    for offset, description in enumerate(circuit(0.5, offset=1.0, seed=1)):  # as far along as the image found
        step = mapper.locate(description)
        assert step is not None
        assert step.match is not None
        expected = offset + 120 / (2 * np.pi)
        assert min(abs(step.match.frame % 120 - expected), 120 - abs(step.match.frame % 120 - expected)) <= 4
        assert step.node == step.match.node == before.labels[step.match.frame]
        assert not step.events
    after = mapper.finish()
    assert after.labels.tolist() == before.labels.tolist()
    assert (after.representatives == before.representatives).all()
