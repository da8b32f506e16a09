"""What a recording says, as one number: equal for two recordings of the same steps.

Their bytes never are: row and chunk ids, the clock, the order of chunks and the footer differ.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
from rerun.chunk import Chunk, RrdReader

from omnieval.errors import ResultError
from omnieval.recording import entities

_NOT_CONTENT = frozenset({"log_time", "log_tick", "RecordingInfo:start_time"})


def digest(path: Path) -> str:
    """Return the digest of a recording's rows, whatever their order and their distribution over chunks.

    Measured durations (`entities.PLOT_COST`) are left out.

    Raises
    ------
    ResultError
        If the file is missing or cannot be read.
    """
    try:
        rows = sorted(row for chunk in RrdReader(path).stream() for row in _rows(chunk))
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ResultError(f"cannot read the recording {path}: {reason}; render it again") from error
    total = hashlib.blake2b(digest_size=16)
    for row in rows:
        total.update(row)
    return total.hexdigest()


def _rows(chunk: Chunk) -> Iterator[bytes]:
    """Digest every value of a chunk with its entity, component and times."""
    if chunk.entity_path.startswith(entities.PLOT_COST):
        return
    batch = chunk.to_record_batch()
    timelines = sorted(set(chunk.timeline_names) - _NOT_CONTENT)
    times = [batch.column(name).cast(pa.int64()).to_pylist() for name in timelines]
    for position, name in enumerate(batch.schema.names):
        kind = (batch.schema.field(position).metadata or {}).get(b"rerun:kind", b"")
        if kind != b"data" or name.rsplit(":", 1)[-1] in _NOT_CONTENT or name in _NOT_CONTENT:
            continue
        column = batch.column(position)
        for index in range(batch.num_rows):
            if not column[index].is_valid:
                continue
            at = [(timeline, times[number][index]) for number, timeline in enumerate(timelines)]
            row = hashlib.blake2b(repr((chunk.entity_path, name, at)).encode(), digest_size=16)
            _add(row, column.slice(index, 1))
            yield row.digest()


def _add(row: hashlib.blake2b, array: pa.Array) -> None:
    """Add the values of an array, not its buffers: slices of Arrow arrays keep more than they show."""
    kind = array.type
    row.update(f"{len(array)}{kind.id}".encode())
    if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind):
        row.update(repr(array.value_lengths().to_pylist()).encode())
        _add(row, array.flatten())
    elif pa.types.is_struct(kind):
        for child in array.flatten():
            _add(row, child)
    elif pa.types.is_primitive(kind) and array.null_count == 0:
        row.update(array.to_numpy(zero_copy_only=False).tobytes())
    else:
        row.update(repr(array.to_pylist()).encode())
