"""Pictures as JPEG files, for people to look at."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def jpeg(picture: NDArray[np.uint8], quality: int = 90, *, width: int | None = None) -> bytes:
    """Return a picture as a JPEG file.

    Parameters
    ----------
    picture
        Shape (height, width, 3), BGR, or (height, width), grey.
    quality
        1 to 100.
    width
        At most so many pixels wide: a wider one is scaled down.
    """
    height, wide = picture.shape[:2]
    shown: NDArray[Any] = picture
    if width is not None and wide > width:
        size = (width, max(1, round(height * width / wide)))
        shown = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    done, encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"a picture of shape {picture.shape} cannot be a JPEG")
    return encoded.tobytes()
