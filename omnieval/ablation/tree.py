"""Jobs that map the same images are run as one tree: what they have in common is computed once (`mapping.sweep`).

Every row is that of an independent replay, to the bit, but for its seconds.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from omnieval.ablation.jobs import Described, Job, failed_row
from omnieval.errors import ResultError
from omnieval.mapping.interface import BranchingMapper, Column
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import FinalMap, Margin, Step, smallest_margin
from omnieval.mapping.sweep import Interval, Outcome, Points, Sweep
from omnieval.metrics.evaluation import Evaluation, evaluate
from omnieval.metrics.ground import Ground
from omnieval.metrics.quality import Making
from omnieval.results.atomic import write_table
from omnieval.results.tables import step_row, steps_frame, with_final_map
from omnieval.source_code import digest_of

_Mapped = tuple[str, FinalMap, NDArray[np.int64], float]
"""Which job's map it is, the map, the node of each image after its own step, and the seconds."""

LARGEST = 64
"""Most jobs of one tree: if a process is killed, no more than these are lost; sharing among more saves little."""


def plant(jobs: Sequence[Job], keys: Sequence[str], processes: int) -> list[list[Job]]:
    """Divide jobs into trees so that all are done soonest; the largest come first.

    Parameters
    ----------
    jobs
        In the order of the grid.
    keys
        What the descriptions of each job's images depend on; jobs of one tree have equal keys.
    processes
        How many trees are grown at a time.
    """
    families: dict[Any, list[Job]] = {}
    for job, key in zip(jobs, keys, strict=True):
        mapper = job.config.mapper
        swept = mapper.cls.swept if issubclass(mapper.cls, BranchingMapper) and not job.span else None
        rest = {name: value for name, value in mapper.settings.items() if name not in (swept or ())}
        # A mapper that cannot branch, and an interval, are trees of their own.
        own = job.number if swept is None else None
        families.setdefault((key, digest_of({**mapper.identity, "settings": rest}), own), []).append(job)
    largest = max(map(len, families.values()), default=0)
    # Pieces of a family share nothing, so the fewest that keep all processes busy to the end.
    plans = [_pieces_of(families.values(), pieces) for pieces in range(1, min(processes, largest) + 1)] or [[]]
    return min(plans, key=lambda trees: max((sum(map(weight, own)) for own in shares(trees, processes)), default=0.0))


