"""Worlds of a few points in the plane, small enough to check every number by hand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.roman2020.evidence import Verdict
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
from omnieval.mapping.step import Comparison, EventKind, Match, NodeEvent, Placement, Step

Point = tuple[float, float]

FACING = (1.0, 0.0, 0.0, 0.0)
"""Four cells with one bin. Images that all face the same way have equal s_ori."""

CROSS: tuple[Point, ...] = ((1, 0), (-1, 0), (0, 1), (0, -1)) * 2
"""Eight images with mean (0, 0): what a first node of ten is fitted to (floor(0.8 * 10) = 8)."""


def look(point: Point, cells: Sequence[float] = FACING) -> Description:
    return Description(np.array(point, np.float32), np.array(cells, np.float32)[:, None])


def replay(mapper: Roman2020, points: Iterable[Point]) -> list[Step]:
    return [mapper.step(look(point)) for point in points]


def mapper_of(points: Iterable[Point], **options: object) -> Roman2020:
    """A mapper with identity covariance whose first node is made of the ten `points`."""
    settings: dict[str, object] = {"n_init": 10, "n_new": 10, "covariance": "identity", "gamma": 0.0}
    mapper = Roman2020(Roman2020Settings.model_validate(settings | options))
    replay(mapper, points)
    return mapper


def asked(step: Step, name: str) -> Comparison:
    """What was compared at a gate."""
    found = step.compared(name)
    assert found is not None
    return found


def gate(step: Step) -> Comparison:
    """What was compared at the node-level gate."""
    return asked(step, "node")


def best(step: Step) -> Match:
    assert step.match is not None
    return step.match


def curve(step: Step, name: str) -> list[float]:
    """A similarity curve of the step."""
    assert step.curves is not None
    return list(step.curves.values[name])


def standing(mapper: Roman2020) -> tuple[int, int]:
    """How many nodes are active and how many pending."""
    final = mapper.finish()
    return len(final.active), len(final.nodes) - len(final.active)


def cluster(centre: Point, size: float = 0.5) -> list[Point]:
    """Ten images: Delta of the held-out two is size^2 and 4 size^2; representative = centre + (0.3 size, 0)."""
    return [(centre[0] + size * x, centre[1] + size * y) for x, y in (*CROSS, (1, 0), (2, 0))]


def assert_margin(step: Step, gate: str, value: float) -> None:
    assert step.margin is not None
    assert step.margin.gate == gate
    assert step.margin.value == pytest.approx(value, rel=1e-5)


class TestNodeGate:
    """Eq. 3 and 4: ratio = |Delta - mu_ns| / sigma_ns against x(C) = max(omega, 3.05 - 0.15 C)."""

    # Held out: Delta = 1 and 9, so mu_ns = 5 and sigma_ns = sqrt(2 * 4^2 / 1) = 4 sqrt 2 = 5.657.
    NODE = (*CROSS, (1, 0), (0, 3))

    @pytest.mark.parametrize(
        ("point", "ratio", "passes"),
        [
            ((0, 4), 11 / math.sqrt(32), True),  # Delta = 16: ratio 1.94 <= 2.9
            ((0, 5), 20 / math.sqrt(32), False),  # Delta = 25: ratio 3.54 > 2.9
            ((0, 0), 5 / math.sqrt(32), True),  # Delta = 0: 0.88, from below
        ],
    )
    def test_the_ratio_counts_deviations_of_the_held_out_distances(
        self, point: Point, ratio: float, passes: bool
    ) -> None:
        step = mapper_of(self.NODE).step(look(point))
        assert gate(step).threshold == pytest.approx(2.9)
        assert list(gate(step).values) == pytest.approx([ratio])
        assert gate(step).passing == ((1,) if passes else ())

    def test_a_large_omega_is_the_threshold(self) -> None:
        step = mapper_of(self.NODE, omega=4.0).step(look((0, 5)))
        assert gate(step).threshold == 4.0
        assert gate(step).passing == (1,)

    # Held out: Delta = 16 and 25, so mu_ns = 20.5 and sigma_ns = sqrt(40.5 / 2 * 2) = 6.364.
    HOLLOW = (*CROSS, (4, 0), (0, 5))

    def test_two_sided_refuses_the_very_mean_of_a_hollow_node(self) -> None:
        step = mapper_of(self.HOLLOW).step(look((0, 0)))
        assert step.verdict == Verdict.NO_CANDIDATE
        assert list(gate(step).values) == pytest.approx([20.5 / math.sqrt(40.5)])  # 3.22 > 2.9

    def test_one_sided_accepts_it(self) -> None:
        step = mapper_of(self.HOLLOW, node_gate="one-sided").step(look((0, 0)))
        assert step.verdict == Verdict.ASSIGNED
        assert list(gate(step).values) == pytest.approx([-20.5 / math.sqrt(40.5)])

    def test_diagonal_divides_by_the_variances(self) -> None:
        # x: four of eight fitted images at +-2, variance 16/7; y: four at +-1, variance 4/7.
        # Held out (2, 0): Delta = 4 * 7/16 = 1.75; (0, 3): Delta = 9 * 7/4 = 15.75; mu = 8.75, sigma = 7 sqrt 2.
        stretched = [(2 * x, y) for x, y in CROSS]
        step = mapper_of([*stretched, (2, 0), (0, 3)], covariance="diagonal").step(look((4, 1)))
        # Delta = 16 * 7/16 + 7/4 = 8.75 = mu
        assert list(gate(step).values) == pytest.approx([0.0], abs=1e-12)

    def test_diagonal_floors_a_variance_of_zero(self) -> None:
        # All y are 0: variances 4/7 * 2 = 8/7 and 0; the floor is 1e-3 * mean = 1e-3 * 4/7.
        # Held out: Delta = 7/8 and 4 * 7/8; mu = 35/16, sigma = 21/8 / sqrt 2.
        line = [(1.0, 0.0), (-1.0, 0.0)] * 4
        step = mapper_of([*line, (1, 0), (2, 0)], covariance="diagonal").step(look((0, 0.25)))
        delta = 0.0625 / (1e-3 * 4 / 7)
        assert list(gate(step).values) == pytest.approx([(delta - 35 / 16) / (21 / 8 / math.sqrt(2))])

    def test_the_fit_follows_an_insertion_unless_frozen(self) -> None:
        # After (0, 3) joins, floor(0.8 * 11) = 8 images still fit; held out are Delta = 1, 9, 9:
        # mu = 19/3, and sigma^2 = ((16/3)^2 + 2 (8/3)^2) / 2 = 64/3.
        for refit, mu, sigma in (("insertion", 19 / 3, 8 / math.sqrt(3)), ("creation", 5, math.sqrt(32))):
            mapper = mapper_of(self.NODE, gate_refit=refit)
            joined, step = replay(mapper, [(0, 3), (0, 2)])
            assert joined.verdict == Verdict.ASSIGNED
            assert list(gate(step).values) == pytest.approx([abs(4 - mu) / sigma])


class TestMatch:
    """Similarities, shift and prominence (section 4)."""

    # The new image stands at the origin, image k at distance 1 / h_k: s_pos draws the curve h.
    #   1 4 2 3 1 8 2 5 4 1, peaks 4, 3, 8, 5 with prominences
    #   4 - max(0, 1) = 3;  3 - max(2, 1) = 1;  8 - 0 = 8;  5 - max(2, 0) = 3;  their mean is 15/4.
    # Sum of h = 31; s_ori = 1/10 for all.
    CURVE = (1, 4, 2, 3, 1, 8, 2, 5, 4, 1)
    UNIT = 1 / 31 / 10

    def drawn(self, **options: object) -> Step:
        # Two on each side: the mean stays near the origin, so that the centroid condition holds.
        sides = (1, 1, -1, -1, 1, 1, -1, -1, 1, -1)
        points = [(side / height, 0.0) for side, height in zip(sides, self.CURVE, strict=True)]
        return mapper_of(points, omega=100.0, **options).step(look((0, 0)))

    def test_the_similarity_curve_is_the_drawn_one(self) -> None:
        step = self.drawn()
        assert curve(step, "position") == pytest.approx([height / 31 for height in self.CURVE], rel=1e-6)
        assert curve(step, "orientation") == pytest.approx([0.1] * 10)
        assert curve(step, "similarity") == pytest.approx([h * self.UNIT for h in self.CURVE], rel=1e-6)
        assert step.curves is not None
        assert (best(step).frame, best(step).node, step.curves.size, step.measured["peaks"]) == (5, 1, 10, 4)

    def test_the_level_is_where_the_curve_would_have_to_end_to_pass(self) -> None:
        # Its peak of 8 stands on 0; gamma = 2 asks for 2 * 15/4 = 7.5 of 8.
        step = self.drawn(gamma=2.0)
        assert step.curves is not None
        assert step.curves.level == pytest.approx(7.5 / 8)

    def test_prominence_over_the_mean_of_the_peaks(self) -> None:
        step = self.drawn()
        assert step.measured["prominence"] == pytest.approx(8 * self.UNIT, rel=1e-6)
        assert step.measured["prominence_mean"] == pytest.approx(15 / 4 * self.UNIT, rel=1e-6)
        assert step.measured["prominence_ratio"] == pytest.approx(32 / 15, rel=1e-6)
        assert asked(step, "prominence").values == (step.measured["prominence_ratio"],)

    def test_prominence_over_all_candidates(self) -> None:
        step = self.drawn(prominence_mean="candidates")
        assert step.measured["prominence_mean"] == pytest.approx(15 / 10 * self.UNIT, rel=1e-6)

    @pytest.mark.parametrize(
        ("gamma", "mean", "verdict"),
        [
            (2.1, "peaks", Verdict.ASSIGNED),  # 8 / (15/4) = 2.133
            (2.2, "peaks", Verdict.PROMINENCE),
            (5.3, "candidates", Verdict.ASSIGNED),  # 8 / (15/10) = 5.333
            (5.4, "candidates", Verdict.PROMINENCE),
        ],
    )
    def test_gamma_is_the_ratio_it_takes(self, gamma: float, mean: str, verdict: Verdict) -> None:
        assert self.drawn(gamma=gamma, prominence_mean=mean).verdict == verdict

    @pytest.mark.parametrize(("single_peak", "verdict"), [("accept", Verdict.ASSIGNED), ("reject", Verdict.PROMINENCE)])
    def test_one_peak_is_up_to_the_option(self, single_peak: str, verdict: Verdict) -> None:
        # Ten images along a line, the new one near the sixth: s rises and falls once.
        line = [(float(x), 0.0) for x in range(10)]
        step = mapper_of(line, omega=100.0, gamma=5.0, single_peak=single_peak).step(look((5.1, 0)))
        assert (step.measured["peaks"], best(step).frame) == (1, 5)
        assert asked(step, "peaks").values == (1,)
        assert step.compared("prominence") is None
        assert step.verdict == verdict

    def test_identical_images_are_one_plateau(self) -> None:
        step = mapper_of([(0, 0)] * 10, single_peak="reject").step(look((0, 0)))
        assert curve(step, "position") == [0.1] * 10
        assert (step.measured["peaks"], best(step).frame) == (1, 0)
        assert step.measured["prominence"] == pytest.approx(0.01)

    def test_the_shift_rolls_the_best_image_onto_the_new_one(self) -> None:
        # Image 3 alone shows what the new one does, two cells earlier.
        mapper = Roman2020(Roman2020Settings(n_init=10, omega=100.0, covariance="identity", gamma=0.0))
        points = (*CROSS, (0, 1), (0, -2))
        for frame, point in enumerate(points):
            mapper.step(look(point, (5, 1, 0, 0) if frame == 3 else (3, 3, 3, 3)))
        step = mapper.step(look((0, 0), (0, 0, 5, 1)))
        assert (best(step).frame, best(step).shift) == (3, 2)
        assert np.roll([5, 1, 0, 0], best(step).shift).tolist() == [0, 0, 5, 1]
        # Image 3 is at the floor of 1e-9, the others at sqrt(9 + 9 + 4 + 4).
        weight = 1e-9 / math.sqrt(26)
        assert curve(step, "orientation")[3] == pytest.approx(1 / (1 + 9 * weight))
        assert curve(step, "orientation")[0] == pytest.approx(weight, rel=1e-6)


class TestCentroid:
    """Eq. 9: ||p_q - r|| / (n + 1) <= max_j ||p_j - r|| / (n - 1)."""

    # Mean of the ten: 0. The farthest lies at 1, so the bound is 1/9.
    NODE = tuple((x, 0.0) for x in (1, -1, 0.5, -0.5, 1, -1, 0.5, -1, 1, -0.5))

    @pytest.mark.parametrize(
        ("x", "verdict"),
        [
            (1.20, Verdict.ASSIGNED),  # 1.20 / 11 = 0.1091 <= 0.1111
            (1.25, Verdict.CENTROID),  # 1.25 / 11 = 0.1136 > 0.1111
        ],
    )
    def test_the_shift_of_the_mean_is_bounded(self, x: float, verdict: Verdict) -> None:
        step = mapper_of(self.NODE, omega=100.0).step(look((x, 0)))
        assert asked(step, "centroid").threshold == step.measured["centroid_bound"] == pytest.approx(1 / 9)
        assert asked(step, "centroid").best == step.measured["centroid_shift"] == pytest.approx(x / 11)
        assert step.verdict == verdict

    def test_it_is_not_reached_when_prominence_refuses(self) -> None:
        step = mapper_of(self.NODE, omega=100.0, gamma=1000.0).step(look((1.25, 0)))
        assert (step.verdict, step.compared("centroid")) == (Verdict.PROMINENCE, None)


class TestMerging:
    """Eq. 11 at a node's creation."""

    # mu_ns = 20.5, sigma_ns = 6.364, mean (0, 0).
    HOLLOW = TestNodeGate.HOLLOW
    # Ten images at distance 10: Delta = 100, ratio 12.5, all refused. Their mean is (0, 0): Delta = 0, ratio -3.22.
    RING = tuple((10 * x, 10 * y) for x, y in (*CROSS, (1, 0), (-1, 0)))

    def test_one_sided_merges_the_mean_of_the_new_node(self) -> None:
        mapper = mapper_of(self.HOLLOW)
        *refused, last = replay(mapper, self.RING)
        assert [step.verdict for step in (*refused, last)] == [Verdict.NO_CANDIDATE] * 10
        assert [step.node for step in refused] == [None] * 9
        assert [step.measured["run"] for step in (*refused, last)] == list(range(1, 11))
        assert last.node == 1
        assert last.events == (
            NodeEvent(EventKind.CREATED, 2, frames=tuple(range(10, 20))),
            NodeEvent(EventKind.MERGED, 2, into=1),
        )
        final = mapper.finish()
        assert final.labels.tolist() == [1] * 20
        assert set(final.placements) == {Placement.FOUNDING}
        # (0.4, 0.5) was the mean of the first ten.
        assert final.representatives.tolist() == [pytest.approx([0.2, 0.25])]

    def test_two_sided_refuses_it_because_it_is_too_close(self) -> None:
        mapper = mapper_of(self.HOLLOW, merge_gate="two-sided")
        last = replay(mapper, self.RING)[-1]
        assert last.node == 2
        assert [event.kind for event in last.events] == [EventKind.CREATED, EventKind.ACTIVATED]
        assert mapper.finish().labels.tolist() == [1] * 10 + [2] * 10

    @pytest.mark.parametrize(("merge_y", "node"), [(5.4, 2), (5.5, 1)])
    def test_merge_y_is_the_ratio_it_takes(self, merge_y: float, node: int) -> None:
        # Node 1: mu = 0.625, sigma = 0.375 sqrt 2. The new images are far, but their mean is (1.875, 0):
        # Delta = 3.516 and a ratio of 2.891 / 0.530 = 5.451.
        far = [(30.0, 0.0)] * 5 + [(-26.25, 0.0)] * 5
        last = replay(mapper_of(cluster((0, 0)), merge_y=merge_y), far)[-1]
        assert last.node == node


