"""The shift-invariant distance against trying all shifts."""

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore


def brute_force(query, other):
    distances = [
        np.linalg.norm(query.astype(np.float64) - np.roll(other, shift, axis=0).astype(np.float64))
        for shift in range(len(query))
    ]
    return min(distances), int(np.argmin(distances))


def a_store(descriptors):
    store = DescriptionStore()
    for descriptor in descriptors:
        store.append(Description(descriptor[:, 0], descriptor))
    return store


def orientations(store, query, others):
    found = store.compare(query, np.array(others))
    return found.orientation, found.shifts


@pytest.mark.parametrize(("cells", "bins"), [(256, 16), (32, 4), (33, 3), (8, 1)])
def test_agrees_with_trying_all_shifts(cells, bins):
    descriptors = np.random.default_rng(cells).random((80, cells, bins), np.float32)
    store = a_store(descriptors)
    others = np.array([3, 0, 70, 41])
    distances, shifts = orientations(store, 79, others)
    expected = [brute_force(descriptors[79], descriptors[other]) for other in others]
    np.testing.assert_allclose(distances, [distance for distance, _ in expected], rtol=1e-12)
    assert shifts.tolist() == [shift for _, shift in expected]


def test_a_rotated_copy_is_at_distance_zero_and_its_shift_is_found():
    descriptor = np.random.default_rng(0).random((256, 16), np.float32)
    store = a_store([np.roll(descriptor, -37, axis=0), descriptor, descriptor])
    distances, shifts = orientations(store, 2, [0, 1])
    assert distances.tolist() == [0.0, 0.0]
    assert shifts.tolist() == [37, 0]


def test_of_equally_good_shifts_the_smallest_is_taken():
    store = a_store([np.full((256, 16), 0.25, np.float32)] * 2)
    distances, shifts = orientations(store, 1, [0])
    assert (distances[0], shifts[0]) == (0.0, 0)


def test_close_descriptors_keep_their_digits():
    descriptor = np.random.default_rng(1).random((256, 16)).astype(np.float32)
    near = descriptor.copy()
    near[5, 3] = np.nextafter(near[5, 3], np.float32(2))
    distances, _ = orientations(a_store([near, descriptor]), 1, [0])
    assert distances[0] == pytest.approx(abs(float(near[5, 3]) - float(descriptor[5, 3])), rel=1e-9)


def test_the_distance_is_symmetric_and_its_shifts_opposite():
    descriptors = np.random.default_rng(2).random((2, 64, 5), np.float32)
    store = a_store(descriptors)
    there, shift = orientations(store, 0, [1])
    back, opposite = orientations(store, 1, [0])
    assert there[0] == pytest.approx(back[0])
    assert (shift[0] + opposite[0]) % 64 == 0
