"""What a worker of a cluster does that a process of this machine need not: say what it is, and send files back."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import omnieval
from omnieval.ablation.jobs import Described, Job
from omnieval.ablation.tree import grow
from omnieval.components.component import resolve_component
from omnieval.components.names import Kind
from omnieval.descriptors.stored import StoredDescriptions
from omnieval.errors import OmnievalError
from omnieval.results.provenance import versions
from omnieval.source_code import files_digest

FACTS = f"{__name__}:facts"
READABLE = f"{__name__}:readable"

Named = tuple[Kind, str, dict[str, Any]]
"""A component as a worker finds it: its kind, what names it, its settings."""


class OtherWorkerError(OmnievalError):
    """A worker that came later is not what the others are."""


@dataclass(frozen=True)
class Grown:
    """What a tree came to.

    Attributes
    ----------
    rows
        See `tree.grow`.
    traces
        Decision traces that were to be kept and are not written yet, as files, by job.
    """

    rows: list[dict[str, Any]]
    traces: dict[int, bytes]


@cache
def package_digest() -> str:
    """Return the digest of the whole package."""
    root = Path(omnieval.__file__).parent
    return files_digest(tuple(sorted(root.rglob("*.py"))), root)


def facts(components: Sequence[Named] = ()) -> dict[str, str]:
    """Return what results can depend on in this process, in words: package, libraries, and the code of components."""
    found = {"the code of omnieval": package_digest()[:12], **versions()}
    for kind, spec, settings in components:
        try:
            code = resolve_component(kind, spec, settings).code[:12]
        except Exception as error:  # whatever the code of others raises
            code = f"not there ({error})"
        found[f"the code of {kind} {spec}"] = code
    return found


def readable(descriptions: StoredDescriptions) -> bool:
    """Whether this process can read descriptions where they are kept."""
    try:
        descriptions.hold()
    except OmnievalError:
        return False
    return True


def grow_here(jobs: Sequence[Job], described: Described, in_map: Described | None, traces: Mapping[int, Path]) -> Grown:
    """Run the jobs of a tree where the driver's files can be written; see `tree.grow`."""
    return Grown(grow(jobs, described, traces, in_map), {})


def grow_elsewhere(
    jobs: Sequence[Job],
    described: Described,
    in_map: Described | None,
    traced: Collection[int],
    expected: Mapping[str, str],
    components: Sequence[Named],
) -> Grown:
    """Run the jobs of a tree in a process that may have no folder in common with the driver; see `tree.grow`.

    Parameters
    ----------
    jobs, described, in_map
        See `tree.grow`.
    traced
        The jobs whose decision traces are to be kept.
    expected, components
        What `facts` gives of these components where the driver is.

    Raises
    ------
    OtherWorkerError
        If this process is not what the driver is: it may have come when the others had been looked at.
    """
    if (mine := facts(components)) != expected:
        names = ", ".join(name for name in {**expected, **mine} if mine.get(name) != expected.get(name))
        raise OtherWorkerError(f"a worker that came later is not like this process, in {names}")
    with TemporaryDirectory() as folder:
        files = {number: Path(folder) / f"{number}.parquet" for number in traced}
        rows = grow(jobs, described, files, in_map)
        return Grown(rows, {number: file.read_bytes() for number, file in files.items() if file.exists()})
