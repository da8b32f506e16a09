"""Videos, read with OpenCV (FFmpeg): every frame, or every N-th, as a lossless PNG with its time in the stream."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import cv2

from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import Scan
from omnieval.datasets.sequence import Frame
from omnieval.datasets.source import Address, parse
from omnieval.datasets.streams.image import file_name, png
from omnieval.datasets.streams.scan import scan_stream
from omnieval.datasets.streams.store import Contents
from omnieval.errors import DatasetError

_MISSING_SHARE = 0.01
"""Of frames and of time that must be missing for a video to be called cut off: what a header says is not exact."""


def scan_video(rest: str) -> Scan:
    """Read a video (``PATH[#every=N]``), decoding it into the cache if need be, and note every fault."""
    address = parse("video", rest)
    return scan_stream(address, [address.path], lambda folder: _decode(address, folder))


def _decode(address: Address, folder: Path) -> Contents:
    capture = cv2.VideoCapture(str(address.path), cv2.CAP_FFMPEG)
    try:
        if not capture.isOpened():
            raise DatasetError(
                "cannot be read as a video: it is cut off, damaged, or of a kind that OpenCV does not decode; copy it "
                "again, or convert it to MP4"
            )
        rate = capture.get(cv2.CAP_PROP_FPS)
        announced = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        files: list[str] = []
        times: list[float] = []
        while capture.grab():
            number = len(times)
            times.append(capture.get(cv2.CAP_PROP_POS_MSEC))
            if number % address.every:
                continue
            sound, image = capture.retrieve()
            if not sound:
                raise DatasetError(f"frame {number} cannot be decoded; copy the video again")
            files.append(file_name(number, ".png"))
            (folder / files[-1]).write_bytes(png(image))
    finally:
        capture.release()
    if not files:
        raise DatasetError("holds no frame that can be decoded; copy it again")
    seconds, findings = _seconds(times, rate)
    findings += _ends_early(seconds, announced, rate)
    taken = seconds[:: address.every]
    frames = (
        Frame(folder / file, file, None if time is None else round(time * 1e9))
        for file, time in zip(files, taken, strict=True)
    )
    return Contents(tuple(frames), tuple(findings))


def _seconds(times: list[float], rate: float) -> tuple[list[float | None], list[Finding]]:
    """Return the times of all frames in seconds, from their number where the stream has none."""
    if all(earlier < later for earlier, later in pairwise(times)):
        return [time / 1e3 for time in times], []
    if math.isfinite(rate) and rate > 0:
        message = f"the stream has no times of its frames; {rate:g} frames a second are taken for granted"
        return [number / rate for number in range(len(times))], [Finding("warning", "times-from-rate", ROOT, message)]
    message = "the stream has neither times nor a rate of its frames; they have no time"
    return [None] * len(times), [Finding("warning", "no-times", ROOT, message)]


def _ends_early(seconds: list[float | None], announced: float, rate: float) -> list[Finding]:
    """Return a finding if less could be decoded than the header announces, in frames and in time."""
    last = seconds[-1]
    if not (math.isfinite(announced) and math.isfinite(rate) and rate > 0) or last is None:
        return []
    kept = 1 - _MISSING_SHARE
    if len(seconds) >= kept * announced - 1 or last + 2 / rate >= kept * announced / rate:
        return []
    message = f"ends early: {len(seconds)} of {announced:.0f} frames can be decoded; copy the video again"
    return [Finding("warning", "ends-early", ROOT, message)]
