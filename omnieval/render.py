"""The recording of a run again, from its tables and images.

The tables say what was decided; nothing is decided here. Only the similarity curves, which they do not hold, are
computed again from the descriptions, and checked against the best match that the tables name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from omnieval.config import Config
from omnieval.datasets import load
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import Description, Descriptor
from omnieval.errors import ResultError
from omnieval.imaging.soundness import without_bad
from omnieval.mapping.matching import match_image
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Step
from omnieval.material import ARCHIVE_SCHEME, Material, archive_material, image_material
from omnieval.metrics.evaluation import Evaluation
from omnieval.recording.records import RecordingOptions
from omnieval.results.run_folder import Run
from omnieval.results.tables import final_map, step_from_row
from omnieval.sinks import RecordingSink


def render(
    run: Run,
    options: RecordingOptions | None = None,
    *,
    descriptor: Descriptor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write the recording of a run anew and return where it is.

    Parameters
    ----------
    run
        A complete or interrupted run.
    options
        How to record.
    descriptor
        The descriptor of the run if it was one's own.
    progress
        Called with (steps done, steps in all).

    Raises
    ------
    DatasetError
        If the sequence is no longer where the run found it.
    ResultError
        If it has changed since, or the recording cannot be written.
    """
    config = Config.model_validate(run.manifest["configuration"])
    with DescriptorCache() as cache:
        material = _material(run, config, descriptor, cache)
        sink = RecordingSink(run.recording, material, config, options or RecordingOptions())
        try:
            _record_steps(run, material, config, sink, progress)
            if run.status == "complete":
                evaluation = Evaluation(run.metrics, run.manifest["null_reasons"])
                sink.finish(final_map(run.steps, run.nodes), evaluation)
        finally:
            sink.close()
    if sink.failure:
        raise ResultError(f"the recording {run.recording} is incomplete: {sink.failure}")
    return run.recording


class StepBuilder:
    """Makes whole steps of table rows again, in their order."""

    def __init__(self, config: Config) -> None:
        self._images = ImageMemory()
        self._partition = Partition()
        self._prominence_mean = config.mapper.prominence_mean

    def build(self, row: dict[str, Any], description: Description) -> Step:
        """Return the step of a row with its match.

        Raises
        ------
        ResultError
            If the description leads to another best match than the row names.
        """
        frame = self._images.append(description)
        step = step_from_row(row)
        if row["best_frame"] is not None and step.gate is not None:
            labels = self._partition.labels
            members = {int(node): np.flatnonzero(labels == node) for node in np.unique(labels[labels > 0])}
            match = match_image(
                self._images, frame, members, step.gate.candidates.tolist(), prominence_mean=self._prominence_mean
            )
            if match.best_frame != row["best_frame"]:
                raise ResultError(
                    f"step {frame}: the best match is image {match.best_frame}, the run found {row['best_frame']}; "
                    "the images or the descriptor have changed since, so replay the sequence again"
                )
            step = dataclasses.replace(step, match=match)
        self._partition.apply(step)
        return step


def _record_steps(
    run: Run,
    material: Material,
    config: Config,
    sink: RecordingSink,
    progress: Callable[[int, int], None] | None,
) -> None:
    steps = run.steps
    builder = StepBuilder(config)
    # An interrupted run has fewer rows than the sequence has frames.
    for row, frame, described in zip(steps.iter_rows(named=True), material.frames, material.described, strict=False):
        if row["file"] != frame.file:
            raise ResultError(
                f"step {row['frame']} of {run.folder} is of {row['file']}, the sequence has {frame.file} there; "
                "it has changed since, so replay it again"
            )
        sink.step(builder.build(row, described.description), frame, row["milliseconds"])
        if progress:
            progress(row["frame"] + 1, len(steps))


def _material(run: Run, config: Config, descriptor: Descriptor | None, cache: DescriptorCache) -> Material:
    source: str = run.manifest["source"]
    if source.startswith(ARCHIVE_SCHEME):
        return archive_material(Path(source.removeprefix(ARCHIVE_SCHEME)))
    sequence = load(source).cut(**run.manifest["cut"])
    if "skipped" in run.manifest:
        sequence, _ = without_bad(sequence)
    return image_material(sequence, config, descriptor or config.make_descriptor(), cache)
