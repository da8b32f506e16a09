"""Puts pages that lie outside ``docs/`` on the documentation site, and lets links between all of them lead there.

MkDocs calls this file (``hooks`` in ``mkdocs.yml``). The pages themselves are written for readers of the repository.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.structure.files import Files

ROOT = Path(__file__).parents[1]

ELSEWHERE = {
    "README.md": "overview.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "datasets/README.md": "cards.md",
}
"""Pages of the repository, and what they are called on the site."""

_LINK = re.compile(r"(!?\[[^\]]*\]\()([^()\s#]+)((?:#[^()\s]*)?\))")
_FENCE = re.compile(r"(^```.*?^```$)", re.DOTALL | re.MULTILINE)


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie elsewhere."""
    from mkdocs.structure.files import File

    for place, page in ELSEWHERE.items():
        files.append(File.generated(config, page, content=(ROOT / place).read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links lead to where pages are on the site."""
    return relinked(markdown, page.file.src_uri)


def relinked(markdown: str, page: str) -> str:
    """Return the text of a page of the site with its links to other files of the repository.

    Parameters
    ----------
    markdown
        The text, whose links are relative to the file in the repository.
    page
        The name of the page on the site.

    Examples
    --------
    >>> relinked("[log](../CHANGELOG.md#added), [seen](pictures/a.png)", "data.md")
    '[log](changelog.md#added), [seen](pictures/a.png)'
    >>> relinked("[the layout](README.md#layout), [x](docs/data.md)", "contributing.md")
    '[the layout](overview.md#layout), [x](data.md)'
    """
    place = next((place for place, name in ELSEWHERE.items() if name == page), f"docs/{page}")

    def on_the_site(found: re.Match[str]) -> str:
        before, link, after = found.groups()
        if ":" in link:
            return found[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(place), link))
        name = ELSEWHERE.get(target, target.removeprefix("docs/"))
        return f"{before}{posixpath.relpath(name, posixpath.dirname(page) or '.')}{after}"

    parts = _FENCE.split(markdown)
    return "".join(part if number % 2 else _LINK.sub(on_the_site, part) for number, part in enumerate(parts))
