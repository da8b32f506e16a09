"""Valley: the eigenvalue by hand, rooms in a row that are visited again, and the contract."""

from __future__ import annotations

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.mapping.journal import Journal
from omnieval.mapping.step import EventKind
from omnieval.mapping.valley import Valley, ValleySettings, connectivity
from omnieval.testing import check_mapper


class TestConnectivity:
    def test_equal_vectors_are_a_complete_graph(self) -> None:
        assert connectivity(np.tile([[0.6, 0.8]], (5, 1))) == pytest.approx(5 / 4)

    def test_two_groups_with_nothing_in_common(self) -> None:
        assert connectivity(np.repeat(np.eye(2), 3, axis=0)) == pytest.approx(0, abs=1e-12)

    def test_three_vectors_on_paper(self) -> None:
        """A path a - b - c of equal weights (a and c at right angles): 0, 1, 2."""
        half = np.sqrt(0.5)
        assert connectivity(np.array([[1, 0], [half, half], [0, 1]])) == pytest.approx(1)

    def test_vectors_that_nothing_is_like(self) -> None:
        assert connectivity(np.eye(3)) == 0.0


def rooms(visits: str, stay: int = 40, seed: int = 2) -> list[Description]:
    """Return a stay in each of some rooms, whose views have nothing in common but noise."""
    rng = np.random.default_rng(seed)
    views = {room: np.abs(rng.normal(size=32)) ** 3 for room in sorted(set(visits))}
    seen = [views[room] / np.linalg.norm(views[room]) + rng.normal(0, 0.05, 32) for room in visits for _ in range(stay)]
    return [Description(one.astype(np.float32), np.ones((4, 1), np.float32)) for one in seen]


def test_a_node_ends_while_the_window_leaves_a_room() -> None:
    mapper = Valley()
    steps = [mapper.step(description) for description in rooms("abcd", stay=80)]
    ends = [step.frame for step in steps if step.verdict == "valley"]
    for border in (80, 160, 240):
        assert any(border < end <= border + 31 for end in ends), (border, ends)


def test_a_rise_that_goes_on_is_one_valley() -> None:
    """Half of those before 0.8 lie within 0.2 of 0.9, so it is 0.6 / (1.4826 * 0.2) = 2.02 deviations above 0.2."""
    mapper, journal = Valley(ValleySettings(warm_up=4)), Journal()
    values = [1.1, 0.9, 1.1, 0.9, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 0.2, 2.0]
    ended = [place for place, value in enumerate(values) if mapper._is_valley(value, journal)]
    assert ended == [7, 12]


def test_a_room_visited_again_becomes_its_old_node() -> None:
    settings = ValleySettings(window=12, from_nodes=4)
    mapper = Valley(settings)
    steps = [mapper.step(description) for description in rooms("abcdefab", stay=40)]
    merged = [(step.frame, event) for step in steps for event in step.events if event.kind is EventKind.MERGED]
    again = [step for step in steps if step.verdict == "revisit"]
    assert [step.frame for step in again] == [frame for frame, _ in merged]
    assert any(step.frame >= 240 for step in again)
    labels = mapper.finish().labels
    last = next(step for step in again if step.frame >= 240)
    assert last.match is not None
    assert last.match.frame // 40 == last.frame // 40 - 6, "room a is the first, and b the second"
    assert labels[last.frame] == labels[last.match.frame]
    gates = {one.gate: one for one in last.comparisons}
    assert gates["row"].best == 3
    assert all(gates[name].passed for name in ("distinct", "least", "mutual", "row"))


def test_before_the_warm_up_and_the_nodes_nothing_is_compared() -> None:
    mapper = Valley(ValleySettings(warm_up=50))
    steps = [mapper.step(description) for description in rooms("ab", stay=25)]
    assert not any(step.comparisons for step in steps)
    assert mapper.finish().labels.tolist() == [1] * 50


def test_it_keeps_the_contract() -> None:
    check_mapper(lambda: Valley(ValleySettings(window=12, from_nodes=3)), rooms("abcdeabc", stay=25))
