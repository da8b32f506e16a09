"""The parameters of unwrapping."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from omnieval.datasets.belt import parse_belt

LARGEST_PX = 100_000
"""No image is wider; beyond, positions in pixels are not exact any more."""


class ImagingConfig(BaseModel):
    """How images become panoramas. Geometry that is not given comes from the dataset or is estimated."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    rows: int = Field(128, ge=16, le=4096, description="height of the panorama in pixels")
    columns: int = Field(512, ge=16, le=16384, description="width of the panorama in pixels")
    kind: Literal["auto", "omnidirectional", "panoramic"] = Field("auto", description="what the images are")
    cx: float | None = Field(None, ge=0, le=LARGEST_PX, description="column of the mirror's centre in pixels")
    cy: float | None = Field(None, ge=0, le=LARGEST_PX, description="row of the mirror's centre in pixels")
    r_in: float | None = Field(None, ge=0, le=LARGEST_PX, description="radius of the camera's own reflection in pixels")
    r_out: float | None = Field(None, gt=0, le=LARGEST_PX, description="radius of the mirror's rim in pixels")
    belt: str | None = Field(
        None, description="rows of panoramas to use, TOP:BOTTOM as shares of the height or elevations (30deg:-50deg)"
    )
    mask: str | None = Field(None, description="PNG file, white where the scene is seen; black is not described")

    @field_validator("belt")
    @classmethod
    def _belt_is_one(cls, belt: str | None) -> str | None:
        if belt is not None:
            parse_belt(belt)
        return belt

    @field_validator("mask")
    @classmethod
    def _mask_is_a_png(cls, mask: str | None) -> str | None:
        if mask is not None and not mask.lower().endswith(".png"):
            raise ValueError("the name of a PNG file")
        return mask
