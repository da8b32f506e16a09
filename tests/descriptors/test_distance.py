"""The shift-invariant distance against trying all shifts."""

import numpy as np
import pytest

from omnieval.descriptors import distance
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore, Selection


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


@pytest.mark.parametrize(("cells", "bins"), [(256, 16), (32, 4), (33, 3), (8, 1), (3, 2), (2, 2), (1, 4)])
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


def descriptions(count, seed=5):
    rng = np.random.default_rng(seed)
    return [Description(rng.random(6, np.float32), rng.random((32, 4), np.float32)) for _ in range(count)]


def all_numbers(store, count):
    """Everything a store says of its first images, to the bit."""
    found = [store.compare(query, np.arange(count)) for query in range(count)]
    return [[one.position.tolist(), one.orientation.tolist(), one.shifts.tolist()] for one in found]


@pytest.mark.parametrize("threads", [1, 2])
def test_what_is_expected_or_anticipated_has_the_same_bits(threads, monkeypatch):
    monkeypatch.setattr(distance, "WORTH_A_THREAD", 1)  # seven tiles would otherwise all be one thread's
    images = descriptions(200)
    plain, hinted = DescriptionStore(), DescriptionStore(threads)
    for start in range(0, 200, 25):
        hinted.expect(images[start : start + 25])
        for image in images[start : start + 25]:
            query = plain.append(image)
            assert hinted.append(image) == query
            others = np.arange(0, query, 2)
            one, other = plain.compare(query, others), hinted.compare(query, others)
            assert one.position.tolist() == other.position.tolist()
            assert one.orientation.tolist() == other.orientation.tolist()
            assert one.shifts.tolist() == other.shifts.tolist()
    expected = all_numbers(plain, 200)
    hinted.anticipate(range(150, 182))
    assert all_numbers(hinted, 200) == expected


def test_an_image_that_was_not_the_expected_one_is_compared_itself():
    first, second = descriptions(70), descriptions(70, seed=6)
    plain, misled = DescriptionStore(), DescriptionStore()
    for image in first:
        plain.append(image)
        misled.append(image)
    misled.compare(69, np.arange(69))
    misled.expect(second[:3])
    for image in (second[0], second[2], second[1]):
        plain.append(image)
        misled.append(image)
    assert all_numbers(misled, 73)[69:] == all_numbers(plain, 73)[69:]


def test_an_image_is_compared_with_those_that_came_after_it():
    images = descriptions(66)
    store = DescriptionStore()
    for image in images[:65]:
        store.append(image)
    before = store.compare(3, np.array([1, 64]))
    store.append(images[65])
    after = store.compare(3, np.array([1, 64, 65]))
    assert after.orientation[:2].tolist() == before.orientation.tolist()
    assert after.orientation[2] == pytest.approx(brute_force(images[3].orientation, images[65].orientation)[0])
    assert after.position[2] == pytest.approx(np.linalg.norm(images[3].position - images[65].position))


@pytest.mark.parametrize("apart", [1.0, 1e-3, 1e-6, 0.0])
def test_position_distances_keep_their_digits(apart):
    rng = np.random.default_rng(3)
    first = rng.random(256).astype(np.float32)
    second = (first + apart * rng.random(256)).astype(np.float32)
    orientation = rng.random((8, 2), np.float32)
    store = DescriptionStore()
    for position in (first, second):
        store.append(Description(position, orientation))
    expected = np.linalg.norm(first.astype(np.float64) - second)
    assert store.compare(1, np.array([0])).position[0] == pytest.approx(expected, rel=1e-10)


def test_images_that_were_expected_but_did_not_come_are_forgotten():
    images = descriptions(60)
    plain, misled = DescriptionStore(), DescriptionStore()
    misled.expect(images[:40])
    for image in images[:5]:
        plain.append(image)
        misled.append(image)
    misled.compare(4, np.arange(4))
    misled.expect(images[50:55])
    for image in images[20:60]:
        plain.append(image)
        misled.append(image)
    assert all_numbers(misled, 45) == all_numbers(plain, 45)


def same(one, other):
    for field in ("position", "orientation", "shifts"):
        np.testing.assert_allclose(getattr(one, field), getattr(other, field), rtol=1e-12)


@pytest.mark.parametrize("ahead", [0, 5])
def test_a_selection_is_compared_as_if_it_had_been_asked_for_by_numbers(ahead):
    """Some are selected between two questions, and descriptions that were expected turn out to be others."""
    rng = np.random.default_rng(4)
    seen = [Description(d[:, 0].copy(), d) for d in rng.random((90, 16, 3), np.float32)]
    store, selection = DescriptionStore(), Selection()
    chosen: list[int] = []
    for number, description in enumerate(seen):
        if ahead and number % ahead == 0:
            store.expect(seen[number : number + 3] + seen[:2])
        store.append(description)
        if chosen:
            same(store.compare_selected(number, selection), store.compare(number, np.array(chosen)))
        if number % 2 == 0:
            store.select(number, selection)
            chosen.append(number)
            same(store.compare_selected(number, selection), store.compare(number, np.array(chosen)))


def test_a_copied_selection_goes_on_by_itself():
    store = a_store(np.random.default_rng(5).random((40, 8, 2), np.float32))
    one, numbers = Selection(), list(range(33))
    for number in numbers:
        store.select(number, one)
    other = one.copied()
    store.select(35, one)
    store.select(36, other)
    same(store.compare_selected(39, one), store.compare(39, np.array([*numbers, 35])))
    same(store.compare_selected(39, other), store.compare(39, np.array([*numbers, 36])))
