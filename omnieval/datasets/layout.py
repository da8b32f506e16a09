"""How a sequence lies on disk, as a data card tells it: the ``[layout]`` table.

    [layout]
    images = "omni/*.jpg"            # glob below the sequence folder; every image it matches is a frame
    kind = "omnidirectional"         # or "panoramic", or "auto": the aspect ratio decides

    [layout.ground_truth]            # leave the table out if there are no positions
    file = "ground_truth.csv"        # a name, or a glob that matches one file
    columns = ["file", "x", "y", "yaw"]
    length_unit = "cm"
    angle_unit = "deg"

It is for families whose layout is not fixed: whoever has the data writes the card, not a reader.
"""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Column = Literal["file", "x", "y", "yaw", "room", "time", "-"]
"""What a column holds; ``-`` is one that is not read."""

Format = Literal["csv", "text", "mat"]

_STRICT = ConfigDict(frozen=True, extra="forbid")


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
    """Where the captures were taken: one file with one row a capture.

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
        name without ending); without, the n-th row belongs to the n-th image in natural order.
    header
        Whether the first line is a heading; it is skipped. Lines that begin with ``#`` or ``%`` always are.
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
    columns: tuple[Column, ...] = ("x", "y", "yaw")
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
