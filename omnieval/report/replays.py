"""The figures of one replay, each drawn from what there is or left out with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import Description
from omnieval.errors import OmnievalError
from omnieval.report.batch import KS, SPECTRAL, Curves, batch_at, batch_figure, computed, recorded
from omnieval.report.curves import curves_figure
from omnieval.report.evidence import batch_curve, descriptions, positions_of, similarity_curve, telling_step
from omnieval.report.figure import Block, Figure, Skipped
from omnieval.report.maps import map_figure, progress_figure
from omnieval.report.series import gate_figure, time_figure
from omnieval.report.sources import Baseline, Replay


@dataclass(frozen=True)
class DrawnReplay:
    """The blocks of a replay, and the silhouette of batch clustering at its number of nodes."""

    blocks: tuple[Block, ...]
    batch: float | None


def draw_replay(
    replay: Replay, baselines: Sequence[Baseline], cache: DescriptorCache, *, step: int | None, figures: bool
) -> DrawnReplay:
    """Draw a replay.

    Parameters
    ----------
    replay
        What to draw.
    baselines
        Where batch clusterings of the same images are looked for.
    cache
        Where descriptions are looked up.
    step
        The step whose similarity curves to draw; None takes a telling one.
    figures
        Whether figures are wanted, or only what the tables need.
    """
    telling = telling_step(replay.steps)
    described = _described(replay, cache, telling)
    ks = sorted({*(KS if figures else ()), replay.nodes})
    curves = _curves(replay, _beside(replay, baselines), described, ks)
    batch = batch_at(curves, replay.nodes) if isinstance(curves, Curves) else None
    if not figures:
        return DrawnReplay((), batch)
    subject = f"{replay.dataset}, {replay.descriptor}"
    silhouettes = (
        batch_figure(curves, [replay] if replay.finished else [], subject)
        if isinstance(curves, Curves)
        else Skipped("Batch clustering over the number of clusters", curves)
    )
    blocks = (
        map_figure(replay),
        progress_figure(replay),
        silhouettes,
        _curves_block(replay, described, telling if step is None else step, chosen=step is not None),
        gate_figure(replay),
        time_figure(replay),
    )
    return DrawnReplay(blocks, batch)


def _described(replay: Replay, cache: DescriptorCache, telling: int | None) -> list[Description] | str:
    """Return the descriptions of the replay's images, or the reason why they are not to be had.

    They are tried on one step first: the descriptor may have been one of the user's own.
    """
    try:
        described = list(descriptions(replay, cache))
        if telling is not None:
            similarity_curve(replay, described, telling)
    except OmnievalError as error:
        return f"its images cannot be described again: {error}"
    return described


def _curves(
    replay: Replay, baselines: Sequence[Baseline], described: list[Description] | str, ks: Sequence[int]
) -> Curves | str:
    """Return the batch curves of a replay, or the reason why there are none."""
    if not replay.posed:
        return "the sequence has no poses, so there is no silhouette"
    beside = recorded(baselines) if baselines else None
    if beside is not None and SPECTRAL in beside.table["method"].to_list():
        return beside
    if isinstance(described, str):
        return f"{described}; name a baseline folder of it beside (omnieval baseline)"
    positions = np.stack([one.position for one in described])
    curve = batch_curve(positions, positions_of(replay.steps), ks, seed=replay.config.mapper.seed)
    if curve.is_empty():
        return "there are fewer than two images"
    found = computed(curve)
    if beside is None:
        return found
    names = beside.table["method"].unique()
    kept = found.table.filter(~pl.col("method").is_in(names.implode()))
    return Curves(pl.concat([kept, beside.table]), f"{found.origin} {beside.origin}")


def _curves_block(
    replay: Replay, described: list[Description] | str, step: int | None, *, chosen: bool
) -> Figure | Skipped:
    title = "Similarity curves of a step" if step is None else f"Similarity curves of step {step}"
    if step is None:
        return Skipped(title, "no loop was closed; choose a step with --step")
    if isinstance(described, str):
        return Skipped(title, described)
    try:
        match, labels = similarity_curve(replay, described, step)
    except OmnievalError as error:
        return Skipped(title, str(error))
    return curves_figure(replay, step, match, labels, chosen=chosen)


def _beside(replay: Replay, baselines: Sequence[Baseline]) -> list[Baseline]:
    """Return the baselines of the same images and descriptor."""
    return [
        baseline
        for baseline in baselines
        if (baseline.source, dict(baseline.cut)) == (replay.source, dict(replay.cut))
        and baseline.table["descriptor"][0] == replay.descriptor
    ]
