"""At which known place the robot is, if at any: the forward algorithm of a hidden Markov model over keyframes.

The robot stays at a keyframe or goes to one that is joined to it, seldom leaves what is known, and seldom comes back
to it. So successive images have to agree on where they are before any is recognised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_STAY = 0.5
"""Chance of staying at a keyframe; the other half goes to those joined to it, to each the same."""


@dataclass(frozen=True)
class Belief:
    """Probabilities of being at each keyframe and of being nowhere known; together 1.

    Attributes
    ----------
    places
        Of each keyframe, shape (keyframes at the time,).
    elsewhere
        Of a place that no keyframe shows.
    """

    places: NDArray[np.float64]
    elsewhere: float = 1.0

    def moved(
        self,
        edges: tuple[NDArray[np.int64], NDArray[np.int64]],
        likelihood: NDArray[np.float64],
        *,
        leave: float,
        enter: float,
    ) -> Belief:
        """Return the belief after the next image.

        Parameters
        ----------
        edges
            Both ends of every edge of the keyframes' graph, in both directions.
        likelihood
            How much better each keyframe explains the image than an unknown place does, shape (keyframes,); 0 where a
            loop cannot be closed.
        leave, enter
            Chance of leaving known places, and of coming to one.
        """
        count = len(likelihood)
        before = np.zeros(count)
        before[: len(self.places)] = self.places
        sources, targets = edges
        degrees = np.bincount(sources, minlength=count)
        share = (1.0 - _STAY) / np.maximum(degrees, 1)
        moved = _STAY * before + np.bincount(targets, (share * before)[sources], count)
        possible = int(np.count_nonzero(likelihood))
        places = (moved * (1.0 - leave) + self.elsewhere * enter / max(possible, 1)) * likelihood
        elsewhere = before.sum() * leave + self.elsewhere * (1.0 - enter)
        total = places.sum() + elsewhere
        return Belief(places / total, float(elsewhere / total))
