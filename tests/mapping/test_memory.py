"""The images the mapper has seen."""

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.mapping.memory import blocks
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
from tests.mapping.test_relations import evidence
from tests.mapping.worlds import World


def test_blocks_are_whole_but_the_last():
    assert list(blocks(range(7), 3)) == [[0, 1, 2], [3, 4, 5], [6]]
    assert list(blocks([], 3)) == []


def test_what_comes_before_an_error_is_not_lost():
    def numbers():
        yield from range(4)
        raise OSError("unreadable")

    found = blocks(numbers(), 3)
    assert [next(found), next(found)] == [[0, 1, 2], [3]]
    with pytest.raises(OSError, match="unreadable"):
        next(found)


def test_a_hint_changes_no_step():
    descriptions = World(seed=4, visits=6).describe()
    config = Roman2020Settings(n_init=15, n_new=10, gamma=2.0)
    plain, hinted = Roman2020(config), Roman2020(config)
    expected = [evidence(plain.step(description)) for description in descriptions]
    found = []
    for block in blocks(descriptions, 16):
        hinted.expect(block)
        found += [evidence(hinted.step(description)) for description in block]
    assert found == expected


def test_a_hint_of_a_damaged_image_is_no_fault_yet():
    descriptions = World(seed=4, visits=2).describe()
    damaged = Description(np.full_like(descriptions[0].position, np.nan), descriptions[0].orientation)
    mapper = Roman2020(Roman2020Settings(n_init=10))
    mapper.expect([descriptions[0], damaged, descriptions[1]])
    assert mapper.step(descriptions[0]).frame == 0
    assert mapper.step(descriptions[1]).frame == 1
