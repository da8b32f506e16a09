"""Arguments and options that several commands share, so that each has one name, one meaning and one help text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from omnieval.config import Config, Setting
    from omnieval.material.source import Cut
    from omnieval.recording import RecordingOptions


def group(help_: str) -> typer.Typer:
    """Return a command with commands of its own, which shows its help when none of them is named."""
    app = typer.Typer(help=help_, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})

    @app.callback()
    def _root(ctx: typer.Context) -> None:
        if ctx.invoked_subcommand is None:
            typer.echo(ctx.get_help())

    return app


def _mappers(incomplete: str) -> list[str]:
    """Return the names of mappers that begin so, for completion in a shell."""
    from omnieval.components.names import known

    return [name for name in known("mapper") if name.startswith(incomplete)]


def _descriptors(incomplete: str) -> list[str]:
    """Return the names of descriptors that begin so, for completion in a shell."""
    from omnieval.components.names import known

    return [name for name in known("descriptor") if name.startswith(incomplete)]


Source = Annotated[
    str,
    typer.Argument(
        help="Sequence: synthetic[:cloudy|night|sunny[:N]], cold:PATH, innova:PATH, folder:PATH, video:FILE, bag:PATH, "
        "descriptors npz:FILE, or a path recognised by its content.",
        metavar="SOURCE",
    ),
]
RunArgument = Annotated[Path, typer.Argument(help="A run folder, e.g. runs/synthetic-cloudy-hog.", metavar="RUN")]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a parameter, e.g. --set omega=1.85; repeatable. All: omnieval parameters.",
        metavar="NAME=VALUE",
    ),
]
ConfigFile = Annotated[
    list[Path] | None, typer.Option("--config", help="TOML file of parameters; repeatable.", metavar="FILE.toml")
]
CameraFile = Annotated[
    Path | None,
    typer.Option(
        "--camera", help="File that describes the camera, like camera.toml (docs/data.md).", metavar="FILE.toml"
    ),
]
Preset = Annotated[
    str | None, typer.Option(help="Named parameters: recommended (default) or paper-literal.", metavar="NAME")
]
MapperName = Annotated[
    str | None,
    typer.Option(
        "--mapper",
        help="Mapper: roman2020 (default), geodesic, leader, birch, valley, "
        "package.module:Class or path/file.py:Class.",
        metavar="NAME",
        autocompletion=_mappers,
    ),
]
DescriptorName = Annotated[
    str | None,
    typer.Option(
        "--descriptor",
        help="Descriptor: hog (default), gist, onnx:MODEL.onnx, package.module:Class or path/file.py:Class.",
        metavar="NAME",
        autocompletion=_descriptors,
    ),
]
Topic = Annotated[str | None, typer.Option("--topic", help="For a bag: the topic of the images.", metavar="NAME")]
PoseTopic = Annotated[
    str | None,
    typer.Option(
        "--pose-topic", help="For a bag: a topic of poses, odometry or transforms (/tf); default none.", metavar="NAME"
    ),
]
PoseFrame = Annotated[
    str | None,
    typer.Option(
        "--pose-frame",
        help="With transforms: the frame of the robot; default the only one that moves.",
        metavar="NAME",
    ),
]
DecodeEvery = Annotated[
    int | None,
    typer.Option("--decode-every", min=1, help="For a video or bag: decode only every N-th image.", metavar="N"),
]
Poses = Annotated[
    Path | None,
    typer.Option(
        "--poses",
        help="Where the images were taken: TUM, KITTI, EuRoC, or a table with a heading; default what the images have.",
        metavar="FILE",
    ),
]
PosesTolerance = Annotated[
    float | None,
    typer.Option(
        "--poses-tolerance",
        min=0,
        help="How far an image may be from its pose in time; default half the median interval between images, from "
        "those of a topic 0.1 s.",
        metavar="SECONDS",
    ),
]
PosesInterpolate = Annotated[
    float | None,
    typer.Option(
        "--poses-interpolate",
        min=0,
        help="Interpolate between poses that are at most so far apart in time; default not at all, between those of a "
        "topic 1 s.",
        metavar="SECONDS",
    ),
]
Start = Annotated[int, typer.Option(min=0, help="First frame to use.", metavar="N")]
Stride = Annotated[int, typer.Option(min=1, help="Use every N-th frame.", metavar="N")]
Limit = Annotated[int | None, typer.Option(min=1, help="Use at most this many frames.", metavar="N")]
Out = Annotated[
    Path | None,
    typer.Option(help="Run folder to write; default runs/<sequence>-<descriptor>[-<mapper>][-<n>].", metavar="DIR"),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an earlier run in the same folder.")]
SkipBad = Annotated[
    bool,
    typer.Option(
        "--skip-bad", help="Leave out images that are damaged or of a different size than most, and count them."
    ),
]
Jobs = Annotated[
    str,
    typer.Option(
        help="Number of processes, or auto: as many as processors allotted; the results are the same for any number.",
        metavar="N|auto",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]
NoMap = Annotated[
    bool,
    typer.Option("--no-map", help="Do not keep the map for localisation (map.npz, about 17 kB per image)."),
]
ContinuedMap = Annotated[
    Path | None,
    typer.Option(
        "--map",
        help="Continue the map of a run, with its mapper, descriptor and imaging, as if both sequences were one.",
        metavar="RUN",
    ),
]
NoImages = Annotated[bool, typer.Option("--no-images", help="Leave images out of the recording.")]
Every = Annotated[
    int, typer.Option("--every", min=1, help="Record images and curves only at every N-th step.", metavar="N")
]


def settings(
    assignments: Sequence[str] | None, files: Sequence[Path] | None, camera: Path | None = None
) -> list[Setting]:
    """Return the parameters that options set: those of the camera, then of files, then of --set; later ones win."""
    from omnieval.config import parse_assignment, read_camera, read_settings

    given = read_camera(camera) if camera is not None else []
    given += [setting for file in files or () for setting in read_settings(file)]
    return given + [parse_assignment(text) for text in assignments or ()]


def configuration(
    assignments: Sequence[str] | None,
    files: Sequence[Path] | None,
    preset: str | None = None,
    mapper: str | None = None,
    descriptor: str | None = None,
    *,
    camera: Path | None = None,
) -> Config:
    """Return the configuration that options ask for: the preset, over which `settings` win."""
    from omnieval.config import resolve

    return resolve(settings(assignments, files, camera), preset=preset, mapper=mapper, descriptor=descriptor)


def source_with(
    source: str,
    poses: Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
    topic: str | None = None,
    pose_topic: str | None = None,
    pose_frame: str | None = None,
    decode_every: int | None = None,
) -> str:
    """Return a source with the options about it written into it: which poses, and what of a video or bag.

    Raises
    ------
    ConfigError
        If an option is given for a source that has no such thing.
    """
    from omnieval.datasets.registry import posed_source, with_options
    from omnieval.errors import ConfigError

    options = {"topic": topic, "pose-topic": pose_topic, "pose-frame": pose_frame, "every": decode_every}
    given = {name: str(value) for name, value in options.items() if value is not None}
    try:
        streamed = with_options(source, given) if given else source
    except KeyError as error:
        name = f"--{error.args[0]}".replace("--every", "--decode-every")
        what = "bags" if error.args[0] != "every" else "videos and bags"
        raise ConfigError(f"{name} is only for {what}, and {source} is something else; leave {name} out") from error
    return str(posed_source(streamed, poses, poses_tolerance, poses_interpolate))


def cut(start: int, stride: int, limit: int | None) -> Cut:
    """Return which frames the options ask for."""
    from omnieval.material.source import Cut

    return Cut(start, stride, limit)


def recording(
    *, no_rrd: bool, no_images: bool = False, every: int = 1, spawn: bool = False, connect: str | None = None
) -> RecordingOptions | None:
    """Return how to record; None when nothing is to be recorded or shown."""
    from omnieval.errors import ConfigError
    from omnieval.recording import RecordingOptions

    if no_rrd and (spawn or connect is not None):
        raise ConfigError("--no-rrd leaves nothing for --spawn or --connect to show; drop one of them")
    if no_rrd:
        return None
    return RecordingOptions(images=not no_images, every=every, spawn=spawn, connect=connect)
