"""A run in a few lines for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from omnieval.imaging.camera import camera_in_words
from omnieval.imaging.soundness import BadImage, in_words
from omnieval.metrics.catalogue import THETA
from omnieval.metrics.evaluation import Evaluation
from omnieval.palette import node_color
from omnieval.results.manifest import status_of
from omnieval.text_table import markdown
from omnieval.wording import shown

_MAP_WIDTH, _MAP_HEIGHT, _MAP_BORDER = 320, 200, 4
"""Of the picture of a map, pixels at most."""


def summary_fields(manifest: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (name, value) pairs that summarise a complete run."""
    metrics, timings = manifest["metrics"], manifest["timings"]
    yield "source", shown(manifest["source"])
    if earlier := manifest.get("continues"):
        yield "continues from", f"{shown(earlier['source'])}, the first {earlier['images']} frames ({earlier['run']})"
    yield "frames", f"{manifest['frames']} in {timings['seconds']:.1f} s ({timings['frames_per_second']:.0f} frames/s)"
    if camera := manifest["camera"]:
        yield "camera", camera_in_words(camera)
    if skipped := skipped_images(manifest):
        yield "skipped", skipped
    if poses := _poses(manifest):
        yield "poses", poses
    yield "nodes", f"{metrics['nodes']}"
    reasons = manifest["null_reasons"]
    yield "silhouette", _value(metrics["silhouette"], reasons.get("silhouette"))
    yield "  time slices", _value(metrics["silhouette_time_slices"], reasons.get("silhouette_time_slices"))
    yield "  true positions", _value(metrics["silhouette_positions"], reasons.get("silhouette_positions"))
    if part := _part(metrics.get("posed"), manifest["frames"], "have a position: silhouettes are over these"):
        yield "  images", part
    yield from _known_again(metrics, reasons)
    if metrics["rooms_ari"] is not None:
        yield "room labels", f"ARI {metrics['rooms_ari']:.3f}, purity {metrics['rooms_purity']:.3f}"
        if part := _part(metrics.get("labelled"), manifest["frames"], "have a label: agreement is over these"):
            yield "  images", part
    shares = {
        "by loop closure": "share_assigned",
        "by a pending node": "share_pending",
        "founding a node": "share_founding",
        "in the retest": "share_retest",
        "forced": "share_forced",
        "unassigned": "share_unassigned",
    }
    yield "images placed", ", ".join(f"{100 * (metrics[name] or 0):.1f} % {words}" for words, name in shares.items())
    if margin := manifest["smallest_margin"]:
        yield "smallest margin", f"{margin['value']:.2g} at frame {margin['frame']} ({margin['gate']})"


def _known_again(metrics: Mapping[str, Any], reasons: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Say what a robot can do with the map, as far as it was judged."""
    if "pair_f1" not in metrics:
        return
    pairs, returns = metrics["pair_f1"], metrics["reentry_f1"]
    split = _percent(metrics["false_merge_share"])
    yield (
        "places",
        f"none: {reasons['pair_f1']}"
        if pairs is None
        else f"F1 {pairs:.3f}: {_percent(metrics['pair_precision'])} of the pairs in one node are within {THETA:g} m, "
        f"{_percent(metrics['pair_recall'])} of those within {THETA:g} m in one node; {split} of nodes in two places",
    )
    yield (
        "returns",
        f"none: {reasons['reentry_f1']}"
        if returns is None
        else f"F1 {returns:.3f}: {_percent(metrics['reentry_precision'])} of re-entries are right, "
        f"{_percent(metrics['reentry_recall'])} of returns to a place are known at once",
    )
    stretch = [metrics[f"stretch_{what}"] for what in ("median", "p5", "p95")]
    yield (
        "ways",
        f"none: {reasons['stretch_median']}"
        if None in stretch
        else "{:.2f} of the true way (90 % from {:.2f} to {:.2f}); far below 1 is through a wall".format(*stretch),
    )


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.0f} %"


def skipped_images(manifest: Mapping[str, Any]) -> str | None:
    """Return how many images a run left out because they were bad, and which; None if it left out none."""
    skipped = manifest.get("skipped")
    if not skipped:
        return None
    return in_words([BadImage(**bad) for bad in skipped], manifest["frames"] + len(skipped))


def _poses(manifest: Mapping[str, Any]) -> str | None:
    """Return what a file of poses was taken for; None if there is none, or nothing to tell."""
    said = (found for found in manifest.get("findings") or () if found["kind"] == "poses-read")
    return next((f"{found['first']}: {found['message']}" for found in said), None)


def _part(known: float | None, frames: int, words: str) -> str | None:
    """Say over how many images metrics are; None if over all, or where it is not known."""
    return f"{known:.0f} of {frames} {words}" if known and known < frames else None


def _value(value: float | int | None, reason: str | None) -> str:
    return f"{value:.4f}" if value is not None else f"none: {reason}"


def configuration_page(
    name: str, source: str, parameters: Mapping[str, Any], camera: Mapping[str, Any] | None = None
) -> str:
    """Return a Markdown page that says what a run replays, through which camera, and with which parameters."""
    rows = [(parameter, str(value)) for parameter, value in parameters.items()]
    seen = f"Camera: {camera_in_words(camera)}\n\n" if camera else ""
    return f"# {name}\n\n`{source}`\n\n{seen}## Parameters\n\n{markdown(('parameter', 'value'), rows)}\n"


def metrics_page(evaluation: Evaluation) -> str:
    """Return a Markdown section that says what the map of a run is worth."""
    reasons = evaluation.reasons
    rows = [(name, f"none: {reasons[name]}" if name in reasons else cell) for name, cell in evaluation.metrics.items()]
    return f"\n## Metrics\n\n{markdown(('metric', 'value'), rows)}\n"


def run_html(folder: Path, manifest: dict[str, Any], steps: pl.DataFrame) -> str:
    """Return a run as a notebook shows it: its summary, where the nodes are, and links to its files."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("omnieval.results"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    status = status_of(manifest)
    width, height, points = _map_points(steps)
    return environment.get_template("run.html.j2").render(
        folder=str(folder),
        status=status,
        mapper=manifest["mapper"]["name"],
        descriptor=manifest["descriptor"]["name"],
        fields=list(summary_fields(manifest)) if status == "complete" else [],
        width=width,
        height=height,
        points=points,
        files=[(path.name, path.as_posix()) for path in sorted(folder.iterdir()) if path.is_file()],
    )


def _map_points(steps: pl.DataFrame) -> tuple[int, int, list[tuple[float, float, str]]]:
    """Return width and height of a picture of the map, pixels, and its points: x, y (downwards), colour of the node."""
    known = steps.drop_nulls(["x", "y"])
    if known.is_empty():
        return 0, 0, []
    positions = known.select("x", "y").to_numpy()
    low, extent = positions.min(axis=0), np.maximum(np.ptp(positions, axis=0), 1.0)
    scale = min(_MAP_WIDTH / extent[0], _MAP_HEIGHT / extent[1])
    places = (positions - low) * scale
    width, height = (extent * scale + 2 * _MAP_BORDER).astype(int).tolist()
    nodes = known["node_final"].fill_null(known["node"]).fill_null(0).to_list()
    return (
        width,
        height,
        [
            (round(x + _MAP_BORDER, 1), round(height - y - _MAP_BORDER, 1), node_color(node))
            for (x, y), node in zip(places.tolist(), nodes, strict=True)
        ],
    )
