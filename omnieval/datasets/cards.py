"""Data cards: what is known of a family of sequences, one TOML file each (``datasets/*.toml``).

A card says where to get the data and how to cite it, and what to expect on disk; what is not known is left out. Where
the layout of a family is not fixed, the card tells it, and the owner of the data writes a card, not a reader::

    [layout]
    images = "omni/*.jpg"            # glob below the sequence folder; every image it matches is a frame
    kind = "omnidirectional"         # or "panoramic", or "auto": the images decide

    [layout.ground_truth]            # leave the table out if there are no positions
    file = "ground_truth.csv"        # a name, or a glob that matches one file
    columns = ["file", "x", "y", "yaw"]
    length_unit = "cm"
    angle_unit = "deg"

``camera.toml`` beside images says what the camera is::

    kind = "omnidirectional"         # or "panoramic"
    mask = "mask.png"                # optional: white where the scene is seen, black for posts and the robot's body
    # belt = "30deg:-50deg"          # optional, panoramic only: the rows to use (`datasets.belt`)

    [mirror]                         # optional, omnidirectional only, pixels
    cx = 320.0
    cy = 240.0
    r_in = 45.0
    r_out = 230.0
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from omnieval.datasets.belt import parse_belt
from omnieval.datasets.sequence import Camera, Mirror
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

CAMERA_FILE = "camera.toml"

_STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
_Pixels = Annotated[float, Field(strict=True)]
_Model = TypeVar("_Model", bound=BaseModel)

Column = Literal["file", "x", "y", "yaw", "room", "time", "-"]
"""What a column holds; ``-`` is one that is not read."""

COLUMNS: tuple[str, ...] = get_args(Column)

Format = Literal["csv", "text", "mat"]


def _below_the_folder(pattern: str) -> str:
    """Refuse a pattern that leaves the sequence folder, or that only some versions of Python take."""
    parts = pattern.split("/")
    if "\0" in pattern or "\\" in pattern:
        raise ValueError("separate folders by /")
    if "" in parts or "." in parts or ".." in parts or ":" in parts[0]:
        raise ValueError("must be a path within the sequence folder, like images/*.jpg")
    if parts[-1] == "**" or any("**" in part and part != "**" for part in parts):
        raise ValueError("** stands for folders and must be a part of its own, like **/*.jpg")
    return pattern


_Pattern = Annotated[str, Field(min_length=1), AfterValidator(_below_the_folder)]


class GroundTruth(BaseModel):
    """Where the captures were taken: one file with one row per capture.

    Attributes
    ----------
    file
        Its name within the sequence folder, or a glob that matches one file. A name must be there; a glob may
        match nothing, and then there is no ground truth.
    format
        ``csv``, ``text`` (columns separated by white space) or ``mat`` (MATLAB v4 to v7, numeric arrays); None
        goes by the ending of the name: ``.csv``, ``.mat``, anything else is text.
    columns
        What the columns hold, from the left. With ``file`` a row belongs to the image it names (path, name or
        name without ending); without, the n-th row belongs to the n-th image in natural order. None: the first
        line names them, ``file``, ``x`` and ``y`` among them.
    header
        Whether the first line is a heading, to be skipped as are lines that begin with ``#`` or ``%``.
    delimiter
        The character between columns; None is a comma in ``csv`` and white space in ``text``.
    decimal
        The decimal mark.
    variable
        Name of the array in a ``mat``, or of several vectors, one a column; None takes its only numeric array.
    transposed
        Whether the array has a column, not a row, for each capture.
    length_unit, angle_unit, time_unit
        Units of x and y, of yaw (counter-clockwise from the x axis) and of time.
    """

    model_config = _STRICT

    file: _Pattern
    format: Format | None = None
    columns: tuple[Column, ...] | None = ("x", "y", "yaw")
    header: bool = False
    delimiter: str | None = Field(None, min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    variable: str | Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    transposed: bool = False
    length_unit: Literal["m", "cm", "mm"] = "m"
    angle_unit: Literal["rad", "deg"] = "rad"
    time_unit: Literal["s", "ms", "us", "ns"] = "s"

    @model_validator(mode="after")
    def _columns_make_sense(self) -> GroundTruth:
        if self.columns is None:
            return self
        counts = Counter(column for column in self.columns if column != "-")
        twice = [column for column, count in counts.items() if count > 1]
        if twice:
            raise ValueError(f"columns names {twice[0]} twice; write - for a column that is not to be read")
        missing = [column for column in ("x", "y") if column not in counts]
        if missing:
            raise ValueError(f"columns has no {missing[0]}; positions need x and y")
        return self

    @model_validator(mode="after")
    def _marks_differ(self) -> GroundTruth:
        if self.delimiter is not None and (self.delimiter in '"\r\n\0' or self.delimiter.isalnum()):
            raise ValueError("delimiter must be a mark such as a comma, a semicolon or a tab")
        delimiter = self.delimiter or ("," if self.resolved_format(self.file) == "csv" else None)
        if delimiter is not None and delimiter == self.decimal:
            raise ValueError("delimiter and decimal are the same mark; set both, like ; and ,")
        return self

    def resolved_format(self, name: str) -> Format:
        """Return the format of the file called `name`."""
        if self.format is not None:
            return self.format
        ending = name.casefold().rpartition(".")[2]
        return "csv" if ending == "csv" else "mat" if ending == "mat" else "text"


class Layout(BaseModel):
    """Where the images of a sequence lie and what they are; `ground_truth` None: no positions are known.

    `images` is a glob below the sequence folder; of what it matches, image files are frames, in the natural order
    of their paths.
    """

    model_config = _STRICT

    images: _Pattern = "**/*"
    kind: Literal["omnidirectional", "panoramic", "auto"] = "auto"
    ground_truth: GroundTruth | None = None


class KnownSequence(BaseModel):
    """A sequence of the family and what to expect of it.

    `path` is its folder within the family, `images` their number, `length_m` the length of the driven path in
    metres, `probable` whether it is only probably the sequence that the figures were published for.
    """

    model_config = _STRICT

    path: str = Field(min_length=1)
    images: int | None = Field(None, gt=0)
    length_m: float | None = Field(None, gt=0)
    probable: bool = False
    note: str | None = None


class MirrorGeometry(BaseModel):
    """The mirror in the images, pixels, as in `omnieval.datasets.sequence.Mirror`."""

    model_config = _STRICT

    cx: _Pixels
    cy: _Pixels
    r_in: _Pixels
    r_out: _Pixels

    @model_validator(mode="after")
    def _radii_ascend(self) -> MirrorGeometry:
        if not 0 <= self.r_in < self.r_out:
            raise ValueError("needs 0 <= r_in < r_out")
        return self


class _CameraTable(BaseModel):
    """What ``camera.toml`` says."""

    model_config = _STRICT

    kind: Literal["panoramic", "omnidirectional"]
    mirror: MirrorGeometry | None = None
    belt: str | None = None
    mask: str | None = Field(None, min_length=1)

    @model_validator(mode="after")
    def _belong_to_the_kind(self) -> _CameraTable:
        if self.mirror is not None and self.kind == "panoramic":
            raise ValueError("a panoramic camera has no [mirror]; remove it, or set kind = 'omnidirectional'")
        if self.belt is not None and self.kind == "omnidirectional":
            raise ValueError("a mirror's belt is between r_in and r_out; remove belt, or set kind = 'panoramic'")
        return self

    @field_validator("belt")
    @classmethod
    def _belt_is_one(cls, belt: str | None) -> str | None:
        if belt is not None:
            parse_belt(belt)
        return belt


class Card(BaseModel):
    """One data card.

    `folders` are the names by which a folder of the family is known, `rooms` the meaning of each room code,
    `image_size` (width, height) in pixels; `mirror_geometry` None means that it is estimated from the images;
    `layout` how a sequence lies on disk, for families whose reader leaves that to the card. The archive of a sequence
    lies at `archives`, followed by name of the card, ``/``, path of the sequence and ``.tar``.
    """

    model_config = _STRICT

    name: str = Field(min_length=1)
    title: str
    get: str
    homepage: str | None = None
    archives: str | None = Field(None, pattern="^https?://")
    citation: str
    licence: str | None = None
    notes: str | None = None
    folders: tuple[str, ...] = ()
    image_size: tuple[int, int] | None = None
    mirror_geometry: MirrorGeometry | None = Field(None, alias="mirror")
    rooms: dict[str, str] = Field(default_factory=dict)
    sequences: tuple[KnownSequence, ...] = ()
    layout: Layout | None = None

    @model_validator(mode="after")
    def _panoramas_have_no_mirror(self) -> Card:
        if self.mirror_geometry is not None and self.layout is not None and self.layout.kind == "panoramic":
            raise ValueError("panoramic images have no [mirror]; remove it, or set layout.kind")
        return self

    @property
    def mirror(self) -> Mirror | None:
        """The mirror, None if it has to be estimated."""
        return _mirror(self.mirror_geometry)

    def sequence(self, path: str | None) -> KnownSequence | None:
        """Return the known sequence called `path`, if there is one."""
        return next((known for known in self.sequences if known.path == path), None)

    def sequence_at(self, folder: Path) -> KnownSequence | None:
        """Return the known sequence that lies in `folder`, by its last parts, flat or nested."""
        parts = [part.casefold() for part in folder.parts[-6:]]
        ends = {"_".join(parts), "_".join(parts[:-1])} if len(parts) > 1 else {"_".join(parts)}
        for known in self.sequences:
            flat = known.path.replace("/", "_")
            if any(f"_{end}".endswith(f"_{flat}") for end in ends):
                return known
        return None


@cache
def all_cards() -> tuple[Card, ...]:
    """Return every data card, by name.

    Raises
    ------
    DatasetError
        If the cards are not there or one is wrong.
    """
    found = sorted((file for file in _folder().iterdir() if file.name.endswith(".toml")), key=lambda file: file.name)
    if not found:
        raise DatasetError(f"no data cards in {_folder()}; reinstall omnieval")
    return tuple(parse_card(file.name.removesuffix(".toml"), file.read_text(encoding="utf-8")) for file in found)


def card(name: str) -> Card:
    """Return the card called `name`, e.g. ``cold-freiburg``.

    Raises
    ------
    DatasetError
        If there is none.
    """
    cards = {known.name: known for known in all_cards()}
    if name not in cards:
        raise DatasetError(f"no data card '{name}'; {did_you_mean(name, cards)}")
    return cards[name]


def find_card(folder: Path) -> tuple[Card | None, str | None]:
    """Return the card of the family that `folder` belongs to, and the path, on that card, of the sequence in it.

    The names of the folders above it tell: ``.../cold-freiburg/part_a/seq2_cloudy3`` and
    ``.../cold-freiburg_part_a_seq2_cloudy3`` are both COLD-Freiburg.
    """
    for part in reversed([part.casefold() for part in folder.parts]):
        for known in all_cards():
            if any(part == alias or part.startswith(f"{alias}_") for alias in known.folders):
                sequence = known.sequence_at(folder)
                return known, sequence.path if sequence else None
    return None, None


def parse_card(name: str, text: str) -> Card:
    """Return the card written in `text` (TOML).

    Raises
    ------
    DatasetError
        If it is not TOML, or a field is unknown, missing or out of range.
    """
    return _parsed(Card, text, f"data card {name}.toml: ", name=name)


def parse_camera(text: str, folder: Path | None = None) -> Camera:
    """Return the camera that a ``camera.toml`` describes.

    Parameters
    ----------
    text
        What the file says.
    folder
        Where it lies: the name of a mask is relative to it.

    Raises
    ------
    DatasetError
        If it is not TOML, a key or kind is unknown, or the mirror is impossible.
    """
    table = _parsed(_CameraTable, text)
    mask = None if table.mask is None else (folder or Path()) / Path(table.mask).expanduser()
    return Camera(table.kind, _mirror(table.mirror), table.belt, mask, CAMERA_FILE)


def overridden(known: Card, text: str, file: str) -> Card:
    """Return `known` with the keys that `text` (TOML) gives in place of its own, a table such as ``[layout]`` whole.

    Parameters
    ----------
    known
        The card to start from.
    text
        What a card beside the data says; it needs no more than what differs.
    file
        Name of that card, for messages.

    Raises
    ------
    DatasetError
        If it is not TOML, or a field is unknown or out of range.
    """
    own = known.model_dump(mode="json", by_alias=True, exclude_unset=True)
    return _parsed(Card, text, f"data card {file}: ", base=own, name=known.name)


def _mirror(geometry: MirrorGeometry | None) -> Mirror | None:
    return None if geometry is None else Mirror(**geometry.model_dump())


def _parsed(
    model: type[_Model], text: str, where: str = "", *, base: Mapping[str, Any] | None = None, **own: str
) -> _Model:
    """Return what a TOML text says in place of `base`, and `own` in place of both; `where` begins the error message.

    Raises
    ------
    DatasetError
        If it is not TOML, or a field is unknown, missing or out of range.
    """
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{where}not valid TOML ({shown(str(error))})") from error
    try:
        return model.model_validate({**(base or {}), **table, **own})
    except ValidationError as error:
        raise DatasetError(f"{where}{_explained(error)}") from error


def _explained(error: ValidationError) -> str:
    """Return the first thing that is wrong, and what would have been right."""
    # A key that is slightly wrong is missing as well, and the near miss says more.
    first = min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    place = [shown(str(piece)) for piece in first["loc"]]
    key = next((piece for piece in reversed(first["loc"]) if isinstance(piece, str)), "")
    what = shown(first["msg"].removeprefix("Value error, "))
    if first["type"] == "missing":
        place, what = place[:-1], f"no {key}"
    elif first["type"] == "extra_forbidden":
        place, what = place[:-1], f"unknown key '{shown(key)}'; {did_you_mean(key, _KEYS, otherwise='remove it')}"
    elif first["type"] == "literal_error":
        value, options = str(first["input"]), re.findall("'([^']*)'", first["ctx"]["expected"])
        place, what = place[:-1], f"unknown {key} '{shown(value)}'; {did_you_mean(value, options)}"
    elif first["type"] == "model_type":
        what = "is not a table"
    return ": ".join([*([".".join(place)] if place else []), what])


def _folder() -> Traversable:
    """Return the folder of the cards: inside an installed package, or beside it in a checkout."""
    installed = files("omnieval.datasets") / "cards_data"
    checkout = Path(__file__).resolve().parents[2] / "datasets"
    return installed if installed.is_dir() else checkout


_KEYS = sorted(
    field.alias or name
    for model in (Card, Layout, GroundTruth, KnownSequence, MirrorGeometry, _CameraTable)
    for name, field in model.model_fields.items()
)
