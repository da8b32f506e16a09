"""How much there is to judge: nodes, and images whose position or room is known."""

from __future__ import annotations

import numpy as np

from omnieval.metrics.metric import Judged
from omnieval.metrics.silhouette import posed


def nodes(judged: Judged) -> int:
    """Return the number of nodes that have an image."""
    return len(np.unique(judged.labels[judged.labels > 0]))


def posed_images(judged: Judged) -> int:
    """Return the number of images whose position is known."""
    return int(posed(judged.positions).sum())


def labelled_images(judged: Judged) -> int:
    """Return the number of images that have a room label."""
    return sum(room is not None for room in judged.rooms)
