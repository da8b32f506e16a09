"""Numeric arrays from a MATLAB file (v5 to v7). Nothing else in the file is read, and nothing is executed.

The format is that of MathWorks, *MAT-File Format*, "Level 5 MAT-File Format": a header of 128 bytes, then elements,
each a tag (type and number of bytes) and its data; a matrix is an element made of elements: flags, dimensions,
name, real part. The tests hold this reader against ``scipy.io``, which is not used here because its ``loadmat``
brings the interpreter down where a tag is damaged.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError
from omnieval.wording import shown

_HDF5_START = b"\x89HDF\r\n\x1a\n"
_HEADER_BYTES = 128
_VERSION_OFFSET = 124
_ORDERS: dict[bytes, Literal["<", ">"]] = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}
"""Byte order by the end of the header: version 1, and a mark."""

_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Type of number by type of element; MATLAB stores an array in the smallest that holds its values."""

_NUMERIC_CLASSES = range(6, 16)
_OTHER_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function handle", 17: "object"}
_OPAQUE = 17
_COMPLEX_FLAG = 0x0800

_HEAD_BYTES = 4096
"""Flags, dimensions and name of a variable lie within these."""

_MOST_NUMBERS = 10_000_000
_MOST_BYTES = 8 * _MOST_NUMBERS + _HEAD_BYTES


@dataclass(frozen=True, slots=True)
class _Variable:
    """A variable of which flags, dimensions and name have been read; `kind` is its class, `data` its element."""

    name: str
    kind: int
    shape: tuple[int, ...]
    is_complex: bool
    data: memoryview
    is_compressed: bool

    @property
    def is_numeric(self) -> bool:
        return self.kind in _NUMERIC_CLASSES


def read_columns(data: bytes, variable: str | Sequence[str] | None, *, transposed: bool) -> NDArray[np.float64]:
    """Return the numbers of a MATLAB file, one row a capture.

    Parameters
    ----------
    data
        The bytes of the file.
    variable
        Name of the array, or names of the vectors that are its columns; None: its only numeric array.
    transposed
        Whether the array has a column, not a row, for each capture.

    Returns
    -------
    NDArray[np.float64]
        Shape (n, columns).

    Raises
    ------
    DatasetError
        If the file is of another version or damaged, or a variable is missing or no real numeric array.
    """
    order = _byte_order(data)
    variables = {found.name: found for found in _variables(data, order)}
    if variable is None:
        variable = _only_array(variables)
    if isinstance(variable, str):
        array = _array(variable, variables, order)
        if array.ndim != 2:
            raise DatasetError(f"variable {shown(variable)} has {array.ndim} dimensions; expected a table")
        return array.T if transposed else array
    arrays = [_array(name, variables, order) for name in variable]
    if len({array.size for array in arrays}) > 1 or any(max(array.shape) != array.size for array in arrays):
        raise DatasetError(f"variables {shown(', '.join(variable))} are not vectors of one length; name others")
    return np.column_stack([array.ravel() for array in arrays])


def _byte_order(data: bytes) -> Literal["<", ">"]:
    if data.startswith((_HDF5_START, b"MATLAB 7.3")) or data[512:520] == _HDF5_START:
        raise DatasetError("MATLAB v7.3 (HDF5) is not read; in MATLAB, save it with the option -v7")
    order = _ORDERS.get(data[_VERSION_OFFSET:_HEADER_BYTES])
    if order is None:
        raise DatasetError("not a MATLAB v5 to v7 file; in MATLAB, save it with the option -v7")
    return order


