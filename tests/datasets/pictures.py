"""Image files as cameras and converters leave them, written byte by byte where OpenCV does not."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray


def scene(width: int = 32, height: int = 16, *, seed: int = 0) -> NDArray[np.uint8]:
    """Grey blocks that a coder keeps nearly as they are, shape (height, width)."""
    blocks = np.random.default_rng(seed).integers(20, 236, (height // 4, width // 4), dtype=np.uint8)
    return np.kron(blocks, np.ones((4, 4), np.uint8))


def coded(suffix: str, image: NDArray[np.generic], *options: int) -> bytes:
    return cv2.imencode(suffix, np.asarray(image), list(options))[1].tobytes()


def exif(orientation: int, order: str = ">") -> bytes:
    """An EXIF block that says nothing but the orientation."""
    mark = b"MM" if order == ">" else b"II"
    return mark + struct.pack(f"{order}HIHHHIHHI", 42, 8, 1, 0x112, 3, 1, orientation, 0, 0)


def with_orientation(data: bytes, orientation: int, order: str = ">") -> bytes:
    """A JPEG, PNG or lossless WebP with an EXIF block."""
    block = exif(orientation, order)
    if data.startswith(b"\xff\xd8"):
        return data[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 8) + b"Exif\0\0" + block + data[2:]
    if data.startswith(b"\x89PNG"):
        chunk = b"eXIf" + block
        return data[:33] + struct.pack(">I", len(block)) + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[33:]
    width, height = (size - 1 for size in reversed(decoded_shape(data)))
    extended = b"VP8X" + struct.pack("<IB3x", 10, 0x08) + width.to_bytes(3, "little") + height.to_bytes(3, "little")
    chunks = extended + data[12:] + b"EXIF" + struct.pack("<I", len(block)) + block
    return b"RIFF" + struct.pack("<I", len(chunks) + 4) + b"WEBP" + chunks


def tiff(image: NDArray[np.uint8], orientation: int) -> bytes:
    """An uncompressed grey TIFF of one strip with an orientation."""
    height, width = image.shape
    tags = [(256, width), (257, height), (258, 8), (259, 1), (262, 1), (273, 8), (274, orientation), (277, 1)]
    tags += [(278, height), (279, width * height)]
    directory = struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    return b"II*\0" + struct.pack("<I", 8 + image.size) + image.tobytes() + directory + bytes(4)


def decoded_shape(data: bytes) -> tuple[int, int]:
    height, width = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)).shape
    return height, width
