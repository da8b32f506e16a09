"""Numeric arrays from a MATLAB file (v4 to v7), read by SciPy in a process of its own that may crash or hang."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError
from omnieval.wording import shown

_PROGRAM = Path(__file__).with_name("loadmat.py")
_REFUSED = 3
"""Code with which the program refuses; it is not imported, and with it SciPy, for this number."""
_MOST_SECONDS = 60
_HDF5_START = b"\x89HDF\r\n\x1a\n"


def read_columns(data: bytes, variable: str | Sequence[str] | None, *, transposed: bool) -> NDArray[np.float64]:
    """Return the numbers of a MATLAB file, one row per capture.

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
    if data.startswith((_HDF5_START, b"MATLAB 7.3")) or data[512:520] == _HDF5_START:
        raise DatasetError("MATLAB v7.3 (HDF5) is not read; in MATLAB, save it with the option -v7")
    # -P: neither the working directory nor this folder may offer modules of the names that SciPy imports.
    command = [sys.executable, "-P", str(_PROGRAM), json.dumps({"variable": variable, "transposed": transposed})]
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=_MOST_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise _damaged(f"reading it takes more than {_MOST_SECONDS} s") from None
    said = done.stderr.decode(errors="replace").strip()
    if done.returncode == _REFUSED:
        raise DatasetError(shown(said))
    if done.returncode:
        reason = said.rpartition("\n")[2] if done.returncode > 0 else "it ends early, or a size in it is wrong"
        raise _damaged(reason)
    try:
        return cast("NDArray[np.float64]", np.load(io.BytesIO(done.stdout), allow_pickle=False))
    except (ValueError, OSError, EOFError):
        raise _damaged("its numbers cannot be read") from None


def _damaged(reason: str) -> DatasetError:
    return DatasetError(f"damaged, or no MATLAB file of v4 to v7 ({shown(reason)}); save it again with -v7")
