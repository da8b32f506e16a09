"""Images as a camera would have given them that has noise, or another gain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Disturbance
from omnieval.seeding import named_generator


def disturbed(image: NDArray[np.uint8], disturbance: Disturbance | None, digest: str) -> NDArray[np.uint8]:
    """Return an image with gain and noise, rounded and clipped to grey levels.

    Parameters
    ----------
    image
        Any shape.
    disturbance
        What to change; None for nothing.
    digest
        Of the bytes of its file, hexadecimal: every image has noise of its own, the same each time.
    """
    if disturbance is None or disturbance.of_pixels is None:
        return image
    changed = image * np.float32(disturbance.gain)
    if disturbance.noise:
        rng = named_generator(disturbance.seed, "noise of the camera", int(digest[:8], 16))
        changed += np.float32(disturbance.noise) * rng.standard_normal(image.shape, np.float32)
    found: NDArray[np.uint8] = np.clip(np.rint(changed), 0, 255).astype(np.uint8)
    return found
