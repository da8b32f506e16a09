"""How a check says that something does not hold, and when two records are the same."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
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
        one, other = ({field.name: getattr(of, field.name) for field in dataclasses.fields(of)} for of in (one, other))
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same(value, other[name]) for name, value in one.items())
    return bool(one == other) or (isinstance(one, float) and math.isnan(one) and math.isnan(other))
