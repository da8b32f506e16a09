"""Records as JSON knows them."""

import dataclasses
import json
import math
from enum import Enum

import numpy as np

from omnieval.json_records import jsonable


class Gate(Enum):
    NODE = "node"


@dataclasses.dataclass(frozen=True, slots=True)
class Record:
    gate: Gate
    margins: np.ndarray
    frames: tuple[object, ...]
    inner: object = None


def test_records_become_objects_and_what_is_not_finite_becomes_null():
    inner = Record(Gate.NODE, np.zeros((1, 2)), (np.int64(3), np.float64("nan"), np.bool_(True)))
    record = Record(Gate.NODE, np.array([1.0, np.inf]), (-math.inf, frozenset({"a"})), inner)
    content = jsonable(record)
    assert content == {
        "gate": "node",
        "margins": [1.0, None],
        "frames": [None, ["a"]],
        "inner": {"gate": "node", "margins": [[0.0, 0.0]], "frames": [3, None, True], "inner": None},
    }
    assert json.loads(json.dumps(content, allow_nan=False)) == content
