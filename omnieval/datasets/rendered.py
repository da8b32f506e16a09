"""The built-in synthetic building as a source: rendered once into the cache, then read as COLD."""

from __future__ import annotations

from dataclasses import replace

from omnieval.datasets.cards import card
from omnieval.datasets.cold import scan_cold
from omnieval.datasets.scan import Scan
from omnieval.datasets.sequence import Camera
from omnieval.datasets.synthetic import LIGHTS, cached
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

CARD = "synthetic"


def scan_rendered(light: str) -> Scan:
    """Read the synthetic sequence in `light` (empty: the first of `LIGHTS`), rendering it if need be.

    Raises
    ------
    DatasetError
        If there is no such light.
    """
    chosen = light or LIGHTS[0]
    if chosen not in LIGHTS:
        raise DatasetError(f"no light '{shown(light)}' in synthetic:{shown(light)}; {did_you_mean(light, LIGHTS)}")
    return replace(
        scan_cold(cached(chosen)),
        name=f"synthetic-{chosen}",
        source=f"synthetic:{chosen}",
        camera=Camera("omnidirectional", card(CARD).mirror),
        card=CARD,
        card_sequence=chosen,
    )
