"""Records as JSON knows them."""

from __future__ import annotations

from typing import Any

from pydantic_core import to_jsonable_python


def jsonable(record: Any) -> Any:
    """Return a record as JSON knows it: dataclasses as objects, arrays as lists, what is not finite as null.

    Examples
    --------
    >>> jsonable({"margin": float("inf"), "frames": (1, 2)})
    {'margin': None, 'frames': [1, 2]}
    """
    return to_jsonable_python(record, inf_nan_mode="null", fallback=lambda array: array.tolist())
