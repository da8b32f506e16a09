"""Data cards: what is known of a family of sequences, one TOML file each (``datasets/*.toml``).

A card says where to get the data and how to cite it, and what to expect on disk; what is not known is left out.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from omnieval.datasets.layout import Layout
from omnieval.datasets.sequence import Mirror
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

_STRICT = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True)


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

    cx: float
    cy: float
    r_in: float = Field(ge=0)
    r_out: float = Field(gt=0)

    @model_validator(mode="after")
    def _radii_ascend(self) -> MirrorGeometry:
        if self.r_in >= self.r_out:
            raise ValueError("r_in must be smaller than r_out")
        return self


class Card(BaseModel):
    """One data card.

    `folders` are the names by which a folder of the family is known, `rooms` the meaning of each room code,
    `image_size` (width, height) in pixels; `mirror_geometry` None means that it is estimated from the images;
    `layout` how a sequence lies on disk, for families whose reader leaves that to the card.
    """

    model_config = _STRICT

    name: str = Field(min_length=1)
    title: str
    get: str
    homepage: str | None = None
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
        geometry = self.mirror_geometry
        return None if geometry is None else Mirror(geometry.cx, geometry.cy, geometry.r_in, geometry.r_out)

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


def card_for(folder: Path) -> Card | None:
    """Return the card of the family that `folder` belongs to, by the names of the folders above it.

    ``.../cold-freiburg/part_a/seq2_cloudy3`` and ``.../cold-freiburg_part_a_seq2_cloudy3`` are both COLD-Freiburg.
    """
    for part in reversed([part.casefold() for part in folder.parts]):
        for known in all_cards():
            if any(part == alias or part.startswith(f"{alias}_") for alias in known.folders):
                return known
    return None


def find_card(folder: Path) -> tuple[Card | None, str | None]:
    """Return the card for `folder` and the path, on that card, of the sequence in it."""
    known = card_for(folder)
    sequence = known.sequence_at(folder) if known else None
    return known, sequence.path if sequence else None


def parse_card(name: str, text: str) -> Card:
    """Return the card written in `text` (TOML).

    Raises
    ------
    DatasetError
        If it is not TOML, or a field is unknown, missing or out of range.
    """
    return _validated(_toml(text, f"{name}.toml"), name, f"{name}.toml")


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
    return _validated({**own, **_toml(text, file)}, known.name, file)


def _toml(text: str, file: str) -> dict[str, object]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"data card {file} is not valid TOML: {shown(str(error))}") from error


def _validated(table: dict[str, object], name: str, file: str) -> Card:
    try:
        return Card.model_validate({**table, "name": name})
    except ValidationError as error:
        first = error.errors()[0]
        field = shown(".".join(str(piece) for piece in first["loc"]))
        raise DatasetError(f"data card {file}: {field or 'card'}: {first['msg']}") from error


def _folder() -> Traversable:
    """Return the folder of the cards: inside an installed package, or beside it in a checkout."""
    installed = files("omnieval.datasets") / "cards_data"
    checkout = Path(__file__).resolve().parents[2] / "datasets"
    return installed if installed.is_dir() else checkout
