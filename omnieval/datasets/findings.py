"""What is worth knowing about a sequence on disk: one list, made once when it is opened, for every command.

An error stops every command. Warnings are said once by every command that opens the sequence, a line per kind, and are
stored in ``run.json``; infos are stored too. `omnieval dataset check` shows each by itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from omnieval.wording import shown

ROOT = "."
"""Where a finding lies that concerns the sequence folder itself."""

Severity = Literal["error", "warning", "info"]
_ORDER: dict[Severity, int] = {"error": 0, "warning": 1, "info": 2}


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing worth knowing about a sequence on disk.

    Attributes
    ----------
    severity
        `error`: the sequence cannot be used; `warning`: look at it; `info`: good to know.
    code
        Kebab-case name of the kind of finding, e.g. ``wrong-size``.
    where
        Relative to the sequence folder, or absolute if it lies elsewhere; ``/`` as separator, ``:LINE`` behind it in
        text files.
    message
        What is wrong and what to do, one line.
    """

    severity: Severity
    code: str
    where: str
    message: str


@dataclass(frozen=True, slots=True)
class KindOfFinding:
    """All findings of one kind in a line: how many there are, and where and what the first is."""

    kind: str
    severity: Severity
    count: int
    first: str
    message: str

    def __str__(self) -> str:
        place = "" if self.first == ROOT else f"{shown(self.first)}: "
        more = f" (and {self.count - 1} more)" if self.count > 1 else ""
        return f"{self.severity}: {place}{self.message}{more} [{self.kind}]"


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return errors, then warnings, then infos."""
    return tuple(sorted(findings, key=lambda finding: _ORDER[finding.severity]))


def errors(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the errors among findings."""
    return tuple(finding for finding in findings if finding.severity == "error")


def by_kind(findings: Iterable[Finding]) -> tuple[KindOfFinding, ...]:
    """Return one line per kind: errors, then warnings, then infos.

    Examples
    --------
    >>> lost = [Finding("warning", "image-without-pose", f"{n}.png", "no pose in poses.csv") for n in range(3)]
    >>> print(*by_kind(lost))
    warning: 0.png: no pose in poses.csv (and 2 more) [image-without-pose]
    """
    kinds: dict[tuple[Severity, str], list[Finding]] = {}
    for finding in in_order(findings):
        kinds.setdefault((finding.severity, finding.code), []).append(finding)
    return tuple(
        KindOfFinding(code, severity, len(found), found[0].where, found[0].message)
        for (severity, code), found in kinds.items()
    )
