"""The figures of one replay, each drawn from what there is or left out with the reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.errors import OmnievalError, ResultError
from omnieval.report.batch import KS, SPECTRAL, Curves, batch_at, batch_figure, computed, recorded
from omnieval.report.curves import curves_figure
from omnieval.report.evidence import batch_curve, position_descriptors, positions_of, step_again, telling_step
from omnieval.report.figure import Block, Figure, Skipped
from omnieval.report.gallery import TITLE, gallery
from omnieval.report.maps import map_figure, progress_figure
from omnieval.report.published import is_papers
from omnieval.report.series import gate_figure, time_figure
from omnieval.report.sources import Baseline, Replay

T = TypeVar("T")


@dataclass(frozen=True)
class DrawnReplay:
    """The blocks of a replay, and the silhouette of batch clustering at its number of nodes."""

    blocks: tuple[Block, ...]
    batch: float | None


def draw_replay(replay: Replay, baselines: Sequence[Baseline], *, step: int | None, figures: bool) -> DrawnReplay:
    """Draw a replay; what cannot be drawn is left out with the reason, and takes nothing else along.

    Parameters
    ----------
    replay
        What to draw.
    baselines
        Where batch clusterings of the same images are looked for.
    step
        The step whose similarity curves to draw; None takes a telling one.
    figures
        Whether figures are wanted, or only what the tables need.
    """
    descriptors = attempted(lambda: position_descriptors(replay))
    ks = sorted({*(KS if figures else ()), replay.nodes})
    curves = attempted(lambda: _curves(replay, _beside(replay, baselines), descriptors, ks))
    batch = batch_at(curves, replay.nodes) if isinstance(curves, Curves) else None
    if not figures:
        return DrawnReplay((), batch)
    subject = replay.subject
    drawn: dict[str, Callable[[], Block | None]] = {
        "The map at ten moments": lambda: map_figure(replay),
        TITLE: lambda: gallery(replay),
        "Number of nodes while the map grows": lambda: progress_figure(replay),
        "Batch clustering over the number of clusters": lambda: (
            batch_figure(curves, [replay] if replay.finished else [], subject)
            if isinstance(curves, Curves)
            else Skipped("Batch clustering over the number of clusters", curves)
        ),
        "Similarity curves of a step": lambda: _curves_block(replay, descriptors, step),
        "The gate x over the number of nodes": lambda: gate_figure(replay) if is_papers(replay) else None,
        "Time per step": lambda: time_figure(replay),
    }
    blocks = (drawn_or_skipped(title, draw) for title, draw in drawn.items())
    return DrawnReplay(tuple(block for block in blocks if block is not None), batch)


def attempted(make: Callable[[], T]) -> T | str:
    """Return what is made, or why it cannot be: numerical trouble and missing inputs are no surprise here."""
    try:
        return make()
    except OmnievalError as error:
        return str(error)
    except (
        ArithmeticError,
        ValueError,
        MemoryError,
        RuntimeError,
        LookupError,
    ) as error:  # LinAlgError is a ValueError
        return " ".join(f"{type(error).__name__}: {error}".split())


def drawn_or_skipped(title: str, draw: Callable[[], Block | None]) -> Block | None:
    """Return a figure, or why it is left out."""
    found = attempted(draw)
    return Skipped(title, f"it cannot be drawn: {found}") if isinstance(found, str) else found


def _curves(
    replay: Replay, baselines: Sequence[Baseline], descriptors: NDArray[np.float32] | str, ks: Sequence[int]
) -> Curves:
    """Return the batch curves of a replay."""
    if not replay.posed:
        raise ResultError("the sequence has no poses, so there is no silhouette")
    beside = recorded(baselines) if baselines else None
    if beside is not None and SPECTRAL in beside.table["method"].to_list():
        return beside
    if isinstance(descriptors, str):
        raise ResultError(f"its images cannot be described again: {descriptors}; name a baseline folder of it beside")
    curve = batch_curve(descriptors, positions_of(replay.steps), ks, seed=replay.config.seed)
    if curve.is_empty():
        raise ResultError("there are fewer than two images")
    found = computed(curve)
    if beside is None:
        return found
    names = beside.table["method"].unique()
    kept = found.table.filter(~pl.col("method").is_in(names.implode()))
    return Curves(pl.concat([kept, beside.table]), f"{found.origin} {beside.origin}")


def _curves_block(replay: Replay, descriptors: NDArray[np.float32] | str, step: int | None) -> Figure | Skipped:
    chosen = step is not None
    step = telling_step(replay) if step is None else step
    title = "Similarity curves of a step" if step is None else f"Similarity curves of step {step}"
    if not replay.method.curves:
        return Skipped(title, f"the mapper {replay.mapper} has none")
    if step is None:
        return Skipped(title, "no loop was closed; choose a step with --step")
    if isinstance(descriptors, str):
        return Skipped(title, f"its images cannot be described again: {descriptors}")
    found = attempted(lambda: step_again(replay, step))
    if isinstance(found, str):
        return Skipped(title, found)
    return curves_figure(replay, *found, chosen=chosen)


def _beside(replay: Replay, baselines: Sequence[Baseline]) -> list[Baseline]:
    """Return the baselines of the same images, described in the same way."""

    def images(one: Baseline | Replay) -> Any:
        return one.source, one.cut, one.described

    def prints(one: Baseline | Replay) -> set[Any]:
        return {one.facts["dataset_fingerprint"]} - {None}  # unknown of one that did not end

    return [one for one in baselines if images(one) == images(replay) and len(prints(one) | prints(replay)) < 2]
