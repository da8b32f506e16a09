"""Where a sequence is not what its data card says."""

from __future__ import annotations

import math
from itertools import pairwise

from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import Scan
from omnieval.datasets.sequence import Frame

LENGTH_TOLERANCE = 0.02
"""Relative; publications do not say how they measured the length."""


def card_findings(found: Scan) -> list[Finding]:
    """Return where the number of images and the length of the path differ from the card; no image is read for it."""
    known = found.known_card
    expected = known.sequence(found.card_sequence) if known else None
    if known is None or expected is None:
        return []
    findings: list[Finding] = []
    label = f"the card {known.name} says {expected.path} has"
    if expected.images is not None and expected.images != len(found.frames):
        message = f"{len(found.frames)} images, {label} {expected.images}"
        findings.append(Finding("warning", "count-differs", ROOT, message))
    length = path_length(found.frames)
    if expected.length_m is not None and length is not None and _differs(length, expected.length_m):
        message = f"the path is {length:.2f} m long, {label} {expected.length_m:.2f} m"
        findings.append(Finding("warning", "length-differs", ROOT, message))
    return findings


def size_findings(size: tuple[int, int] | None, expected: tuple[int, int] | None) -> list[Finding]:
    """Return where the size of most images, (width, height) in pixels, differs from what the card expects."""
    if size is None or expected is None or size == expected:
        return []
    message = f"images are {_pixels(size)}, the card says {_pixels(expected)}"
    return [Finding("warning", "size-differs", ROOT, message)]


def path_length(frames: tuple[Frame, ...]) -> float | None:
    """Return the length of the polyline through the positions, metres; None unless all are known and finite."""
    positions = [(frame.pose.x, frame.pose.y) for frame in frames if frame.pose is not None]
    if not frames or len(positions) < len(frames):
        return None
    length = sum(math.dist(a, b) for a, b in pairwise(positions))
    return length if math.isfinite(length) else None


def _differs(length: float, expected: float) -> bool:
    return abs(length - expected) > LENGTH_TOLERANCE * expected


def _pixels(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
