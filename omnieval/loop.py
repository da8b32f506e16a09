"""The replay loop: sequence + descriptor + mapper -> steps -> sinks.

The sinks are the run folder (`results`), which is the record, and the Rerun recording (`recording`), which is a view
and may fail without changing any result.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from omnieval.config import Config, resolve
from omnieval.datasets import Sequence, load
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.archive import Archive, save_archive
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import DescribedFrame
from omnieval.descriptors.description import Descriptor
from omnieval.errors import ConfigError, ResultError
from omnieval.imaging.soundness import without_bad
from omnieval.mapping.interface import IncrementalMapper
from omnieval.mapping.mapper import Mapper
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.step import Step
from omnieval.material import Material, archive_material, image_material
from omnieval.metrics.evaluation import Evaluation, evaluate
from omnieval.recording.records import RecordingOptions
from omnieval.results.atomic import replacing
from omnieval.results.provenance import code_digest, dataset_fingerprint, identity, versions
from omnieval.results.run_folder import RECORDING, Run, RunWriter, free_folder
from omnieval.results.tables import nodes_frame, step_row, transitions_frame, with_final_map

if TYPE_CHECKING:
    from omnieval.sinks import RecordingSink

Progress = Callable[[int, int], None]
RUNS = Path("runs")


def replay(
    source: str | Path | Sequence = "synthetic",
    *,
    config: Config | None = None,
    descriptor: Descriptor | None = None,
    mapper: IncrementalMapper | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    skip_bad: bool = False,
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
    mapper
        A new mapper of one's own (`mapping.interface`), which need not heed the parameters of `config`; default
        omnieval's.
    out
        Run folder; default ``runs/<sequence>-<descriptor>[-<n>]``.
    overwrite
        Replace an earlier run in `out`.
    skip_bad
        Leave out images that are not fit for use (`imaging.soundness`) and list them in ``run.json``, instead of
        refusing the sequence.
    recording
        How to record for the Rerun viewer; None records nothing.
    progress
        Called with (frames done, frames in all).

    Raises
    ------
    ConfigError
        If the sequence is shorter than the first node.
    DatasetError
        If the sequence cannot be read, or one of its images is not fit for use: before the first step.
    ResultError
        If the run folder cannot be written.
    """
    config = config or resolve()
    sequence = source if isinstance(source, Sequence) else load(source)
    sequence, left_out = without_bad(sequence) if skip_bad else (sequence, None)
    describing = descriptor or config.make_descriptor()
    with DescriptorCache() as cache:
        material = image_material(sequence, config, describing, cache, left_out=left_out)
        folder = out or free_folder(RUNS, f"{sequence.name}-{describing.name}")
        return run(material, config, folder, mapper=mapper, overwrite=overwrite, recording=recording, progress=progress)


