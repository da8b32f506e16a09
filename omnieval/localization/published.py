"""What others published for COLD-Freiburg, part A: their numbers, on the real images; none of it was run here.

The map is seq2_cloudy3, the queries seq2_cloudy2, seq2_night2 and seq2_sunny2. Sources: the READMEs of
IndoorLocalizationSingleCNN and IndoorLocalizationSNN of the UMH group. Cloudy values below 0.17 m look like another
split: a map of 588 images is 0.17 m apart.
"""

from __future__ import annotations

from typing import NamedTuple


class Published(NamedTuple):
    """A method's mean errors by the light of the query, metres."""

    method: str
    cloudy: float
    night: float
    sunny: float


PUBLISHED = (
    Published("HOG", 0.163, 0.451, 0.820),
    Published("gist", 0.052, 1.065, 0.884),
    Published("AlexNet, 2022", 0.051, 0.288, 0.389),
    Published("triplet VGG16, 2024", 0.25, 0.28, 0.40),
    Published("ConvNeXt-L, 2024", 0.22, 0.26, 0.83),
    Published("ConvNeXt-L with augmentation, 2024", 0.22, 0.27, 0.57),
    Published("Siamese with augmentation, 2024", 0.033, 0.257, 0.991),
)
