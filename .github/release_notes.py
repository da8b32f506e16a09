"""Prints what CHANGELOG.md says of a version: ``python .github/release_notes.py v0.2.0``.

Ends with 1 if the tag is not the version of pyproject.toml, or the changelog has no section for it, or still calls it
unreleased.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def notes(tag: str, version: str, changelog: str) -> str:
    """Return the section of a version.

    Raises
    ------
    SystemExit
        With what to mend, if it cannot be released like this.
    """
    if tag != f"v{version}":
        raise SystemExit(f"the tag is {tag}, but the version of pyproject.toml is {version}: tag v{version}")
    sections = re.split(r"^## ", changelog, flags=re.MULTILINE)[1:]
    found = next((one for one in sections if one.startswith(f"[{version}]")), None)
    if found is None:
        raise SystemExit(f"CHANGELOG.md has no section [{version}]: write one")
    heading, _, text = found.partition("\n")
    if not re.search(r"\d{4}-\d\d-\d\d", heading):
        raise SystemExit(f"CHANGELOG.md says '{heading}': put the date in place of (unreleased), as 2026-12-31")
    return text.strip() + "\n"


if __name__ == "__main__":
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    sys.stdout.write(notes(sys.argv[1], declared, (ROOT / "CHANGELOG.md").read_text("utf-8")))
