"""A run in a few lines for people."""

from __future__ import annotations

from collections.abc import Iterator

from omnieval.results.run_folder import Run


def summary_fields(run: Run) -> Iterator[tuple[str, str]]:
    """Yield (name, value) pairs that say what a run came to."""
    manifest, metrics = run.manifest, run.metrics
    timings = manifest["timings"]
    yield "source", manifest["source"]
    yield "frames", f"{manifest['frames']} in {timings['seconds']:.1f} s ({timings['frames_per_second']:.0f} frames/s)"
    yield "nodes", f"{metrics['nodes']}"
    reasons = manifest["null_reasons"]
    yield "silhouette", _value(metrics["silhouette"], reasons.get("silhouette"))
    yield "  time slices", _value(metrics["silhouette_time_slices"], reasons.get("silhouette_time_slices"))
    yield "  true positions", _value(metrics["silhouette_positions"], reasons.get("silhouette_positions"))
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


def _value(value: float | int | None, reason: str | None) -> str:
    return f"{value:.4f}" if value is not None else f"none: {reason}"