def _pieces_of(families: Iterable[Sequence[Job]], pieces: int) -> list[list[Job]]:
    trees = [
        list(tree)
        for family in families
        for tree in np.array_split(np.array(family, object), max(min(pieces, len(family)), -(-len(family) // LARGEST)))
    ]
    return sorted(trees, key=weight, reverse=True)


def weight(tree: Sequence[Job]) -> float:
    """Return about how long a tree takes, in no unit.

    A mapper compares with more images the more it has seen. Of what one more job of a tree does, about nine tenths are
    shared; of an interval three passes are taken for granted, for nobody knows its pieces before.
    """
    images = tree[0].input.images
    passes = 3.0 if tree[0].span else 1 + (len(tree) - 1) / 10
    return passes * images * math.sqrt(images)


def shares(trees: Sequence[list[Job]], count: int) -> list[list[list[Job]]]:
    """Divide trees, largest first, among so many that work at a time: the next one always to who has least to do."""
    loads = [(0.0, number) for number in range(count)]
    found: list[list[list[Job]]] = [[] for _ in loads]
    for tree in trees:
        load, number = heapq.heappop(loads)
        found[number].append(tree)
        heapq.heappush(loads, (load + weight(tree), number))
    return found


def grow(
    jobs: Sequence[Job], described: Described, steps_files: Mapping[int, Path], in_map: Described | None = None
) -> list[dict[str, Any]]:
    """Run the jobs of one tree and return their rows, all but `batch_silhouette`; a job that fails has its error.

    Parameters
    ----------
    jobs
        What to run.
    described
        Their images.
    steps_files
        Where to keep decision traces (`schemas.steps_schema`), by job.
    in_map
        Images in whose map theirs are also looked for; None if there are none.
    """
    with threadpool_limits(1):  # so that nothing depends on how many jobs run beside this one
        try:
            rows = list(_rows(jobs, described, steps_files))
            return rows if in_map is None else [_with_found(row, jobs, described, in_map) for row in rows]
        except Exception as error:
            if len(jobs) == 1:
                return [failed_row(jobs[0], error)]
    # What failed is found by running them one by one.
    return [row for job in jobs for row in grow([job], described, steps_files, in_map)]


def _with_found(row: dict[str, Any], jobs: Sequence[Job], described: Described, in_map: Described) -> dict[str, Any]:
    """Return the row of a job with the metrics of looking for its images in the map of others."""
    if row["error"] is not None:
        return row
    from omnieval.ablation.finding import found_in

    job = next(job for job in jobs if job.number == row["job"])
    assert job.input.in_map is not None
    return {**row, "map": job.input.in_map.name, **found_in(job.config.mapper, in_map, described)}


@dataclass
class _Traces:
    """What accumulates of each job's settings while a sweep runs; settings are known by their text."""

    described: Described
    kept: frozenset[str]
    margins: dict[str, tuple[Margin, int]] = field(default_factory=dict)
    partitions: dict[str, Partition] = field(default_factory=dict)
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def add(self, key: str, settings: Any, step: Step, milliseconds: float) -> None:
        margin = smallest_margin(step.comparisons, settings)
        smallest = self.margins.get(key)
        if margin and (smallest is None or margin.value < smallest[0].value):
            self.margins[key] = margin, step.frame
        if key in self.kept:
            partition = self.partitions.setdefault(key, Partition())
            partition.apply(step)
            own = step if settings is None else step.seen_by(settings)
            row = step_row(own, self.described.frames[step.frame], partition, milliseconds)
            self.rows.setdefault(key, []).append(row)

    def margin(self, key: str) -> dict[str, Any]:
        if key not in self.margins:
            return {}
        margin, frame = self.margins[key]
        return {
            "smallest_margin": margin.value,
            "smallest_margin_frame": frame,
            "smallest_margin_gate": margin.gate,
        }


def _rows(jobs: Sequence[Job], described: Described, steps_files: Mapping[int, Path]) -> Iterator[dict[str, Any]]:
    if jobs[0].span:
        yield from _pieces(jobs[0], described)
        return
    of: dict[str, list[Job]] = {}
    for job in jobs:
        of.setdefault(_key(job), []).append(job)
    traces = _Traces(described, frozenset(_key(job) for job in jobs if job.number in steps_files))
    judged = _Judge(described)
    branching = issubclass(jobs[0].config.mapper.cls, BranchingMapper)
    for key, final, online, seconds in (_swept if branching else _alone)(
        {key: some[0] for key, some in of.items()}, traces
    ):
        for job in of[key]:
            metrics, judging = judged(final, online, job.config.seed)
            row = job.origin | metrics | traces.margin(key)
            row |= {"seconds": seconds + judging, "error": None}
            columns = getattr(job.config.mapper.cls, "columns", ())
            yield _kept(job, row, traces.rows.get(key), columns, final, steps_files.get(job.number))


def _key(job: Job) -> str:
    return digest_of(job.config.mapper.identity)


def _swept(of: Mapping[str, Job], traces: _Traces) -> Iterator[_Mapped]:
    """Map with many settings of one mapper, in a tree; yield the final map of each, and the seconds it took."""
    mapper = next(iter(of.values())).config.mapper.cls
    settings = {key: job.config.mapper.typed_settings for key, job in of.items()}
    keys = {id(one): key for key, one in settings.items()}
    sweep = Sweep(mapper, [Points(tuple(settings.values()))])
    before = time.perf_counter()
    for taken in sweep.steps(traces.described.descriptions):
        milliseconds = 1e3 * (time.perf_counter() - before) / len(taken)
        for points, step in taken:
            for one in points.settings:
                traces.add(keys[id(one)], one, step, milliseconds)
        before = time.perf_counter()
    for outcome in sweep.finish():
        for one in outcome.region.settings:
            yield keys[id(one)], outcome.final, outcome.online, outcome.seconds


def _alone(of: Mapping[str, Job], traces: _Traces) -> Iterator[_Mapped]:
    """Map with a mapper that does not branch, one setting after the other; see `_swept`."""
    for key, job in of.items():
        mapper = job.config.mapper.fresh()
        expect = getattr(mapper, "expect", None)
        online: list[int] = []
        started = time.perf_counter()
        for block in blocks(traces.described.descriptions, AHEAD):
            if expect:
                expect(block)
            for description in block:
                before = time.perf_counter()
                step = mapper.step(description)
                online.append(step.node or 0)
                traces.add(key, None, step, 1e3 * (time.perf_counter() - before))
        final = mapper.finish()
        yield key, final, np.array(online, np.int64), time.perf_counter() - started


def _kept(
    job: Job,
    row: dict[str, Any],
    steps: list[dict[str, Any]] | None,
    columns: Sequence[Column],
    final: FinalMap,
    file: Path | None,
) -> dict[str, Any]:
    """Keep the decision trace of a job, if asked for, and return its row."""
    if file is None or steps is None:
        return row
    try:
        write_table(with_final_map(steps_frame(steps, columns), final), file)
    except ResultError as error:
        return failed_row(job, error)
    return row


def _pieces(job: Job, described: Described) -> Iterator[dict[str, Any]]:
    """Yield a row for every piece of an interval on which the map is the same."""
    assert job.span is not None
    name, first, last = job.span.name, job.span.first, job.span.last
    mapper = job.config.mapper
    whole = Interval(mapper.typed_settings, name, first, float(np.nextafter(last, np.inf)))
    sweep = Sweep(mapper.cls, [whole])
    for _ in sweep.steps(described.descriptions):
        pass
    judged = _Judge(described)
    for outcome, low, high in _joined(sweep.finish()):
        metrics, seconds = judged(outcome.final, outcome.online, job.config.seed)
        yield (
            job.origin
            | metrics
            | {
                name: low,
                "exact": name,
                "exact_from": low,
                "exact_to": min(high, last),
                "seconds": outcome.seconds + seconds,
                "error": None,
            }
        )


def _joined(outcomes: Iterable[Outcome[Interval]]) -> Iterator[tuple[Outcome[Interval], float, float]]:
    """Yield the pieces of an interval, neighbours with the same map as one."""

    def came_to(outcome: Outcome[Interval]) -> tuple[Any, ...]:
        return outcome.final.labels.tolist(), outcome.final.placements, outcome.online.tolist()

    ordered = sorted(outcomes, key=lambda outcome: outcome.region.low)
    for _, group in groupby(ordered, key=came_to):
        pieces = list(group)
        yield pieces[0], pieces[0].region.low, pieces[-1].region.high


class _Judge:
    """Evaluates final maps, equal ones once."""

    def __init__(self, described: Described) -> None:
        self._described = described
        self._ground = None if described.positions is None else Ground(described.positions, described.times)
        self._known: dict[Any, Evaluation] = {}

    def __call__(self, final: FinalMap, online: NDArray[np.int64], seed: int) -> tuple[dict[str, Any], float]:
        """Return the metrics of a map and the seconds they took."""
        started = time.perf_counter()
        key = final.labels.tobytes(), final.placements, final.representatives.tobytes(), online.tobytes(), seed
        if key not in self._known:
            images, ground = self._described, self._ground
            descriptors = images.descriptions
            self._known[key] = evaluate(
                final.labels,
                final.placements,
                images.positions,
                rooms=images.rooms,
                seed=seed,
                times=images.times,
                making=Making.of_mapper(
                    final, online, descriptors.array("position"), descriptors.orientation_values, ground
                ),
                ground=ground,
            )
        return self._known[key].metrics, time.perf_counter() - started
