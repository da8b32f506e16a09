"""Run the benchmarks: ``python -m tests.benchmarks [--json] [--only PART ...] [--growth N ...]``.

Every figure stands beside that of the plain implementation in `tests/reference` and beside its bound, all from the
same run: on a busy machine only the ratios mean something.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

from tests.benchmarks import describing, finding, growth, mapping, replaying
from tests.benchmarks.figures import Figure, machine

PARTS = {
    "describing": describing.measure,
    "mapping": mapping.measure,
    "finding": finding.measure,
    "replaying": replaying.measure,
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--only", nargs="*", choices=[*PARTS, "profile"], default=[*PARTS, "profile"], metavar="PART")
    parser.add_argument("--growth", nargs="+", type=int, default=[], metavar="N", help="map walks of this many images")
    options = parser.parse_args()
    figures: list[Figure] = []
    for name in options.only:
        print(f"measuring {name} ...", file=sys.stderr)
        figures += PARTS[name]() if name in PARTS else []
    result: dict[str, Any] = {
        "machine": machine(),
        "figures": [figure.row() for figure in figures],
        "profile": replaying.profile() if "profile" in options.only else [],
        "growth": growth.measure(options.growth),
    }
    if options.json:
        print(json.dumps(result))
        return
    print("  ".join(f"{name}: {value}" for name, value in result["machine"].items()))
    for rows in ([_shown(figure) for figure in figures], result["profile"], result["growth"]):
        _print(rows)


def _shown(figure: Figure) -> dict[str, Any]:
    """Return a figure as the table shows it."""
    bound = f"{figure.bound:.3g} ({figure.bounded_by})" if figure.bound else ""
    times = ""
    if figure.plain:
        times = f"{max(figure.plain / figure.value, figure.value / figure.plain):.3g} x"
    return {
        "figure": figure.name,
        "value": f"{figure.value:.3g} {figure.unit}",
        "target": figure.target,
        "plain": f"{figure.plain:.3g}" if figure.plain else "",
        "against plain": times,
        "bound": bound,
    }


def _print(rows: Sequence[dict[str, Any]]) -> None:
    if not rows:
        return
    cells = [[f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(list(rows[0]), *cells, strict=True)]
    print()
    for line in (list(rows[0]), ["-" * width for width in widths], *cells):
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |")


if __name__ == "__main__":
    main()
