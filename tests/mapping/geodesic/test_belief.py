"""The forward algorithm by hand."""

from __future__ import annotations

import numpy as np
import pytest

from omnieval.mapping.geodesic.belief import Belief

CHAIN = (np.array([0, 1, 1, 2]), np.array([1, 0, 2, 1]))
"""0 - 1 - 2"""


def test_coming_to_known_places_is_shared_among_the_possible_ones() -> None:
    after = Belief(np.zeros(0)).moved(CHAIN, np.array([1.0, 1.0, 0.0]), leave=0.1, enter=0.2)
    assert after.places == pytest.approx([0.1, 0.1, 0.0])
    assert after.elsewhere == pytest.approx(0.8)


def test_half_stays_and_half_goes_on_along_the_edges() -> None:
    after = Belief(np.array([0.0, 1.0]), 0.0).moved(CHAIN, np.ones(3), leave=0.1, enter=0.2)
    assert after.places == pytest.approx([0.225, 0.45, 0.225])
    assert after.elsewhere == pytest.approx(0.1)


def test_an_image_weighs_what_was_expected() -> None:
    after = Belief(np.array([0.0, 1.0]), 0.0).moved(CHAIN, np.array([0.0, 1.0, 4.0]), leave=0.1, enter=0.2)
    weights = np.array([0.0, 0.45, 0.9])
    assert after.places == pytest.approx(weights / 1.45)
    assert after.elsewhere == pytest.approx(0.1 / 1.45)


def test_it_takes_a_run_of_images_to_be_sure() -> None:
    belief, seen = Belief(np.zeros(0)), []
    for at in (0, 1, 2):
        belief = belief.moved(CHAIN, np.exp(np.where(np.arange(3) == at, 4.0, -4.0)), leave=0.02, enter=0.002)
        seen.append(belief.places[at])
    assert seen[0] < 0.1
    assert seen == sorted(seen)
    assert seen[-1] > 0.8