def _variables(data: bytes, order: Literal["<", ">"]) -> Iterator[_Variable]:
    """Yield the variables of the file; those without a name are MATLAB's own."""
    for kind, content in _elements(memoryview(data)[_HEADER_BYTES:], order):
        if kind not in {_MATRIX, _COMPRESSED}:
            raise _damaged(f"an element of type {kind} where a variable was expected")
        head = _matrix(content, order, _HEAD_BYTES) if kind == _COMPRESSED else content
        parts = [part for _, part in islice(_elements(head, order), 3)]
        if not parts or len(parts[0]) < 4:
            raise _damaged("a variable without flags")
        flags = struct.unpack_from(f"{order}I", parts[0])[0]
        opaque = flags & 0xFF == _OPAQUE
        if len(parts) < 3:
            raise _damaged("a variable without a name")
        name = bytes(parts[1 if opaque else 2]).decode("utf-8", "backslashreplace")
        shape = () if opaque else _shape(parts[1], order)
        if name:
            yield _Variable(name, flags & 0xFF, shape, bool(flags & _COMPLEX_FLAG), content, kind == _COMPRESSED)


def _elements(data: memoryview, order: Literal["<", ">"]) -> Iterator[tuple[int, memoryview]]:
    """Yield type and data of the elements that follow each other in `data`."""
    at = 0
    while at < len(data):
        if at + 8 > len(data):
            raise _damaged("it ends within a tag")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # a small element has its data within the tag
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
        else:
            start = at + 8
            end = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if start + size > min(end, len(data)):
            raise _damaged("it ends early")
        yield kind, data[start : start + size]
        at = end


def _matrix(compressed: memoryview, order: Literal["<", ">"], most_bytes: int) -> memoryview:
    """Return the data of the matrix that `compressed` holds, no more than `most_bytes` of it."""
    try:
        content = zlib.decompressobj().decompress(compressed, most_bytes)
    except zlib.error as error:
        raise _damaged(str(error)) from error
    if len(content) < 8 or struct.unpack_from(f"{order}I", content)[0] != _MATRIX:
        raise _damaged("a compressed element without a variable")
    return memoryview(content)[8:]


def _shape(data: memoryview, order: Literal["<", ">"]) -> tuple[int, ...]:
    sizes = struct.unpack(f"{order}{len(data) // 4}i", data[: len(data) // 4 * 4])
    if len(sizes) < 2 or min(sizes) < 0:
        raise _damaged(f"a variable has the dimensions {sizes}")
    return sizes


def _only_array(variables: dict[str, _Variable]) -> str:
    numeric = [found.name for found in variables.values() if found.is_numeric]
    if len(numeric) != 1:
        names = f" ({shown(', '.join(numeric))})" if numeric else ""
        raise DatasetError(f"{len(numeric)} numeric arrays{names}; name one in layout.ground_truth.variable")
    return numeric[0]


def _array(name: str, variables: dict[str, _Variable], order: Literal["<", ">"]) -> NDArray[np.float64]:
    found = variables.get(name)
    if found is None:
        raise DatasetError(f"no variable {shown(name)}; there are {shown(', '.join(variables)) or 'none'}")
    if not found.is_numeric or found.is_complex:
        kind = "complex" if found.is_complex else _OTHER_CLASSES.get(found.kind, "unknown")
        raise DatasetError(f"variable {shown(name)} is {kind}; only arrays of real numbers are read")
    count = math.prod(found.shape)
    if count > _MOST_NUMBERS:
        raise DatasetError(f"variable {shown(name)} has {count} numbers; that is no list of poses")
    content = _matrix(found.data, order, _MOST_BYTES) if found.is_compressed else found.data
    parts = list(islice(_elements(content, order), 4))
    number = _NUMBERS.get(parts[3][0]) if len(parts) == 4 else None
    if number is None:
        raise _damaged(f"variable {shown(name)} has no numbers")
    dtype = np.dtype(number).newbyteorder(order)
    if len(parts[3][1]) != count * dtype.itemsize:
        raise _damaged(f"variable {shown(name)} has too few or too many numbers")
    return np.frombuffer(parts[3][1], dtype).astype(np.float64).reshape(found.shape, order="F")


def _damaged(reason: str) -> DatasetError:
    return DatasetError(f"damaged MATLAB file ({reason}); copy it again")
