"""The page, from its template: one HTML file that is complete in itself.

Figures stand in it as SVG, see `draw` for why. Colours of text and lines follow the reader's light or dark scheme: the
style sheet overrides the few attributes that `palette` reserves for them.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from omnieval.report.figure import Content, Figure, Gallery, Skipped, Table
from omnieval.text_table import typeset
from omnieval.wording import ordinal

_MOST_ROWS = 60
"""Rows of the table under a figure; the file beside the page has all."""
_SVG = re.compile(
    r'<svg [^>]*?width="([\d.]+)" height="([\d.]+)"[^>]*>(<rect width="[\d.]+" height="[\d.]+" fill="white"/>)?'
)


@dataclass(frozen=True)
class Drawn:
    """A figure as it stands in files: its number, the stem of their names, and the SVG."""

    number: int
    stem: str
    svg: str


def page(content: Content, drawn: Mapping[int, Drawn], version: str) -> str:
    """Return the page.

    Parameters
    ----------
    content
        What it shows.
    drawn
        The figures of `content` by their `id()`.
    version
        Of omnieval.
    """
    template = _environment().get_template("page.html.j2")
    return template.render(content=content, drawn=lambda figure: drawn[id(figure)], version=version)


def _environment() -> Environment:
    room = Environment(
        loader=PackageLoader("omnieval.report"), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    room.filters |= {"typeset": typeset, "inline": _inline, "data": _data, "base64": _base64}
    room.tests |= {
        "table": lambda block: isinstance(block, Table),
        "gallery": lambda block: isinstance(block, Gallery),
        "skipped": lambda block: isinstance(block, Skipped),
    }
    return room


def _inline(drawn: Drawn) -> dict[str, str]:
    """Return the width, the height and the marks of an SVG, without its paper, to be part of the page."""
    found = _SVG.match(drawn.svg)
    if found is None:
        raise ValueError(f"figure {drawn.number} is not an SVG of known form")
    width, height = (f"{float(number):g}" for number in found.groups()[:2])
    return {"width": width, "height": height, "marks": Markup(drawn.svg[found.end() :].removesuffix("\n"))}


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _data(figure: Figure, drawn: Drawn) -> Table:
    stride = -(-len(figure.data) // _MOST_ROWS)
    rows = figure.data.gather_every(stride) if stride > 1 else figure.data
    every = f"Every {ordinal(stride)} row; the file figures/{drawn.stem}.csv has all." if stride > 1 else ""
    return Table("data", "", tuple(rows.columns), (("", tuple(rows.iter_rows())),), (every,) if every else ())
