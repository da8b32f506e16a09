"""Archives as `numpy.savez` writes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from omnieval.descriptors.archive import load_archive
from omnieval.errors import DatasetError

ARRAYS: dict[str, Any] = {"position": np.ones((3, 2), np.float32), "orientation": np.ones((3, 4, 2), np.float32)}


def test_the_names_of_images_may_be_called_files(tmp_path):
    """`numpy.savez` takes no array called `file`: that is its own first parameter."""
    np.savez(tmp_path / "a.npz", files=np.array(["a", "b", "c"]), rooms=np.array(["R", "", "S"]), **ARRAYS)
    frames = load_archive(tmp_path / "a.npz").frames
    assert [frame.file for frame in frames] == ["a", "b", "c"]
    assert [frame.room for frame in frames] == ["R", None, "S"]


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("files", np.array(["a", None, "c"], object)),
        ("room", np.array(["R", None, "S"], object)),
        ("position", np.array([[1.0], [2.0, 3.0], [4.0]], object)),
    ],
)
def test_an_array_of_objects_is_named(name, array, tmp_path):
    np.savez(tmp_path / "a.npz", **{**ARRAYS, name: array})
    with pytest.raises(DatasetError, match=f"a.npz: array '{name}' holds Python objects, which"):
        load_archive(tmp_path / "a.npz")


def test_a_shape_that_is_wrong_is_named_by_its_array(tmp_path):
    np.savez(tmp_path / "a.npz", files=np.array(["a", "b"]), **ARRAYS)
    with pytest.raises(DatasetError, match=r"array 'file' must have shape \(3\)"):
        load_archive(tmp_path / "a.npz")
