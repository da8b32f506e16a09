"""What a table says, as one number: equal for two tables of the same content, however they were computed and stored.

The **content hash** of a table is the BLAKE2b digest (16 bytes, hexadecimal) of, in this order,

1. the tag ``omnieval-content-1`` and the number of rows (8 bytes, little-endian, as all numbers here),
2. for every column but those of `MEASURED`, in the order of the table: its name and its type, each as UTF-8 behind its
   length, and its values in the order of the rows.

Values are a byte per row that says whether it is there (1) or null (0), followed by

- for numbers, booleans and times their bits, so that floats are equal only to the bit, with zero in place of null,
- for text and choices the length of each in bytes (0 for null), then all of them in UTF-8,
- for lists the length of each (0 for null), then all their items as values of their own,
- for structures each of their fields as a column, name, type and values.

The bytes of the parquet file play no part: neither its compression nor who wrote it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

MEASURED = frozenset({"milliseconds", "seconds"})
"""The columns that the clock fills, which no two runs share."""

_TAG = "omnieval-content-1"


def content_hash(table: pl.DataFrame) -> str:
    """Return the content hash of a table, as the module describes it.

    Parameters
    ----------
    table
        A table of `omnieval.results.schemas`, or any other of numbers, booleans, times, text, choices, lists and
        structures.

    Raises
    ------
    TypeError
        If a column has a type for which the hash is not defined.
    """
    digest = hashlib.blake2b(digest_size=16)
    _add_text(digest, _TAG)
    _add_number(digest, len(table))
    for column in table:
        if column.name not in MEASURED:
            _add_column(digest, column)
    return digest.hexdigest()


def folder_hash(hashes: Mapping[str, str]) -> str:
    """Return the hash of several tables: that of ``NAME HASH`` lines in alphabetical order."""
    lines = "".join(f"{name} {hashes[name]}\n" for name in sorted(hashes))
    return hashlib.blake2b(lines.encode(), digest_size=16).hexdigest()


def _add_column(digest: hashlib.blake2b, column: pl.Series) -> None:
    _add_text(digest, column.name)
    _add_text(digest, _name_of(column.dtype))
    _add_values(digest, column)


def _add_values(digest: hashlib.blake2b, column: pl.Series) -> None:
    """Add values; most columns miss none, and are asked for as little as can be: every question costs a query."""
    missing = column.null_count() > 0
    there = column.is_not_null().to_numpy() if missing else np.ones(len(column), np.bool_)
    digest.update(there.tobytes())
    kind = column.dtype
    if isinstance(kind, pl.Struct):
        for field in column.struct.fields:
            _add_column(digest, column.struct.field(field))
    elif isinstance(kind, pl.List):
        lengths = column.list.len()
        lengths = lengths.fill_null(0) if missing else lengths
        _add_lengths(digest, lengths.to_numpy())
        _add_values(digest, column.filter(lengths > 0).explode())
    elif isinstance(kind, pl.String | pl.Enum | pl.Categorical):
        words = [b"" if word is None else word.encode() for word in column.to_list()]
        _add_lengths(digest, np.fromiter(map(len, words), np.int64, len(words)))
        digest.update(b"".join(words))
    else:
        plain = column if kind.is_numeric() or kind == pl.Boolean else column.to_physical()
        bits = (plain.fill_null(False if kind == pl.Boolean else 0) if missing else plain).to_numpy()
        digest.update(bits.astype(bits.dtype.newbyteorder("<"), copy=False).tobytes())


def _name_of(kind: pl.DataType) -> str:
    """Return the name of a type, which is ours to keep: polars' own words may change."""
    if isinstance(kind, pl.List):
        inner = kind.inner
        return f"list of {_name_of(inner if isinstance(inner, pl.DataType) else inner())}"
    if isinstance(kind, pl.Struct):
        return "struct"
    if isinstance(kind, pl.Enum):
        return "choice " + " ".join(kind.categories)
    if isinstance(kind, pl.Datetime):
        return f"time {kind.time_unit}"
    if kind.is_numeric() or isinstance(kind, pl.String | pl.Boolean | pl.Categorical):
        return kind.base_type().__name__.lower()
    raise TypeError(f"the content hash is not defined for columns of {kind}")


def _add_text(digest: hashlib.blake2b, text: str) -> None:
    content = text.encode()
    _add_number(digest, len(content))
    digest.update(content)


def _add_number(digest: hashlib.blake2b, number: int) -> None:
    digest.update(number.to_bytes(8, "little"))


def _add_lengths(digest: hashlib.blake2b, lengths: NDArray[np.integer]) -> None:
    digest.update(lengths.astype(np.dtype("<u8")).tobytes())
