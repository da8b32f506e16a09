"""Descriptors from any network: pooled from the last feature map of the panorama, by ONNX Runtime.

With a feature map of C channels, H' rows and W' columns, the position descriptor is pooled over rows and columns, and
the orientation descriptor over the rows alone: it has W' cells, and rolls as the robot turns. If a network gives one
vector, that is the position descriptor, and there is no orientation. GeM is that of F. Radenović, G. Tolias, O. Chum,
*Fine-tuning CNN Image Retrieval with No Human Annotation*, doi 10.1109/TPAMI.2018.2846566.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
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
    output: str = Field(description="name of the output, a feature map or one vector")
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
    batch: int = Field(1, ge=1, le=256, description="panoramas that it is given at once, always this many")
    licence: str = Field("", description="of the weights")
    source: str = Field("", description="where they are from")


class Network:
    """A descriptor by a network in a file, ``onnx:MODEL.onnx``.

    Both parts are divided by their Euclidean norm. One thread per session: the result has the same bits everywhere.

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
        self._tried = False

    def __reduce__(self) -> tuple[type[Network], tuple[Path]]:
        return Network, (self.weights,)

    @property
    def batch(self) -> int:
        """How many panoramas it is given at once."""
        return self._card.batch

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe one panorama, colour (BGR) or grey, shape (rows, columns[, 3]), uint8."""
        return self.describe_batch([panorama])[0]

    def describe_batch(self, panoramas: Sequence[NDArray[np.uint8]]) -> list[Description]:
        """Describe panoramas of one size; what is missing of a batch is filled up.

        Raises
        ------
        ConfigError
            If the network does not give what its card says, or gives a panorama other features in a batch of others.
        """
        size = self._card.batch
        if size > 1 and not self._tried:
            self._try_batch(as_input(panoramas[0], self._card).shape[1:])
            self._tried = True
        found: list[Description] = []
        for start in range(0, len(panoramas), size):
            given = [as_input(panorama, self._card) for panorama in panoramas[start : start + size]]
            outputs = self._outputs(np.concatenate([*given, *[given[-1]] * (size - len(given))]))
            found += [self._pooled(output) for output in outputs[: len(given)]]
        return found

    def _outputs(self, given: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return feature maps or vectors, one a panorama."""
        found = np.asarray(self._run(given))
        if found.ndim not in {2, 4} or len(found) != len(given):
            raise ConfigError(
                f"{self.weights}: output {self._card.output!r} must be one feature map or vector for each of "
                f"{len(given)}, got shape {found.shape}"
            )
        return found

    def _try_batch(self, shape: tuple[int, ...]) -> None:
        """Refuse batches in which the features of a panorama depend on where it stands, or beside what.

        The order of sums may depend on the place, but not on what is summed: noise tells as well as panoramas.
        """
        noise = np.random.default_rng(0).normal(size=(self._card.batch, *shape)).astype(np.float32)
        among_others, everywhere = self._outputs(noise), self._outputs(np.repeat(noise[:1], len(noise), axis=0))
        if any(one.tobytes() != among_others[0].tobytes() for one in everywhere):
            raise ConfigError(
                f"{self.weights} gives a panorama other features by its place in a batch of {self._card.batch}; "
                "write batch = 1 in its card"
            )

    def _pooled(self, output: NDArray[np.float32]) -> Description:
        """Return both descriptors of a feature map, or the position descriptor alone of a vector."""
        if output.ndim == 1:
            return Description(_normalised(output.astype(np.float64)), np.ones((1, 1), np.float32))
        features = self._features(output)
        if self._card.pooling == "mean":
            position = features.mean(axis=(1, 2))
        else:
            raised = np.maximum(features, _SMALLEST) ** self._card.power
            position = raised.mean(axis=(1, 2)) ** (1.0 / self._card.power)
        return Description(_normalised(position), _normalised(features.mean(axis=1).T))

    def _features(self, output: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the feature map of what is not padding, shape (C, H', W')."""
        card = self._card
        features = np.asarray(output if card.layout == "nchw" else output.transpose(2, 0, 1), np.float64)
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
        raise ConfigError(f"{file} is not valid TOML: {error}") from error
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
    images = next(one.shape[0] for one in session.get_inputs() if one.name == card.input)
    if isinstance(images, int) and images != card.batch:
        raise ConfigError(f"{model} takes {images} at once; write batch = {images} in its card")
    return lambda given: session.run([card.output], {card.input: given})[0]


def _normalised(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(values / max(float(np.linalg.norm(values)), _SMALLEST), np.float32)
