"""``omnieval cache``: what is in the cache folder, and removing what is old or too much."""

from __future__ import annotations

from typing import Annotated

import typer

from omnieval.cli import options

app = options.group("What the cache folder holds; removing old parts.")


@app.command("info", short_help="Show what is kept, by kind.")
def info(json: options.Json = False) -> None:
    """Show where the cache folder is and what it holds, by kind. Looking changes nothing.

    All in it can be computed again. Descriptors are found again by the bytes of the images, the camera, and the
    descriptor with its settings and code: a set of descriptions is one such way to describe images.

    Examples:

      omnieval cache info
    """
    import dataclasses

    from omnieval.cli.console import print_fields, print_json
    from omnieval.descriptors.cache_folder import DESCRIPTIONS, KINDS, cache_state
    from omnieval.wording import bytes_in_words, counted

    state = cache_state()
    kinds = {kind: state.of(kind) for kind in KINDS}
    if json:
        content = {
            "schema_version": 1,
            "folder": str(state.folder),
            "writable": state.writable,
            "bytes": state.bytes,
            "sets": state.sets,
            "segments": state.segments,
            "integrity": state.integrity,
            "kinds": {kind: dataclasses.asdict(one) for kind, one in kinds.items()},
        }
        print_json(content)
        return
    print(state.folder)
    facts = {
        "writable": "yes" if state.writable else "no",
        "size": bytes_in_words(state.bytes),
        "integrity": state.integrity,
    }
    print_fields(facts.items())
    for kind, one in kinds.items():
        if one.count:
            sets = f", {counted(state.sets, 'set')}, {counted(state.segments, 'segment')}"
            much = f"{one.count:,}, {bytes_in_words(one.bytes)}{sets if kind == DESCRIPTIONS else ''}"
            print(f"{kind}: {much}\n  {KINDS[kind]}")


@app.command("prune", short_help="Remove what is old or too much.")
def prune(
    older: Annotated[
        str | None,
        typer.Option(help="Remove what was last used longer ago than this: 30d, 12h, 4w.", metavar="TIME"),
    ] = None,
    max_: Annotated[
        str | None,
        typer.Option(
            "--max",
            help="Remove what was used longest ago until no more than this is left: 10GB, 500MB.",
            metavar="SIZE",
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be removed.")] = False,
    json: options.Json = False,
) -> None:
    """Remove descriptors, decoded and rendered images that are old or too much; they are made again when needed.

    What nothing reads any more goes in any case: caches of older versions, damaged parts, leftovers of processes that
    were killed. What a running process uses stays. Last used is last written or, where the file system notes it (most
    do, to the day), last read.

    Examples:

      omnieval cache prune --older 30d

      omnieval cache prune --max 10GB --dry-run
    """
    from omnieval.cli.console import print_fields, print_json
    from omnieval.descriptors.cache_folder import KINDS, Item
    from omnieval.descriptors.cache_folder import prune as prune_folder
    from omnieval.errors import ConfigError
    from omnieval.wording import bytes_in_words, parse_bytes, parse_seconds

    try:
        older_s = None if older is None else parse_seconds(older)
    except ValueError as error:
        raise ConfigError(f"--older: {error}") from error
    try:
        most = None if max_ is None else parse_bytes(max_)
    except ValueError as error:
        raise ConfigError(f"--max: {error}") from error
    pruned = prune_folder(older_s=older_s, most_bytes=most, dry=dry_run)

    def told(items: list[Item]) -> dict[str, dict[str, int]]:
        return {
            kind: {"count": sum(one.count for one in some), "bytes": sum(one.bytes for one in some)}
            for kind in KINDS
            if (some := [item for item in items if item.kind == kind])
        }

    removed, in_use = told(pruned.removed), told(pruned.in_use)
    if json:
        print_json(
            {
                "schema_version": 1,
                "dry_run": dry_run,
                "removed": removed,
                "in_use": in_use,
                "bytes_left": pruned.bytes_left,
            }
        )
        return
    for title, told_ in (("would be removed" if dry_run else "removed", removed), ("in use, kept", in_use)):
        print(title if told_ else f"{title}: nothing")
        print_fields((kind, f"{one['count']:,}, {bytes_in_words(one['bytes'])}") for kind, one in told_.items())
    print(f"left: {bytes_in_words(pruned.bytes_left)}")
