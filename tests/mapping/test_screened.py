"""Decisions by bounds are the decisions: step by step against the mapper with all its evidence, and the reference."""

import numpy as np
import pytest

from omnieval.descriptors import screening
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.roman2020 import mapper as module
from omnieval.mapping.roman2020.conditions import prominence
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.screened import _prominent, _Range, screened_match
from omnieval.mapping.roman2020.settings import Roman2020Settings
from tests.mapping.comparison import assert_final
from tests.mapping.test_against_reference import cases
from tests.mapping.worlds import World
from tests.reference.mapper import ReferenceMapper


def decisions(mapper, descriptions, ahead=AHEAD):
    found = []
    for block in blocks(descriptions, ahead):
        mapper.expect(block)
        for description in block:
            step = mapper.step(description)
            found.append((step.verdict, step.node, step.match, step.events))
    return found


@pytest.fixture
def calls(monkeypatch):
    """What was decided by bounds, None where it was too close."""
    answers = []
    decide = screened_match

    def noted(*args):
        answers.append(decide(*args))
        return answers[-1]

    monkeypatch.setattr(module, "screened_match", noted)
    return answers


@pytest.mark.parametrize("number", range(5))
def test_worlds_and_options_are_decided_alike(number, calls):
    world, settings = cases(5, seed=300, visits=5)[number]
    descriptions = world.describe()
    plain, screened = Roman2020(settings), Roman2020(settings, ImageMemory(screening=True))
    expected = decisions(plain, descriptions)
    assert decisions(screened, descriptions) == expected
    one, other = plain.finish(), screened.finish()
    assert other.labels.tolist() == one.labels.tolist()
    assert other.placements == one.placements
    assert other.representatives.tolist() == one.representatives.tolist()
    assert sum(answer is not None for answer in calls) > 0.5 * len(calls) > 0


def test_the_reference_decides_alike():
    settings = Roman2020Settings(n_init=10, n_new=10, gamma=2.0)
    descriptions = World(seed=8, visits=5).describe()
    screened, reference = Roman2020(settings, ImageMemory(screening=True)), ReferenceMapper(settings)
    for (verdict, node, match, _), image in zip(decisions(screened, descriptions), descriptions, strict=True):
        expected = reference.step(image.position, image.orientation)
        assert (verdict, node) == (expected["verdict"], expected["node"])
        if match is not None:
            assert (match.frame, match.node, match.shift) == tuple(
                expected[name] for name in ("best_frame", "best_node", "shift")
            )
    assert_final(screened.finish(), reference.finish())


def test_no_evidence_is_told():
    mapper = Roman2020(Roman2020Settings(n_init=10, n_new=10, gamma=1.0), ImageMemory(screening=True))
    steps = [mapper.step(description) for description in World(seed=1, visits=4).describe()]
    assert any(step.match for step in steps)
    assert all(step.comparisons == () and step.curves is None and set(step.measured) == {"run"} for step in steps)


def test_equal_images_are_decided_as_they_are_with_evidence(calls):
    """Every image three times: similarities are equal to the bit, so that the first of them is the best."""
    descriptions = [one for one in World(seed=3, visits=4).describe() for _ in range(3)]
    settings = Roman2020Settings(n_init=12, n_new=12, gamma=1.5)
    assert decisions(Roman2020(settings, ImageMemory(screening=True)), descriptions) == decisions(
        Roman2020(settings), descriptions
    )
    assert calls


@pytest.mark.parametrize("rounding", [2.0**-16, 2.0**-10])
def test_what_single_precision_leaves_open_is_looked_at_closely(rounding, calls, monkeypatch):
    """Bounds so wide that they decide little: first the neighbours that may be the one or the other way, then all."""
    monkeypatch.setattr(screening, "_UNIT", rounding)
    narrowed = []
    narrow = ImageMemory.narrow

    def noted(memory, frame, frames):
        narrowed.append(len(frames))
        return narrow(memory, frame, frames)

    monkeypatch.setattr(ImageMemory, "narrow", noted)
    settings = Roman2020Settings(n_init=10, n_new=10, gamma=2.0)
    descriptions = World(seed=5, visits=5).describe()
    screened = Roman2020(settings, ImageMemory(screening=True))
    assert decisions(screened, descriptions) == decisions(Roman2020(settings), descriptions)
    assert len(narrowed) > 0.5 * len(calls) > 0
    assert None not in calls


@pytest.mark.parametrize("mean", ["peaks", "candidates"])
@pytest.mark.parametrize("radius", [0.0, 1e-6, 1e-2])
def test_bounds_on_prominence_decide_rightly_or_not_at_all(mean, radius):
    """Curves of few distinct heights, so that many peaks are equally high and many neighbours level."""
    rng = np.random.default_rng(7)
    decided = 0
    for _ in range(100):
        count = int(rng.integers(1, 30))
        size = count + int(rng.integers(0, 10))
        slots = np.sort(rng.permutation(size)[:count])
        values = rng.integers(1, 6, count) / 5.0 + (0.0 if rng.random() < 0.5 else rng.random(count))
        best = int(values.argmax())
        for gamma in (0.0, 1.0, 2.0, 5.0):
            settings = Roman2020Settings(gamma=gamma, prominence_mean=mean, single_peak="reject")
            measured = prominence(values, slots, size, best)
            over = measured.total / (measured.peaks if mean == "peaks" else count)
            expected = measured.peaks >= 2 and measured.best >= gamma * over
            off = radius * rng.uniform(-1.0, 1.0, count)
            similarity = _Range(np.maximum(values + off - radius, 0.0), values + off + radius)
            height = (values[best] * (1 - 1e-12), values[best] * (1 + 1e-12))
            found = _prominent(similarity, slots, size, height, settings)
            if measured.best == pytest.approx(gamma * over, rel=1e-9):
                continue  # on the threshold
            assert found is None or found == expected
            decided += found is not None
    assert decided > 100
