"""Where a result comes from: versions, the code that decides, the data, and the identity of a run."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from omnieval.datasets.sequence import Frame
from omnieval.source_code import digest_of, files_digest

_LIBRARIES = (
    "numpy",
    "scipy",
    "scikit-learn",
    "opencv-python-headless",
    "simplejpeg",
    "polars",
    "pydantic",
    "rerun-sdk",
)
_DECIDING = (
    "datasets/sequence.py",
    "datasets/images.py",
    "datasets/jpeg.py",
    "imaging",
    "descriptors",
    "mapping",
    "baselines",
    "metrics",
    "seeding.py",
)
"""The parts of the package that a result can depend on."""


def versions() -> dict[str, str]:
    """Return the versions of omnieval, Python and the libraries a result may depend on."""
    return {
        "omnieval": _version("omnieval"),
        "python": platform.python_version(),
        **{one: _version(one) for one in _LIBRARIES},
    }


@cache
def _version(name: str) -> str:
    return version(name)


@cache
def code_digest() -> str:
    """Return a digest of the source files that a result can depend on."""
    root = Path(__file__).parents[1]
    parts = [root / name for name in _DECIDING]
    files = sorted(file for part in parts for file in (part.rglob("*.py") if part.is_dir() else [part]))
    return files_digest(tuple(files), root)


def dataset_fingerprint(frames: Sequence[Frame], image_digests: Iterable[str]) -> str:
    """Return a digest of the images of a sequence, their names, poses and labels, in order; no path, no host.

    Parameters
    ----------
    frames
        The frames of the sequence.
    image_digests
        Digest of the bytes of each image.
    """
    described = [
        [frame.file, digest, frame.time_ns, [pose.x, pose.y, pose.yaw] if (pose := frame.pose) else None, frame.room]
        for frame, digest in zip(frames, image_digests, strict=True)
    ]
    return digest_of(described)


def identity(configuration: dict[str, Any], fingerprint: str) -> str:
    """Return the identity of a run: equal identities have equal tables."""
    return digest_of({"configuration": configuration, "dataset": fingerprint, "code": code_digest()})
