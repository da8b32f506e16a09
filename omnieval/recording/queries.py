"""Records a localisation: queries beside what was found in the map, both places, errors over time, refusals in words.

What was found of a query is named after the strategies that found it; all other names are constant.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.recording import entities
from omnieval.recording.blueprint import log_view, map_view, plot, whole_window
from omnieval.recording.rerun_stream import Stream
from omnieval.recording.rows import NO_SEGMENTS, Page, Picture, Points, Row, Scalar, Segments, Words
from omnieval.recording.styles import (
    ACCEPTED_COLOR,
    CURVE_COLOR,
    GREY_TEXT_COLOR,
    MARKDOWN,
    MEASURED_COLOR,
    PENDING_COLOR,
    REFUSED_COLOR,
    line_style,
    map_styles,
)
from omnieval.recording.viewport import Origin, around, extent_of, origin_of

_COLORS = (REFUSED_COLOR, CURVE_COLOR, PENDING_COLOR, MEASURED_COLOR)
"""Of strategies, in their order."""
_FOUND = "/found"
_ERRORS = "/plot/error"
_REACHABLE = f"{_ERRORS}/reachable"

Place = tuple[float, float]


@dataclass(frozen=True)
class QueryAnswer:
    """What a strategy made of a query.

    Attributes
    ----------
    place
        Where the image that was found was taken, metres; None if the query was refused or that is not known.
    error
        How far that is from the query, metres.
    refused
        Why it was refused; None if it was not.
    panorama
        The most similar image, turned to the heading of the query, as JPEG.
    """

    place: Place | None
    error: float | None
    refused: str | None
    panorama: bytes | None


@dataclass(frozen=True)
class QueryView:
    """A query as it is shown: what to call it, when and where it was taken, and the answers by strategy."""

    title: str
    time_ns: int | None
    place: Place | None
    reachable: float | None
    panorama: bytes | None
    answers: dict[str, QueryAnswer]
    words: str


@dataclass(frozen=True)
class QueriesInfo:
    """What holds for a whole localisation.

    Attributes
    ----------
    name
        Shown in the viewer's list of recordings.
    page
        Markdown page with the metrics.
    strategies
        Their names.
    queries
        Number of queries of all sequences.
    xy, labels
        Where the images of the map were taken, metres, shape (n, 2), NaN where unknown, and their nodes, shape (n,).
    """

    name: str
    page: str
    strategies: tuple[str, ...]
    queries: int
    xy: NDArray[np.float64]
    labels: NDArray[np.int64]


def record_queries(path: Path, info: QueriesInfo, views: Iterator[QueryView]) -> None:
    """Write the recording; step n shows the n-th query.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    known = np.isfinite(info.xy).all(axis=1)
    extent = extent_of(info.xy[known]) if known.any() else None
    origin = origin_of(extent)
    shown = around(extent, origin)
    stream = Stream(
        path,
        application_id=f"{entities.APPLICATION} localization",
        recording_id=str(uuid.uuid4()),
        blueprint=_blueprint(info, shown),
    )
    stream.name(info.name, {})
    for entity, style in map_styles(int(info.labels.max(initial=0)) * 20, shown):
        if entity != entities.MAP_LEGEND:  # which is of loop closures
            stream.static(entity, style)
    points = (info.xy[known] - origin) * (1.0, -1.0)
    stream.static(entities.MAP_IMAGES, rr.Points2D(points, class_ids=info.labels[known].astype(np.uint16)))
    stream.static(entities.PAGE, rr.TextDocument(info.page, media_type=rr.MediaType.MARKDOWN))
    stream.static(entities.WHY, MARKDOWN)
    for strategy, color in zip(info.strategies, _colors(info.strategies), strict=True):
        stream.static(f"{_ERRORS}/{strategy}", line_style(strategy, color))
        style = rr.Points2D.from_fields(
            radii=rr.Radius.ui_points(6.0), colors=color, show_labels=False, draw_order=45.0
        )
        stream.static(f"{entities.MAP}{_FOUND}/{strategy}", style)
        width = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.5), draw_order=44.0)
        stream.static(f"{entities.MAP}{_FOUND}/{strategy}/line", width)
    stream.static(_REACHABLE, line_style("nearest image of the map", GREY_TEXT_COLOR))
    try:
        for number, view in enumerate(views):
            stream.begin(number, view.time_ns)
            stream.add([*_rows(view, info.strategies, origin)])
    finally:
        stream.close()
    if stream.failure:
        raise ResultError(f"the recording {path} was not made: {stream.failure}")


def _rows(view: QueryView, strategies: Sequence[str], origin: Origin) -> Iterator[tuple[str, Row]]:
    yield entities.PANORAMA, Picture(view.panorama)
    yield entities.WHY, Page(view.words)
    yield _REACHABLE, Scalar(np.nan if view.reachable is None else view.reachable)
    yield entities.MAP_ROBOT, _point(view.place, origin)
    refused = [f"{name}: {one.refused}" for name, one in view.answers.items() if one.refused is not None]
    said = f"{view.title}: {'; '.join(refused) if refused else 'found'}"
    level, color = ("REFUSED", REFUSED_COLOR) if refused else ("FOUND", ACCEPTED_COLOR)
    yield entities.LOG_DECISION, Words(said, level, color)
    for strategy, color in zip(strategies, _colors(strategies), strict=True):
        answer = view.answers[strategy]
        yield f"{_FOUND}/{strategy}", Picture(answer.panorama)
        yield f"{_ERRORS}/{strategy}", Scalar(np.nan if answer.error is None else answer.error)
        found = f"{entities.MAP}{_FOUND}/{strategy}"
        yield found, _point(answer.place, origin)
        yield f"{found}/line", _line(view.place, answer.place, origin, color)


def _point(place: Place | None, origin: Origin) -> Points:
    positions = np.zeros((0, 2)) if place is None else np.array([place]) - origin
    return Points(positions, np.zeros(len(positions), np.int64))


def _line(start: Place | None, end: Place | None, origin: Origin, color: int) -> Segments:
    if start is None or end is None:
        return NO_SEGMENTS
    return Segments(np.array([[start, end]]) - origin, np.array([color], np.uint32))


def _colors(strategies: Sequence[str]) -> list[int]:
    return [_COLORS[number % len(_COLORS)] for number, _ in enumerate(strategies)]


def _blueprint(info: QueriesInfo, extent: tuple[float, float, float, float] | None) -> rrb.Blueprint:
    pictures = [
        rrb.Spatial2DView(origin=entities.PANORAMA, name="Query"),
        *(
            rrb.Spatial2DView(origin=f"{_FOUND}/{strategy}", name=f"{strategy}: most similar, turned")
            for strategy in info.strategies
        ),
    ]
    words = rrb.Tabs(
        log_view("Found and refused"), rrb.TextDocumentView(origin=entities.PAGE, name="Metrics"), active_tab=0
    )
    root = rrb.Vertical(
        rrb.Horizontal(
            rrb.Vertical(*pictures),
            map_view("Map: the query is white, what was found has the colour of its line below", extent),
            rrb.TextDocumentView(origin=entities.WHY, name="Why"),
            column_shares=[0.34, 0.36, 0.30],
        ),
        rrb.Horizontal(
            plot(_ERRORS, "Error, m", info.queries, legend="LeftTop"),
            words,
            column_shares=[0.6, 0.4],
        ),
        row_shares=[0.68, 0.32],
    )
    return whole_window(root, "localization")
