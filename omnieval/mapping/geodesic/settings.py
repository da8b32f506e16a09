"""The parameters of `Geodesic`."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class GeodesicSettings(BaseModel):
    """Parameters of `Geodesic`, validated and frozen; lengths are in travelled frames (`odometer`)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    extent: float = Field(
        10.0, gt=0, le=64, description="mean distance between a keyframe and those of its node, at most; in frames"
    )
    reach: float = Field(
        30.0, gt=0, le=1000, description="travel up to which the distance of keyframes is known, in frames"
    )
    spacing: float = Field(2.0, gt=0, le=32, description="travel after which an unrecognised image is a keyframe")
    gap: float = Field(40.0, ge=0, le=10_000, description="travel within which an earlier keyframe closes no loop")
    sure: float = Field(0.8, gt=0.5, lt=1, description="belief in one place from which an image is recognised")
    likeness: float = Field(
        0.5,
        gt=0,
        lt=1,
        description="how unlike an image that may be the same place is: 0 as its predecessor, 1 as images of elsewhere",
    )
    sharpness: float = Field(
        0.05, gt=0, le=1, description="change of likeness that makes a place e times as believable, on the same scale"
    )
    leave: float = Field(0.02, gt=0, lt=1, description="chance of leaving known places from one image to the next")
    enter: float = Field(0.002, gt=0, lt=1, description="chance of coming to a known place from an unknown one")