def map_archive(
    file: Path,
    *,
    config: Config | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    recording: RecordingOptions | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run the mapper alone on an archive of descriptors (`descriptors.archive`); see `replay`."""
    config = config or resolve()
    material = archive_material(file)
    folder = out or free_folder(RUNS, f"{material.name}-map")
    return run(material, config, folder, overwrite=overwrite, recording=recording, progress=progress)


def describe_archive(
    sequence: Sequence,
    file: Path,
    *,
    config: Config | None = None,
    descriptor: Descriptor | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Archive:
    """Describe a sequence and write the archive; see `replay` and `descriptors.archive`."""
    claim_file(file, overwrite=overwrite)
    config = config or resolve()
    describing = descriptor or config.make_descriptor()
    described = []
    with DescriptorCache() as cache:
        for one in image_material(sequence, config, describing, cache).described:
            described.append(one.description)
            if progress:
                progress(len(described), len(sequence))
    archive = Archive(
        sequence.frames,
        np.stack([description.position for description in described]),
        np.stack([description.orientation for description in described]),
    )
    with replacing(file) as temporary:
        save_archive(temporary, archive.frames, archive.position, archive.orientation)
    return archive


def claim_file(file: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot or must not be written, before the work of filling it is done.

    Raises
    ------
    ResultError
        If it exists and is not to be overwritten, or has no folder.
    """
    try:
        occupied = file.is_dir() or (file.exists() and not overwrite)
    except OSError as error:
        raise ResultError(f"cannot write {file}: {error.strerror or error}; choose another --out") from error
    if occupied:
        raise ResultError(f"{file} exists; choose another --out or pass --overwrite")
    if not file.parent.is_dir():
        raise ResultError(f"cannot write {file}: there is no folder {file.parent}; make it or choose another --out")


def run(
    material: Material,
    config: Config,
    folder: Path,
    *,
    mapper: IncrementalMapper | None = None,
    overwrite: bool = False,
    recording: RecordingOptions | None = None,
    progress: Progress | None = None,
) -> Run:
    """Map the material, step by step, into a run folder; see `replay`."""
    if isinstance(mapper, Mapper):
        config = config.model_copy(update={"mapper": mapper.config})
    if mapper is None and len(material.frames) < config.mapper.n_init:
        raise ConfigError(
            f"{material.source}: the first node needs n_init = {config.mapper.n_init} images but there are only "
            f"{len(material.frames)}; lower n_init or give a longer sequence"
        )
    method = _method(config, mapper)
    mapper = mapper or Mapper(config.mapper, ImageMemory(threads=os.cpu_count() or 1))
    with RunWriter(folder, _manifest(material, config, method), overwrite=overwrite) as writer:
        sink = None
        try:
            if recording:
                from omnieval.sinks import RecordingSink  # loads Rerun, which nobody else waits for

                sink = RecordingSink(writer.path / RECORDING, material, config, recording)
            return _run(material, config, mapper, method, writer, sink, progress)
        finally:
            if sink:
                sink.close()


@dataclass
class _Trace:
    """What accumulates while a replay runs, besides the steps table."""

    digests: list[str] = field(default_factory=list)
    positions: list[NDArray[np.float32]] = field(default_factory=list)
    milliseconds: list[float] = field(default_factory=list)
    smallest_margin: dict[str, float | int | str] | None = None

    def add(self, described: DescribedFrame, step: Step, milliseconds: float) -> None:
        self.digests.append(described.digest)
        self.positions.append(described.description.position)
        self.milliseconds.append(milliseconds)
        margin = step.margin
        if margin and (self.smallest_margin is None or margin.value < float(self.smallest_margin["value"])):
            self.smallest_margin = {"value": margin.value, "frame": step.frame, "gate": margin.gate}

    def told(self, frames: tuple[Frame, ...], steps: int) -> dict[str, Any]:
        """Return what ``run.json`` says of a run that came to this many steps, which may be fewer than were traced."""
        return {"dataset_fingerprint": dataset_fingerprint(frames[:steps], self.digests[:steps])} if steps else {}


def _run(
    material: Material,
    config: Config,
    mapper: IncrementalMapper,
    method: dict[str, Any],
    writer: RunWriter,
    sink: RecordingSink | None,
    progress: Progress | None,
) -> Run:
    started = time.perf_counter()
    trace = _Trace()
    writer.when_abandoned = lambda: trace.told(material.frames, len(writer.steps()))
    for frame, described, step, milliseconds in _steps(mapper, material):
        trace.add(described, step, milliseconds)
        writer.step(step_row(step, frame, milliseconds))
        if sink:
            sink.step(step, frame, milliseconds)
        if progress:
            progress(step.frame + 1, len(material.frames))
    final = mapper.finish()
    rooms = [frame.room for frame in material.frames]
    evaluation = evaluate(
        final.labels,
        final.placements,
        material.positions,
        rooms=rooms,
        seed=config.mapper.seed,
        unposed=material.unposed,
    )
    seconds = time.perf_counter() - started
    steps = with_final_map(writer.steps(), final)
    tables = {
        "steps": steps,
        "nodes": nodes_frame(steps, final, np.stack(trace.positions)),
        "transitions": transitions_frame(final),
    }
    run = writer.finish(tables, _outcome(material, method, trace, evaluation, seconds))
    if sink is None:
        return run
    # Only now, when nothing that happens to the view can touch the record any more.
    sink.finish(final, evaluation)
    sink.close()
    return writer.annotate({"recording_failure": sink.failure})


def _steps(mapper: IncrementalMapper, material: Material) -> Iterator[tuple[Frame, DescribedFrame, Step, float]]:
    """Yield every frame with its step and the time it took, in milliseconds."""
    for block in blocks(zip(material.frames, material.described, strict=True), AHEAD):
        before = time.perf_counter()
        if isinstance(mapper, Mapper):
            mapper.expect([described.description for _, described in block])
        ahead = (time.perf_counter() - before) / max(1, len(block))
        for frame, described in block:
            before = time.perf_counter()
            step = mapper.step(described.description)
            yield frame, described, step, 1e3 * (time.perf_counter() - before + ahead)


def _method(config: Config, mapper: IncrementalMapper | None) -> dict[str, Any]:
    """Return what determines the decisions: the parameters, or the name of a mapper that need not heed them."""
    if mapper is None or isinstance(mapper, Mapper):
        return config.mapper.model_dump(mode="json")
    return {"class": f"{type(mapper).__module__}.{type(mapper).__qualname__}"}


def _manifest(material: Material, config: Config, method: dict[str, Any]) -> dict[str, Any]:
    """Return what ``run.json`` says when the run begins."""
    return {
        "source": material.source,
        **material.about,
        "frames": len(material.frames),
        "descriptor": material.descriptor,
        "orientation_cells": material.cells,
        "mapper": method.get("class", "omnieval"),
        "configuration": config.model_dump(mode="json"),
        "versions": versions(),
        "code": code_digest(),
    }


def _outcome(
    material: Material, method: dict[str, Any], trace: _Trace, evaluation: Evaluation, seconds: float
) -> dict[str, Any]:
    """Return what ``run.json`` says besides when the run is complete."""
    fingerprint = dataset_fingerprint(material.frames, trace.digests)
    determining = {"mapper": method, **material.determining}
    return {
        "dataset_fingerprint": fingerprint,
        "identity": identity(determining, fingerprint),
        "metrics": evaluation.metrics,
        "null_reasons": evaluation.reasons,
        "smallest_margin": trace.smallest_margin,
        "cache": {"hits": cache.hits, "misses": cache.misses, "note": cache.note}
        if (cache := material.cache)
        else None,
        "timings": {
            "seconds": seconds,
            "frames_per_second": len(material.frames) / seconds,
            "step_milliseconds_median": statistics.median(trace.milliseconds),
            "step_milliseconds_max": max(trace.milliseconds),
        },
    }
