"""HOG against the pixel-by-pixel oracle, by hand, and under rotation."""

import itertools

import numpy as np
import pytest

from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.errors import ConfigError
from tests.reference.hog import hog as plain_hog

OPTIONS = list(
    itertools.product(
        ["signed", "unsigned"], ["central", "sobel"], ["hard", "linear"], ["cell-l2", "none", "cell-l1", "global-l2"]
    )
)


def a_panorama(seed=0, rows=32, columns=64):
    rng = np.random.default_rng(seed)
    # Steps and flat parts, so that angles on the border of two bins and zero gradients are common.
    return np.kron(rng.integers(0, 256, (rows // 4, columns // 4)), np.ones((4, 4))).astype(np.uint8)


@pytest.mark.parametrize(("angles", "kernel", "binning", "normalisation"), OPTIONS)
def test_agrees_with_the_oracle(angles, kernel, binning, normalisation):
    config = HogSettings(
        orientation_range=angles,
        kernel=kernel,
        binning=binning,
        normalisation=normalisation,
        orientation_cells=32,
        position_cells=8,
    )
    panorama = a_panorama()
    found = Hog(config).describe(panorama)
    position, orientation = plain_hog(
        panorama,
        signed=angles == "signed",
        kernel=kernel,
        interpolate=binning == "linear",
        norm=normalisation,
        position_cells=8,
    )
    np.testing.assert_allclose(found.position, position.ravel(), rtol=2e-6, atol=2e-6)
    np.testing.assert_allclose(found.orientation, orientation, rtol=2e-6, atol=2e-6)


def test_sizes_are_the_papers():
    found = Hog().describe(a_panorama(rows=128, columns=512))
    assert found.position.shape == (256,)
    assert found.orientation.shape == (256, 16)
    assert found.position.dtype == found.orientation.dtype == np.float32


def test_a_vertical_edge_votes_for_zero_degrees_by_hand():
    panorama = np.zeros((16, 32), np.uint8)
    panorama[:, 16:] = 100
    config = HogSettings(normalisation="none", orientation_cells=16, orientation_width=2, position_cells=4)
    position = Hog(config).describe(panorama).position.reshape(4, 16)
    # Rising at column 16 (two columns see it), falling where the panorama closes: 4 rows x 2 columns x 100 each.
    assert position[:, 0].tolist() == [800.0] * 4
    assert position[:, 8].tolist() == [800.0] * 4
    assert position.sum() == 6400.0


def test_a_ramp_down_the_rows_votes_for_ninety_degrees_by_hand():
    panorama = np.repeat(np.arange(16, dtype=np.uint8)[:, None] * 3, 32, axis=1)
    config = HogSettings(normalisation="none", orientation_cells=16, position_cells=16)
    position = Hog(config).describe(panorama).position.reshape(16, 16)
    assert position[:, 4].tolist() == [96.0] + [192.0] * 14 + [96.0]
    assert np.delete(position, 4, axis=1).sum() == 0.0


@pytest.mark.parametrize("columns", [1, 2, 17, 100, 511])
def test_a_rotation_leaves_the_position_descriptor_bit_for_bit(columns):
    panorama = np.random.default_rng(1).integers(0, 256, (128, 512)).astype(np.uint8)
    hog = Hog()
    turned = hog.describe(np.roll(panorama, columns, axis=1))
    assert np.array_equal(turned.position, hog.describe(panorama).position)


@pytest.mark.parametrize("normalisation", ["cell-l2", "none", "cell-l1", "global-l2"])
@pytest.mark.parametrize("cells", [1, 7, 255])
def test_a_rotation_rolls_the_orientation_descriptor_bit_for_bit(cells, normalisation):
    panorama = np.random.default_rng(2).integers(0, 256, (128, 512)).astype(np.uint8)
    hog = Hog(HogSettings(normalisation=normalisation))
    turned = hog.describe(np.roll(panorama, 2 * cells, axis=1))
    assert np.array_equal(turned.orientation, np.roll(hog.describe(panorama).orientation, cells, axis=0))


def test_brightness_does_not_matter_and_contrast_hardly():
    panorama = np.random.default_rng(3).integers(0, 100, (128, 512)).astype(np.uint8)
    hog = Hog()
    plain = hog.describe(panorama).position
    assert np.array_equal(hog.describe(panorama + 50).position, plain)
    np.testing.assert_allclose(hog.describe(panorama * 2).position, plain, atol=1e-4)


def test_a_black_image_has_a_finite_descriptor():
    found = Hog().describe(np.zeros((128, 512), np.uint8))
    assert not found.position.any()
    assert np.isfinite(found.orientation).all()


def test_a_cell_wider_than_the_panorama_is_refused():
    with pytest.raises(ConfigError, match=r"hog\.orientation_width"):
        Hog(HogSettings(orientation_width=600)).describe(np.zeros((128, 512), np.uint8))


def test_a_size_that_does_not_divide_is_refused():
    with pytest.raises(ConfigError, match=r"imaging\.rows"):
        Hog().describe(np.zeros((100, 512), np.uint8))
