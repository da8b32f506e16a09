"""Orientation descriptors stay in a large archive, where they are stored as they are used."""

import zipfile

import numpy as np
import pytest

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.archive import load_archive, save_archive
from omnieval.errors import DatasetError

RNG = np.random.default_rng(0)
POSITION, ORIENTATION = RNG.random((5, 3), np.float32), RNG.random((5, 8, 2), np.float32)


@pytest.fixture(autouse=True)
def _small_is_large(monkeypatch):
    monkeypatch.setattr("omnieval.descriptors.archive.WORTH_MAPPING", 1)


def test_nothing_is_mapped_unless_that_is_allowed_and_worth_it(archive, monkeypatch):
    seen = load_archive(archive)
    assert seen.mapped is None
    save_archive(archive, seen.frames, seen.position, seen.orientation)  # onto itself
    monkeypatch.undo()
    assert load_archive(archive, may_map=True).mapped is None


@pytest.fixture
def archive(tmp_path):
    frames = [Frame(tmp_path, f"{number}.png") for number in range(5)]
    save_archive(tmp_path / "a.npz", frames, POSITION, ORIENTATION)
    return tmp_path / "a.npz"


def test_what_is_mapped_is_what_was_saved_and_stays_so_when_it_is_released(archive):
    loaded = load_archive(archive, may_map=True)
    assert loaded.mapped is not None
    assert not loaded.orientation.flags.writeable
    for _ in range(2):
        np.testing.assert_array_equal(loaded.orientation, ORIENTATION)
        loaded.release()


@pytest.mark.parametrize(
    "saved",
    [
        lambda path: np.savez_compressed(path, position=POSITION, orientation=ORIENTATION),
        lambda path: np.savez(path, position=POSITION, orientation=ORIENTATION.astype(np.float64)),
        lambda path: np.savez(path, position=POSITION, orientation=np.asfortranarray(ORIENTATION)),
        lambda path: np.savez(path, position=POSITION, orientation=ORIENTATION.astype(">f4")),
    ],
    ids=["compressed", "double", "columns first", "big-endian"],
)
def test_what_is_stored_in_another_way_is_read(saved, tmp_path):
    saved(tmp_path / "a.npz")
    loaded = load_archive(tmp_path / "a.npz", may_map=True)
    assert loaded.mapped is None
    np.testing.assert_array_equal(loaded.orientation, ORIENTATION)


def test_damage_is_noticed_though_nothing_is_copied(archive):
    with zipfile.ZipFile(archive) as file:
        offset = file.getinfo("orientation.npy").header_offset
    data = bytearray(archive.read_bytes())
    data[offset + 300] ^= 1
    archive.write_bytes(data)
    with pytest.raises(DatasetError, match=r"cannot read descriptors .*a.npz: Bad CRC"):
        load_archive(archive, may_map=True)


def test_values_that_are_not_finite_are_found_in_it(tmp_path):
    broken = ORIENTATION.copy()
    broken[3, 1, 0] = np.nan
    np.savez(tmp_path / "a.npz", position=POSITION, orientation=broken)
    with pytest.raises(DatasetError, match="'orientation' has NaN or infinite values, first in image 3"):
        load_archive(tmp_path / "a.npz", may_map=True)
