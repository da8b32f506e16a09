"""The replay loop: sequence + descriptor + mapper -> steps -> sinks.

The sinks are the run folder (`results`), which is the record, and the Rerun recording (`recording`), which is a view
and can fail without changing any result.
"""

from __future__ import annotations

import statistics
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.config import Config, resolve
from omnieval.datasets import Sequence, load
from omnieval.datasets.sequence import Frame
from omnieval.descriptors import make_descriptor
from omnieval.descriptors.archive import load_archive
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import DescribedFrame, Describer
from omnieval.descriptors.description import Descriptor
from omnieval.errors import ConfigError, OmnievalError
from omnieval.imaging.camera import resolve_camera
from omnieval.imaging.pictures import Pictures
from omnieval.mapping.mapper import Mapper
from omnieval.mapping.step import FinalMap, Step
from omnieval.metrics.evaluation import Evaluation, evaluate
from omnieval.recording.options import RecordingOptions
from omnieval.results.provenance import code_digest, dataset_fingerprint, identity, versions
from omnieval.results.run_folder import RECORDING, Run, RunWriter, free_folder
from omnieval.results.tables import nodes_frame, step_row, transitions_frame, with_final_map

Progress = Callable[[int, int], None]
RUNS = Path("runs")


@dataclass(frozen=True)
class Material:
    """What is replayed, whether it comes from images or from descriptors computed elsewhere."""

    name: str
    source: str
    frames: tuple[Frame, ...]
    positions: NDArray[np.float64] | None
    described: Iterable[DescribedFrame]
    determining: dict[str, Any]
    """All settings besides the mapper's that determine the result; part of the run's identity."""
    about: dict[str, Any]
    """What else ``run.json`` says of it."""
    pictures: Pictures | None = None


@dataclass
class _Trace:
    """What accumulates while a replay runs."""

    digests: list[str] = field(default_factory=list)
    positions: list[NDArray[np.float32]] = field(default_factory=list)
    milliseconds: list[float] = field(default_factory=list)
    margin: tuple[float, int, str] | None = None

    def add(self, described: DescribedFrame, step: Step, milliseconds: float) -> None:
        self.digests.append(described.digest)
        self.positions.append(described.description.position)
        self.milliseconds.append(milliseconds)
        if step.margin and (self.margin is None or step.margin.value < self.margin[0]):
            self.margin = (step.margin.value, step.frame, step.margin.gate)


def replay(
    source: str | Path | Sequence = "synthetic",
    *,
    config: Config | None = None,
    descriptor: Descriptor | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    recording: RecordingOptions | None = None,
    progress: Progress | None = None,
) -> Run:
    """Replay the mapping method over a sequence and keep the evidence of every decision.

    Parameters
    ----------
    source
        A source as on the command line, or a sequence.
    config
        Parameters; default `recommended`.
    descriptor
        A descriptor of one's own; default the one `config` names.
    out
        Run folder; default ``runs/<sequence>-<descriptor>[-<n>]``.
    overwrite
        Replace an earlier run in `out`.
    recording
        How to record for the Rerun viewer; None records nothing.
    progress
        Called with (frames done, frames in all).

    Raises
    ------
    ConfigError
        If the sequence is shorter than the first node.
    DatasetError
        If the sequence or one of its images cannot be read.
    ResultError
        If the run folder cannot be written.
    """
    config = config or resolve()
    sequence = source if isinstance(source, Sequence) else load(source)
    describing = descriptor or make_descriptor(config)
    with DescriptorCache() as cache:
        material = _material(sequence, config, describing, cache)
        folder = out or free_folder(RUNS, f"{sequence.name}-{describing.name}")
        return run(material, config, folder, overwrite=overwrite, recording=recording, progress=progress)
