"""Which replay is which case: the same source, the same cut, the same components with the same parameters."""

from __future__ import annotations

import dataclasses
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omnieval.config import Config, resolve
from omnieval.datasets.registry import canonical, place_of
from omnieval.errors import ConfigError, DatasetError, OmnievalError
from omnieval.imaging.settings import ImagingConfig
from omnieval.loop import replay
from omnieval.material.source import ARCHIVE, ARCHIVE_SCHEME, Cut, archive_file, refuse_descriptor
from omnieval.regression.guarded import Case
from omnieval.regression.reference import sayable
from omnieval.results.manifest import MANIFEST, expanded
from omnieval.results.run_folder import Run, open_run

Progress = Callable[[int, int], None]
_COMPONENTS = ("mapper", "descriptor")


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
    skipped
        Images that are left out because they are not fit for use; None if `skip_bad` is not asked for.
    parameters
        What finds the components, and all parameters by name.
    """

    source: str
    cut: Cut
    skipped: tuple[str, ...] | None
    parameters: dict[str, Any]

    @staticmethod
    def of(source: str, selection: Selection, skipped: tuple[str, ...] | None) -> Job:
        """Return what a source is replayed with."""
        config = selection.config
        if source.startswith(ARCHIVE_SCHEME):  # its descriptions are what they are
            config = Config(config.mapper, ARCHIVE, ImagingConfig())
        # Nothing finds an object again, whatever it calls itself.
        found = {str(one.kind): one.spec or f"{one.name} (an object)" for one in (config.mapper, config.descriptor)}
        return Job(source, selection.cut, skipped, {**found, **config.settings})

    @staticmethod
    def of_run(run: Run) -> Job:
        """Return what a run replayed.

        Raises
        ------
        ConfigError
            If it continued from the map of another, which a case cannot describe.
        """
        manifest = run.manifest
        if "continues" in manifest:
            raise ConfigError(
                f"{run.folder} continues from the map of another run, which a case cannot describe; check that run "
                "instead"
            )
        return Job.of(manifest["source"], Selection(run.config, Cut(**manifest["cut"])), left_out(run))

    @staticmethod
    def of_case(case: Case) -> Job:
        """Return what a case replays with the code at hand.

        Raises
        ------
        ConfigError, DatasetError
            If a component, a parameter or the source is unknown.
        """
        return Job.of(canonical_source(case.source), selection_of(case), case.skipped)

    @property
    def recorded(self) -> dict[str, Any]:
        """Its parameters as a reference holds them."""
        return {
            name: portable(value) if name in _COMPONENTS else value
            for name, value in self.parameters.items()
            if sayable(value)
        }

    @property
    def deviations(self) -> dict[str, Any]:
        """The parameters that differ from the defaults of the same components, as a reference holds them."""
        archive = self.source.startswith(ARCHIVE_SCHEME)
        chosen = {kind: self.parameters[kind] for kind in _COMPONENTS[: 1 if archive else 2]}
        plain = resolve(**chosen).settings
        return {
            name: value
            for name, value in self.recorded.items()
            if name not in _COMPONENTS and (name not in plain or value != plain[name])
        }


@dataclass(frozen=True)
class Target:
    """A run or a source that is compared with a reference.

    Attributes
    ----------
    run
        The run; None for a source.
    job
        What it replayed, or what is to be replayed.
    cases
        The cases that it is compared with.
    """

    run: Run | None
    job: Job
    cases: list[Case]


def target_of(target: str, selection: Selection | None, cases: Sequence[Case]) -> Target:
    """Return what a run folder or source is compared with: its one case, or without `selection` all of its source.

    Raises
    ------
    ConfigError
        If a run is to be selected from, or the selection does not fit the source.
    DatasetError, ResultError
        If it is neither a run folder nor a source.
    """
    folder = expanded(target)
    if (folder / MANIFEST).is_file():
        refuse_selection(selection)
        run = open_run(folder)
        job = Job.of_run(run)
        return Target(run, job, [case for case in cases if job_of(case) == job])
    chosen = selection or Selection(resolve())
    if archive_file(target) is not None:
        refuse_descriptor(target, chosen.config)
    source = canonical_source(target)
    job = Job.of(source, chosen, () if chosen.skip_bad else None)
    if selection is None:
        return Target(None, job, [case for case in cases if source_of(case) == source])
    # Which images are left out is known only when they are looked at.
    jobs = ((case, found) for case in cases if (found := job_of(case)))
    asked = [case for case, found in jobs if dataclasses.replace(found, skipped=found.skipped and ()) == job]
    return Target(None, job, asked)


def refuse_selection(selection: Selection | None) -> None:
    """Refuse parameters that no source was given for."""
    if selection is not None:
        raise ConfigError("parameters and cuts select among the cases of a SOURCE; name one, or leave them out")


def job_of(case: Case) -> Job | None:
    """Return the job of a case, None where its source is not on this machine or its parameters are faulty."""
    try:
        return Job.of_case(case)
    except OmnievalError:
        return None


def source_of(case: Case) -> str | None:
    """Return the canonical source of a case, None where it is not on this machine."""
    try:
        return canonical_source(case.source)
    except OmnievalError:
        return None


def selection_of(case: Case) -> Selection:
    """Return what a case replays its source with.

    Raises
    ------
    ConfigError
        See `Case.config`.
    """
    return Selection(case.config(), case.cut, case.skipped is not None)


def left_out(run: Run) -> tuple[str, ...] | None:
    """Return the images that a run left out because they are not fit for use; None if `skip_bad` was not asked for."""
    skipped = run.manifest.get("skipped")
    return None if skipped is None else tuple(bad["file"] for bad in skipped)


@contextmanager
def replayed(
    source: str, selection: Selection, progress: Progress | None = None, *, save_map: bool = False
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
            config=selection.config,
            **dataclasses.asdict(selection.cut),
            skip_bad=selection.skip_bad,
            out=Path(temporary) / "run",
            save_map=save_map,
            progress=progress,
        )


def refuse_missing(source: str) -> None:
    """Refuse a canonical source whose place does not exist.

    Raises
    ------
    DatasetError
        If it does not.
    """
    place = place_of(source)
    if place is not None and place.is_absolute() and not place.exists():
        raise DatasetError(f"there is no {place}; sources are relative to the working directory")


def canonical_source(source: str) -> str:
    """Return a source as runs record it, so that two names of the same sequence are equal. No image is read.

    Raises
    ------
    DatasetError
        If the source is unknown, or a bare path holds no sequence.
    """
    if (file := archive_file(source)) is not None:
        return f"{ARCHIVE_SCHEME}{file.resolve()}"
    return canonical(source)


def portable(name: str) -> str:
    """Return a source or what names a component with a path in the working directory made relative.

    It is for other people's checkouts.
    """
    here = re.escape(str(Path.cwd()))
    return re.sub(rf"(^|:|=){here}(/|$)", lambda found: found[1] + ("" if found[2] else "."), name)
