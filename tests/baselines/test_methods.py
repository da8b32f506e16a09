"""Every baseline method: finds places that are there, says what it lacks, and draws the same twice."""

import sys
import types
from importlib.machinery import ModuleSpec

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score
from threadpoolctl import threadpool_limits

from omnieval.baselines.batch import WardTree, kmeans_clusters, numbered
from omnieval.baselines.methods import METHODS, Images
from omnieval.baselines.similarity import SIMILARITIES
from omnieval.baselines.stream import dbstream_clusters
from omnieval.errors import ConfigError, DatasetError

TRUTH = np.repeat([0, 1, 2, 1, 0], 12)
"""Three places, visited in turn."""


def three_places(spread=0.1):
    rng = np.random.default_rng(3)
    descriptors = 3 * np.eye(3, 6)[TRUTH] + spread * rng.normal(size=(len(TRUTH), 6))
    positions = 5 * np.eye(3, 2)[TRUTH] + 0.3 * rng.normal(size=(len(TRUTH), 2))
    rooms = tuple("ABC"[place] for place in TRUTH)
    return Images("three places", descriptors.astype(np.float32), positions, rooms)


def partition(name, images, k, *, seed=0, similarity="gaussian-median"):
    return METHODS[name].prepare(images, similarity, k, seed)(k)


@pytest.mark.parametrize("name", ["spectral", "kmeans", "agglomerative", "positions", "rooms"])
@pytest.mark.parametrize("seed", range(3))
def test_places_that_are_there_are_found(name, seed):
    labels = partition(name, three_places(), 3, seed=seed)
    assert adjusted_rand_score(TRUTH, labels) == 1.0
    assert set(labels) == {1, 2, 3}


def test_dbstream_finds_places_that_are_there():
    pytest.importorskip("river")
    labels = partition("dbstream", three_places(), 0)
    assert adjusted_rand_score(TRUTH, labels) > 0.9


def test_dbstream_is_told_its_radius_and_asked_at_the_end(monkeypatch):
    """With a stand-in for river: radius twice the median step, images in time order, labels from the final clusters."""
    seen = types.SimpleNamespace(options={}, learned=[])

    class Stream:
        def __init__(self, **options):
            seen.options = options

        def learn_one(self, row):
            seen.learned.append(row[0])

        def predict_one(self, row):
            assert len(seen.learned) == 4
            return 7 if row[0] < 5 else 3

    river, cluster = types.ModuleType("river"), types.ModuleType("river.cluster")
    river.__spec__ = ModuleSpec("river", None)
    monkeypatch.setattr(cluster, "DBSTREAM", Stream, raising=False)
    monkeypatch.setitem(sys.modules, "river", river)
    monkeypatch.setitem(sys.modules, "river.cluster", cluster)
    labels = dbstream_clusters(np.array([[0.0], [1.0], [9.0], [10.0]]))
    assert labels.tolist() == [1, 1, 2, 2]
    assert seen.learned == [0.0, 1.0, 9.0, 10.0]
    assert seen.options["clustering_threshold"] == 2.0


def test_without_river_dbstream_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr("omnieval.baselines.stream.find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install 'omnieval\[river\]'"):
        METHODS["dbstream"].check(three_places())


def test_methods_say_what_they_lack():
    bare = Images("bare", np.eye(4, dtype=np.float32), None, (None,) * 4)
    with pytest.raises(DatasetError, match="bare: the sequence has no poses"):
        METHODS["positions"].check(bare)
    with pytest.raises(DatasetError, match="bare has no room labels"):
        METHODS["rooms"].check(bare)


def test_images_without_a_position_are_in_no_cluster_of_positions():
    positions = np.array([[0.0, 0], [np.nan, np.nan], [5, 5], [0, 1]])
    images = Images("some", np.eye(4, dtype=np.float32), positions, (None,) * 4)
    assert partition("positions", images, 2).tolist() == [1, 0, 2, 1]


def test_images_without_a_label_are_in_no_room():
    images = Images("some", np.eye(4, dtype=np.float32), None, ("B", None, "A", "B"))
    assert partition("rooms", images, 0).tolist() == [1, 0, 2, 1]


@pytest.mark.parametrize("name", ["spectral", "kmeans", "agglomerative", "time-slices", "positions"])
@pytest.mark.parametrize("k", [1, 2, 9, 60])
def test_as_many_clusters_as_asked_for(name, k):
    assert set(partition(name, three_places(spread=1.0), k)) == set(range(1, k + 1))


@pytest.mark.parametrize("name", ["kmeans", "positions"])
def test_equal_images_leave_fewer_clusters_and_no_error(name):
    points = np.repeat(np.eye(3), 4, axis=0)
    images = Images("four times", points.astype(np.float32), points[:, :2], (None,) * 12)
    assert len(set(partition(name, images, 5))) == 3


@pytest.mark.parametrize("similarity", SIMILARITIES)
@pytest.mark.parametrize("name", ["spectral", "kmeans", "agglomerative", "positions"])
def test_labels_do_not_depend_on_the_number_of_threads(name, similarity):
    images = three_places(spread=1.0)
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            found.append(partition(name, images, 11, similarity=similarity))
    assert np.array_equal(*found)


def test_one_tree_is_cut_at_every_number_and_its_cuts_are_nested():
    tree = WardTree.grow(three_places(spread=1.0).descriptors)
    for k in range(1, 20):
        coarse, fine = tree.cut(k), tree.cut(k + 1)
        assert all(len(set(coarse[fine == label])) == 1 for label in set(fine))


def test_restarts_draw_the_same_twice_and_something_else_for_another_purpose():
    points = np.random.default_rng(0).normal(size=(200, 5))
    once = kmeans_clusters(points, 20, seed=1, restarts=1)
    assert np.array_equal(once, kmeans_clusters(points, 20, seed=1, restarts=1))
    assert not np.array_equal(once, kmeans_clusters(points, 20, seed=1, restarts=1, name="else"))


def test_clusters_are_numbered_in_the_order_of_first_appearance():
    assert numbered(np.array([7, 7, 2, 7, 4])).tolist() == [1, 1, 2, 1, 3]