class TestActivation:
    """Section 5: a new node must be as far from the active nodes as these are from each other."""

    # Representatives of the first two: 10 apart. All clusters have the same shape, mu = 0.625, sigma = 0.53.
    def two_active_nodes(self) -> Roman2020:
        mapper = mapper_of(cluster((0, 0)))
        last = replay(mapper, cluster((10, 0)))[-1]
        assert [event.kind for event in last.events] == [EventKind.CREATED, EventKind.ACTIVATED]
        assert standing(mapper) == (2, 0)
        return mapper

    def test_a_distant_node_is_active_at_once(self) -> None:
        mapper = self.two_active_nodes()
        replay(mapper, cluster((5, 9)))  # sqrt(25 + 81) = 10.30 >= 10
        assert standing(mapper) == (3, 0)

    def test_a_node_in_between_is_pending_until_it_has_moved_away(self) -> None:
        mapper = self.two_active_nodes()
        last = replay(mapper, cluster((5, 8.6)))[-1]  # sqrt(25 + 73.96) = 9.95 < 10
        assert [event.kind for event in last.events] == [EventKind.CREATED]
        assert (last.node, standing(mapper)) == (3, (2, 1))
        # (5.15, 9.6): Delta = 0.15^2 + 1 = 1.0225, ratio 0.75 <= x(2) = 2.75. The representative moves by 1/11
        # to (5.15, 8.691): sqrt(25 + 75.53) = 10.03 >= 10.
        step = mapper.step(look((5.15, 9.6)))
        assert (step.verdict, step.node, step.measured["run"]) == (Verdict.PENDING, 3, 0)
        assert step.events == (NodeEvent(EventKind.ACTIVATED, 3),)
        assert standing(mapper) == (3, 0)
        assert gate(step).of == (1, 2)
        assert gate(step).threshold == pytest.approx(2.75)

    def test_a_pending_node_is_no_candidate_but_stands_on_the_curve(self) -> None:
        mapper = self.two_active_nodes()
        replay(mapper, cluster((5, 8)))
        step = mapper.step(look((10.2, 0.1)))
        assert step.verdict == Verdict.ASSIGNED
        assert step.curves is not None
        assert step.curves.size == 30
        assert step.curves.slots.tolist() == list(range(10, 20))


