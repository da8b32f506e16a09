"""What is known of distances from single precision, against the distances."""

import numpy as np
import pytest

from omnieval.descriptors import screened_store
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.descriptors.screened_store import ScreenedStore


def descriptions(count, cells=32, bins=4, scale=1.0, seed=0):
    """Some images, the last of which repeats the first, rolled, and the one before that nearly does."""
    rng = np.random.default_rng(seed)
    images = [
        Description(scale * rng.random(6, np.float32), scale * rng.random((cells, bins), np.float32))
        for _ in range(count - 2)
    ]
    first = images[0]
    near = np.float32(1.0 + 1e-6) * first.orientation
    return [
        *images,
        Description(first.position, near),
        Description(first.position, np.roll(first.orientation, cells // 3, 0)),
    ]


def both(images):
    exact, screened = DescriptionStore(), ScreenedStore()
    for image in images:
        exact.append(image)
        screened.append(image)
    return exact, screened


@pytest.mark.parametrize(
    ("cells", "bins"), [(256, 16), (32, 4), (33, 3), (31, 2), (49, 5), (8, 1), (3, 2), (2, 2), (1, 4)]
)
@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e4])
def test_distances_are_within_their_bounds_which_are_close(cells, bins, scale):
    images = descriptions(40, cells, bins, scale)
    exact, screened = both(images)
    others = np.arange(39)
    found, glance = exact.compare(39, others), screened.glance(39, others)
    bounds = screened.bounds(39, others)
    assert (glance.position_low <= found.position).all()
    assert (glance.orientation_low <= bounds.orientation_low).all()
    assert (bounds.orientation_high <= glance.orientation_high).all()
    narrow = screened.narrow(39, others)
    assert (narrow.orientation_low <= found.orientation).all()
    assert (found.orientation <= narrow.orientation_high).all()
    for distances, low, high in (
        (found.position, bounds.position_low, bounds.position_high),
        (found.orientation, bounds.orientation_low, bounds.orientation_high),
    ):
        assert (low <= distances).all()
        assert (distances <= high).all()
        far = distances > 0.1 * np.median(distances)
        assert (high[far] - low[far] <= 2e-3 * distances[far]).all()


@pytest.mark.parametrize("scale", [1e-30, 1e-16, 1e15, 1e18])
def test_what_single_precision_cannot_hold_is_not_known(scale):
    exact, screened = both(descriptions(10, scale=np.float32(scale)))
    found, bounds = exact.compare(9, np.arange(9)), screened.bounds(9, np.arange(9))
    assert (bounds.orientation_low <= found.orientation).all()
    assert (found.orientation <= bounds.orientation_high).all()


def test_the_bounds_hold_where_rounding_is_worst():
    """All of a correlation is in one frequency, so that every stage of the transform rounds large numbers."""
    cells = 256
    wave = np.cos(2 * np.pi * np.arange(cells) * 100 / cells)[:, np.newaxis].astype(np.float32)
    images = [Description(np.ones(2, np.float32), np.roll(wave, shift, axis=0) * (1 + shift)) for shift in range(20)]
    exact, screened = both(images)
    found, bounds = exact.compare(19, np.arange(19)), screened.bounds(19, np.arange(19))
    assert (bounds.orientation_low <= found.orientation).all()
    assert (found.orientation <= bounds.orientation_high).all()


@pytest.mark.parametrize("ahead", [0, 25])
@pytest.mark.parametrize("threads", [1, 2])
def test_what_it_says_exactly_has_the_same_bits(ahead, threads, monkeypatch):
    monkeypatch.setattr(screened_store, "WORTH_A_THREAD", 1)
    images = descriptions(100)
    exact, screened = DescriptionStore(), ScreenedStore(threads)
    for number, image in enumerate(images):
        if ahead and number % ahead == 0:
            screened.expect(images[number : number + ahead])
            for later in range(number + 1, min(number + ahead, len(images)), 3):
                screened.foresee(later, np.arange(0, number, 2))
        assert screened.append(image) == exact.append(image) == number
        others = np.arange(number % 3, number, 2)
        if not len(others):
            continue
        one, other = exact.compare(number, others), screened.compare(number, others)
        for part in ("position", "orientation", "shifts"):
            assert getattr(one, part).tolist() == getattr(other, part).tolist()
        assert screened.position_distances(number, others).tolist() == one.position.tolist()
        bounds = screened.bounds(number, others)
        assert (bounds.orientation_low <= one.orientation).all()
        assert (one.orientation <= bounds.orientation_high).all()


def test_images_that_were_expected_but_did_not_come_are_forgotten():
    images, others = descriptions(60), descriptions(60, seed=1)
    exact, screened = DescriptionStore(), ScreenedStore()
    screened.expect(images[:40])
    for image in (*images[:5], *others[:20]):
        exact.append(image)
        screened.append(image)
    one, other = exact.compare(24, np.arange(24)), screened.compare(24, np.arange(24))
    assert other.orientation.tolist() == one.orientation.tolist()
    assert (screened.bounds(24, np.arange(24)).orientation_low <= one.orientation).all()


def test_images_asked_about_out_of_turn_are_screened_with_those_that_were_anticipated():
    images = descriptions(70)
    exact, screened = both(images)
    screened.anticipate([3, 40, 66])
    for query in (3, 66, 40, 12):
        distances, bounds = exact.compare(query, np.arange(70)), screened.bounds(query, np.arange(70))
        assert (bounds.orientation_low <= distances.orientation).all()
        assert (distances.orientation <= bounds.orientation_high).all()


def test_the_callers_array_may_be_used_again():
    images = descriptions(12)
    buffer = np.empty_like(images[0].orientation)
    exact, screened = DescriptionStore(), ScreenedStore()
    for image in images:
        buffer[:] = image.orientation
        exact.append(image)
        screened.append(Description(image.position, buffer))
    assert (
        screened.compare(11, np.arange(11)).orientation.tolist()
        == exact.compare(11, np.arange(11)).orientation.tolist()
    )
