"""Pixels of ``sensor_msgs/Image``: what its encodings mean, as its header ``image_encodings.h`` names them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError
from omnieval.wording import shown

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True)
class Raw:
    """An image as it lies in memory: `step` bytes a row, of which the first ones hold pixels."""

    encoding: str
    width: int
    height: int
    step: int
    big_endian: bool
    data: bytes


_GENERIC = re.compile(r"(8|16)UC([134]?)")
_GREY, _COLOUR = "", "bgr"
_NAMED = {
    "mono8": (8, 1, _GREY),
    "mono16": (16, 1, _GREY),
    "bgr8": (8, 3, "bgr"),
    "rgb8": (8, 3, "rgb"),
    "bgra8": (8, 4, "bgra"),
    "rgba8": (8, 4, "rgba"),
    "bgr16": (16, 3, "bgr"),
    "rgb16": (16, 3, "rgb"),
    "bgra16": (16, 4, "bgra"),
    "rgba16": (16, 4, "rgba"),
    **{f"bayer_{cells}{bits}": (bits, 1, cells) for cells in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)},
    **dict.fromkeys(("yuv422", "uyvy"), (8, 2, "uyvy")),
    **dict.fromkeys(("yuv422_yuy2", "yuyv"), (8, 2, "yuyv")),
}
"""Bits of a value, values of a pixel, and what they are."""
_OF_CHANNELS = {1: _GREY, 3: "bgr", 4: "bgra"}
_TO_BGR = {
    "rgb": cv2.COLOR_RGB2BGR,
    "rgba": cv2.COLOR_RGBA2BGR,
    "bgra": cv2.COLOR_BGRA2BGR,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "yuyv": cv2.COLOR_YUV2BGR_YUY2,
    # OpenCV names a mosaic by the second row and column, ROS by the first.
    "rggb": cv2.COLOR_BayerBG2BGR,
    "bggr": cv2.COLOR_BayerRG2BGR,
    "gbrg": cv2.COLOR_BayerGR2BGR,
    "grbg": cv2.COLOR_BayerGB2BGR,
}


def pixels(raw: Raw) -> Pixels:
    """Return grey levels, shape (height, width), or BGR, shape (height, width, 3), of 8 or 16 bits.

    Raises
    ------
    DatasetError
        If the encoding is none of images, or there are fewer bytes than pixels need.
    """
    bits, channels, kind = _meaning(raw.encoding)
    depth = np.dtype(np.uint8) if bits == 8 else np.dtype(np.uint16).newbyteorder(">" if raw.big_endian else "<")
    used = raw.width * channels * depth.itemsize
    step = max(raw.step, used)
    if raw.width < 1 or raw.height < 1 or len(raw.data) < step * (raw.height - 1) + used:
        raise DatasetError(f"has {len(raw.data)} bytes, too few for {raw.width} x {raw.height} pixels {raw.encoding}")
    rows = np.lib.stride_tricks.as_strided(np.frombuffer(raw.data, np.uint8), (raw.height, used), (step, 1))
    values = np.ascontiguousarray(rows).view(depth).astype(depth.newbyteorder("="))
    image = cast("Pixels", values).reshape(
        (raw.height, raw.width) if channels == 1 else (raw.height, raw.width, channels)
    )
    return image if kind in {_GREY, _COLOUR} else cast("Pixels", cv2.cvtColor(image, _TO_BGR[kind]))


def _meaning(encoding: str) -> tuple[int, int, str]:
    name = encoding.strip("\0 ").casefold()
    if name in _NAMED:
        return _NAMED[name]
    if (found := _GENERIC.fullmatch(name.upper())) is not None:
        channels = int(found[2] or 1)
        return int(found[1]), channels, _OF_CHANNELS[channels]
    known = "mono8, mono16, bgr8, rgb8, bayer_*, yuv422 and the like"
    raise DatasetError(f"has encoding '{shown(encoding)}', which is not an image that is read here ({known})")
