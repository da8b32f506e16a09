"""``omnieval dataset``: known datasets, downloads, checks of what is on disk, and the synthetic building."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from collections.abc import Iterable

    from omnieval.datasets.check import CheckReport
    from omnieval.datasets.findings import Finding
    from omnieval.imaging.settings import ImagingConfig

app = options.group("Cards, downloads, checks, the synthetic building.")


Card = Annotated[str, typer.Argument(help="Name of a data card; see: omnieval dataset list.", metavar="CARD")]


@app.command("list", short_help="List the datasets that are known.")
def list_cards(json: options.Json = False) -> None:
    """List the datasets that have a data card.

    Examples:

      omnieval dataset list
    """
    from omnieval.cli.console import print_fields, print_json
    from omnieval.datasets.cards import all_cards

    cards = all_cards()
    if json:
        print_json({"schema_version": 1, "cards": [{"name": card.name, "title": card.title} for card in cards]})
    else:
        print_fields((card.name, card.title) for card in cards)


@app.command("info", short_help="Where to get a dataset, what to expect.")
def info(card: Card, json: options.Json = False) -> None:
    """Show a data card: where to get the dataset, how to cite it, its sequences and rooms.

    Examples:

      omnieval dataset info cold-freiburg
    """
    from omnieval.cli.console import print_fields, print_json
    from omnieval.datasets.cards import card as find_card

    found = find_card(card)
    if json:
        print_json({"schema_version": 1, **found.model_dump(mode="json", by_alias=True)})
        return
    print(found.title)
    texts = {
        "get": found.get,
        "homepage": found.homepage,
        "citation": found.citation,
        "licence": found.licence,
        "notes": found.notes,
    }
    print_fields((name, " ".join(text.split())) for name, text in texts.items() if text)
    if found.rooms:
        print("rooms")
        print_fields(found.rooms.items())
    if found.sequences:
        print("sequences")
        print_fields(
            (known.path, ", ".join(_facts(known.images, known.length_m, known.note))) for known in found.sequences
        )


@app.command("fetch", short_help="Download a sequence.")
def fetch(
    name: Annotated[
        str, typer.Argument(help="Card and sequence, e.g. cold-freiburg/part_a/seq2_cloudy3.", metavar="CARD/SEQUENCE")
    ],
    to: Annotated[Path, typer.Option(help="Folder in which to put it, under that name.", metavar="DIR")] = Path(
        "datasets"
    ),
    base_url: Annotated[
        str | None,
        typer.Option("--base-url", help="Download URL/CARD/SEQUENCE.tar, from a mirror or server.", metavar="URL"),
    ] = None,
    json: options.Json = False,
) -> None:
    """Download a sequence, unpack it, and print its folder; if the folder exists already, nothing is done.

    An interrupted download continues where it stopped. The SHA-256 of an archive is kept beside the sequence, and every
    later download must have the same. Where COLD can be downloaded is not verified: if it is not there, name a mirror.

    Examples:

      omnieval dataset fetch cold-freiburg/part_a/seq2_cloudy3

      omnieval dataset fetch cold-freiburg/part_a/seq2_cloudy3 --to /data
    """
    from omnieval.cli.console import note, print_json, progress
    from omnieval.datasets.fetch import fetch as fetch_sequence

    with progress("downloading, MB") as report:
        folder = fetch_sequence(
            name, to, base_url=base_url, progress=lambda done, total: report(done // 10**6, total // 10**6)
        )
    if json:
        print_json({"schema_version": 1, "folder": str(folder)})
        return
    print(folder)
    note(f"look at it with: omnieval dataset check {folder}")


@app.command("check", short_help="Find what is wrong on disk.")
def check(
    source: options.Source = "synthetic",
    preview: Annotated[
        Path | None,
        typer.Option(help="Write a picture: the mirror's circles on an image, and its panorama.", metavar="FILE.png"),
    ] = None,
    set_: options.Set = None,
    camera: options.CameraFile = None,
    poses: options.Poses = None,
    poses_tolerance: options.PosesTolerance = None,
    poses_interpolate: options.PosesInterpolate = None,
    topic: options.Topic = None,
    pose_topic: options.PoseTopic = None,
    pose_frame: options.PoseFrame = None,
    decode_every: options.DecodeEvery = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture if it is there.")] = False,
    json: options.Json = False,
) -> None:
    """Check a sequence on disk against itself and its data card, reporting every finding at once.

    Reads every image, and says what the camera is and where that is known from. Exits with 3 if there is an error.

    Examples:

      omnieval dataset check cold:/data/cold-freiburg/part_a/seq2_cloudy3

      omnieval dataset check folder:/data/panoramas --preview camera.png
    """
    from omnieval.cli.console import print_json, progress
    from omnieval.datasets.check import check as check_sequence
    from omnieval.datasets.findings import in_order
    from omnieval.errors import DatasetError
    from omnieval.results.atomic import claim_file

    imaging = options.configuration(set_, None, camera=camera).imaging
    if preview is not None:
        preview = preview.expanduser()
        claim_file(preview, overwrite=overwrite)
    source = options.source_with(
        source, poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    )
    with progress("checking") as report_progress:
        report = check_sequence(source, progress=report_progress)
    words = None
    if report.ok:
        words, found = _camera(source, imaging, preview)
        report = dataclasses.replace(report, findings=in_order([*report.findings, *found]))
    if json:
        print_json({"schema_version": 1, "ok": report.ok, "camera": words, **dataclasses.asdict(report)})
    else:
        _print_report(report, words)
    if not report.ok:
        errors = sum(finding.severity == "error" for finding in report.findings)
        raise DatasetError(f"{report.source} has {errors} error(s), listed above; correct or remove what they name")


@app.command("synthesize", short_help="Render a synthetic building.")
def synthesize(
    directory: Annotated[Path, typer.Argument(help="Folder to write the sequence to.", metavar="DIR")],
    light: Annotated[str, typer.Option(help="cloudy, night or sunny.", metavar="NAME")] = "cloudy",
    building: Annotated[int, typer.Option(min=1, help="Number of the building.", metavar="N")] = 1,
    frames: Annotated[
        int | None, typer.Option(min=1, help="Number of frames; default the whole tour.", metavar="N")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of noise, people and the path's details.", metavar="N")] = 0,
) -> None:
    """Render a synthetic building as a sequence in COLD's layout.

    Examples:

      omnieval dataset synthesize night3 --light night --building 3 --frames 300
    """
    from omnieval.cli.console import progress
    from omnieval.datasets.synthetic import synthesize as write_sequence

    with progress("rendering") as report:
        print(write_sequence(directory, light=light, building=building, frames=frames, seed=seed, progress=report))


def _camera(source: str, imaging: ImagingConfig, picture: Path | None) -> tuple[str, Iterable[Finding]]:
    """Return what the camera is, in words, and what is odd about it; draw it if asked to."""
    from omnieval.datasets import load
    from omnieval.descriptors.cache import DescriptorCache
    from omnieval.imaging.preview import write_preview
    from omnieval.imaging.survey import survey_camera

    sequence = load(source)
    with DescriptorCache() as notebook:
        survey = survey_camera(sequence, imaging, notebook)
    if picture is not None:
        write_preview(picture, sequence, survey)
    return survey.words, survey.findings


def _print_report(report: CheckReport, camera: str | None) -> None:
    from omnieval.cli.console import print_fields

    facts = {
        "name": report.name,
        "folder": report.root,
        "card": report.card,
        "frames": report.frames,
        "length": _with_unit(report.length_m, "m"),
        "duration": _with_unit(report.duration_s, "s"),
        "mean spacing": _with_unit(report.spacing_m, "m"),
        "image size": " x ".join(map(str, report.image_size)) if report.image_size else None,
        "camera": camera,
        "rooms": ", ".join(f"{room} {count}" for room, count in report.rooms.items()) or None,
    }
    print(report.source)
    print_fields((name, str(value)) for name, value in facts.items() if value is not None)
    for finding in report.findings:
        print(f"{finding.severity}: {finding.where}: {finding.message} [{finding.code}]")
    print("ok" if report.ok else "not ok")


def _with_unit(value: float | None, unit: str) -> str | None:
    return None if value is None else f"{value:.3g} {unit}" if value < 1 else f"{value:.2f} {unit}"


def _facts(images: int | None, length_m: float | None, note: str | None) -> list[str]:
    facts = [f"{images} images" if images else "", f"{length_m} m" if length_m else "", note or ""]
    return [fact for fact in facts if fact]
