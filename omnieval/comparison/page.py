"""The page of a benchmark: the metrics of every method, and where the paper's method is better or worse than others."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import polars as pl

from omnieval.comparison.methods import Comparison, Group, GroupDifference, GroupEstimate, better, compare_methods
from omnieval.comparison.records import ablation_records
from omnieval.components.names import BUILT_IN
from omnieval.localization.measures import METRICS as FINDING
from omnieval.metrics.catalogue import BY_NAME
from omnieval.statistics.ranks import SIGNIFICANT
from omnieval.text_table import markdown

QUALITY = ("pair_f1", "reentry_precision", "reentry_f1", "false_merge_share", "silhouette")
LOCALISATION = ("error_mean", "recall@1", "room_accuracy")
_BESIDE = ("nodes", "share_forced", "seconds")
_KINDS = ("mappers", "descriptors")
_PAPER = next(iter(BUILT_IN["mapper"]))


def benchmark_page(table: pl.DataFrame, command: str, facts: Mapping[str, Any]) -> str:
    """Return the page in Markdown.

    Parameters
    ----------
    table
        Rows of `schemas.ablation_schema`.
    command
        What made it.
    facts
        ``timings``, ``versions`` and ``code`` as ``run.json`` has them.
    """
    judged = [name for name in (*QUALITY, *LOCALISATION) if table[name].null_count() < len(table)]
    records = ablation_records(table, ())
    found = compare_methods(records, metrics=(*judged, *_BESIDE))
    parts = [
        "# The benchmark",
        "\n".join(_head(table, command, facts)),
        "## Maps\n\n" + _estimates(found, [name for name in QUALITY if name in judged]),
        "## Localisation\n\n" + _localisation(table, found, judged),
        "## Size and time\n\n" + _estimates(found, _BESIDE),
        "## Where the paper's method wins and loses\n\n" + "\n".join(_verdicts(found, judged)),
        "## Ranks\n\n" + _ranks(found),
        "## Every sequence\n\n" + _every(table),
        "## The metrics\n\n" + "\n".join(f"- `{name}`: {_meaning(name)}" for name in judged),
    ]
    return "\n\n".join(parts) + "\n"


def _head(table: pl.DataFrame, command: str, facts: Mapping[str, Any]) -> Iterator[str]:
    timings, failed = facts.get("timings", {}), table["error"].count()
    yield "```sh"
    yield command
    yield "```"
    yield ""
    parts = [table[name].unique(maintain_order=True).to_list() for name in ("mapper", "descriptor")]
    mappers, descriptors = (
        f"{len(names)} {what} ({', '.join(names)})" for names, what in zip(parts, _KINDS, strict=True)
    )
    lost = f", {failed} failed" if failed else ""
    yield (
        f"{mappers} with {descriptors} on {table['dataset'].n_unique()} sequences: {len(table)} runs, "
        f"{len(table) - failed} finished{lost}."
    )
    if "seconds" in timings:
        yield (
            f"Mapping, judging and localising took {timings['seconds']:.0f} s in {timings['processes']} processes on "
            f"{os.cpu_count()} processors ({platform.machine()}), with the images described before."
        )
    versions = facts.get("versions", {})
    yield f"omnieval {versions.get('omnieval')}, code {facts.get('code')}."
    yield ""
    yield (
        "All have their default parameters everywhere. In brackets is the 95 % interval over sequences "
        "([how](comparison.md)). Lights of one building are not independent of each other, so these intervals are "
        "rather too narrow."
    )


def _estimates(found: Comparison, metrics: Sequence[str]) -> str:
    cells = {(one.group.key, one.metric): one for one in found.estimates}
    groups = list(dict.fromkeys(one.group.key for one in found.estimates))
    rows = [[*map(str, key), *(_cell(cells.get((key, metric))) for metric in metrics)] for key in groups]
    return markdown([*found.by, *metrics], rows)


def _localisation(table: pl.DataFrame, found: Comparison, judged: Sequence[str]) -> str:
    metrics = [name for name in LOCALISATION if name in judged]
    if not metrics:
        return "No sequence was looked for in the map of another."
    asked = table.filter(pl.col("map").is_not_null())
    strategies = asked.select("mapper", "strategy").unique(maintain_order=True).rows()
    pairs = asked.select("dataset", "map").n_unique()
    own = ", ".join(f"{mapper} {strategy}" for mapper, strategy in strategies)
    return (
        f"{pairs} sequences, each in the map of another light of its building, by the mapper's own levels where\n"
        f"it has some, which may refuse, and coarse to fine where it has none ({own}). Refused images have no error,\n"
        "and count as misses of `recall@1` (within 0.5 m).\n\n" + _estimates(found, metrics)
    )


def _verdicts(found: Comparison, judged: Sequence[str]) -> Iterator[str]:
    """Yield a line for every metric and other mapper with the same descriptor."""
    yield (
        f"`{_PAPER}` against each other mapper with the same descriptor, on the sequences that both finished. *Better* "
        "and *worse*"
    )
    yield f"are significant (Wilcoxon, Holm for all pairs of methods, {SIGNIFICANT}); *ahead* and *behind* not."
    yield ""
    rows = [row for one in found.differences if one.metric in judged for row in _verdict(one)]
    columns = ("metric", "descriptor", "against", f"{_PAPER} is", "difference", "sequences", "p (Holm)")
    yield markdown(columns, rows) if rows else "There is no other mapper."


def _verdict(one: GroupDifference) -> Iterator[tuple[str | int, ...]]:
    """Yield the row of a difference, if it is one of the paper's method and another mapper on some sequence."""
    pair, mean = _papers(one), one.difference.mean
    if pair is None or mean.value is None or one.p_holm is None:
        return
    other, sign, descriptor = pair
    gain = sign * mean.value if better(one.metric) == "higher" else -sign * mean.value
    words = ("better", "worse") if one.p_holm < SIGNIFICANT else ("ahead", "behind")
    word = "equal" if gain == 0 else words[0] if gain > 0 else words[1]
    between = ""
    if mean.low is not None and mean.high is not None:
        low, high = sorted((sign * mean.low, sign * mean.high))
        between = f" [{low:+.3f}, {high:+.3f}]"
    yield one.metric, descriptor, other, word, f"{sign * mean.value:+.3f}{between}", mean.n, f"{one.p_holm:.4f}"


