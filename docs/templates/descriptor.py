"""A descriptor of your own, to start from: ``cp docs/templates/descriptor.py mine.py``, ``pytest mine.py``.

Replay with it: ``omnieval replay --descriptor mine.py:MyDescriptor --set my-descriptor.bands=16``.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

import omnieval
from omnieval.testing import check_descriptor


class MySettings(BaseModel):
    """Parameters: each has a default, a range and a meaning, and can be set by its name."""

    bands: int = Field(32, gt=0, description="bands of rows; must divide the rows of a panorama")


class MyDescriptor:
    """The mean grey level of bands of rows (position), and of columns (orientation)."""

    name = "my-descriptor"
    Settings = MySettings

    def __init__(self, settings: MySettings) -> None:
        self.settings = settings

    def describe(self, panorama: NDArray[np.uint8]) -> omnieval.Description:
        """Describe a grey panorama, shape (rows, columns).

        The position, shape (d,), must not change when the robot turns, which rolls the columns; the orientation, shape
        (cells, bins), must roll with them.
        """
        bands = panorama.reshape(self.settings.bands, -1).mean(axis=1, dtype=np.float32)
        columns = panorama.mean(axis=0, dtype=np.float32)
        return omnieval.Description(position=bands, orientation=columns[:, np.newaxis])


def test_it_keeps_the_contract_of_descriptors():
    check_descriptor(MyDescriptor(MySettings()))
    check_descriptor(MyDescriptor(MySettings(bands=16)))
