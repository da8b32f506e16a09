"""Small sequences on disk for the tests: real layout, tiny images."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from omnieval.datasets import Pose
from omnieval.datasets.check import CheckReport
from omnieval.datasets.cold import format_name

START_NS = 1_152_904_768_652_404_000


def image_bytes(suffix: str = ".jpeg", *, width: int = 16, height: int = 12, seed: int = 0) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    return cv2.imencode(suffix, pixels)[1].tobytes()


def cold_names(count: int, *, step_m: float = 0.1, period_ns: int = 200_000_000) -> list[str]:
    """Names along a straight line of `step_m`, one every `period_ns`."""
    return [format_name(START_NS + i * period_ns, Pose(i * step_m, 0.0, math.pi / 4)) for i in range(count)]


def make_cold(
    root: Path, names: Sequence[str], *, label: Callable[[int], str] | None = lambda i: "CR-A", width: int = 16
) -> Path:
    """A COLD sequence folder with `names`; without `label` it has no places.lst."""
    (root / "omni_cam").mkdir(parents=True)
    for i, name in enumerate(names):
        (root / "omni_cam" / name).write_bytes(image_bytes(seed=i, width=width))
    if label is not None:
        (root / "localization").mkdir()
        lines = "".join(f"{name} {label(i)}\n" for i, name in enumerate(names))
        (root / "localization" / "places.lst").write_text(lines)
    return root


def make_folder(root: Path, names: Sequence[str], poses: str | None = None, camera: str | None = None) -> Path:
    """A folder of images with `names`, perhaps with a poses.csv and a camera.toml."""
    root.mkdir(parents=True, exist_ok=True)
    for i, name in enumerate(names):
        (root / name).write_bytes(image_bytes(Path(name).suffix.lower(), seed=i))
    if poses is not None:
        (root / "poses.csv").write_text(poses)
    if camera is not None:
        (root / "camera.toml").write_text(camera)
    return root


def codes(report: CheckReport) -> list[tuple[str, str]]:
    """Every finding as (code, where)."""
    return [(finding.code, finding.where) for finding in report.findings]
