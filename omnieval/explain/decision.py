"""One decision with its surroundings: the image, its best match in metres and rooms, and every number compared."""

from __future__ import annotations

from dataclasses import dataclass

from omnieval.explain.capture import Capture
from omnieval.explain.revisit import Revisit
from omnieval.mapping.step import Centroid, Margin, Match, NodeEvent, NodeGate, Step, Verdict


@dataclass(frozen=True, slots=True)
class BestMatch:
    """The most similar image of the candidate nodes (`Match`, without the curves).

    Attributes
    ----------
    capture
        The image.
    node
        Its node at that step.
    distance
        Metres between the two capture points; None without poses.
    shift
        Cells it is rolled to align with the new image.
    shift_degrees
        The same as an angle in (-180, 180]; None where the number of cells is unknown.
    position, orientation, similarity
        s_pos, s_ori and their product s.
    prominence, prominence_mean, prominence_ratio
        Prominence of its peak, the mean it is compared with, and their ratio, which is held against gamma.
    peaks
        Number of peaks on the similarity curve.
    """

    capture: Capture
    node: int
    distance: float | None
    shift: int
    shift_degrees: float | None
    position: float
    orientation: float
    similarity: float
    prominence: float
    prominence_mean: float
    prominence_ratio: float
    peaks: int

    @property
    def best_frame(self) -> int:
        """Frame number of the image."""
        return self.capture.frame


@dataclass(frozen=True)
class Decision:
    """A step with its surroundings; the fields are those of `Step`, besides these.

    Attributes
    ----------
    capture
        The image.
    match
        Its best match; None without candidate.
    revisit
        The earlier image with which a loop would rightly be closed; None where there is none, or no ground truth.
    """

    capture: Capture
    verdict: Verdict
    node: int | None
    gate: NodeGate | None
    match: BestMatch | None
    revisit: Revisit | None
    centroid: Centroid | None
    run: int
    events: tuple[NodeEvent, ...]
    active: int
    pending: int
    margin: Margin | None
    merge_ratio: float | None


def decision(step: Step, capture: Capture, match: BestMatch | None, revisit: Revisit | None = None) -> Decision:
    """Put a step into its surroundings."""
    return Decision(
        capture=capture,
        verdict=step.verdict,
        node=step.node,
        gate=step.gate,
        match=match,
        revisit=revisit,
        centroid=step.centroid,
        run=step.run,
        events=step.events,
        active=step.active,
        pending=step.pending,
        margin=step.margin,
        merge_ratio=step.merge_ratio,
    )


def best_match(match: Match, capture: Capture, best: Capture, cells: int | None) -> BestMatch:
    """Return the best match of a step as the image `best`, seen from the image `capture`.

    Parameters
    ----------
    match
        Image-level loop closure of the step.
    capture, best
        The new image and the most similar one.
    cells
        Cells of the orientation descriptor, None where unknown.
    """
    return BestMatch(
        capture=best,
        node=match.node,
        distance=capture.distance(best),
        shift=match.shift,
        shift_degrees=shift_degrees(match.shift, cells),
        position=float(match.position[match.best]),
        orientation=float(match.orientation[match.best]),
        similarity=float(match.similarity[match.best]),
        prominence=match.prominence,
        prominence_mean=match.prominence_mean,
        prominence_ratio=match.prominence_ratio,
        peaks=match.peaks,
    )


def shift_degrees(shift: int, cells: int | None) -> float | None:
    """Return a shift of cells as an angle in (-180, 180] degrees; None where the number of cells is unknown.

    Examples
    --------
    >>> shift_degrees(192, 256)
    -90.0
    """
    if cells is None:
        return None
    degrees = 360.0 * (shift % cells) / cells
    return degrees - 360.0 if degrees > 180.0 else degrees
