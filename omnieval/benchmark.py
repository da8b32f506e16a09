"""Baselines over the material of a replay: the same images, the same metrics, partitions made by other means.

The folder of a baseline is ``runs/<sequence>-<descriptor>-<method>[-<n>]/``: ``run.json`` says what was clustered and
how, its status and timings; ``baseline.parquet`` has one row per partition, written as they come, so that a killed
baseline leaves a readable prefix.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.baselines.methods import METHODS, Images, Method
from omnieval.baselines.similarity import SIMILARITIES, Similarity, default_similarity, is_sparse, too_many
from omnieval.config import Config, as_config, resolve
from omnieval.errors import ConfigError
from omnieval.material.material import Material
from omnieval.material.opening import opened
from omnieval.material.source import Cut, Source, with_poses
from omnieval.metrics.evaluation import evaluate
from omnieval.metrics.ground import Ground
from omnieval.metrics.quality import Making
from omnieval.results.atomic import write_table
from omnieval.results.content import content_hash
from omnieval.results.folder import ResultFolder
from omnieval.results.provenance import code_digest, dataset_fingerprint, identity, versions
from omnieval.results.run_folder import free_folder, open_run
from omnieval.results.schemas import PARTITIONS
from omnieval.wording import did_you_mean

Progress = Callable[[int, int], None]
_LOG = logging.getLogger("omnieval")
KIND = "baseline"
TABLE = "baseline.parquet"
RUNS = Path("runs")
KS = tuple(range(2, 41))
"""The numbers of clusters when none are asked for."""


@dataclass(frozen=True)
class BaselineRun:
    """A baseline folder, what its ``run.json`` says, and its table (`schemas.PARTITIONS`)."""

    folder: Path
    manifest: dict[str, Any]
    table: pl.DataFrame


@dataclass(frozen=True)
class _Order:
    """An order of partitions: a method, its similarity (None if it uses none) and the numbers of clusters."""

    name: str
    method: Method
    similarity: Similarity | None
    ks: tuple[int, ...]
    by_default: bool = False
    """Whether nobody asked for the similarity."""


def baseline(
    source: Source = "synthetic",
    *,
    method: str = "spectral",
    similarity: str | None = None,
    ks: Iterable[int] | None = None,
    at_k_of: str | Path | None = None,
    config: Config | Mapping[str, Any] | None = None,
    descriptor: Any = None,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    skip_bad: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> pl.DataFrame:
    """Divide a sequence by another method, and return one row per partition (`schemas.PARTITIONS`): `run_baseline`."""
    return run_baseline(
        with_poses(source, poses, poses_tolerance, poses_interpolate),
        method=method,
        similarity=similarity,
        ks=ks,
        at_k_of=at_k_of,
        config=as_config(config, descriptor=descriptor),
        cut=Cut(start, stride, limit),
        skip_bad=skip_bad,
        out=out,
        overwrite=overwrite,
        progress=progress,
    ).table


def run_baseline(
    source: Source = "synthetic",
    *,
    method: str = "spectral",
    similarity: str | None = None,
    ks: Iterable[int] | None = None,
    at_k_of: str | Path | None = None,
    config: Config | None = None,
    cut: Cut | None = None,
    skip_bad: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> BaselineRun:
    """Divide a sequence by a batch or control method, judge it like a map, and write the baseline folder.

    Parameters
    ----------
    source
        A source as on the command line, a sequence, or an archive of descriptors (``.npz``).
    method
        A name of `baselines.methods.METHODS`.
    similarity
        For ``spectral``: ``gaussian-median`` (default up to 10,000 images), ``local-scaling`` or ``knn`` (default
        above, where it is a sparse graph).
    ks
        Numbers of clusters; default 2 to 40, or as many of them as there are images.
    at_k_of
        A run folder whose number of nodes is a number of clusters too; alone, the only one.
    config
        Descriptor, imaging and seed; default `recommended`.
    cut
        Which frames of the source; None for all.
    skip_bad
        Leave out images that are not fit for use instead of refusing the sequence.
    out
        Folder to write; default ``runs/<sequence>-<descriptor>-<method>[-<n>]``.
    overwrite
        Replace an earlier baseline in `out`.
    progress
        Called with (done, in all): frames first, then partitions.

    Raises
    ------
    ConfigError
        If method, similarity or a number of clusters is wrong.
    DatasetError
        If the sequence cannot be read or lacks what the method needs.
    ResultError
        If the folder cannot be written, or `at_k_of` is not a complete run.
    """
    config = config or resolve()
    order = _order(method, similarity, ks, at_k_of)
    with opened(source, config, cut, skip_bad=skip_bad) as material:
        order = _within(order, len(material.frames), material.source, asked=ks is not None or at_k_of is not None)
        images = _undescribed(material)
        order.method.check(images)
        folder = out or free_folder(RUNS, f"{material.name}-{material.descriptor.name}-{method}")
        about = _manifest(material, config, order, at_k_of)
        with ResultFolder(folder, KIND, about, files=[TABLE], overwrite=overwrite) as held:
            return _run(material, images, config, order, held, progress)


def check_options(
    *, method: str, similarity: str | None = None, ks: Iterable[int] | None = None, at_k_of: str | Path | None = None
) -> None:
    """Refuse what is wrong whatever the sequence is, before one is opened; `run_baseline` describes each.

    Raises
    ------
    ConfigError
        If method, similarity or a number of clusters is wrong, or they do not go together.
    ResultError
        If `at_k_of` is not a complete run.
    """
    _order(method, similarity, ks, at_k_of)


def _order(method: str, similarity: str | None, ks: Iterable[int] | None, at_k_of: str | Path | None) -> _Order:
    if method not in METHODS:
        raise ConfigError(f"unknown method {method!r}; {did_you_mean(method, METHODS)}")
    known = METHODS[method]
    chosen = next((name for name in SIMILARITIES if name == (similarity or "gaussian-median")), None)
    if chosen is None:
        raise ConfigError(f"unknown similarity {similarity!r}; {did_you_mean(str(similarity), SIMILARITIES)}")
    if similarity is not None and not known.takes_similarity:
        raise ConfigError(f"method {method} uses no similarity; leave --similarity out")
    if not known.takes_k:
        if ks is not None or at_k_of is not None:
            raise ConfigError(f"method {method} takes no number of clusters; leave --k and --at-k-of out")
        return _Order(method, known, None, ())
    asked = {*ks} if ks is not None else set() if at_k_of is not None else {*KS}
    if at_k_of is not None:
        asked.add(_nodes_of(at_k_of))
    if not asked or min(asked) < 1:
        raise ConfigError(f"numbers of clusters must be 1 or more, got {', '.join(map(str, sorted(asked))) or 'none'}")
    by_default = similarity is None and known.takes_similarity
    return _Order(method, known, chosen if known.takes_similarity else None, tuple(sorted(asked)), by_default)


def _nodes_of(folder: str | Path) -> int:
    nodes = open_run(folder).metrics.get("nodes")
    if not nodes:
        raise ConfigError(f"{folder} has no number of nodes; name the folder of a complete replay")
    return int(nodes)


def _within(order: _Order, images: int, source: str, *, asked: bool) -> _Order:
    """Check the numbers of clusters against the number of images; default ones that are too large are dropped."""
    if order.similarity is not None and images < 2:
        raise ConfigError(f"{source}: a similarity needs at least 2 images, there is {images}")
    similarity = order.similarity
    if order.by_default:
        similarity = default_similarity(images)
        if is_sparse(similarity, images):
            _LOG.warning("%s: %s images are many; the similarity is a sparse graph of neighbours (knn)", source, images)
    if order.method.compares_all and not is_sparse(similarity, images) and (fault := too_many(images)):
        raise ConfigError(f"{source}: {fault}")
    ks = tuple(k for k in order.ks if k <= images)
    if order.method.takes_k and (not ks or (asked and ks != order.ks)):
        raise ConfigError(f"{source}: {order.ks[-1]} clusters need as many images, there are {images}")
    return replace(order, similarity=similarity, ks=ks)


def _run(
    material: Material,
    undescribed: Images,
    config: Config,
    order: _Order,
    folder: ResultFolder,
    progress: Progress | None,
) -> BaselineRun:
    seed = config.seed
    descriptors, digests = _describe(material, progress)
    images = replace(undescribed, descriptors=descriptors)
    started = time.perf_counter()
    partition = order.method.prepare(images, order.similarity or "gaussian-median", max(order.ks, default=0), seed)
    shared = time.perf_counter() - started
    times = [frame.time_ns for frame in material.frames]
    ground = None if images.positions is None else Ground(images.positions, times)
    table = PARTITIONS.to_frame()
    reasons: dict[str, dict[str, None]] = {}
    asked = order.ks or (0,)
    for done, k in enumerate(asked, start=1):
        before = time.perf_counter()
        labels = partition(k)
        seconds = shared + time.perf_counter() - before
        evaluation = evaluate(
            labels,
            None,
            images.positions,
            rooms=images.rooms,
            seed=seed,
            unposed=material.unposed,
            times=times,
            making=Making.of_partition(labels, descriptors, ground),
            ground=ground,
        )
        for name, reason in evaluation.reasons.items():
            reasons.setdefault(name, {})[reason] = None
        made = {"dataset": material.name, "descriptor": material.descriptor.name, "method": order.name}
        row = made | {"similarity": order.similarity, "k": k or None} | evaluation.metrics | {"seconds": seconds}
        table = pl.concat([table, pl.DataFrame([row], schema=PARTITIONS)])
        write_table(table, folder.path / TABLE)
        if progress:
            progress(done, len(asked))
    fingerprint = dataset_fingerprint(material.frames, digests)
    determining = {"baseline": _described(order), "seed": seed, **material.determining}
    outcome = {
        "dataset_fingerprint": fingerprint,
        "identity": identity(determining, fingerprint),
        "null_reasons": {name: "; ".join(why) for name, why in reasons.items()},
        "content_hashes": {KIND: content_hash(table)},
        "timings": {"shared_seconds": shared, "seconds": time.perf_counter() - started},
    }
    folder.complete(outcome)
    return BaselineRun(folder.path, folder.content, table)


def _undescribed(material: Material) -> Images:
    rooms = tuple(frame.room for frame in material.frames)
    nothing = np.empty((len(rooms), 0), np.float32)
    return Images(material.source, nothing, material.positions, rooms, unposed=material.unposed)


def _describe(material: Material, progress: Progress | None) -> tuple[NDArray[np.float32], list[str]]:
    """Return the position descriptors of the material, shape (n, d), and the digests of its images."""
    descriptors, digests = [], []
    for described in material.described:
        descriptors.append(described.description.position)
        digests.append(described.digest)
        if progress:
            progress(len(digests), len(material.frames))
    return np.stack(descriptors), digests


def _manifest(material: Material, config: Config, order: _Order, at_k_of: str | Path | None) -> dict[str, Any]:
    """Return what ``run.json`` says when the baseline begins."""
    extra = order.method.extra
    return {
        **material.about,
        "baseline": _described(order) | {"at_k_of": None if at_k_of is None else str(at_k_of)},
        "imaging": config.imaging.model_dump(mode="json"),
        "seed": config.seed,
        "versions": versions() | ({extra: version(extra)} if extra else {}),
        "code": code_digest(),
    }


def _described(order: _Order) -> dict[str, Any]:
    return {"method": order.name, "similarity": order.similarity, "ks": list(order.ks)}
