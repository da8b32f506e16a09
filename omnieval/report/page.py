"""The page: one HTML file with its style and all figures inside, that asks the network for nothing and runs no script.

Figures stand in it as SVG, see `draw` for why. Colours of text and lines follow the reader's light or dark scheme: the
style sheet overrides the few attributes that `palette` reserves for them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

import polars as pl

from omnieval.report import markup
from omnieval.report.figure import Block, Content, Figure, Section, Skipped, Table
from omnieval.report.published import DOI, PAPER
from omnieval.report.wording import ordinal

_STYLE = Path(__file__).with_name("style.css")
_MOST_ROWS = 60
"""Rows of the table under a figure; the file beside the page has all."""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
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
    style = _STYLE.read_text("utf-8")
    anchors = [f"section-{number}" for number in range(1, len(content.sections) + 1)]
    sections = "".join(
        _section(section, anchor, drawn) for section, anchor in zip(content.sections, anchors, strict=True)
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="color-scheme" content="light dark">\n<title>{escape(content.title)}</title>\n'
        f'<link rel="icon" href="data:,">\n<style>\n{style}</style>\n</head>\n<body>\n'
        '<a class="skip" href="#content">Skip to the content</a>\n'
        f"<header><h1>{escape(content.title)}</h1><p>Incremental topological mapping after "
        f'<a href="{DOI}">{PAPER}</a>, replayed by omnieval {escape(version)}.</p></header>\n'
        f'{_contents(content, anchors, drawn)}<main id="content">\n{sections}</main>\n</body>\n</html>\n'
    )


def _contents(content: Content, anchors: list[str], drawn: Mapping[int, Drawn]) -> str:
    items = []
    for section, anchor in zip(content.sections, anchors, strict=True):
        inner = "".join(_entry(block, anchor, drawn) for block in section.blocks)
        items.append(
            f'<li><a href="#{anchor}">{escape(section.heading)}</a>{f"<ul>{inner}</ul>" if inner else ""}</li>'
        )
    return f'<nav aria-label="Contents"><h2>Contents</h2><ol>{"".join(items)}</ol></nav>\n'


def _entry(block: Block, anchor: str, drawn: Mapping[int, Drawn]) -> str:
    if isinstance(block, Skipped):
        return ""
    if isinstance(block, Table):
        return f'<li><a href="#{anchor}-{block.key}">{escape(block.title)}</a></li>'
    figure = drawn[id(block)]
    return f'<li><a href="#figure-{figure.number}">Figure {figure.number}. {escape(block.title)}</a></li>'


def _section(section: Section, anchor: str, drawn: Mapping[int, Drawn]) -> str:
    facts = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in section.facts if value)
    blocks = "".join(_block(block, anchor, drawn) for block in section.blocks)
    return (
        f'<section id="{anchor}" aria-labelledby="{anchor}-heading"><h2 id="{anchor}-heading">'
        f"{escape(section.heading)}</h2>{f'<dl>{facts}</dl>' if facts else ''}{blocks}</section>\n"
    )


def _block(block: Block, anchor: str, drawn: Mapping[int, Drawn]) -> str:
    if isinstance(block, Skipped):
        return f'<div class="skipped"><h3>{escape(block.title)}</h3><p>Not drawn: {escape(block.reason)}.</p></div>'
    if isinstance(block, Table):
        title = f'<h3 id="{anchor}-{block.key}">{escape(block.title)}</h3>'
        return f'<div class="table">{title}{markup.html(block, caption=block.title)}</div>'
    return _figure(block, drawn[id(block)])


def _figure(figure: Figure, drawn: Drawn) -> str:
    name = f"figure-{drawn.number}"
    files = " · ".join(
        f'<a href="figures/{drawn.stem}.{kind}">{kind.upper()}<span class="hidden"> of figure {drawn.number}</span></a>'
        for kind in ("svg", "png", "csv")
    )
    return (
        f'<figure id="{name}" aria-labelledby="{name}-title"><h3 id="{name}-title">Figure {drawn.number}. '
        f'{escape(figure.title)}</h3><div class="scroll" tabindex="0" role="region" '
        f'aria-label="Figure {drawn.number}, scrolls sideways">{_inline(figure, drawn)}</div>'
        f"<figcaption>{escape(figure.caption)}</figcaption>"
        f"<details><summary>Data of figure {drawn.number} ({len(figure.data)} rows)</summary>"
        f'{_data(figure, drawn)}</details><p class="files">{files}</p></figure>'
    )


def _inline(figure: Figure, drawn: Drawn) -> str:
    """Return the SVG as part of the page: named, without paper, as wide as there is room."""
    found = _SVG.match(drawn.svg)
    if found is None:
        raise ValueError(f"figure {drawn.number} is not an SVG of known form")
    width, height = (float(number) for number in found.groups()[:2])
    label = f"figure-{drawn.number}-alt"
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-labelledby="{label}" '
        f'viewBox="0 0 {width:g} {height:g}" style="--width:{width:g}px" '
        f'focusable="false"><title id="{label}">{escape(figure.alt)}</title>'
    )
    return head + drawn.svg[found.end() :].removesuffix("\n")


def _data(figure: Figure, drawn: Drawn) -> str:
    stride = -(-len(figure.data) // _MOST_ROWS)
    rows = figure.data.gather_every(stride) if stride > 1 else figure.data
    every = f"Every {ordinal(stride)} row; the file figures/{drawn.stem}.csv has all." if stride > 1 else ""
    table = Table("data", "", tuple(rows.columns), (("", tuple(_rows(rows))),), (every,) if every else ())
    return markup.html(table, caption=f"Data of figure {drawn.number}")


def _rows(data: pl.DataFrame) -> Iterator[tuple[str | int | float | None, ...]]:
    for row in data.iter_rows():
        yield tuple(("yes" if cell else "no") if isinstance(cell, bool) else cell for cell in row)
