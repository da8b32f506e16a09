"""Which replay is which case: the same source, the same cut, the same components with the same parameters."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from omnieval.config import Config, resolve
from omnieval.datasets import load
from omnieval.datasets.registry import split_source
from omnieval.datasets.scan import canonical_path
from omnieval.datasets.synthetic import LIGHTS
from omnieval.errors import ResultError
from omnieval.loop import replay
from omnieval.material import ARCHIVE, ARCHIVE_SCHEME, archive_file, refuse_descriptor
from omnieval.regression.reference import Case, Cut, Value, parameters_of
from omnieval.results.manifest import MANIFEST
from omnieval.results.run_folder import Run, open_run

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Selection:
    """Components, parameters and cut that a source is to be checked with."""

    config: Config
    cut: Cut = field(default_factory=Cut)
    skip_bad: bool = False


@dataclass(frozen=True)
class Job:
    """What determines a replay.

    Attributes
    ----------
    source
        As `canonical_source` returns it.
    cut
        Which of its frames.
    skip_bad
        Whether images that are not fit for use are left out.
    parameters
        All else that it depends on, as `parameters_of` returns them.
    """

    source: str
    cut: Cut
    skip_bad: bool
    parameters: dict[str, Value]


def job_of_run(run: Run) -> Job:
    """Return what a run replayed."""
    cut = Cut.model_validate(run.manifest["cut"])
    return _job(run.manifest["source"], cut, "skipped" in run.manifest, run.config)


def job_of_case(case: Case) -> Job:
    """Return what a case replays with the code at hand.

    Raises
    ------
    ConfigError, DatasetError
        If a component, a parameter or the source is unknown.
    """
    return _job(canonical_source(case.source), case.cut, case.skipped is not None, case.config())


def job_of_source(source: str, selection: Selection | None) -> Job:
    """Return what a source is replayed with; `selection` None is the defaults."""
    chosen = selection or Selection(resolve())
    if archive_file(source) is not None:
        refuse_descriptor(source, chosen.config)
    return _job(canonical_source(source), chosen.cut, chosen.skip_bad, chosen.config)


def _job(source: str, cut: Cut, skip_bad: bool, config: Config) -> Job:
    parameters = parameters_of(config)
    if source.startswith(ARCHIVE_SCHEME):  # its descriptions are what they are
        own = f"{config.descriptor.name}."
        parameters = {name: value for name, value in parameters.items() if not name.startswith((own, "imaging."))}
        parameters["descriptor"] = ARCHIVE.name
    return Job(source, cut, skip_bad, parameters)


def run_at(target: str) -> Run | None:
    """Return the run that `target` names, None if it names a source."""
    folder = Path(target)
    return open_run(folder) if (folder / MANIFEST).is_file() else None


@contextmanager
def replayed(
    source: str, cut: Cut, config: Config, *, skip_bad: bool = False, progress: Progress | None = None
) -> Iterator[Run]:
    """Replay into a temporary folder, without a recording.

    Raises
    ------
    ConfigError, DatasetError
        If the source cannot be replayed.
    """
    with tempfile.TemporaryDirectory(prefix="omnieval-check-") as temporary:
        yield replay(
            canonical_source(source),
            config=config,
            **cut.model_dump(),
            skip_bad=skip_bad,
            out=Path(temporary) / "run",
            progress=progress,
        )


def refuse_unrepeatable(run: Run) -> None:
    """Refuse a run that no check could replay.

    Raises
    ------
    ResultError
        One line that says why.
    """
    archive = archive_file(run.manifest["source"])
    if archive is not None and not archive.is_file():
        raise ResultError(f"{run.folder} cannot be a case: its descriptors {archive} are gone")
    components = [run.config.mapper, *([] if archive is not None else [run.config.descriptor])]
    try:
        for component in components:
            component.again()
    except ResultError as error:
        raise ResultError(f"{run.folder} cannot be a case: {error}") from error


def canonical_source(source: str) -> str:
    """Return a source as runs record it, so that two names of the same sequence are equal. No image is read.

    Raises
    ------
    DatasetError
        If the source is unknown, or a bare path holds no sequence.
    """
    if (file := archive_file(source)) is not None:
        return f"{ARCHIVE_SCHEME}{file.resolve()}"
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


def portable_spec(spec: str) -> str:
    """Return what names a component, with a path in the working directory made relative; see `portable_source`."""
    where, _, name = spec.rpartition(":")
    path = Path(where)
    if not where.endswith(".py") or not path.is_relative_to(Path.cwd()):
        return spec
    return f"{path.relative_to(Path.cwd()).as_posix()}:{name}"


def deviations(config: Config, *, archive: bool) -> dict[str, Value]:
    """Return the parameters that differ from the defaults of the same components; an `archive` has no descriptor's."""
    plain = resolve(mapper=config.mapper.spec, descriptor=None if archive else config.descriptor.spec)
    defaults = parameters_of(plain)
    return {
        name: value
        for name, value in parameters_of(config).items()
        if name not in ("mapper", "descriptor") and value != defaults.get(name)
    }
