"""Which replay is which case: the same source, the same cut and the same parameters."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from omnieval.config import Config, resolve
from omnieval.datasets import load
from omnieval.datasets.registry import split_source
from omnieval.datasets.scan import canonical_path
from omnieval.datasets.synthetic import LIGHTS
from omnieval.errors import ConfigError
from omnieval.loop import map_archive, replay
from omnieval.material import ARCHIVE_SCHEME
from omnieval.regression.reference import Case, Cut, Value, parameters_of
from omnieval.results.manifest import MANIFEST
from omnieval.results.run_folder import Run, open_run

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Selection:
    """Parameters and cut that a source is to be checked with."""

    config: Config
    cut: Cut = field(default_factory=Cut)


@dataclass(frozen=True)
class Job:
    """What determines a replay.

    Attributes
    ----------
    source
        As `canonical_source` returns it.
    cut
        Which of its frames.
    parameters
        All that it depends on, as `parameters_of` returns them.
    """

    source: str
    cut: Cut
    parameters: dict[str, Value]


def job_of_run(run: Run) -> Job:
    """Return what a run replayed."""
    cut = Cut.model_validate(run.manifest["cut"])
    return Job(run.manifest["source"], cut, parameters_of(run.manifest["configuration"]))


def job_of_case(case: Case) -> Job:
    """Return what a case replays with the code at hand.

    Raises
    ------
    ConfigError, DatasetError
        If a parameter or the source is unknown.
    """
    return Job(canonical_source(case.source), case.cut, parameters_of(case.config().model_dump(mode="json")))


def job_of_source(source: str, selection: Selection | None) -> Job:
    """Return what a source is replayed with; `selection` None is the defaults."""
    chosen = selection or Selection(resolve())
    return Job(canonical_source(source), chosen.cut, parameters_of(chosen.config.model_dump(mode="json")))


def run_at(target: str) -> Run | None:
    """Return the run that `target` names, None if it names a source."""
    folder = Path(target)
    return open_run(folder) if (folder / MANIFEST).is_file() else None


@contextmanager
def replayed(source: str, cut: Cut, config: Config, progress: Progress | None = None) -> Iterator[Run]:
    """Replay into a temporary folder, without a recording.

    Raises
    ------
    ConfigError, DatasetError
        If the source cannot be replayed.
    """
    with tempfile.TemporaryDirectory(prefix="omnieval-check-") as temporary:
        out = Path(temporary) / "run"
        canonical = canonical_source(source)
        if canonical.startswith(ARCHIVE_SCHEME):
            if cut != Cut():
                raise ConfigError(f"{source} is taken as it is; leave start, stride and limit out")
            archive = Path(canonical.removeprefix(ARCHIVE_SCHEME))
            yield map_archive(archive, config=config, out=out, progress=progress)
        else:
            sequence = load(canonical).cut(start=cut.start, stride=cut.stride, limit=cut.limit)
            yield replay(sequence, config=config, out=out, progress=progress)


def canonical_source(source: str) -> str:
    """Return a source as runs record it, so that two names of the same sequence are equal. No image is read.

    Raises
    ------
    DatasetError
        If the source is unknown, or a bare path holds no sequence.
    """
    if source.startswith(ARCHIVE_SCHEME) or source.endswith(".npz"):
        return f"{ARCHIVE_SCHEME}{Path(source.removeprefix(ARCHIVE_SCHEME)).resolve()}"
    scheme, rest = split_source(source)
    if scheme is None:
        return load(source).source
    # Asking the registry would render the building first.
    return f"{scheme}:{rest or LIGHTS[0]}" if scheme == "synthetic" else f"{scheme}:{canonical_path(rest)}"


def portable_source(source: str) -> str:
    """Return a canonical source with a path in the working directory made relative, for other people's checkouts."""
    scheme, _, rest = source.partition(":")
    path = Path(rest)
    if not path.is_absolute() or not path.is_relative_to(Path.cwd()):
        return source
    return f"{scheme}:{path.relative_to(Path.cwd()).as_posix()}"


def deviations(parameters: Mapping[str, Value]) -> dict[str, Value]:
    """Return the descriptor, and the parameters that differ from the defaults."""
    configuration = resolve().model_dump(mode="json") | {"descriptor": parameters["descriptor"]}
    defaults = parameters_of(configuration)
    return {name: value for name, value in parameters.items() if name == "descriptor" or value != defaults.get(name)}
