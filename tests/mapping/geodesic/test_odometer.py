"""Distances as frames of travel, on paper."""

from __future__ import annotations

import numpy as np
import pytest

from omnieval.mapping.geodesic.odometer import LAGS, Odometer, RunningMedian


class TestRunningMedian:
    def test_of_odd_and_even_counts(self) -> None:
        median = RunningMedian()
        seen = []
        for number in (3.0, 1.0, 2.0, 10.0):
            median.add(number)
            seen.append(median.value)
        assert seen == [3.0, 2.0, 2.0, 2.5]

    def test_a_copy_goes_on_by_itself(self) -> None:
        median = RunningMedian()
        median.add(1.0)
        other = median.copied()
        other.add(9.0)
        assert (median.value, other.value) == (1.0, 5.0)


class TestOdometer:
    def steady(self, count: int = 40) -> Odometer:
        """Return one that has seen images whose distance is a tenth of the frames between them."""
        odometer = Odometer()
        for frame in range(1, count):
            odometer.add(np.array([0.1 * lag for lag in LAGS if lag <= frame]))
        return odometer

    def test_a_distance_is_the_frames_that_usually_make_it(self) -> None:
        odometer = self.steady()
        assert [odometer.frames(0.1 * frames) for frames in (1, 4, 20.5)] == pytest.approx([1, 4, 20.5])

    def test_no_more_than_the_largest_lag_and_never_nothing(self) -> None:
        assert self.steady().frames(100.0) == 34.0
        assert self.steady(count=4).frames(100.0) == 3.0
        assert self.steady().frames(0.0) == self.steady().frames(1e-9) == 0.05

    def test_a_pause_is_next_to_nothing_and_a_leap_no_more_than_two_frames_halved_on_a_logarithmic_scale(self) -> None:
        odometer = self.steady()
        steps = [odometer.add(np.full(8, distance)) for distance in (0.0, 0.05, 0.0501, 0.144, 3.0)]
        assert steps == pytest.approx([0.05, 0.05, np.sqrt(0.501), 1.2, np.sqrt(2)])
        assert odometer.travelled == pytest.approx(39.0 + sum(steps))

    def test_what_seems_nearer_from_farther_away_says_nothing(self) -> None:
        odometer = Odometer()
        odometer.add(np.array([0.5]))
        odometer.add(np.array([0.5, 0.2]))
        odometer.add(np.array([0.5, 0.2, 0.8]))
        assert odometer.frames(0.65) == pytest.approx(2.5)

    def test_images_that_are_all_the_same(self) -> None:
        odometer = Odometer()
        for frame in range(1, 60):
            odometer.add(np.zeros(sum(lag <= frame for lag in LAGS)))
        assert odometer.travelled == pytest.approx(59 * 0.05)
        assert odometer.frames(1.0) == 34.0
