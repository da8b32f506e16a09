"""Charts as SVG and PNG, the same bytes every time; the only file that knows the renderer.

The page holds the figures as SVG without any JavaScript. Interactive charts would need 1 MB of Vega in every page, draw
nothing where scripts are off, print badly and be opaque to screen readers; what tooltips would tell is in the table
under each figure.
"""

from __future__ import annotations

import re
from itertools import count
from typing import Any

import altair as alt
import vl_convert

from omnieval.palette import GRID, INK, MUTED
from omnieval.report.figure import Chart

PNG_SCALE = 2.0
"""Pixels of the PNG for each of the SVG: sharp in print at column width."""

_FONT = "Liberation Sans, Arial, Helvetica, sans-serif"
_LABEL, _TITLE = 11, 12
CONFIG: dict[str, Any] = {
    "background": "white",
    "font": _FONT,
    "padding": 8,
    "view": {"stroke": None, "continuousWidth": 640, "continuousHeight": 260},
    "axis": {
        "aria": False,
        "domainColor": MUTED,
        "gridColor": GRID,
        "tickColor": MUTED,
        "labelColor": INK,
        "labelFontSize": _LABEL,
        "titleColor": INK,
        "titleFontSize": _TITLE,
        "titleFontWeight": "normal",
        "titlePadding": 8,
    },
    "legend": {
        "aria": False,
        "labelColor": INK,
        "labelFontSize": _LABEL,
        "titleColor": INK,
        "titleFontSize": _TITLE,
        "titleFontWeight": "normal",
    },
    "title": {"aria": False, "color": INK, "fontSize": _TITLE + 1, "fontWeight": "bold", "anchor": "start"},
    "text": {"fill": INK, "font": _FONT},
    "mark": {"aria": False},
}
"""How all figures look. What is drawn is described in words beside it, mark by mark it would only be noise."""

_GEOMETRY = re.compile(r' (?:d|transform|[xy][12]?|width|height|viewBox)="[^"]*"')
_DECIMALS = re.compile(r"\d+\.\d{3,}")
_IDS = re.compile(r'(?<=id=")[\w-]+(?=")|(?<=url\(#)[\w-]+(?=\))|(?<=href="#)[\w-]+(?=")')
_VERSION = ".".join(alt.SCHEMA_VERSION.lstrip("v").split(".")[:2])


def spec_of(chart: Chart) -> dict[str, Any]:
    """Return a chart as the Vega-Lite it is drawn from."""
    return {**chart.to_dict(), "config": CONFIG}


def svg_of(chart: Chart, name: str) -> str:
    """Return a chart as SVG.

    Parameters
    ----------
    chart
        What to draw.
    name
        Begins all ids in it, so that several figures can stand on one page.
    """
    drawn = vl_convert.vegalite_to_svg(spec_of(chart), vl_version=_VERSION)
    return _rounded(_renamed(drawn, name))


def png_of(svg: str) -> bytes:
    """Return an SVG as PNG, `PNG_SCALE` pixels for each of its own."""
    return vl_convert.svg_to_png(svg, scale=PNG_SCALE)


def _renamed(svg: str, name: str) -> str:
    """Give ids numbers in the order of this figure; the renderer counts on from figure to figure."""
    numbers = count(1)
    names: dict[str, str] = {}
    return _IDS.sub(lambda found: names.setdefault(found[0], f"{name}-{next(numbers)}"), svg)


def _rounded(svg: str) -> str:
    """Round coordinates to a hundredth of a pixel, which halves the size of the page."""
    return _GEOMETRY.sub(lambda part: _DECIMALS.sub(_two_decimals, part[0]), svg)


def _two_decimals(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")
