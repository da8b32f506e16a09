"""Motions in the plane, on paper."""

from __future__ import annotations

import math

import pytest

from omnieval.mapping.geodesic.motion import Motion, angle_of


def approx(motion: Motion) -> tuple[object, ...]:
    return tuple(pytest.approx(value, abs=1e-12) for value in (motion.ahead, motion.aside, motion.turn))


def values(motion: Motion) -> tuple[float, float, float]:
    return motion.ahead, motion.aside, motion.turn


def test_four_sides_with_quarter_turns_come_back() -> None:
    side, pose = Motion(2.0, 0.0, math.pi / 2), Motion()
    for _ in range(4):
        pose = pose.then(side)
    assert values(pose) == approx(Motion(0, 0, 2 * math.pi))


def test_there_and_back_is_nothing() -> None:
    motion = Motion(1.0, -2.0, 0.7)
    assert values(motion.then(motion.back)) == approx(Motion())
    assert values(motion.back.then(motion)) == approx(Motion())
    assert motion.distance == motion.back.distance == pytest.approx(math.sqrt(5))


def test_a_step_goes_along_an_arc() -> None:
    assert values(Motion.step(2.0, 0.4)) == approx(Motion(2 * math.cos(0.2), 2 * math.sin(0.2), 0.4))


def test_a_sudden_turn_is_a_wrong_alignment() -> None:
    assert Motion.step(1.0, 3.0) == Motion(1.0, 0.0, 0.0)


def test_a_shift_is_an_angle_the_short_way_round() -> None:
    assert [angle_of(shift, 4) for shift in range(4)] == pytest.approx([0, math.pi / 2, math.pi, -math.pi / 2])
    assert angle_of(0, 1) == 0.0
