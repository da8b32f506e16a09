"""Ng-Jordan-Weiss: against a dense reference and scikit-learn, and one decomposition for every number of clusters."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from sklearn.cluster import SpectralClustering
from sklearn.metrics import adjusted_rand_score

from omnieval.baselines.similarity import SIMILARITIES, similarity_matrix, sparse_neighbour_graph
from omnieval.baselines.spectral import sparse_spectral_embedding, spectral_embedding


def groups(count=4, each=15, spread=0.3, seed=0):
    """Separated groups of descriptors, in no order, and which group each is of."""
    rng = np.random.default_rng(seed)
    truth = rng.permutation(np.repeat(np.arange(count), each))
    centers = 4 * rng.normal(size=(count, 8))
    return (centers[truth] + spread * rng.normal(size=(len(truth), 8))).astype(np.float32), truth


def reference_rows(similarities, clusters):
    """Steps 2 to 4 of Ng, Jordan and Weiss, line by line, through the Laplacian I - D^-1/2 A D^-1/2."""
    root = np.diag(1 / np.sqrt(similarities.sum(axis=1)))
    laplacian = np.eye(len(similarities)) - root @ similarities @ root
    values, vectors = np.linalg.eigh(laplacian)
    main = vectors[:, np.argsort(values)[:clusters]]
    return main / np.linalg.norm(main, axis=1)[:, None]


def test_gaussian_similarity_by_hand():
    points = np.array([[0.0], [1.0], [4.0]])  # distances 1, 3, 4: the median is 3
    expected = np.exp(-np.array([[np.inf, 1, 16], [1, np.inf, 9], [16, 9, np.inf]]) / 18)
    assert similarity_matrix(points, "gaussian-median") == pytest.approx(expected)


def test_local_scaling_by_hand():
    points = np.arange(9.0)[:, None] ** 2
    scales = np.sort(cdist(points, points), axis=1)[:, 7]
    assert scales[0] == 49.0
    similarities = similarity_matrix(points, "local-scaling")
    assert similarities[0, 3] == pytest.approx(np.exp(-(9.0**2) / (scales[0] * scales[3])))


def test_neighbour_graph_by_hand():
    points = np.concatenate([np.arange(11.0), [1000.0]])[:, None]
    graph = similarity_matrix(points, "knn")
    assert graph[0, 10] == 1.0  # eleven on a line are all neighbours of each other
    assert graph[11, 10] == 0.5  # the far one has neighbours and is nobody's
    assert graph[11, 0] == 0.0


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_similarities_are_symmetric_finite_and_zero_on_the_diagonal(similarity):
    points = np.repeat(np.random.default_rng(0).normal(size=(6, 3)), 5, axis=0)  # with equal images
    similarities = similarity_matrix(points, similarity)
    assert np.array_equal(similarities, similarities.T)
    assert np.isfinite(similarities).all()
    assert similarities.min() == 0.0
    assert similarities.max() <= 1.0
    assert not similarities.diagonal().any()


@pytest.mark.parametrize("similarity", SIMILARITIES)
def test_equal_images_have_a_similarity_too(similarity):
    assert np.isfinite(similarity_matrix(np.zeros((12, 3)), similarity)).all()


@pytest.mark.parametrize("similarity", ["gaussian-median", "local-scaling"])
@pytest.mark.parametrize("clusters", [2, 4, 7])
def test_the_embedding_is_that_of_the_dense_reference(similarity, clusters):
    points, _ = groups(spread=1.5)  # not so far apart that the main eigenvalues are all 1 and their vectors arbitrary
    similarities = similarity_matrix(points, similarity)
    rows = spectral_embedding(similarities, 7).rows(clusters)
    expected = reference_rows(similarities, clusters)
    # Eigenvectors are unique up to sign, their rows' angles are unique.
    assert rows @ rows.T == pytest.approx(expected @ expected.T, abs=1e-4)
    assert np.linalg.norm(rows, axis=1) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("similarity", SIMILARITIES)
@pytest.mark.parametrize("seed", range(3))
def test_separated_groups_are_found_as_by_scikit_learn(similarity, seed):
    points, truth = groups(seed=seed)
    similarities = similarity_matrix(points, similarity)
    labels = spectral_embedding(similarities, 10).cluster(4, seed=seed)
    theirs = SpectralClustering(4, affinity="precomputed", random_state=0).fit_predict(similarities + 1e-6)
    assert adjusted_rand_score(truth, labels) == 1.0
    assert adjusted_rand_score(theirs, labels) == 1.0


def test_one_decomposition_serves_every_number_of_clusters():
    points, _ = groups(spread=1.5)
    similarities = similarity_matrix(points, "gaussian-median")
    whole = spectral_embedding(similarities, 12)
    for clusters in range(2, 13):
        alone = spectral_embedding(similarities, clusters).cluster(clusters, seed=5)
        assert np.array_equal(whole.cluster(clusters, seed=5), alone)


def test_eigenvalues_descend_from_one():
    points, _ = groups()
    values = spectral_embedding(similarity_matrix(points, "gaussian-median"), 9).values
    assert values[0] == pytest.approx(1.0)
    assert (np.diff(values) <= 0).all()


def test_an_image_that_is_like_no_other_is_no_obstacle():
    similarities = np.ones((5, 5)) - np.eye(5)
    similarities[4] = similarities[:, 4] = 0
    labels = spectral_embedding(similarities, 2).cluster(2, seed=0)
    assert len(set(labels[:4])) == 1
    assert labels.min() == 1


def test_more_clusters_than_eigenvectors_is_an_error_of_the_caller():
    with pytest.raises(ValueError, match="4 clusters need as many"):
        spectral_embedding(np.ones((5, 5)) - np.eye(5), 3).cluster(4, seed=0)


@pytest.mark.parametrize("count", [2, 8, 60, 150])
def test_the_sparse_graph_of_neighbours_is_the_dense_one(count, monkeypatch):
    """Among the images are near-duplicates, and equal ones, of which the earlier are the nearer."""
    monkeypatch.setattr("omnieval.baselines.similarity._ROWS", 50)
    rng = np.random.default_rng(count)
    points = 100 + rng.random((count, 6), np.float32)
    points[count // 2 :] = points[: count - count // 2] + rng.choice([0, 1e-5], (count - count // 2, 1))
    np.testing.assert_array_equal(sparse_neighbour_graph(points).toarray(), similarity_matrix(points, "knn"))


def test_the_sparse_embedding_is_the_dense_one():
    points, _ = groups(count=3, each=60, spread=1.5)
    dense = spectral_embedding(similarity_matrix(points, "knn"), 3)
    sparse = sparse_spectral_embedding(sparse_neighbour_graph(points), 3)
    np.testing.assert_allclose(sparse.values, dense.values, atol=1e-10)
    # The same space, whatever the basis where eigenvalues are equal.
    np.testing.assert_allclose(sparse.vectors @ sparse.vectors.T, dense.vectors @ dense.vectors.T, atol=1e-5)
    assert adjusted_rand_score(dense.cluster(3, seed=0), sparse.cluster(3, seed=0)) == 1.0
