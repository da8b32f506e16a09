"""How many processors this process may use: those allotted to it, which may be fewer than the machine has."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

SHARE = "OMNIEVAL_CORES"
"""Environment variable: the share of a worker, of what was allotted to all."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""What the libraries that compute ask for when they are loaded."""


def allotted(root: Path = Path("/")) -> int:
    """Return how many processors this process may use, at least 1.

    It is the least of those it may run on (affinity), those that the quota of its control groups comes to (version 1
    and 2, of all groups above as well; half a processor does not count), and its share if it is a worker.

    Parameters
    ----------
    root
        Where the files of the system are.
    """
    limits = [len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1]
    limits += [int(quota) for quota in _quotas(root)]
    share = os.environ.get(SHARE, "")
    if share.isdigit():
        limits.append(int(share))
    return max(1, min(limits))


def take_share(workers: int) -> None:
    """Let this process, one of so many workers, and the libraries that it loads from now on use its share alone."""
    share = max(1, allotted() // workers)
    os.environ[SHARE] = str(share)
    for name in _THREADS:
        os.environ.setdefault(name, str(share))


def _quotas(root: Path) -> Iterator[float]:
    """Yield the processors that every quota comes to."""
    for folder in _groups(root):
        known = _text(folder / "cpu.max").split()  # version 2: quota or "max", and period, in microseconds
        if not known:
            known = [_text(folder / f"cpu.cfs_{what}_us").strip() for what in ("quota", "period")]
        if len(known) == 2 and all(value.isdigit() and int(value) for value in known):
            yield int(known[0]) / int(known[1])


def _groups(root: Path) -> Iterator[Path]:
    """Yield the folders of this process's control groups that may have a quota, and of all groups above."""
    mounted = root / "sys/fs/cgroup"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, group = (*line.split(":", 2), "", "")[:3]
        if controllers and "cpu" not in controllers.split(","):
            continue
        path = PurePosixPath(group)
        # Seen from inside a container the own group may be the mounted folder itself, whatever it is called.
        for above in (path, *path.parents):
            for name in dict.fromkeys((controllers, "cpu") if controllers else ("", "unified")):
                yield mounted / name / above.relative_to(above.anchor or ".")


def _text(file: Path) -> str:
    try:
        return file.read_text("ascii", "replace")
    except OSError:
        return ""
