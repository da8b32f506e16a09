"""Descriptors of panoramas of which a part is masked."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from omnieval.descriptors.description import LEAST_SEEN, MaskedDescriptor, with_neutral_cells
from omnieval.descriptors.distance import DescriptionStore
from omnieval.descriptors.gist import Gist, GistSettings
from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.imaging.mask import PanoramaMask

ROWS, COLUMNS, CELLS = 32, 128, 64
DESCRIPTORS = {
    "hog": Hog(HogSettings(position_cells=8, orientation_cells=CELLS, orientation_width=4)),
    "hog-global": Hog(
        HogSettings(position_cells=8, orientation_cells=CELLS, orientation_width=4, normalisation="global-l2")
    ),
    "gist": Gist(GistSettings(position_cells=8, orientation_cells=CELLS, orientation_width=4, orientations=8)),
}
POST = np.ones((ROWS, COLUMNS), np.bool_)
POST[:, 40:64] = False
POST[28:] = False


def a_panorama(seed=0):
    noise = np.random.default_rng(seed).normal(size=(ROWS, COLUMNS))
    return np.clip(128 + 300 * gaussian_filter(noise, 2, mode=("nearest", "wrap")), 0, 255).astype(np.uint8)


def masked(descriptor, panorama, seen=POST):
    return descriptor.describe_masked(PanoramaMask(seen).filled(panorama), seen)


@pytest.fixture(params=DESCRIPTORS)
def descriptor(request):
    return DESCRIPTORS[request.param]


def test_a_mask_that_hides_nothing_changes_nothing(descriptor):
    panorama, everything = a_panorama(), np.ones((ROWS, COLUMNS), np.bool_)
    plain, seen = descriptor.describe(panorama), descriptor.describe_masked(panorama, everything)
    assert isinstance(descriptor, MaskedDescriptor)
    assert np.allclose(plain.position, seen.position, rtol=1e-6)
    assert np.allclose(plain.orientation, seen.orientation, rtol=1e-6)


def test_what_is_masked_does_not_matter(descriptor):
    scene = a_panorama()
    black, bright = (np.where(POST, scene, value).astype(np.uint8) for value in (0, 255))
    one, other = masked(descriptor, black), masked(descriptor, bright)
    assert np.array_equal(one.position, other.position)
    assert np.array_equal(one.orientation, other.orientation)
    unmasked = descriptor.describe(black), descriptor.describe(bright)
    assert not np.allclose(unmasked[0].position, unmasked[1].position)


def test_masked_cells_are_the_mean_of_the_seen_ones_and_masked_bands_are_zero(descriptor):
    found = masked(descriptor, a_panorama())
    cell_columns = COLUMNS // CELLS
    hidden = [cell for cell in range(CELLS) if np.roll(POST, -cell * cell_columns, axis=1)[:, :4].mean() < LEAST_SEEN]
    assert len(hidden) > 8
    rest = np.delete(found.orientation, hidden, axis=0).mean(axis=0)
    assert np.allclose(found.orientation[hidden], rest, atol=1e-5 * rest.max())
    bands = found.position.reshape(-1, 8, found.position.size // 8 // (2 if isinstance(descriptor, Gist) else 1))
    assert (bands[:, 7] == 0).all()
    assert (bands[:, :7].max(axis=2) > 0).all()


@pytest.mark.parametrize("turn", [0, 3, 10, 20, 31, 50, 63])
def test_a_turned_scene_is_found_turned_although_the_mask_is_not(descriptor, turn):
    """The post covers a fifth of the view: zeros there would draw the best roll to nought."""
    scene = a_panorama(seed=1)
    turned = np.roll(scene, turn * COLUMNS // CELLS, axis=1)
    store = DescriptionStore()
    for panorama in (scene, turned):
        store.append(masked(descriptor, panorama))
    found = store.compare(1, np.array([0]))
    assert found.shifts[0] == turn


def test_neutral_cells_add_the_same_to_the_distance_at_every_roll():
    rng = np.random.default_rng(0)
    share = np.ones(16)
    share[3:6] = 0
    one, other = (with_neutral_cells(rng.random((16, 4)), share) for _ in range(2))
    for roll in range(16):
        beside = np.roll(other, roll, axis=0)
        products = ((one - one.mean(axis=0)) * (beside - other.mean(axis=0))).sum(axis=1)
        assert np.allclose(products[share == 0], 0)
        constant = np.square(one - one.mean(axis=0)).sum() + np.square(other - other.mean(axis=0)).sum()
        constant += 16 * np.square(one.mean(axis=0) - other.mean(axis=0)).sum()
        assert np.square(one - beside).sum() == pytest.approx(constant - 2 * products.sum())
