"""The replay loop: sequence + descriptor + mapper -> steps -> sinks.

The sinks are the run folder (`results`), which is the record, and the Rerun recording (`recording`), which is a view
and may fail without changing any result.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.components.component import Component
from omnieval.config import Config, as_config
from omnieval.cores import allotted
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.errors import ConfigError, ResultError
from omnieval.mapping.interface import BranchingMapper, Mapper, Method
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import FinalMap, Step
from omnieval.material.continued import opened_after
from omnieval.material.material import Material
from omnieval.material.opening import opened
from omnieval.material.source import ARCHIVE, Cut, Source, with_poses
from omnieval.metrics.evaluation import Evaluation, evaluate
from omnieval.metrics.ground import THETAS, Ground
from omnieval.metrics.quality import Making
from omnieval.recording import RecordingOptions
from omnieval.results.map_file import MapWriter
from omnieval.results.provenance import code_digest, dataset_fingerprint, identity, versions
from omnieval.results.run_folder import RECORDING, Run, RunWriter, free_folder, open_run
from omnieval.results.tables import (
    nodes_frame,
    quality_frame,
    read_steps,
    step_row,
    transitions_frame,
    with_final_map,
)

if TYPE_CHECKING:
    from omnieval.sinks import RecordingSink

Progress = Callable[[int, int], None]
RUNS = Path("runs")
_MADE_BY = ("sequence", "source", "cut", "descriptor", "mapper", "imaging", "camera", "continues")
"""What a map says of the run that made it, as ``run.json`` says it."""


def replay(
    source: Source = "synthetic",
    *,
    mapper: Any = None,
    descriptor: Any = None,
    config: Config | Mapping[str, Any] | None = None,
    preset: str | None = None,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    skip_bad: bool = False,
    recording: RecordingOptions | bool | None = None,
    save_map: bool = True,
    continuing: Run | str | Path | None = None,
    evidence: bool = True,
    progress: Progress | None = None,
    **parameters: Any,
) -> Run:
    """Replay a mapper over a sequence and keep the evidence of every decision.

    Parameters
    ----------
    source
        A source as on the command line, or a sequence.
    mapper, descriptor
        What maps, and what describes the images: a name, ``package.module:Class``, ``path/file.py:Class``, a class, or
        an object; default the paper's method and HOG, or what `config` chooses.
    config
        Parameters by name, or a configuration.
    preset
        Named parameters of the mapper.
    poses, poses_tolerance, poses_interpolate
        Where the images were taken; see `datasets.registry.posed_source`.
    start, stride, limit
        Which frames of the source.
    out
        Run folder; default ``runs/<sequence>-<descriptor>[-<mapper>][-<n>]``.
    overwrite
        Replace an earlier run in `out`.
    skip_bad
        Leave out images that are not fit for use (`imaging.soundness`) and list them in ``run.json``, instead of
        refusing the sequence.
    recording
        Whether, or how, to record for the Rerun viewer.
    save_map
        Whether to keep the map with the descriptions of its images, in which others can be localised.
    continuing
        A run, or its folder, whose map is continued: its images are mapped again, from the map, and the sequence
        follows on them, as if both had been one. The run brings mapper, descriptor and imaging, so that none of these
        is given.
    evidence
        Whether to keep what was compared at every step. Without it a mapper that can decide by bounds on what it
        compares (`BranchingMapper.screens`) comes to the same decisions faster; what it was near to is not known.
    progress
        Called with (frames done, frames in all).
    **parameters
        Parameters by name, such as ``omega=1.85``.

    Raises
    ------
    ConfigError
        If a parameter is wrong, there is no such component, evidence cannot be left out, or the sequence is too short
        for the mapper.
    DatasetError
        If the sequence cannot be read, or one of its images is not fit for use: before the first step.
    ResultError
        If the run folder cannot be written, or the map cannot continue with the sequence.
    """
    earlier = None if continuing is None else continuing if isinstance(continuing, Run) else open_run(continuing)
    if earlier is None:
        resolved = as_config(config, preset=preset, mapper=mapper, descriptor=descriptor, **parameters)
    else:
        given = (config, preset, mapper, descriptor, parameters or None)
        resolved = _continued_config(earlier, out, given=any(one is not None for one in given))
    options = RecordingOptions() if recording is True else recording or None
    source = with_poses(source, poses, poses_tolerance, poses_interpolate)
    cut = Cut(start, stride, limit)
    with (
        opened(source, resolved, cut, skip_bad=skip_bad)
        if earlier is None
        else opened_after(earlier, source, cut, skip_bad=skip_bad)
    ) as material:
        name = run_name(material.name, material.descriptor, resolved.mapper)
        folder = Path(out) if out is not None else free_folder(RUNS, name)
        return run(
            material,
            resolved,
            folder,
            overwrite=overwrite,
            recording=options,
            save_map=save_map,
            evidence=evidence,
            progress=progress,
        )


def _continued_config(earlier: Run, out: str | Path | None, *, given: bool) -> Config:
    """Return the configuration that continues the map of a run.

    Raises
    ------
    ConfigError
        If something else was given, or its folder is to be written.
    ResultError
        If its mapper cannot be made again as it was.
    """
    if given:
        raise ConfigError(
            f"the map of {earlier.folder} continues with its own mapper, descriptor and imaging; leave parameters out, "
            "or map both sequences from the start"
        )
    if out is not None and Path(out).expanduser().resolve() == earlier.folder.resolve():
        raise ConfigError(f"{earlier.folder} is the run whose map is continued; choose another --out")
    config = earlier.config
    return replace(config, mapper=config.mapper.again())


def run_name(sequence: str, descriptor: Component, mapper: Component) -> str:
    """Return what the folder of a run is called: the sequence, what describes it, and a mapper that is not the default.

    An archive does not say which descriptor made it: ``map`` is put in its place.
    """
    described = "map" if descriptor == ARCHIVE else descriptor.name
    return "-".join([sequence, described, *([] if mapper.is_default else [mapper.name])])


def run(
    material: Material,
    config: Config,
    folder: Path,
    *,
    overwrite: bool = False,
    recording: RecordingOptions | None = None,
    save_map: bool = True,
    evidence: bool = True,
    progress: Progress | None = None,
) -> Run:
    """Map the material, step by step, into a run folder; see `replay`."""
    if recording and not evidence:
        raise ConfigError("a recording shows the evidence of every step; leave out either of them")
    mapper = made_mapper(config.mapper, evidence=evidence)
    if fault := too_short(mapper, len(material.frames)):
        raise ConfigError(f"{material.source}: {fault}")
    method = Method.of(mapper, config.mapper.name, config.mapper.settings)
    with RunWriter(folder, _manifest(material, config, method, evidence=evidence), overwrite=overwrite) as writer:
        trace = _Trace()
        sink = None
        try:
            if recording:
                from omnieval.sinks import RecordingSink  # loads Rerun, which nobody else waits for

                sink = RecordingSink(writer.path / RECORDING, material, method, recording)
            with MapWriter(writer.path) if save_map else nullcontext() as atlas:
                return _run(material, config, mapper, writer, trace, atlas, sink, progress)
        finally:
            if sink:
                sink.close()


def made_mapper(component: Component, *, evidence: bool = True) -> Mapper:
    """Return a new mapper, which compares images on all processors if it can.

    Raises
    ------
    ConfigError
        If it is to leave its evidence out, and cannot.
    """
    branching = component.given is None and issubclass(component.cls, BranchingMapper)
    if not evidence and not (branching and component.cls.screens):
        raise ConfigError(f"the mapper {component.name} decides by its evidence, which cannot be left out")
    memory = ImageMemory(threads=allotted(), screening=not evidence)
    mapper: Mapper = component.make(**({"images": memory} if branching else {}))
    return mapper


def mapped(component: Component, descriptions: Iterable[Description]) -> Mapper:
    """Return a new mapper that has mapped some images."""
    mapper = made_mapper(component)
    expect = getattr(mapper, "expect", None)
    for block in blocks(descriptions, AHEAD):
        if expect:
            expect(block)
        for description in block:
            mapper.step(description)
    return mapper


def too_short(mapper: Any, images: int) -> str | None:
    """Say why so many images are too few for a mapper, if it says so."""
    ask: Callable[[int], str | None] = getattr(mapper, "too_short", lambda images: None)
    return ask(images)


@dataclass
class _Trace:
    """What accumulates while a replay runs, besides the steps table."""

    digests: list[str] = field(default_factory=list)
    positions: list[NDArray[np.float32]] = field(default_factory=list)
    orientation_values: int = 0
    judging: float = 0.0
    milliseconds: list[float] = field(default_factory=list)
    smallest_margin: dict[str, float | int | str] | None = None

    def add(self, described: DescribedFrame, step: Step, milliseconds: float) -> None:
        self.digests.append(described.digest)
        self.positions.append(described.description.position)
        self.orientation_values = described.description.orientation.size
        self.milliseconds.append(milliseconds)
        margin = step.margin
        if margin and (self.smallest_margin is None or margin.value < float(self.smallest_margin["value"])):
            self.smallest_margin = {"value": margin.value, "frame": step.frame, "gate": margin.gate}

    def told(self, frames: tuple[Frame, ...], steps: int) -> dict[str, Any]:
        """Return what ``run.json`` says of a run with this many steps, which may be fewer than were traced."""
        return {"dataset_fingerprint": dataset_fingerprint(frames[:steps], self.digests[:steps])} if steps else {}


def _run(
    material: Material,
    config: Config,
    mapper: Mapper,
    writer: RunWriter,
    trace: _Trace,
    atlas: MapWriter | None,
    sink: RecordingSink | None,
    progress: Progress | None,
) -> Run:
    started = time.perf_counter()
    partition = Partition()
    writer.when_abandoned = lambda: trace.told(material.frames, len(writer.steps()))
    earlier = material.earlier
    before = iter(()) if earlier is None else read_steps(earlier.run.steps, ())
    for frame, described, step, milliseconds in _steps(mapper, material):
        if earlier and (recorded := next(before, None)):
            hold_decision(step, recorded[0], str(earlier.run.folder))
        partition.apply(step)
        trace.add(described, step, milliseconds)
        writer.step(step_row(step, frame, partition, milliseconds))
        if atlas:
            atlas.add(described.description)
        if sink:
            sink.step(step, frame, milliseconds)
        if progress:
            progress(step.frame + 1, len(material.frames))
    final = mapper.finish()
    steps = with_final_map(writer.steps(), final)
    positions = np.stack(trace.positions)
    judging = time.perf_counter()
    evaluation = _judged(final, steps, positions, material, trace, config.seed)
    trace.judging = time.perf_counter() - judging
    seconds = time.perf_counter() - started
    tables = {
        "steps": steps,
        "nodes": nodes_frame(steps, final, positions),
        "transitions": transitions_frame(final),
        "quality": quality_frame(evaluation.measures),
    }
    outcome = _outcome(material, config.mapper, trace, evaluation, seconds, writer.content.get("evidence", True))
    if atlas:
        made_by = {name: writer.content[name] for name in _MADE_BY if name in writer.content}
        atlas.finish(final, steps, {**made_by, "run": outcome["identity"]})
    run = writer.finish(tables, outcome)
    if sink is None:
        return run
    # Only now, when nothing that happens to the view can touch the record any more.
    sink.finish(final, evaluation)
    sink.close()
    return writer.annotate({"recording_failure": sink.failure})


def hold_decision(step: Step, recorded: Step, where: str) -> None:
    """Refuse a decision that is made again and differs.

    Parameters
    ----------
    step
        What was decided now.
    recorded
        What the table of a run says of it.
    where
        What to call the run.

    Raises
    ------
    ResultError
        If verdict, node or match are others.
    """
    if (step.verdict, step.node, step.match) != (recorded.verdict, recorded.node, recorded.match):
        raise ResultError(
            f"step {step.frame} of {where} is decided differently now: {recorded.verdict} became {step.verdict}; "
            "its images, the machine or a library may have changed, so replay the sequence again"
        )


def _judged(
    final: FinalMap,
    steps: pl.DataFrame,
    descriptors: NDArray[np.float32],
    material: Material,
    trace: _Trace,
    seed: int,
) -> Evaluation:
    times = [frame.time_ns for frame in material.frames]
    ground = None if material.positions is None else Ground(material.positions, times)
    online = steps["node"].fill_null(0).cast(pl.Int64).to_numpy()
    return evaluate(
        final.labels,
        final.placements,
        material.positions,
        rooms=[frame.room for frame in material.frames],
        seed=seed,
        unposed=material.unposed,
        times=times,
        making=Making.of_mapper(final, online, descriptors, trace.orientation_values, ground),
        thetas=THETAS,
        ground=ground,
    )


def _steps(mapper: Mapper, material: Material) -> Iterator[tuple[Frame, DescribedFrame, Step, float]]:
    """Yield every frame with its step and the time it took, in milliseconds."""
    expect = getattr(mapper, "expect", None)
    for block in blocks(zip(material.frames, material.described, strict=True), AHEAD):
        before = time.perf_counter()
        if expect:
            expect([described.description for _, described in block])
        ahead = (time.perf_counter() - before) / max(1, len(block))
        for frame, described in block:
            before = time.perf_counter()
            step = mapper.step(described.description)
            yield frame, described, step, 1e3 * (time.perf_counter() - before + ahead)


def _manifest(material: Material, config: Config, method: Method, *, evidence: bool) -> dict[str, Any]:
    """Return what ``run.json`` says when the run begins."""
    return {
        **material.about,
        "mapper": {**config.mapper.about, **method.about},
        "imaging": config.imaging.model_dump(mode="json"),
        "versions": versions(),
        "code": code_digest(),
        **({} if evidence else {"evidence": False}),
    }


def _outcome(
    material: Material, mapper: Component, trace: _Trace, evaluation: Evaluation, seconds: float, evidence: bool
) -> dict[str, Any]:
    """Return what ``run.json`` says besides when the run is complete."""
    fingerprint = dataset_fingerprint(material.frames, trace.digests)
    determining = {"mapper": mapper.identity, **material.determining, **({} if evidence else {"evidence": False})}
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
            "judging_seconds": trace.judging,
            "upkeep_ms_mean": statistics.fmean(trace.milliseconds),
            "upkeep_ms_median": statistics.median(trace.milliseconds),
            "upkeep_ms_p99": float(np.percentile(trace.milliseconds, 99)),
        },
    }
