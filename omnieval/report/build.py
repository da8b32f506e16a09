"""A report put together from its sources: which sections, which figures, and why one is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from omnieval.errors import ConfigError
from omnieval.localization.run import Localization
from omnieval.material.source import Cut
from omnieval.report.batch import batch_figure, recorded
from omnieval.report.figure import Block, Content, Figure, Section, Skipped, Table
from omnieval.report.heatmaps import sweep_figures
from omnieval.report.localizations import (
    lights_table,
    localization_blocks,
    localization_facts,
    published_table,
)
from omnieval.report.methods import methods_figures
from omnieval.report.pieces import pieces_figures
from omnieval.report.quality import quality_table
from omnieval.report.replays import DrawnReplay, attempted, draw_replay, drawn_or_skipped
from omnieval.report.sources import Baseline, Replay, Sources, Sweep
from omnieval.report.tables import batch_table, best_table, partitions_table, summary_table
from omnieval.wording import value_text

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Order:
    """What is asked of a report.

    Attributes
    ----------
    step
        The step whose similarity curves to draw; None takes a telling one of each replay.
    figures
        Whether figures are wanted, or tables only.
    progress
        Called with (replays done, replays in all).
    """

    step: int | None = None
    figures: bool = True
    progress: Progress | None = None


def build(sources: Sources, order: Order) -> Content:
    """Return the report of some sources.

    Raises
    ------
    ConfigError
        If no replay has the step that was asked for.
    """
    replays = list(sources.replays)
    if order.figures:
        replays += [replay for sweep in sources.sweeps for replay in sweep.replays]
    _check_step(replays, order.step)
    drawn: dict[int, DrawnReplay] = {}
    for done, replay in enumerate(replays, start=1):
        drawn[id(replay)] = draw_replay(replay, sources.baselines, step=order.step, figures=order.figures)
        if order.progress:
            order.progress(done, len(replays))
    table_3 = batch_table(sources.sweeps, [(one, drawn[id(one)].batch) for one in sources.replays if one.finished])
    first: list[Block] = [] if sources.only_localizations else [summary_table(sources)]
    first += [table_3] if table_3 else []
    first += [lights_table(sources.localizations), published_table()] if sources.localizations else []
    sections = [Section("Overview", (), tuple(first))]
    for sweep in sources.sweeps:
        sections.append(_sweep_section(sweep, order))
        if order.figures:
            sections += [_replay_section(replay, drawn[id(replay)].blocks) for replay in sweep.replays]
    sections += [_replay_section(replay, drawn[id(replay)].blocks) for replay in sources.replays]
    sections += [_baseline_section(baseline, order) for baseline in sources.baselines]
    sections += [_localization_section(found, order) for found in sources.localizations]
    return Content(_title(sources), tuple(sections))


def tables(content: Content) -> list[Table]:
    """Return the tables of a report that the paper has too, and the summary."""
    kept = {"summary", "table-2", "table-3"}
    return [
        block
        for section in content.sections
        for block in section.blocks
        if isinstance(block, Table) and block.key in kept
    ]


def _check_step(replays: Sequence[Replay], step: int | None) -> None:
    if step is None:
        return
    longest = max((len(replay.steps) for replay in replays), default=0)
    if step >= longest:
        what = f"the longest replay ends at step {longest - 1}" if longest else "no replay with its steps is given"
        raise ConfigError(f"--step {step}: {what}; choose another")


def _sweep_section(sweep: Sweep, order: Order) -> Section:
    failed = sweep.table["error"].count()
    axes = {axis: ", ".join(map(value_text, values)) for axis, values in sweep.axes.items()}
    facts = {
        "folder": str(sweep.folder),
        "status": sweep.status,
        "pieces" if sweep.exact else "runs": f"{len(sweep.table)}{f', {failed} failed' if failed else ''}",
        **axes,
        "other parameters": _parameter_words({name: value for name, value in sweep.fixed.items() if "." not in name}),
        **_origin(sweep.facts),
    }
    blocks: list[Block] = [*(_sweep_figures(sweep) if order.figures else []), best_table(sweep)]
    if order.figures and not sweep.replays:
        reason = (
            "an exact sweep makes no single runs; replay one to see its map"
            if sweep.exact
            else "no run has a silhouette, so none is the best"
            if sweep.table["silhouette"].null_count() == len(sweep.table)
            else "no decision trace was kept; sweep with --keep-steps or --rrd best"
        )
        blocks.append(Skipped("Maps of the best runs", reason))
    return Section(f"Sweep {sweep.name}", tuple(facts.items()), tuple(blocks))


def _sweep_figures(sweep: Sweep) -> Sequence[Figure | Skipped]:
    found = attempted(
        lambda: pieces_figures(sweep) if sweep.exact else [*methods_figures(sweep), *sweep_figures(sweep)]
    )
    return [Skipped("Figures of the sweep", found)] if isinstance(found, str) else found


def _replay_section(replay: Replay, blocks: tuple[Block, ...]) -> Section:
    facts = {
        "folder": str(replay.folder),
        "source": replay.source,
        "cut": _cut_words(replay.cut),
        "mapper": replay.mapper,
        "descriptor": replay.descriptor,
        "status": replay.status,
        "images": str(len(replay.steps)),
        "parameters": _parameter_words(replay.config.settings),
        **_origin(replay.facts),
    }
    judged = None if replay.run is None else quality_table(replay.run)
    return Section(replay.title, tuple(facts.items()), blocks if judged is None else (*blocks, judged))


def _parameter_words(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value_text(value)}" for name, value in parameters.items())


def _cut_words(cut: Cut) -> str:
    if cut.whole:
        return "the whole sequence"
    parts = {"start": cut.start, "stride": cut.stride, "limit": cut.limit}
    return ", ".join(f"{name} {value}" for name, value in parts.items() if value is not None)


def _localization_section(found: Localization, order: Order) -> Section:
    facts = tuple(localization_facts(found).items())
    title = f"Localisation {found.folder.resolve().name}"
    return Section(title, facts, tuple(localization_blocks(found, figures=order.figures)))


def _baseline_section(baseline: Baseline, order: Order) -> Section:
    facts = {
        "folder": str(baseline.folder),
        "source": baseline.source,
        "status": baseline.status,
        **_origin(baseline.facts),
    }
    table = partitions_table(baseline)
    return Section(f"Baseline {baseline.name}", tuple(facts.items()), (*_baseline_figure(baseline, order), table))


def _baseline_figure(baseline: Baseline, order: Order) -> Iterator[Block]:
    curves = recorded([baseline])
    if not order.figures:
        return
    if curves.table["silhouette"].null_count() == len(curves.table):
        yield Skipped("Silhouette over the number of clusters", "the baseline has no silhouette at any k")
    else:
        dataset, descriptor = baseline.table.select("dataset", "descriptor").row(0)
        title = "Silhouette over the number of clusters"
        drawn = drawn_or_skipped(title, lambda: batch_figure(curves, [], f"{dataset}, {descriptor}"))
        if drawn is not None:
            yield drawn


def _origin(facts: Any) -> dict[str, str]:
    """Return where a result comes from, as names and values."""
    versions = facts.get("versions") or {}
    prints = facts.get("dataset_fingerprints") or {}
    found = {
        "dataset fingerprint": facts.get("dataset_fingerprint") or ", ".join(dict.fromkeys(prints.values())),
        "identity": facts.get("identity"),
        "code": facts.get("code"),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }
    return {name: value for name, value in found.items() if value}


def _title(sources: Sources) -> str:
    datasets = dict.fromkeys(
        [
            *(replay.dataset for replay in sources.replays),
            *(str(name) for sweep in sources.sweeps for name in sweep.table["dataset"].unique(maintain_order=True)),
            *(str(baseline.table["dataset"][0]) for baseline in sources.baselines),
            *(str(found.manifest["map"]["sequence"]) for found in sources.localizations),
        ]
    )
    return f"omnieval report: {', '.join(datasets)}"
