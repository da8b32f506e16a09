"""How a check says that something does not hold, and when two records are the same."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np


def require(condition: bool | np.bool, message: str) -> None:
    """Raise AssertionError with a message unless a condition holds, also where Python strips assert statements."""
    if not condition:
        raise AssertionError(message)


def same(one: Any, other: Any) -> bool:
    """Return whether two records are equal in every field, arrays to the bit."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if type(one) is not type(other):
        return False
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if dataclasses.is_dataclass(one):
        return all(same(getattr(one, field.name), getattr(other, field.name)) for field in dataclasses.fields(one))
    if isinstance(one, float) and math.isnan(one):
        return math.isnan(other)
    return bool(one == other)
