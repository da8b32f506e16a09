"""MATLAB arrays: read by SciPy, in a process that may fall."""

from __future__ import annotations

import io
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat, savemat

from omnieval.datasets import matlab
from omnieval.datasets.loadmat import REFUSED, columns
from omnieval.datasets.matlab import read_columns
from omnieval.errors import DatasetError

DTYPES = ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"]


def mat(*, compressed: bool = False, version: str = "5", **variables) -> bytes:
    stream = io.BytesIO()
    savemat(stream, variables, do_compression=compressed, format=version)
    return stream.getvalue()


@given(
    array=st.sampled_from(DTYPES).flatmap(
        lambda dtype: hnp.arrays(dtype, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9))
    ),
    compressed=st.booleans(),
)
def test_the_program_reads_what_scipy_writes(array, compressed):
    data = mat(compressed=compressed, p=array)
    with np.errstate(invalid="ignore"):
        expected = loadmat(io.BytesIO(data))["p"].astype(np.float64)
        np.testing.assert_array_equal(columns(data, "p", transposed=False), expected)
        np.testing.assert_array_equal(columns(data, None, transposed=True), expected.T)


def test_the_other_byte_order_is_read():
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    flags = b"\0\0\0\x06\0\0\0\x08" + b"\0\0\0\x06\0\0\0\0"
    shape = b"\0\0\0\x05\0\0\0\x08" + b"\0\0\0\x01\0\0\0\x02"
    name = b"\0\x01\0\x01p\0\0\0"
    numbers = b"\0\x04\0\x03\x01\x02\x03\x04"
    body = flags + shape + name + numbers
    data = header + b"\0\0\0\x0e" + len(body).to_bytes(4, "big") + body
    assert read_columns(data, None, transposed=False).tolist() == [[0x0102, 0x0304]]


@pytest.mark.parametrize("version", ["4", "5"])
def test_vectors_become_columns_in_the_order_asked_for(version):
    data = mat(version=version, x=np.arange(3.0), y=np.arange(3.0)[:, None] + 5, p=np.eye(2))
    assert read_columns(data, ["y", "x"], transposed=False).tolist() == [[5, 0], [6, 1], [7, 2]]


def test_other_contents_do_no_harm():
    cells = np.array([1, "a", np.eye(2)], dtype=object)
    data = mat(text="poses", cells=cells, struct={"a": 1}, p=np.eye(3), empty=np.zeros((0, 0)))
    np.testing.assert_array_equal(read_columns(data, "p", transposed=False), np.eye(3))


@pytest.mark.parametrize(
    ("data", "variable", "complaint"),
    [
        (b"MATLAB 7.3 MAT-file, Platform".ljust(512) + b"\x89HDF\r\n\x1a\n", None, "v7.3 .HDF5. is not read; .*-v7"),
        (b"\x89HDF\r\n\x1a\n", None, "v7.3"),
        (b"", None, "no MATLAB file of v4 to v7"),
        (b"plain text", None, "no MATLAB file of v4 to v7"),
        (mat(p=np.eye(3)), "q", "no variable q; there are p"),
        (mat(text="abc"), None, "0 numeric arrays"),
        (mat(a=np.eye(2), b=np.eye(2)), None, r"2 numeric arrays \(a, b\)"),
        (mat(text="abc"), "text", "is char; only arrays of real numbers"),
        (mat(s={"a": 1}), "s", "is struct"),
        (mat(c=np.array([1, "a"], dtype=object)), "c", "is cell"),
        (mat(z=np.eye(2) * 1j), "z", "is complex"),
        (mat(p=np.zeros((2, 2, 2))), "p", "3 dimensions"),
        (mat(x=np.zeros(3), y=np.zeros(4)), ["x", "y"], "not vectors of one length"),
        (mat(x=np.zeros((2, 2)), y=np.zeros((2, 2))), ["x", "y"], "not vectors"),
        (mat(p=np.eye(3))[:-9], "p", "damaged"),
        (mat(compressed=True, p=np.eye(3))[:140] + bytes(60), "p", "damaged"),
    ],
)
def test_what_it_cannot_read_it_refuses(data, variable, complaint):
    with pytest.raises(DatasetError, match=complaint) as caught:
        read_columns(data, variable, transposed=False)
    assert str(caught.value).isprintable()


def test_a_variable_of_monstrous_size_is_refused_before_it_is_unpacked():
    data = bytearray(mat(p=np.zeros((3, 3))))
    place = data.index(b"\x03\0\0\0\x03\0\0\0")
    data[place : place + 8] = b"\xff\xff\xff\x7f" * 2
    with pytest.raises(DatasetError, match="not a list of poses"):
        read_columns(bytes(data), "p", transposed=False)


@pytest.mark.parametrize(
    ("program", "complaint"),
    [
        ("import os; os.kill(os.getpid(), 11)", "ends early, or a size in it is wrong"),
        ("import time; time.sleep(60)", "takes more than 0.5 s"),
        ("print('no array')", "its numbers cannot be read"),
        ("raise ValueError('a\\x1bb')", r"ValueError: a\\x1bb"),
        (f"import sys; print('no x', file=sys.stderr); sys.exit({REFUSED})", "^no x$"),
    ],
)
def test_a_program_that_falls_hangs_or_babbles_is_an_error_of_the_dataset(tmp_path, monkeypatch, program, complaint):
    (tmp_path / "loadmat.py").write_text(program)
    monkeypatch.setattr(matlab, "_PROGRAM", tmp_path / "loadmat.py")
    monkeypatch.setattr(matlab, "_MOST_SECONDS", 0.5 if "sleep" in program else 60)
    with pytest.raises(DatasetError, match=complaint):
        read_columns(b"", None, transposed=False)


@pytest.mark.parametrize("compressed", [False, True])
def test_damage_anywhere_is_a_dataset_error_or_another_number(compressed):
    whole = mat(compressed=compressed, x=np.arange(6.0), s={"a": "text"}, y=np.arange(6))
    rng = random.Random(0)
    complaints = []
    for _ in range(8):
        data = bytearray(whole)
        data[rng.randrange(128, len(data))] = rng.randrange(256)
        try:
            read_columns(bytes(data), ["x", "y"], transposed=False)
        except DatasetError as error:
            complaints.append(str(error))
    assert complaints
    assert all(complaint.isprintable() for complaint in complaints)