class TestMargin:
    """How far the nearest comparison was from going the other way, relative to its threshold."""

    def test_node_gate(self) -> None:
        step = mapper_of(TestNodeGate.NODE).step(look((0, 5)))
        assert_margin(step, "node", (20 / math.sqrt(32) - 2.9) / 2.9)

    def test_prominence(self) -> None:
        assert_margin(TestMatch().drawn(gamma=2.2), "prominence", (2.2 - 32 / 15) / 2.2)

    def test_centroid(self) -> None:
        step = mapper_of(TestCentroid.NODE, omega=100.0).step(look((1.25, 0)))
        assert_margin(step, "centroid", (1.25 / 11 - 1 / 9) * 9)

    def test_merging(self) -> None:
        far = [(30.0, 0.0)] * 5 + [(-26.25, 0.0)] * 5  # see TestMerging
        step = replay(mapper_of(cluster((0, 0)), merge_y=5.5), far)[-1]
        assert_margin(step, "merge", (5.5 - (1.875**2 - 0.625) / 0.375 / math.sqrt(2)) / 5.5)

    def test_activation(self) -> None:
        step = replay(TestActivation().two_active_nodes(), cluster((5, 8.6)))[-1]
        assert_margin(step, "activation", (10 - math.hypot(5, 8.6)) / 10)

    def test_match_between_two_nodes(self) -> None:
        # Node 1 reaches far (mu_ns = 50.5, sigma_ns = 70), node 2 stands at (20, 0): both let (10.2, 0) in, which
        # is nearer to (19, 0) of node 2 than to (1, 0) of node 1.
        mapper = mapper_of([*CROSS, (1, 0), (0, 10)])
        replay(mapper, [(x + 20, y) for x, y in (*CROSS, (1, 0), (0, 10))])
        assert standing(mapper) == (2, 0)
        step = mapper.step(look((10.2, 0)))
        assert gate(step).passing == (1, 2)
        assert best(step).frame == 11
        assert_margin(step, "match", 1 - 8.8 / 9.2)

    def test_nothing_is_compared_for_initial_images(self) -> None:
        assert [step.margin for step in replay(Roman2020(Roman2020Settings(n_init=10)), CROSS)] == [None] * 8


