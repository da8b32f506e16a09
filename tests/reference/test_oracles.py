"""The oracles themselves, against SciPy, scikit-learn and what can be counted by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import find_peaks as scipy_find_peaks
from scipy.signal import peak_prominences
from sklearn.metrics import silhouette_score

from tests.reference.curve import Image, find_peaks, orientation_distance, prominence
from tests.reference.hog import hog
from tests.reference.silhouette import silhouettes


@pytest.mark.parametrize("seed", range(20))
def test_peaks_and_prominences_are_those_of_scipy(seed: int) -> None:
    # Few levels, so that there are plateaus and peaks of equal height.
    curve = np.random.default_rng(seed).integers(0, 5, size=60).astype(float)
    expected, _ = scipy_find_peaks(curve)
    peaks = find_peaks(curve.tolist())
    assert peaks == expected.tolist()
    heights, _, _ = peak_prominences(curve, expected)
    assert [prominence(curve.tolist(), peak) for peak in peaks] == heights.tolist()


def test_the_shift_is_the_number_of_cells_the_image_is_rolled() -> None:
    cells = np.random.default_rng(0).normal(size=(9, 2))
    query = Image.of(np.zeros(1), np.roll(cells, 4, axis=0))
    assert orientation_distance(query, Image.of(np.zeros(1), cells)) == (0.0, 4)


def test_silhouette_over_images_is_that_of_scikit_learn() -> None:
    rng = np.random.default_rng(0)
    positions, labels = rng.normal(size=(60, 2)), rng.integers(1, 6, size=60)
    labels[:2] = (6, 7)  # two singletons
    found = silhouettes(positions.tolist(), labels.tolist())
    assert found["silhouette_image"] == pytest.approx(silhouette_score(positions, labels))


def test_the_four_silhouettes_of_five_images_on_a_line() -> None:
    # Clusters {0, 2}, {4}, {10}; an unassigned image at 5.
    # Rousseeuw: (4 - 2)/4 = 0.5 and (2 - 2)/2 = 0; the singletons score 0.
    # All others together: b = 7 and 5: 5/7 and 3/5. Squared: a = 4, b = 16 and 4: 12/16 and 0.
    found = silhouettes([(0, 0), (2, 0), (4, 0), (10, 0), (5, 0)], [1, 1, 2, 3, 0])
    assert found == pytest.approx(
        {
            "silhouette": (0.5 / 2) / 3,
            "silhouette_image": 0.5 / 4,
            "silhouette_literal": (5 / 7 + 3 / 5) / 2 / 3,
            "silhouette_sq": (0.75 / 2) / 3,
        }
    )


def test_one_cluster_has_no_silhouette() -> None:
    assert all(math.isnan(value) for value in silhouettes([(0, 0), (1, 0)], [1, 1]).values())


def test_hog_of_a_single_edge() -> None:
    # 4 x 8 pixels, bright from column 4 on: D_x = 100 at columns 3 and 4 (to the right: bin 0), and, as the
    # columns wrap around, D_x = -100 at columns 7 and 0 (half a turn: bin 2 of 4).
    panorama = np.zeros((4, 8), np.uint8)
    panorama[:, 4:] = 100
    options = {"bins": 4, "position_cells": 2, "orientation_step": 2, "orientation_width": 2}
    position, orientation = hog(panorama, norm="none", **options)  # type: ignore[arg-type]
    assert position.tolist() == [[400, 0, 400, 0]] * 2
    assert orientation.tolist() == [[0, 0, 400, 0], [400, 0, 0, 0], [400, 0, 0, 0], [0, 0, 400, 0]]
    unsigned, _ = hog(panorama, norm="none", signed=False, **options)  # type: ignore[arg-type]
    assert unsigned.tolist() == [[800, 0, 0, 0]] * 2
    # Centres of bins are at 45, 135 ... degrees: 0 lies half way between the last and the first.
    linear, _ = hog(panorama, norm="none", interpolate=True, **options)  # type: ignore[arg-type]
    assert linear.tolist() == [[200, 200, 200, 200]] * 2
    sobel, _ = hog(panorama, norm="none", kernel="sobel", **options)  # type: ignore[arg-type]
    assert sobel.tolist() == [[1600, 0, 1600, 0]] * 2
