"""Who runs the jobs of an ablation: a thread, processes, or the workers of a cluster, all asked in one way."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any

from omnieval.ablation.jobs import Described, Job, batch_silhouettes
from omnieval.ablation.worker import FACTS, READABLE, Grown, Named, facts, grow_elsewhere, grow_here
from omnieval.cluster import ClusterExecutor, ClusterSpec, cluster, differing_workers
from omnieval.components.component import Component
from omnieval.components.names import BUILT_IN
from omnieval.descriptors.describe import Elsewhere, RawImage, described_images
from omnieval.descriptors.description import Description
from omnieval.descriptors.stored import StoredDescriptions
from omnieval.errors import ConfigError, OmnievalError
from omnieval.imaging.camera import CameraModel
from omnieval.processes import workers

_LOG = logging.getLogger(__name__)
_LOOK_S = 5.0
"""How often it is seen to it that somebody is still there, seconds."""


class Crew:
    """A thread or processes of this machine.

    Attributes
    ----------
    count
        How many jobs run at a time.
    """

    def __init__(self, pool: Executor, count: int) -> None:
        self.count = count
        self._pool = pool

    @property
    def elsewhere(self) -> Elsewhere | None:
        """Where images are described; None: in this process."""
        return None

    def take(self, described: Mapping[str, Described]) -> None:
        """Make the images known that jobs are going to be run on."""

    def grow(
        self, jobs: Sequence[Job], images: Described, in_map: Described | None, traces: Mapping[int, Path]
    ) -> Future[Grown]:
        """Have a tree grown; `traces` says where decision traces go, by job."""
        return self._pool.submit(grow_here, jobs, images, in_map, traces)

    def batch(self, images: Described, ks: list[int], seed: int) -> Future[dict[int, float | None]]:
        """Have batch clustering done; where nobody is left to do it, the future says so too."""
        try:
            return self._pool.submit(batch_silhouettes, self._given(images), ks, seed)
        except BrokenExecutor as error:
            future: Future[dict[int, float | None]] = Future()
            future.set_exception(error)
            return future

    def completed(self, futures: Iterable[Future[Any]]) -> Iterator[Future[Any]]:
        """Yield what has ended as it ends.

        Raises
        ------
        LostClusterError
            If nobody is left to do the rest.
        """
        waiting = set(futures)
        while waiting:
            done, waiting = wait(waiting, _LOOK_S, FIRST_COMPLETED)
            if any(future.cancelled() for future in done):
                self._look()
            yield from done
            if waiting:
                self._look()

    def killed(self, future: Future[Any]) -> bool:
        """Whether a job has ended with the workers that had it, perhaps through another that they had too."""
        del future
        return False

    def _look(self) -> None:
        """See that somebody is still there."""

    def _given(self, images: Described) -> Any:
        return images


class ClusterCrew(Crew):
    """The workers of a cluster; jobs and rows travel, files do not.

    Parameters
    ----------
    pool
        The workers.
    components
        Those that the jobs need and that are not of this package.

    Raises
    ------
    ConfigError
        If a worker is not as this process is; it is named.
    """

    def __init__(self, pool: ClusterExecutor, components: Sequence[Named]) -> None:
        super().__init__(pool, pool.count)
        self._workers, self._components = pool, components
        self._expected = facts(components)
        self._shared: dict[int, Any] = {}
        if others := differing_workers(pool.everywhere(FACTS, components), self._expected):
            raise ConfigError(f"workers are not like this process, so nothing was run: {'; '.join(others)}")

    @property
    def elsewhere(self) -> Elsewhere:
        """See `Crew`."""
        return _Describers(self._workers)

    def take(self, described: Mapping[str, Described]) -> None:
        """See `Crew`: workers read descriptions where they are kept or, if not all of them can, are sent them."""
        for images in described.values():
            sent, stored = images, images.descriptions
            if isinstance(stored, StoredDescriptions) and not all(
                answer is True for answer in self._workers.everywhere(READABLE, stored).values()
            ):
                sent = replace(images, descriptions=stored.held())
            self._shared[id(images)] = self._workers.share(sent)

    def grow(
        self, jobs: Sequence[Job], images: Described, in_map: Described | None, traces: Mapping[int, Path]
    ) -> Future[Grown]:
        """See `Crew`."""
        place = None if in_map is None else self._given(in_map)
        traced = tuple(traces)
        return self._workers.submit(
            grow_elsewhere, jobs, self._given(images), place, traced, self._expected, self._components
        )

    def killed(self, future: Future[Any]) -> bool:
        """See `Crew`."""
        return not future.cancelled() and self._workers.killed(future.exception())

    def _look(self) -> None:
        self._workers.check()

    def _given(self, images: Described) -> Any:
        return self._shared[id(images)]


class _Describers:
    """The workers of a cluster as `Elsewhere`: images are sent to them, they need no folder in common."""

    def __init__(self, pool: ClusterExecutor) -> None:
        self.count = pool.count
        self._workers = pool
        self._usable: dict[str, bool] = {}
        self._lock = Lock()

    def describe(
        self, camera: CameraModel, descriptor: Component, images: Sequence[RawImage]
    ) -> list[Description | OmnievalError]:
        """See `Elsewhere`; what the workers cannot do, or have died of, is done here."""
        sent = replace(descriptor, given=None)
        if not self._have(descriptor):
            return described_images(camera, descriptor, images)
        future = self._workers.submit(described_images, camera, sent, images)
        while not future.done():
            if not wait([future], _LOOK_S).done:
                self._workers.check()
        if future.cancelled() or isinstance(future.exception(), Exception):
            self._workers.check()
            return described_images(camera, descriptor, images)
        found: list[Description | OmnievalError] = future.result()
        return found

    def _have(self, descriptor: Component) -> bool:
        """Whether all workers have the descriptor as it is here."""
        name = str(descriptor.spec)
        with self._lock:
            if name not in self._usable:
                asked: list[Named] = [("descriptor", name, descriptor.settings)]
                others = [f"{name} is known in this process only"] if descriptor.spec is None else []
                others = others or differing_workers(self._workers.everywhere(FACTS, asked), facts(asked))
                if others:
                    _LOG.info("images are described by this process alone: %s", "; ".join(others))
                self._usable[name] = not others
            return self._usable[name]


@contextmanager
def crew_of(jobs: Iterable[Job], count: int, spec: ClusterSpec | None) -> Iterator[Crew]:
    """Give the crew for some jobs: `count` of this machine, or those of a cluster.

    Raises
    ------
    ConfigError
        If there is no such cluster, or a worker of it is not as this process is.
    """
    if spec is None:
        with workers(count) as pool:
            yield Crew(pool, count)
        return
    with cluster(spec) as far:
        crew = ClusterCrew(far, _components(jobs))
        shown = f"; what they do: {far.dashboard}" if far.dashboard else ""
        _LOG.info("%d workers of %s%s", far.count, spec.text, shown)
        yield crew


def _components(jobs: Iterable[Job]) -> list[Named]:
    """Return the mappers that are not of this package, each once."""
    named: dict[str, Named] = {}
    for mapper in (job.config.mapper for job in jobs):
        if mapper.spec is not None and mapper.spec not in BUILT_IN["mapper"].values():
            named.setdefault(mapper.spec, ("mapper", mapper.spec, mapper.settings))
    return list(named.values())
