"""The mapper against the second implementation: every decision and every number, over many worlds and options."""

from __future__ import annotations

from functools import cache
from typing import Any, get_args

import numpy as np
import pytest

from omnieval.mapping.roman2020.evidence import Verdict
from omnieval.mapping.roman2020.settings import PRESETS, Roman2020Settings
from omnieval.mapping.step import EventKind, Placement
from tests.mapping.comparison import Tally, assert_agreement
from tests.mapping.worlds import World

NUMBERS: dict[str, tuple[Any, ...]] = {
    "omega": (1.7, 2.0, 2.3, 4.0),
    "merge_y": (0.75, 1.5, 2.25, 5.0),
    "gamma": (1.2, 2.0, 2.5, 3.5, 5.0),
    "n_init": (10, 14, 20),
    "n_new": (10, 12, 17),
    "seed": (0, 1, 2**40),
}
OPTIONS = {
    name: get_args(field.annotation)
    for name, field in Roman2020Settings.model_fields.items()
    if field.default is not None and get_args(field.annotation)
}
WORLDS: dict[str, tuple[Any, ...]] = {
    "places": (3, 5, 7),
    "dwell": ((12, 25), (18, 40)),
    "passage": (0, 4),
    "spread": (0.2, 0.4, 0.8),
    "noise": (0.003, 0.02, 0.06),
    "repeats": (0.0, 0.0, 0.15),
    "twins": (False, True),
    "flat": (0, 2),
    "dimension": (4, 8, 20),
}


def cases(count: int, seed: int, **world: Any) -> list[tuple[World, Roman2020Settings]]:
    """Worlds and configurations in which each value of each parameter takes its turn, in random company."""
    rng = np.random.default_rng(seed)

    def columns(choices: dict[str, tuple[Any, ...]]) -> list[dict[str, Any]]:
        turns = {name: rng.permutation(count) % len(values) for name, values in choices.items()}
        return [{name: choices[name][turns[name][i]] for name in choices} for i in range(count)]

    configs = [Roman2020Settings(**choice) for choice in columns(NUMBERS | OPTIONS)]
    worlds = [World(seed=seed + i, **(choice | world)) for i, choice in enumerate(columns(WORLDS))]
    return list(zip(worlds, configs, strict=True))


FAST = cases(24, seed=100, visits=7)
SLOW = cases(60, seed=10_000)


@cache
def compared(number: int) -> Tally:
    world, config = FAST[number]
    return assert_agreement(config, world.describe())


@pytest.mark.parametrize("number", range(len(FAST)))
def test_every_step_agrees_with_the_reference(number: int) -> None:
    assert compared(number).verdicts["initial"] == FAST[number][1].n_init


def test_the_worlds_show_everything_that_can_happen() -> None:
    tallies = [compared(number) for number in range(len(FAST))]
    for kinds, counters in (
        (Verdict, [tally.verdicts for tally in tallies]),
        (EventKind, [tally.events for tally in tallies]),
        (Placement, [tally.placements for tally in tallies]),
    ):
        for kind in kinds:
            assert sum(counter[kind] > 0 for counter in counters) >= 3, f"{kind} is too rare to be compared"


def test_the_configurations_use_every_value_of_every_option() -> None:
    for name, values in (NUMBERS | OPTIONS).items():
        assert {getattr(config, name) for _, config in FAST} == set(values)


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_presets_agree_with_the_reference(preset: str) -> None:
    config = Roman2020Settings(**PRESETS[preset])
    tally = assert_agreement(config, World(seed=5, spread=0.8, noise=0.005).describe())
    assert tally.verdicts["assigned"] > 0


def test_the_sizes_of_the_paper_agree_with_the_reference() -> None:
    world = World(seed=7, visits=3, places=2, dwell=(12, 14), passage=0, dimension=256, cells=256, bins=16)
    tally = assert_agreement(Roman2020Settings(gamma=1.2, omega=3.0, n_init=12, n_new=10), world.describe())
    assert tally.events["created"] > 1
    assert tally.verdicts["assigned"] > 0


@pytest.mark.slow
@pytest.mark.parametrize(("world", "config"), SLOW)
def test_many_more_worlds_agree_with_the_reference(world: World, config: Roman2020Settings) -> None:
    assert assert_agreement(config, world.describe()).verdicts["initial"] == config.n_init
