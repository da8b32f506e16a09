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
from omnieval.results.inside import FIGURES, PAGE, REPORT, report_files
from omnieval.results.manifest import MANIFEST, Manifest, read_manifest


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
    paths: Iterable[Path], order: Order | None = None, *, out: Path | None = None, overwrite: bool = False
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
    given = list(paths)
    sources = open_sources(given)
    folder = out or given[0] / REPORT
    _refuse(folder, overwrite=overwrite)
    content = build(sources, order or Order())
    files = _files(content)
    about: dict[str, Any] = {"paths": [str(path) for path in given], "files": list(files)}
    about["versions"] = {name: version(name) for name in ("omnieval", "altair", "vl-convert-python")}
    manifest = Manifest(folder, REPORT, about, files=report_files(folder), overwrite=overwrite)
    with manifest.closing():
        _write(folder, files)
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


def _refuse(folder: Path, *, overwrite: bool) -> None:
    """Say so at once, and not after minutes, if the folder cannot be taken."""
    try:
        written, occupied = (folder / MANIFEST).exists(), folder.is_dir() and any(folder.iterdir())
    except OSError as error:
        raise ResultError(f"cannot write to {folder}: {error.strerror or error}; choose another --out") from error
    if written:
        read_manifest(folder, REPORT)
        if not overwrite:
            raise ResultError(f"{folder} holds a {REPORT} already; choose another --out or pass --overwrite")
    elif occupied:
        raise ResultError(f"{folder} holds files that are not a {REPORT} of omnieval; choose another --out")
