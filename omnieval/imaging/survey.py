"""What the images of a sequence show of the camera, as `dataset check` reports it: a camera, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass

from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.sequence import Sequence
from omnieval.errors import OmnievalError
from omnieval.imaging.camera import CameraModel, camera_in_words, resolve_camera
from omnieval.imaging.circles import Circle
from omnieval.imaging.glance import Notebook, seen_mirror
from omnieval.imaging.settings import ImagingConfig


@dataclass(frozen=True)
class CameraSurvey:
    """What was found out.

    Attributes
    ----------
    camera
        The camera; None if it is not known.
    words
        What it is and where that is known from, or why it is not known.
    findings
        What is odd about it.
    candidate
        Without a camera: the circle that came nearest to being a mirror's rim.
    """

    camera: CameraModel | None
    words: str
    findings: tuple[Finding, ...]
    candidate: Circle | None = None


def survey_camera(sequence: Sequence, config: ImagingConfig, notebook: Notebook | None = None) -> CameraSurvey:
    """Find out what `resolve_camera` does, and what there is if it refuses.

    Raises
    ------
    DatasetError
        If an image that is needed for this cannot be read.
    """
    try:
        camera = resolve_camera(sequence, config, notebook)
    except OmnievalError as error:
        words = str(error).removeprefix(f"{sequence.source}: ")
        estimate = seen_mirror(sequence, notebook)
        return CameraSurvey(None, words, (Finding("error", "camera-unknown", ROOT, words),), estimate.candidate)
    return CameraSurvey(camera, camera_in_words(camera.about), camera.findings)
