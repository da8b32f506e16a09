"""What a report is made of: figures, tables, and the reasons why a figure is not there."""

from __future__ import annotations

from dataclasses import dataclass

import altair as alt
import polars as pl

from omnieval.text_table import Cell, sides

Chart = alt.Chart | alt.LayerChart | alt.FacetChart | alt.HConcatChart | alt.VConcatChart | alt.ConcatChart


@dataclass(frozen=True)
class Figure:
    """One figure.

    Attributes
    ----------
    key
        What it shows, as part of a file name.
    title
        A few words.
    caption
        What one sees, and which figure of the paper it corresponds to. Plain text.
    alt
        The same for readers who cannot see it: kind, axes, and what stands out.
    chart
        The drawing.
    data
        What is drawn, one row per mark or value, to be read as a table.
    """

    key: str
    title: str
    caption: str
    alt: str
    chart: Chart
    data: pl.DataFrame


@dataclass(frozen=True)
class Skipped:
    """A figure that cannot be drawn, and the sentence that says why."""

    title: str
    reason: str


@dataclass(frozen=True)
class Table:
    """A table to read: rows in groups, and notes below.

    Attributes
    ----------
    key
        What it shows, as part of an anchor.
    title
        A few words.
    columns
        Their names, with units.
    groups
        (name, rows); the name says whose rows they are, empty when there is only one group.
    notes
        Sentences that must be read with it.
    """

    key: str
    title: str
    columns: tuple[str, ...]
    groups: tuple[tuple[str, tuple[tuple[Cell, ...], ...]], ...]
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> list[tuple[Cell, ...]]:
        """The rows of all groups."""
        return [row for _, rows in self.groups for row in rows]

    @property
    def sides(self) -> str:
        """``r`` for each column of numbers and ``l`` for each of text."""
        return sides(len(self.columns), self.rows)


@dataclass(frozen=True)
class Photo:
    """A JPEG file of `width` by `height` pixels, what stands below it, and the same for who cannot see it."""

    jpeg: bytes
    width: int
    height: int
    label: str
    alt: str


@dataclass(frozen=True)
class Gallery:
    """Pictures side by side."""

    key: str
    title: str
    caption: str
    photos: tuple[Photo, ...]


Block = Figure | Skipped | Table | Gallery


@dataclass(frozen=True)
class Section:
    """A part of the page: a heading, facts as names and values, and blocks in order."""

    heading: str
    facts: tuple[tuple[str, str], ...]
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Content:
    """A whole report."""

    title: str
    sections: tuple[Section, ...]
