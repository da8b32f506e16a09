"""``omnieval diff``: the first step at which two runs differ, why, and how far they agree."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from omnieval.results.compare import Agreement, Difference
    from omnieval.results.run_folder import Run

_LONGEST_LIST = 6


def diff(
    one: Annotated[Path, typer.Argument(help="A run folder.", metavar="A")],
    other: Annotated[Path, typer.Argument(help="Another one.", metavar="B")],
    rrd: Annotated[
        Path | None,
        typer.Option(
            help="Write a recording of both for the Rerun viewer, with the differing steps marked.", metavar="FILE.rrd"
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE.rrd.")] = False,
    json: options.Json = False,
) -> None:
    """Show the first step at which two runs differ: what was decided, and the numbers that differ.

    Two runs are equal if the content hashes of their tables are equal. These cover every bit of every value but no
    times. Where they are not, it also counts the steps with the same verdict and with the same partition of the images
    so far (whatever the nodes are called), and how far the two final maps agree.

    Examples:

      omnieval diff runs/synthetic-cloudy-hog runs/synthetic-cloudy-hog-2

      omnieval diff runs/a runs/b --rrd both.rrd
    """
    from omnieval.cli.console import note, print_json
    from omnieval.errors import ResultError
    from omnieval.results.compare import agreement, first_difference
    from omnieval.results.run_folder import open_run

    if rrd is not None and rrd.exists() and not overwrite:
        raise ResultError(f"{rrd} exists; choose another --rrd or pass --overwrite")
    runs = open_run(one), open_run(other)
    found, agreed = first_difference(*runs), agreement(*runs)
    if rrd is not None:
        if agreed is None or not len(agreed.verdicts):
            raise ResultError(
                f"{one} and {other} replay different images; only runs over the same images can be recorded together"
            )
        from omnieval.recording.side_by_side import record_pair

        record_pair(rrd, *runs, agreed)
        note(f"wrote {rrd}; look at it with: omnieval view {rrd}")
    if json:
        print_json(_content(runs, found, agreed))
    else:
        _print(runs, found, agreed)


def _print(runs: tuple[Run, Run], found: Difference | None, agreed: Agreement | None) -> None:
    from omnieval.cli.console import print_fields

    one, other = runs
    hashes = [run.content_hash for run in runs]
    if hashes[0] == hashes[1]:
        print(f"equal: all {len(one.steps)} steps")
    elif found is None:
        print(f"equal: all {len(one.steps)} steps; only the final maps differ")
    else:
        print(f"step {found.frame} ({found.file}) is the first that differs: {one.folder} | {other.folder}")
        if not found.columns:
            print("  one of the runs ends here")
        else:
            print_fields((name, f"{_short(left)} | {_short(right)}") for name, (left, right) in found.columns.items())
        if agreed is not None and agreed.first_parted is not None:
            _print_parting(runs, agreed.first_parted)
        if found.settings:
            print("parameters")
            print_fields((name, f"{left} | {right}") for name, (left, right) in found.settings.items())
    if found is not None:
        print("agreement")
        print_fields(_agreement_fields(agreed))
    print(f"content hash: {' | '.join(hashes)}")


def _print_parting(runs: tuple[Run, Run], frame: int) -> None:
    """Print both explanations of the first step that was decided otherwise or leads to another partition."""
    from omnieval.cli.console import print_fields
    from omnieval.explain.run import RunExplainer, explanation_lines

    print(f"step {frame} is the first with another verdict or another partition of the images")
    for letter, run in zip("AB", runs, strict=True):
        explainer = RunExplainer(run)
        print(f"{letter}: {run.folder}")
        print_fields(explanation_lines(explainer.explain(frame), explainer.method))


def _agreement_fields(agreed: Agreement | None) -> Iterator[tuple[str, str]]:
    if agreed is None:
        yield "steps", "the runs replay different images, so their steps cannot be matched"
        return
    steps = len(agreed.verdicts)
    for name, same in (
        ("same verdict", agreed.verdicts),
        ("same partition", agreed.partitions),
        ("same of both", agreed.both),
    ):
        yield name, f"{same.sum()} of {steps} steps ({100 * same.mean() if steps else 0:.1f} %)"
    ari = agreed.final_ari
    reason = "none: both runs must be complete and of equal length"
    yield "final maps", f"adjusted Rand index {ari:.3f}" if ari is not None else reason


def _content(runs: tuple[Run, Run], found: Difference | None, agreed: Agreement | None) -> dict[str, Any]:
    from omnieval.json_records import jsonable

    hashes = [run.content_hash for run in runs]
    content: dict[str, Any] = {"schema_version": 1, "equal": hashes[0] == hashes[1], "content_hashes": hashes}
    if found is not None:
        content["difference"] = jsonable(found)
    if agreed is not None:
        content["agreement"] = {
            "steps": len(agreed.verdicts),
            "same_verdict": int(agreed.verdicts.sum()),
            "same_partition": int(agreed.partitions.sum()),
            "same_both": int(agreed.both.sum()),
            "first_parted": agreed.first_parted,
            "final_adjusted_rand": agreed.final_ari,
        }
    return content


def _short(value: Any) -> str:
    """Write a value so that it fits a line: numbers in seven digits, long lists by their beginning."""
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, dict):
        return " ".join(f"{name} {_short(one)}" for name, one in value.items() if one is not None)
    if isinstance(value, list):
        items = [_short(item) for item in value[:_LONGEST_LIST]]
        return f"[{', '.join(items)}{f', ... {len(value)} in all' if len(value) > _LONGEST_LIST else ''}]"
    return str(value)
