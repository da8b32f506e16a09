"""``omnieval explain``: one decision in words and numbers, or the refused loop closures worth explaining."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from pathlib import Path

    from omnieval.results.run_folder import Run


def explain(
    run: options.RunArgument,
    step: Annotated[
        str | None, typer.Argument(help="The step: its number, or the name of its image file.", metavar="STEP")
    ] = None,
    refused: Annotated[
        bool,
        typer.Option("--refused", help="List refused loop closures that the ground truth would have allowed."),
    ] = False,
    within: Annotated[
        float,
        typer.Option(
            min=0.0, help="With --refused: the true match was taken at most this far away, metres.", metavar="METRES"
        ),
    ] = 1.0,
    ago: Annotated[
        int,
        typer.Option(
            min=1, help="With --refused: the true match was taken at least so many steps before.", metavar="STEPS"
        ),
    ] = 20,
    limit: Annotated[int, typer.Option(min=1, help="With --refused: list at most this many.", metavar="N")] = 20,
    sequence: Annotated[
        str | None,
        typer.Option("--sequence", help="For a localisation of several sequences: which one.", metavar="NAME"),
    ] = None,
    json: options.Json = False,
) -> None:
    """Explain a decision: what was compared, the result, and what would have changed it.

    Reads the tables of the run only; no image is needed. What *would flip* a gate changes that gate only: the gates
    behind it may still refuse the image.

    Examples:

      omnieval explain runs/synthetic-cloudy-hog 412

      omnieval explain runs/synthetic-cloudy-hog --refused
    """
    from omnieval.errors import ConfigError
    from omnieval.results.manifest import kind_of
    from omnieval.results.run_folder import open_run

    if refused == (step is not None):
        raise ConfigError(
            "name a STEP to explain (a number or an image file), or list refused loop closures with --refused"
        )
    if kind_of(run) == "localization" and step is not None:
        _print_answer(run, step, sequence, json=json)
        return
    opened = open_run(run)
    if step is None:
        _print_refused(opened, within, ago, limit, json=json)
    else:
        _print_step(opened, step, json=json)


def _print_answer(folder: Path, query: str, sequence: str | None, *, json: bool) -> None:
    from omnieval.cli.console import print_fields, print_json
    from omnieval.json_records import jsonable
    from omnieval.localization.run import open_localization
    from omnieval.localization.words import answer_lines, find_query

    localization = open_localization(folder)
    rows = find_query(localization, query, sequence)
    if json:
        print_json(
            {"schema_version": 1, "localization": str(folder), "query": rows[0]["query"], "answers": jsonable(rows)}
        )
        return
    print(f"query {rows[0]['query']} of {folder}, {rows[0]['sequence']} in {localization.manifest['map']['sequence']}")
    print_fields(answer_lines(localization, rows))


def _print_step(run: Run, step: str, *, json: bool) -> None:
    from omnieval.cli.console import print_fields, print_json
    from omnieval.explain.run import RunExplainer, explanation_lines
    from omnieval.json_records import jsonable

    explainer = RunExplainer(run)
    frame = explainer.find(step)
    explanation = explainer.explain(frame)
    if json:
        scene = explanation.scene
        derived = {"outcome": scene.outcome, "margin": scene.step.margin, "metres": scene.metres}
        content = {"schema_version": 1, "run": str(run.folder), "step": frame, **jsonable(explanation)}
        print_json(content | jsonable(derived))
        return
    print(f"step {frame} of {run.folder} (0 to {len(explainer) - 1})")
    print_fields(explanation_lines(explanation, explainer.method))


def _print_refused(run: Run, within: float, ago: int, limit: int, *, json: bool) -> None:
    from omnieval.cli.console import print_json, print_table
    from omnieval.explain.refused import refused_closures

    table = refused_closures(run, within=within, ago=ago)
    shown = table.head(limit)
    if json:
        print_json({"schema_version": 1, "run": str(run.folder), "refused": len(table), "closures": shown.to_dicts()})
        return
    print(f"{len(table)} refused loop closures with a true match within {within:g} m, nearest to passing first")
    if len(shown):
        print_table(shown)
        print(f"explain one: omnieval explain {run.folder} {shown['step'][0]}")
