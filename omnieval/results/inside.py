"""Folders of results inside others: a report in what it reports on, the best run in its ablation.

When the outer one is written anew, they would go on telling of what was there before.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

from omnieval.errors import ResultError
from omnieval.results.manifest import MANIFEST, read_manifest, refuse_running

REPORT = "report"
"""The kind of a report, and where it goes inside the first of what it reports on."""
PAGE = "index.html"
FIGURES = "figures"
_OF_REPORT = re.compile(rf"{re.escape(PAGE)}|{FIGURES}/\d{{2,}}-[\w-]+\.(svg|png|csv)")


def report_files(folder: Path) -> list[str]:
    """Return the files that a report in the folder says it wrote, as far as they can be a report's."""
    try:
        files = json.loads((folder / MANIFEST).read_text("utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    if not isinstance(files, list):
        return []
    return [name for name in files if isinstance(name, str) and _OF_REPORT.fullmatch(name)]


def report_inside(folder: Path) -> list[str]:
    """Return all files of the report inside a folder of results, relative to it; see `results_inside`."""
    return results_inside(folder, REPORT, REPORT, report_files(folder / REPORT))


def results_inside(folder: Path, name: str, kind: str, files: Iterable[str]) -> list[str]:
    """Return all files of the results inside other results, relative to these; none if there are no such results.

    Parameters
    ----------
    folder
        The outer folder.
    name, kind
        Name of the inner folder, and what it must hold to be ours.
    files
        Names or patterns of all that it can hold besides ``run.json``.

    Raises
    ------
    ResultError
        If it is being written.
    """
    inner = folder / name
    try:
        content = read_manifest(inner, kind)
    except ResultError:
        return []
    if inner.is_symlink():  # it lies elsewhere, and may belong to something else
        return []
    refuse_running(inner, content)
    return [f"{name}/{file}" for file in (*files, MANIFEST)]
