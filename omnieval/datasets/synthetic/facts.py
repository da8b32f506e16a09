"""What is known of the synthetic building without rendering it."""

from __future__ import annotations

from typing import Final

from omnieval.datasets.sequence import Mirror

LIGHTS: Final[tuple[str, ...]] = ("cloudy", "night", "sunny")
"""The days the building can be seen in; the first is the default."""

MIRROR: Final = Mirror(322.0, 239.0, 46.0, 228.0)
"""Where the mirror lies in the images, which are 640 pixels wide and 480 high."""

RENDERER_VERSION: Final = 1
"""Raised with every change of pixels or poses, so that old cached images are never taken for new ones."""
