"""What a benchmark reports."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "polars", "rerun-sdk")


@dataclass(frozen=True)
class Figure:
    """One measured figure.

    Attributes
    ----------
    name, unit
        What was measured, in what.
    value
        Of the package.
    plain
        Of the implementation in `tests/reference`, in the same unit; None if it does not do this.
    bound
        Of the part that cannot be left out, alone, in the same unit; None if nothing bounds it.
    bounded_by
        What that part is.
    target
        What the value is to reach.
    """

    name: str
    unit: str
    value: float
    plain: float | None = None
    bound: float | None = None
    bounded_by: str = ""
    target: str = ""

    def row(self) -> dict[str, Any]:
        """Return the figure as plain values."""
        return asdict(self)


def seconds_of(action: Callable[[], object], repeats: int = 3) -> float:
    """Return the median time of an action, in seconds."""
    found = []
    for _ in range(repeats):
        started = time.perf_counter()
        action()
        found.append(time.perf_counter() - started)
    return statistics.median(found)


def machine() -> dict[str, Any]:
    """Describe what the figures were measured on."""
    return {
        "cores": os.cpu_count(),
        "processor": _processor(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "python": platform.python_version(),
        "versions": {
            name: version(name) for name in ("numpy", "scipy", "opencv-python-headless", "polars", "rerun-sdk")
        },
        "blas": sorted({f"{one['internal_api']} {one['version']}" for one in threadpool_info()}),
    }


def _processor() -> str:
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()