class TestRunsAndLeftovers:
    """Images that nobody takes."""

    NODE = TestNodeGate.NODE
    AWAY: Point = (0, 50)

    def test_an_accepted_image_breaks_the_run(self) -> None:
        steps = replay(mapper_of(self.NODE), [self.AWAY] * 9 + [(0, 1)] + [self.AWAY])
        assert [step.measured["run"] for step in steps] == [*range(1, 10), 0, 1]
        assert [event for step in steps for event in step.events] == []

    def test_only_images_without_candidate_count_under_that_option(self) -> None:
        mapper = mapper_of(self.NODE, gamma=1000.0, run_counts="no-candidate")
        steps = replay(mapper, [self.AWAY] * 9 + [(0, 1), (1, 0)] + [self.AWAY])
        assert [step.verdict for step in steps[9:]] == [Verdict.PROMINENCE] * 2 + [Verdict.NO_CANDIDATE]
        assert [step.measured["run"] for step in steps] == [*range(1, 10), 9, 9, 10]
        assert steps[-1].events[0].frames == (*range(10, 19), 21)

    def test_a_leftover_goes_by_force_to_the_node_of_its_most_similar_image(self) -> None:
        mapper = mapper_of(self.NODE)
        replay(mapper, cluster((40, 0)))
        replay(mapper, [(30, 0), (9, 0)])  # nearest: (39.5, 0) of node 2 and (1, 0) of node 1
        final = mapper.finish()
        assert final.labels[-2:].tolist() == [2, 1]
        assert final.placements[-2:] == (Placement.FORCED, Placement.FORCED)

    def test_a_leftover_that_the_later_map_accepts_is_a_retest(self) -> None:
        mapper = mapper_of(self.NODE)
        early, home = (40.0, 0.5), (0.0, 1.0)
        steps = replay(mapper, [early, home, *cluster((40, 0))])
        assert [steps[0].verdict, steps[1].verdict] == [Verdict.NO_CANDIDATE, Verdict.ASSIGNED]
        final = mapper.finish()
        assert (final.labels[10], final.placements[10]) == (2, Placement.RETEST)

    def test_leftovers_may_stay_out(self) -> None:
        mapper = mapper_of(self.NODE, leftovers="unassigned")
        replay(mapper, [self.AWAY])
        final = mapper.finish()
        assert (final.labels[-1], final.placements[-1]) == (0, Placement.UNASSIGNED)

    def test_too_few_images_for_the_first_node(self) -> None:
        mapper = mapper_of(self.NODE[:9])
        with pytest.raises(ConfigError, match="n_init"):
            mapper.finish()
