"""Writes a synthetic sequence in COLD's layout, whole or not at all."""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from omnieval.cores import allotted
from omnieval.datasets.cachedir import cache_dir, hold_for_good, synthetic_folder
from omnieval.datasets.synthetic.facts import HIGHEST_BUILDING, LIGHTS, RENDERER_VERSION, Rendered
from omnieval.errors import DatasetError

Progress = Callable[[int, int], None]
_PART = "A"
OUTLINES = "building.json"
"""The file with the rooms' outlines and the doors."""


def synthesize(
    folder: Path,
    *,
    light: str = "cloudy",
    building: int = 1,
    frames: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Render a drive through the building and write it in COLD's layout.

    Parameters
    ----------
    folder
        Where to; it must not exist, or be empty. It appears under this name only when it is complete.
    light
        One of `LIGHTS`.
    building
        Number of the building: 1 is drawn by hand, the plans of the others follow from the number.
    frames
        How many captures: the first of the tour; more than one tour has, and the robot drives it again. None: one
        whole tour.
    seed
        Decides sway, clock, people and noise. The same seed gives the same bytes.
    workers
        Threads; None: one a processor. The result does not depend on it.
    progress
        Called with frames done and frames in all after every frame.

    Returns
    -------
    Path
        `folder`, now with ``omni_cam/*.jpeg``, ``localization/places.lst`` and ``building.json``.

    Raises
    ------
    DatasetError
        If light or building is unknown, a number makes no sense, or the folder is in use or cannot be written.
    """
    _refuse_nonsense(light, building, frames, seed, workers)
    folder = Path(folder)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise DatasetError(f"{folder} exists and is not empty; choose another folder for the synthetic sequence")
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
            draft = Path(scratch) / "sequence"
            _write_sequence(draft, Rendered(light, building), frames, seed, workers or allotted(), progress)
            draft.replace(folder)
    except OSError as error:
        raise DatasetError(f"cannot write a synthetic sequence to {folder}: {error.strerror or error}") from error
    return folder


def _refuse_nonsense(light: str, building: int, frames: int | None, seed: int, workers: int | None) -> None:
    if light not in LIGHTS:
        raise DatasetError(f"no light '{light}' in the synthetic building; choose one of {', '.join(LIGHTS)}")
    if not 1 <= building <= HIGHEST_BUILDING:
        raise DatasetError(f"there is no synthetic building {building}; they are numbered 1 to {HIGHEST_BUILDING}")
    if frames is not None and frames < 1:
        raise DatasetError(f"a synthetic sequence needs at least 1 frame, not {frames}")
    if seed < 0:
        raise DatasetError(f"the seed of a synthetic sequence must be 0 or more, not {seed}")
    if workers is not None and workers < 1:
        raise DatasetError(f"a synthetic sequence needs at least 1 worker, not {workers}")


def cached(light: str, building: int = 1) -> Path:
    """Return the default sequence in `light` from the cache folder, rendering it first if it is not there.

    It stays there as long as this process.

    Raises
    ------
    DatasetError
        If light or building is unknown or the cache folder cannot be written.
    """
    folder = synthetic_folder(cache_dir()) / "-".join((f"v{RENDERER_VERSION}", *Rendered(light, building).words))
    if not hold_for_good(folder / OUTLINES):
        try:
            synthesize(folder, light=light, building=building)
        except DatasetError:
            # Another process may have finished the same sequence meanwhile; both have the same bytes.
            if not folder.is_dir():
                raise
        hold_for_good(folder / OUTLINES)
    return folder


def _write_sequence(
    folder: Path, which: Rendered, frames: int | None, seed: int, workers: int, progress: Progress | None
) -> None:
    """Write all images, the list of places and the outlines of the rooms into a new folder."""
    from omnieval.datasets.synthetic.outlines import outlines
    from omnieval.datasets.synthetic.shoot import Drive

    drive = Drive.of(which.light, seed, frames, which.building)
    images, places = folder / "omni_cam", folder / "localization"
    images.mkdir(parents=True)
    places.mkdir()
    names = drive.names
    for done, (index, data) in enumerate(_in_order(drive.jpeg, len(names), workers), start=1):
        (images / names[index]).write_bytes(data)
        if progress is not None:
            progress(done, len(names))
    lines = [f"{name} {room}-{_PART}\n" for name, room in zip(names, drive.rooms, strict=True)]
    (places / "places.lst").write_text("".join(lines), encoding="utf-8", newline="\n")
    (folder / OUTLINES).write_text(outlines(drive.building), encoding="utf-8", newline="\n")


def _in_order(make: Callable[[int], bytes], count: int, workers: int) -> Iterator[tuple[int, bytes]]:
    """Yield make(0), make(1), ... from a pool of threads, never much further ahead than there are workers."""
    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[tuple[int, Future[bytes]]] = deque()
        for index in range(count):
            waiting.append((index, pool.submit(make, index)))
            if len(waiting) > 2 * workers:
                first, future = waiting.popleft()
                yield first, future.result()
        for first, future in waiting:
            yield first, future.result()