def _papers(one: GroupDifference) -> tuple[str, int, str] | None:
    """Return the other mapper, the sign that makes the difference the paper's minus it, and the descriptor."""
    (mapper, descriptor), (mapper_of_other, descriptor_of_other) = one.one.key, one.other.key
    if descriptor != descriptor_of_other or _PAPER not in (mapper, mapper_of_other):
        return None
    return (mapper_of_other, 1, descriptor) if mapper == _PAPER else (mapper, -1, descriptor)


def _ranks(found: Comparison) -> str:
    rows = []
    for one in found.ranks:
        order = sorted(range(len(one.groups)), key=one.ranking.ranks.__getitem__)
        listed = ", ".join(f"{one.groups[place].name} {one.ranking.ranks[place]:.2f}" for place in order)
        p = "-" if one.ranking.p is None else f"{one.ranking.p:.4f}"
        rows.append((one.metric, listed, one.ranking.cases, p))
    return "Mean rank of each method, 1 the best, over the sequences that all finished with a value.\n\n" + markdown(
        ("metric", "best to worst", "sequences", "p (Friedman)"), rows
    )


def _every(table: pl.DataFrame) -> str:
    metric = "pair_f1"
    groups = [Group(key, (), ()) for key in table.select("mapper", "descriptor").unique(maintain_order=True).rows()]
    values = {(row["dataset"], row["mapper"], row["descriptor"]): row for row in table.iter_rows(named=True)}
    rows = []
    for dataset in table["dataset"].unique(maintain_order=True).to_list():
        own = [values.get((dataset, *group.key)) for group in groups]
        rows.append([dataset, *("failed" if row is None or row["error"] else row[metric] for row in own)])
    return f"`{metric}` of each:\n\n" + markdown(["sequence", *(group.name for group in groups)], rows)


def _cell(one: GroupEstimate | None) -> str | None:
    if one is None or one.estimate.value is None:
        return None
    digits = 1 if one.estimate.value >= 10 else 3
    value, low, high = one.estimate.value, one.estimate.low, one.estimate.high
    between = "" if low is None or high is None else f" [{low:.{digits}f}, {high:.{digits}f}]"
    lacking = "" if one.finished == one.runs else f", {one.finished}/{one.runs} finished"
    return f"{value:.{digits}f}{between}{lacking}"


def _meaning(name: str) -> str:
    return BY_NAME[name].meaning if name in BY_NAME else FINDING[name]
