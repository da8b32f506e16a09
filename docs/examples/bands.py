"""A descriptor of your own, set by name: ``--descriptor docs/examples/bands.py:Bands --set bands.rows=16``."""

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from omnieval import Description


class BandsSettings(BaseModel):
    """How many bands; they must divide the size of the panorama."""

    rows: int = Field(32, gt=0, description="bands of rows, which no rotation changes")
    columns: int = Field(128, gt=0, description="bands of columns, which a rotation rolls")


class Bands:
    """The mean grey level of bands of rows, and of columns."""

    name = "bands"
    Settings = BandsSettings

    def __init__(self, settings: BandsSettings) -> None:
        self.settings = settings

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe one grey panorama."""
        rows = panorama.reshape(self.settings.rows, -1).mean(axis=1)
        columns = panorama.T.reshape(self.settings.columns, -1).mean(axis=1)
        return Description(rows.astype(np.float32), columns[:, np.newaxis].astype(np.float32))
