"""What is wrong with the images of a sequence, or odd about them, all at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from omnieval.datasets.findings import Finding
from omnieval.datasets.image_header import TURNS
from omnieval.datasets.images import ImageReport, used_bits, usual_size, wrong_size
from omnieval.datasets.scan import place_of


def image_findings(reports: Mapping[Path, ImageReport], root: Path) -> list[Finding]:
    """Return what is wrong with the images of a sequence in the folder `root` or odd about them, in their order."""
    usual = _Usual.of(reports.values())
    return [
        Finding("error" if code in faults else "warning", code, place_of(path, root), message)
        for path, report in reports.items()
        for faults in [{report.code, "wrong-size"}]
        for code, message in _told(report, usual)
    ]


def bits_of(reports: Iterable[ImageReport]) -> int | None:
    """Return how many of 16 bits a channel the images of a sequence use; None if none has so many."""
    highest = [report.highest for report in reports if report.highest is not None]
    return used_bits(max(highest)) if highest else None


@dataclass(frozen=True, slots=True)
class _Usual:
    """What most sound images of a sequence are."""

    size: tuple[int, int] | None
    kind: str
    orientation: int
    bits: int | None

    @staticmethod
    def of(reports: Iterable[ImageReport]) -> _Usual:
        sound = [report for report in reports if report.size is not None]
        kinds = Counter(report.header.kind for report in sound)
        turns = Counter(report.header.orientation for report in sound)
        return _Usual(
            usual_size(sound),
            min(kinds, key=lambda kind: (-kinds[kind], kind), default=""),
            min(turns, key=lambda turn: (-turns[turn], turn), default=1),
            bits_of(sound),
        )


def _told(report: ImageReport, usual: _Usual) -> Iterator[tuple[str, str]]:
    """Yield the codes and messages of the findings on one image."""
    if report.size is None:
        yield report.code, report.message
        return
    header = report.header
    if usual.size is not None and report.size != usual.size:
        yield "wrong-size", wrong_size(report.size, usual.size)
    if header.kind != usual.kind:
        yield "mixed-kinds", f"is {header.kind}, most are {usual.kind}; move masks, depth and the like elsewhere"
    if header.orientation != usual.orientation:
        one, most = _turn(header.orientation), _turn(usual.orientation)
        yield "mixed-orientation", f"is {one} by its EXIF orientation, most are {most}; is the camera the same?"
    elif header.orientation in TURNS:
        yield "turned-image", f"is {_turn(header.orientation)}, as its EXIF orientation says"
    if report.highest is not None and usual.bits != 16:
        yield "few-bits", f"uses {usual.bits} of its 16 bits; the values are scaled by these"
    if report.is_flat:
        yield "no-contrast", "shows nothing: its grey levels hardly differ"
    if report.lacks_end:
        yield "no-end-marker", "lacks its last bytes, but no pixels; it is read as it is"


def _turn(orientation: int) -> str:
    return TURNS.get(orientation, "not turned")
