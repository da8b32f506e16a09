"""Descriptors from any network: pooled from the last feature map of the panorama, by ONNX Runtime.

With a feature map of C channels, H' rows and W' columns, the position descriptor is pooled over rows and columns, and
the orientation descriptor over the rows alone: it has W' cells, and rolls as the robot turns. GeM is that of F.
Radenović, G. Tolias, O. Chum, *Fine-tuning CNN Image Retrieval with No Human Annotation*, doi
10.1109/TPAMI.2018.2846566.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError

_SMALLEST = 1e-6
"""What GeM takes for a feature that is not positive."""


class Card(BaseModel):
    """What has to be known of a network: the file ``MODEL.toml`` beside ``MODEL.onnx``."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    input: str = Field(description="name of the input")
    output: str = Field(description="name of the output, a feature map")
    layout: Literal["nchw", "nhwc"] = Field("nchw", description="order of the axes of both")
    rows: int = Field(gt=0, le=4096, description="rows of the panorama as the network sees it")
    columns: int = Field(gt=0, le=8192, description="its columns, before padding")
    padding: int = Field(0, ge=0, le=4096, description="columns on either side that go on around the panorama")
    colours: Literal["rgb", "bgr", "grey"] = Field("rgb", description="channels of the input")
    mean: tuple[float, ...] = Field(
        (0.0,), description="of values from 0 to 1: what is subtracted, one a channel or one"
    )
    std: tuple[float, ...] = Field((1.0,), description="and what they are divided by then")
    pooling: Literal["gem", "mean"] = Field("gem", description="how position descriptors are pooled")
    power: float = Field(3.0, ge=1, le=20, description="of GeM")
    licence: str = Field("", description="of the weights")
    source: str = Field("", description="where they are from")


class Network:
    """A descriptor by a network in a file, ``onnx:MODEL.onnx``.

    Both parts are divided by their Euclidean norm. One thread a session: the result has the same bits everywhere.

    Parameters
    ----------
    model
        The network; its card lies beside it.

    Raises
    ------
    ConfigError
        If onnxruntime is not installed, or network or card cannot be read.
    """

    colour = True

    def __init__(self, model: str | Path) -> None:
        if find_spec("onnxruntime") is None:
            raise ConfigError("a network needs onnxruntime, which is not installed; pip install 'omnieval[onnx]'")
        self.weights = Path(model)
        self.name = re.sub(r"\W+", "-", self.weights.stem).strip("-").lower() or "network"
        self._card = load_card(self.weights.with_suffix(".toml"))
        self.settings: dict[str, Any] = self._card.model_dump(mode="json")
        self._run = _session(self.weights, self._card)

    def __reduce__(self) -> tuple[type[Network], tuple[Path]]:
        return Network, (self.weights,)

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe one panorama, colour (BGR) or grey, shape (rows, columns[, 3]), uint8."""
        features = self._features(panorama)
        if self._card.pooling == "mean":
            position = features.mean(axis=(1, 2))
        else:
            raised = np.maximum(features, _SMALLEST) ** self._card.power
            position = raised.mean(axis=(1, 2)) ** (1.0 / self._card.power)
        return Description(_normalised(position), _normalised(features.mean(axis=1).T))

    def _features(self, panorama: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the feature map of the panorama, shape (C, H', W')."""
        card = self._card
        given = as_input(panorama, card)
        found = np.asarray(self._run(given), np.float64)
        if found.ndim != 4 or len(found) != 1:
            raise ConfigError(
                f"{self.weights}: output {card.output!r} must be one feature map, got shape {found.shape}"
            )
        features = found[0] if card.layout == "nchw" else found[0].transpose(2, 0, 1)
        width = features.shape[2]
        beyond, rest = divmod(width * card.padding, card.columns + 2 * card.padding)
        if rest:
            raise ConfigError(
                f"{self.weights}: {width} columns of features for {card.columns} and 2 x {card.padding} of the input; "
                "columns and padding must be multiples of the network's stride"
            )
        within: NDArray[np.float64] = features[:, :, beyond : width - beyond]
        return within


def load_card(file: Path) -> Card:
    """Read the card of a network.

    Raises
    ------
    ConfigError
        If it is not there, or wrong.
    """
    try:
        return Card.model_validate(tomllib.loads(file.read_text("utf-8")))
    except OSError as error:
        raise ConfigError(f"cannot read {file}, the card of the network: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file} is no TOML: {error}") from error
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        raise ConfigError(f"{file}: {faults}") from error


def as_input(panorama: NDArray[np.uint8], card: Card) -> NDArray[np.float32]:
    """Return what a network is given: resized, padded around, normalised, shape (1, ...) by its layout."""
    image = panorama
    if card.colours == "grey" and image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
    elif card.colours != "grey" and image.ndim == 2:
        image = np.repeat(image[:, :, np.newaxis], 3, axis=2)
    elif card.colours == "rgb":
        image = image[:, :, ::-1]
    # Three times around, so that what is resized goes on beyond both ends.
    thrice = np.ascontiguousarray(np.concatenate([image] * 3, axis=1))
    resized = cv2.resize(thrice, (3 * card.columns, card.rows), interpolation=cv2.INTER_AREA)
    padded = resized[:, card.columns - card.padding : 2 * card.columns + card.padding]
    levels = padded.reshape(*padded.shape[:2], -1).astype(np.float32) / np.float32(255)
    mean, std = (np.array(numbers, np.float32) for numbers in (card.mean, card.std))
    values = np.asarray((levels - mean) / std, np.float32)
    return np.ascontiguousarray((values.transpose(2, 0, 1) if card.layout == "nchw" else values)[np.newaxis])


def _session(model: Path, card: Card) -> Callable[[NDArray[np.float32]], Any]:
    """Return what runs the network."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(model.read_bytes(), options, providers=["CPUExecutionProvider"])
    except OSError as error:
        raise ConfigError(f"cannot read the network {model}: {error.strerror or error}") from error
    except Exception as error:  # ONNX Runtime has errors of its own, one for each kind of fault
        raise ConfigError(f"cannot load the network {model}: {' '.join(str(error).split())}") from error
    known = [one.name for one in session.get_inputs()], [one.name for one in session.get_outputs()]
    for what, name, names in zip(("input", "output"), (card.input, card.output), known, strict=True):
        if name not in names:
            raise ConfigError(f"{model} has no {what} {name!r}; it has {', '.join(names)}; correct its card")
    return lambda given: session.run([card.output], {card.input: given})[0]


def _normalised(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(values / max(float(np.linalg.norm(values)), _SMALLEST), np.float32)
