"""The folder of a report: ``index.html`` and its figures as files.

index.html          the page, complete in itself
figures/NN-*.svg    each figure, to edit
figures/NN-*.png    each figure, to paste
figures/NN-*.csv    what each figure draws
run.json            what the report is about, and which files it wrote
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from omnieval.errors import ResultError
from omnieval.report.build import Order, build
from omnieval.report.draw import png_of, svg_of
from omnieval.report.figure import Content, Figure, Skipped
from omnieval.report.page import Drawn, page
from omnieval.report.sources import open_sources
from omnieval.results.atomic import replacing
from omnieval.results.folder import FIGURES, PAGE, REPORT, ResultFolder, report_files
from omnieval.results.manifest import expanded


@dataclass(frozen=True)
class Report:
    """A report as it was written.

    Attributes
    ----------
    folder
        Where it is.
    content
        What it shows.
    files
        Everything in it besides ``run.json``, relative to the folder.
    """

    folder: Path
    content: Content
    files: tuple[str, ...]

    @property
    def page(self) -> Path:
        """The page to open."""
        return self.folder / PAGE

    @property
    def skipped(self) -> list[Skipped]:
        """The figures that could not be drawn."""
        return [block for section in self.content.sections for block in section.blocks if isinstance(block, Skipped)]


def write_report(
    paths: Iterable[str | Path], order: Order | None = None, *, out: str | Path | None = None, overwrite: bool = False
) -> Report:
    """Write the report of folders of results.

    Parameters
    ----------
    paths
        Run folders, ablations and baselines.
    order
        What is asked of it.
    out
        Folder to write; default ``report`` inside the first path.
    overwrite
        Replace an earlier report there; only files that it wrote itself.

    Raises
    ------
    ConfigError
        If no replay has the step that was asked for.
    ResultError
        If a path cannot be read, or the folder not be written.
    """
    given = [expanded(path) for path in paths]
    sources = open_sources(given)
    folder = expanded(out or given[0] / REPORT)
    about: dict[str, Any] = {"paths": [str(path) for path in given]}
    about["versions"] = {name: version(name) for name in ("omnieval", "altair", "vl-convert-python")}
    with ResultFolder(folder, REPORT, files=report_files(folder), overwrite=overwrite) as held:
        content = build(sources, order or Order())  # an earlier report stays until there is a new one
        files = _files(content)
        held.begin(about | {"files": list(files)})
        _write(folder, files)
        held.complete()
    return Report(folder, content, tuple(files))


def _files(content: Content) -> dict[str, bytes]:
    """Return every file of a report by its name within the folder."""
    figures = [block for section in content.sections for block in section.blocks if isinstance(block, Figure)]
    drawn: dict[int, Drawn] = {}
    files: dict[str, bytes] = {}
    for number, figure in enumerate(figures, start=1):
        one = Drawn(number, f"{number:02d}-{figure.key}", svg_of(figure.chart, f"figure-{number}"))
        drawn[id(figure)] = one
        files[f"{FIGURES}/{one.stem}.svg"] = one.svg.encode()
        files[f"{FIGURES}/{one.stem}.png"] = png_of(one.svg)
        files[f"{FIGURES}/{one.stem}.csv"] = figure.data.write_csv().encode()
    return {PAGE: page(content, drawn, version("omnieval")).encode(), **files}


def _write(folder: Path, files: dict[str, bytes]) -> None:
    try:
        (folder / FIGURES).mkdir(exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot write {folder / FIGURES}: {error.strerror}; choose another --out") from error
    for name, content in files.items():
        with replacing(folder / name) as temporary:
            temporary.write_bytes(content)
