"""From JPEG files to descriptions."""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from omnieval.components.component import resolve_component
from omnieval.config import resolve
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import Describer
from omnieval.imaging.camera import resolve_camera
from omnieval.imaging.decode import decode_grey
from tests.benchmarks.figures import Figure, seconds_of
from tests.benchmarks.sequences import building
from tests.reference.gist import gist as plain_gist
from tests.reference.hog import hog as plain_hog

FRAMES = 400
THREADS = 2


def measure() -> list[Figure]:
    """Measure describing, beside the pixel-by-pixel oracle, and beside decoding and transforms alone."""
    frames = building().frames[:FRAMES]
    camera = resolve_camera(building(), resolve().imaging)
    data = [frame.read() for frame in frames[:100]]
    panorama = camera.panorama(decode_grey(data[0], "first"), where="first")

    def decode() -> None:
        with ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(lambda one: camera.panorama(decode_grey(one, "image"), where="image"), data))

    bounds = {
        "hog": (len(data) / seconds_of(decode), "decode + unwrap on as many threads"),
        "gist": (THREADS / seconds_of(lambda: _transforms(panorama), 9), "its FFTs on as many threads"),
    }
    figures = []
    for name, plain, target in (("hog", plain_hog, ">= 400"), ("gist", plain_gist, ">= 60")):
        descriptor, speeds = resolve_component("descriptor", name), []
        for _ in range(3):
            with tempfile.TemporaryDirectory() as folder, DescriptorCache(Path(folder)) as cold:
                started = time.perf_counter()
                for _ in Describer(camera, descriptor, cold).describe_frames(frames):
                    pass
                speeds.append(FRAMES / (time.perf_counter() - started))
        started = time.perf_counter()
        plain(panorama)
        bound, bounded_by = bounds[name]
        figures.append(
            Figure(
                f"describe, {name}, cold",
                "frames/s",
                float(np.median(speeds)),
                plain=1 / (time.perf_counter() - started),
                bound=bound,
                bounded_by=bounded_by,
                target=target,
            )
        )
    return figures


def _transforms(panorama: NDArray[np.uint8]) -> None:
    """Transform there once and back 16 times on both levels, as gist has to."""
    for step in (1, 2):
        padded = np.pad(panorama[::step, ::step].astype(np.float32), ((16, 16), (0, 0)), mode="symmetric")
        spectrum = scipy.fft.fft2(padded)
        for _ in range(16):
            scipy.fft.ifft2(spectrum)
