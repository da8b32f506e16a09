"""A program of its own, run by `omnieval.datasets.matlab`: a MATLAB file in, its numbers out as an ``.npy``.

``loadmat`` of SciPy brings the interpreter down where a tag is damaged, and this program is all that falls. It ends
with the code `REFUSED` and a sentence on stderr if the file is sound, but not what was asked for.
"""

from __future__ import annotations

import io
import json
import math
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat

REFUSED = 3

_NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
_MOST_NUMBERS = 10_000_000


class RefusedError(Exception):
    """Says why the file is not what was asked for."""


def columns(data: bytes, variable: str | Sequence[str] | None, *, transposed: bool) -> NDArray[np.float64]:
    """Return the numbers, shape (n, columns), see `omnieval.datasets.matlab.read_columns`.

    Raises
    ------
    RefusedError
        If a variable is missing or no real numeric array; of a damaged file, whatever SciPy raises.
    """
    listed = {name: (kind, math.prod(shape)) for name, shape, kind in whosmat(io.BytesIO(data))}
    if variable is None:
        variable = _only_array([name for name, (kind, _) in listed.items() if kind in _NUMERIC])
    names = [variable] if isinstance(variable, str) else list(variable)
    for name in names:
        _refuse_others(name, listed)
    loaded = loadmat(io.BytesIO(data), variable_names=names)
    for name in names:
        if np.iscomplexobj(loaded[name]):
            raise RefusedError(f"variable {name} is complex; only arrays of real numbers are read")
    arrays = [np.asarray(loaded[name], dtype=np.float64) for name in names]
    if isinstance(variable, str):
        if arrays[0].ndim != 2:
            raise RefusedError(f"variable {variable} has {arrays[0].ndim} dimensions; expected a table")
        return arrays[0].T if transposed else arrays[0]
    if len({array.size for array in arrays}) > 1 or any(max(array.shape) != array.size for array in arrays):
        raise RefusedError(f"variables {', '.join(names)} are not vectors of one length; name others")
    return np.column_stack([array.ravel() for array in arrays])


def _only_array(numeric: list[str]) -> str:
    if len(numeric) != 1:
        names = f" ({', '.join(numeric)})" if numeric else ""
        raise RefusedError(f"{len(numeric)} numeric arrays{names}; name one in layout.ground_truth.variable")
    return numeric[0]


def _refuse_others(name: str, listed: dict[str, tuple[str, int]]) -> None:
    """Refuse a variable that is not there, not numeric or of monstrous size, before it is unpacked."""
    if name not in listed:
        raise RefusedError(f"no variable {name}; there are {', '.join(listed) or 'none'}")
    kind, size = listed[name]
    if kind not in _NUMERIC:
        raise RefusedError(f"variable {name} is {kind}; only arrays of real numbers are read")
    if size > _MOST_NUMBERS:
        raise RefusedError(f"variable {name} has {size} numbers; that is not a list of poses")


if __name__ == "__main__":
    try:
        table = columns(sys.stdin.buffer.read(), **json.loads(sys.argv[1]))
    except RefusedError as refusal:
        print(refusal, file=sys.stderr)
        sys.exit(REFUSED)
    np.save(sys.stdout.buffer, table, allow_pickle=False)
