"""Datasets: from a source on disk to a `Sequence` of frames, of which only names are known until one is read.

`load` reads any source; `omnieval.datasets.check.check` says what is wrong with one;
`omnieval.datasets.cards` knows where to get data. A new dataset is one reader and one line in `registry`.
"""

from omnieval.datasets.registry import load
from omnieval.datasets.sequence import Camera, Frame, Mirror, Pose, Sequence

__all__ = ["Camera", "Frame", "Mirror", "Pose", "Sequence", "load"]
