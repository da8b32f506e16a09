"""Sequences of many thousand images through ``omnieval map``: time a step, and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.archive import save_archive
from tests.benchmarks.sequences import building, walk

TAIL = 500
"""Steps at the end of a sequence whose time is given."""


def measure(lengths: Sequence[int]) -> list[dict[str, Any]]:
    """Return a row for each length: steps, what their time and memory were, and what the map came to."""
    with tempfile.TemporaryDirectory() as folder:
        return [_run(length, Path(folder)) for length in lengths]


def _run(length: int, folder: Path) -> dict[str, Any]:
    archive, out = folder / "walk.npz", folder / f"run-{length}"
    images = list(walk(length))
    frames = building().frames
    names = [f"{number:06d}.jpeg" for number in range(length)]
    named = [Frame(Path(name), name, pose=frames[number % len(frames)].pose) for number, name in enumerate(names)]
    position, orientation = [image.position for image in images], [image.orientation for image in images]
    save_archive(archive, named, np.stack(position), np.stack(orientation))
    del images, position, orientation
    command = [sys.executable, "-m", "omnieval", "map", str(archive), "--out", str(out), "--json"]
    with (folder / "summary.json").open("w+", encoding="utf-8") as printed:
        process = subprocess.Popen(command, stdout=printed)
        _, status, usage = os.wait4(process.pid, 0)  # memory of this process alone
        if status:
            raise RuntimeError(f"omnieval map of {length} images ended with status {status}")
        printed.seek(0)
        summary = json.load(printed)
    steps = pl.read_parquet(out / "steps.parquet")
    tail = steps.tail(TAIL)
    archive.unlink()
    return {
        "images": length,
        "seconds": summary["timings"]["seconds"],
        "step_ms_median": tail["milliseconds"].median(),
        "step_ms_mean": tail["milliseconds"].mean(),
        "nodes": summary["metrics"]["nodes"],
        "peak_gigabytes": usage.ru_maxrss / 1e6,
    }
