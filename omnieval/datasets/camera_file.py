"""``camera.toml`` beside the images of a sequence: what the camera is, written by the owner of the data."""

from __future__ import annotations

from pathlib import Path

from omnieval.datasets.cards import CAMERA_FILE, parse_camera
from omnieval.datasets.findings import Finding
from omnieval.datasets.scan import called, exists, read_text
from omnieval.datasets.sequence import Camera
from omnieval.errors import DatasetError


def camera_beside(root: Path, otherwise: Camera) -> tuple[Camera, list[Finding]]:
    """Return the camera that a file in a folder describes, and what is wrong with the file; else another."""
    try:
        file = called(root, CAMERA_FILE)
        return (parse_camera(read_text(file), root) if exists(file) else otherwise), []
    except DatasetError as error:
        return otherwise, [Finding("error", "bad-camera", CAMERA_FILE, str(error))]
