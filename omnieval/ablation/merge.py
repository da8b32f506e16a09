"""Shards put together: the table is that of one ablation that was never divided, to the bit but for the seconds."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omnieval.ablation.crew import crew_of
from omnieval.ablation.driver import Ablation, Progress, Work, conclude, dropping_descriptors, fingerprints
from omnieval.ablation.grid import Span
from omnieval.ablation.jobs import Described
from omnieval.ablation.plan import Plan, jobs_again
from omnieval.ablation.store import FINGERPRINTS, KIND, Part, Store
from omnieval.config import flattened
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.results.atomic import replacing
from omnieval.results.compare import differing
from omnieval.results.manifest import expanded, read_manifest, status_of
from omnieval.results.provenance import code_digest, versions
from omnieval.source_code import digest_of

_COMMON = ("grid", "keep_steps", "code", "versions")
"""Entries of ``run.json`` that all shards of a plan share, and the whole as well."""


def merge(
    folders: Sequence[str | Path],
    out: str | Path,
    *,
    overwrite: bool = False,
    csv: bool = False,
    record_best: bool = False,
    progress: Progress | None = None,
) -> tuple[Ablation, Plan]:
    """Put the shards of an ablation together, and add what needs all rows, such as batch clustering.

    Parameters
    ----------
    folders
        All shards of one plan, in any order.
    out
        Folder to write; a whole ablation, with which ``--resume`` goes on.
    overwrite
        Replace an earlier ablation in `out`.
    csv, record_best, progress
        See `run.run_plan`.

    Raises
    ------
    ConfigError
        If `out` is one of the shards.
    ResultError
        If they are no shards, not of one plan or not by this version of omnieval, if one is missing, given twice or not
        complete, or if the images are others by now.
    """
    stores = [Store(folder) for folder in folders]
    places = [store.folder.resolve() for store in stores]
    if twice := [store.folder for number, store in enumerate(stores) if places[number] in places[:number]]:
        raise ConfigError(f"{twice[0]} is named twice; name every shard once")
    if expanded(out).resolve() in places:
        raise ConfigError(f"--out {out} is one of the shards; choose another folder")
    manifests = {store.folder: read_manifest(store.folder, KIND) for store in stores}
    shard = _check(manifests)
    parts = _all_parts(stores, shard)
    first = next(iter(manifests.values()))
    grid, tuned_on = first["grid"], tuple(shard["tuned_on"])
    prints = _together(manifests)
    content = {name: first[name] for name in _COMMON} | {FINGERPRINTS: prints, "shards": shard["of"]}
    whole = Store(out)
    started = time.perf_counter()
    held = whole.open(content, overwrite=overwrite)
    with crew_of((), 1, None) as crew, held as folder, dropping_descriptors(whole):
        for done, (part, store) in enumerate(parts):
            trace = store.steps(part)
            if trace is not None:
                with replacing(whole.steps_file(part.name)) as temporary:
                    shutil.copyfile(trace, temporary)
            whole.add(part)
            if progress:
                progress(done + 1, len(parts))
        plan = Plan((), tuple(grid["axes"]), grid, Span(*grid["exact"]) if grid["exact"] else None, tuned_on)
        work = Work(plan, whole, shard["tune_by"], keep_steps=first["keep_steps"], fail_fast=False, progress=None)
        described: dict[str, Described] = {}
        lacking = None
        try:
            work = replace(work, plan=replace(plan, jobs=jobs_again(grid, [part for part, _ in parts])))
            described = work.describe(crew)
        except DatasetError as error:  # where the shards are merged, their images need not be
            lacking = str(error)
        if changed := differing(*_shared(prints, fingerprints(described)[FINGERPRINTS])):
            raise ResultError(f"the images of {', '.join(changed)} are not those of the shards; run them again")
        ablation = conclude(
            work,
            described,
            folder,
            crew,
            started=started,
            csv=csv,
            record_best=record_best and not lacking,
            lacking=lacking,
        )
    return ablation, work.plan


def _check(manifests: Mapping[Path, Mapping[str, Any]]) -> dict[str, Any]:
    """See that these are all shards of one plan, each once and complete, and return what they say of it."""
    for folder, manifest in manifests.items():
        if not manifest.get("shard"):
            raise ResultError(f"{folder} is not a shard of an ablation; name the folders that --shard has written")
    (first, about), *others = manifests.items()
    for folder, other in others:
        if changed := differing(_plan_of(about), _plan_of(other)):
            name, (one, another) = next(iter(changed.items()))
            raise ResultError(f"{first} and {folder} are not of one plan: {name} is {one} and {another}; run one again")
    shard: dict[str, Any] = about["shard"]
    here = {"code": code_digest(), "versions": versions()}
    if changed := differing(dict(flattened({name: about[name] for name in here})), dict(flattened(here))):
        words = ", ".join(f"{name} was {one}, now {other}" for name, (one, other) in changed.items())
        raise ResultError(f"{first} cannot be merged by this omnieval: {words}; use the one that ran the shards")
    numbers: dict[int, Path] = {}
    for folder, manifest in manifests.items():
        number = manifest["shard"]["number"]
        if number in numbers:
            raise ResultError(f"shard {number} of {shard['of']} is there twice, {numbers[number]} and {folder}")
        numbers[number] = folder
    if missing := [str(number) for number in range(1, shard["of"] + 1) if number not in numbers]:
        raise ResultError(f"of {shard['of']} shards {', '.join(missing)} {_is(missing)} missing; name all folders")
    for number, folder in sorted(numbers.items()):
        if (status := status_of(dict(manifests[folder]))) != "complete":
            raise ResultError(f"shard {number} of {shard['of']}, {folder}, is {status}; go on with it by --resume")
    return shard


def _is(some: Sequence[str]) -> str:
    return "is" if len(some) == 1 else "are"


def _plan_of(manifest: Mapping[str, Any]) -> dict[str, Any]:
    shard = {name: value for name, value in manifest["shard"].items() if name != "number"}
    return dict(flattened({name: manifest[name] for name in _COMMON} | {"shard": shard}))


def _all_parts(stores: Sequence[Store], shard: Mapping[str, Any]) -> list[tuple[Part, Store]]:
    """Return the parts of all shards in the order of the grid, each with where it is.

    Raises
    ------
    ResultError
        If a job is missing, or there twice.
    """
    found: dict[int, tuple[Part, Store]] = {}
    for store in stores:
        for part in store.parts().values():
            if part.number in found:
                both = f"{found[part.number][1].folder} and {store.folder}"
                raise ResultError(f"job {part.number} is in two shards, {both}; run the shards again")
            found[part.number] = part, store
    if missing := [number for number in range(shard["jobs"]) if number not in found]:
        raise ResultError(f"{len(missing)} jobs are in no shard, such as job {missing[0]}; resume the shards")
    parts = [found[number] for number in sorted(found)]
    if digest_of([part.key for part, _ in parts]) != shard["plan"]:
        raise ResultError("the rows of the shards are not those of their plan; run the shards again")
    return parts


def _together(manifests: Mapping[Path, Mapping[str, Any]]) -> dict[str, str]:
    """Return the fingerprints of all sequences.

    Raises
    ------
    ResultError
        If two shards saw different images.
    """
    prints: dict[str, str] = {}
    for folder, manifest in manifests.items():
        own = manifest.get(FINGERPRINTS, {})
        if changed := differing(*_shared(prints, own)):
            raise ResultError(f"the images of {', '.join(changed)} are others in {folder} than in another shard")
        prints |= own
    return prints


def _shared(one: Mapping[str, str], other: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    names = sorted(one.keys() & other.keys())
    return {name: one[name] for name in names}, {name: other[name] for name in names}
