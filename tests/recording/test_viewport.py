"""The map view shows the whole building, a legend below it, and how long a metre is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.recording.viewport import around, extent_of, map_window, origin_of

SIZES = st.floats(0.0, 500.0)


@given(SIZES, SIZES)
def test_the_scale_is_a_round_number_of_metres_that_fits_beside_the_legend(width, height):
    window = map_window((-3.0, 4.0, -3.0 + width, 4.0 + height))
    length, ends = window.scale()
    assert f"{length:.0e}"[0] in "125"
    assert ends[1, 0] - ends[0, 0] == pytest.approx(length)
    assert ends[0, 1] == ends[1, 1] == window.legend(4)[0, 1]
    assert window.x_min < ends[0, 0] < ends[1, 0] < window.legend(4)[0, 0]
    assert length > 0.05 * window.width


@given(SIZES, SIZES)
def test_building_and_legend_are_inside_the_window_and_apart(width, height):
    window = map_window((0.0, 0.0, width, height))
    legend = window.legend(4)
    assert window.x_min < 0.0
    assert width < window.x_max
    assert window.y_min < legend[:, 1].max() < 0.0
    assert height < window.y_max
    assert window.x_min < legend[:, 0].min() < legend[:, 0].max() < window.x_max


@pytest.mark.parametrize("far", [(0.0, 0.0), (465_123.4, 5_249_321.0), (-9_000.0, 20.0)])
def test_what_is_drawn_keeps_its_millimetres_wherever_the_building_stands(far):
    places = np.array([[0.0, 0.0], [0.001, 40.003], [25.0, -3.0]]) + far
    origin = origin_of(extent_of(places))
    drawn = (places - origin).astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(np.diff(drawn, axis=0), np.diff(places, axis=0), atol=1e-3)
    assert max(far) > 10_000 or origin == (0.0, 0.0)
    assert around(extent_of(places), origin) == extent_of(places - origin)
    assert around(None, origin) is None


def test_the_extent_is_that_of_all_positions_or_unknown():
    assert extent_of(np.array([[1.0, 5.0], [-2.0, 6.0]])) == (-2.0, 5.0, 1.0, 6.0)
    assert extent_of(np.array([[1.0, 5.0], [np.nan, 3.0], [-2.0, 6.0]])) == (-2.0, 5.0, 1.0, 6.0)
    assert extent_of(np.array([[1.0, np.nan]])) is None
    assert extent_of(np.zeros((0, 2))) is None
