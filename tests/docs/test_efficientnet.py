"""The example that makes a descriptor of EfficientNet-Lite0: its reader, its network on made-up weights, and whole."""

import io
import pickle
import runpy
import subprocess
import sys
import types
from collections import OrderedDict
from pathlib import Path

import numpy as np
import onnx
import pytest

from omnieval.descriptors.network import Network, load_card
from omnieval.testing import check_descriptor
from tests.docs.pages import ROOT, blocks

SCRIPT = ROOT / "docs" / "examples" / "efficientnet_lite0.py"
STRIDES = [1, 2, 1, 2, 1, 2, 1, 1, 1, 1, 1, 2, 1, 1, 1, 1]
KERNELS = [3, 3, 3, 5, 5, 3, 3, 3, 5, 5, 5, 5, 5, 5, 5, 3]
CHANNELS = [4, 4, 6, 6, 5, 5, 7, 7, 7, 8, 8, 8, 9, 9, 9, 9, 10]
"""Before the blocks, and after each of them; where a block keeps size and channels, what it was given is added."""


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def state():
    """Weights of a network with few channels."""
    rng = np.random.default_rng(11)
    weights: dict[str, np.ndarray] = {}

    def layer(name: str, norm: str, *shape: int) -> None:
        weights[f"{name}.weight"] = rng.normal(0, 1.5 / np.sqrt(np.prod(shape[1:])), shape).astype(np.float32)
        for what, low, high in (
            ("weight", 0.5, 2),
            ("bias", -0.5, 1),
            ("running_mean", -1, 1),
            ("running_var", 0.2, 2),
        ):
            weights[f"{norm}.{what}"] = rng.uniform(low, high, shape[0]).astype(np.float32)

    layer("_conv_stem", "_bn0", CHANNELS[0], 3, 3, 3)
    for number, kernel in enumerate(KERNELS):
        name, within = f"_blocks.{number}", CHANNELS[number] * (1 if number == 0 else 2)
        if number > 0:
            layer(f"{name}._expand_conv", f"{name}._bn0", within, CHANNELS[number], 1, 1)
        layer(f"{name}._depthwise_conv", f"{name}._bn1", within, 1, kernel, kernel)
        layer(f"{name}._project_conv", f"{name}._bn2", CHANNELS[number + 1], within, 1, 1)
    layer("_conv_head", "_bn1", 12, CHANNELS[-1], 1, 1)
    return weights


def forward(state, image, *, around):
    """The network in plain sums, padded as TensorFlow does: an output is as wide as the input divided by the stride."""

    def convolve(x, name, norm, stride=1, relu=True):
        kernel = state[f"{name}.weight"].astype(np.float64)
        size = kernel.shape[2]
        for axis in (1, 2):
            total = max((-(-x.shape[axis] // stride) - 1) * stride + size - x.shape[axis], 0)
            widths = [(0, 0)] * 3
            widths[axis] = (total // 2, total - total // 2)
            x = np.pad(x, widths, mode="wrap" if around and axis == 2 else "constant")
        seen = np.lib.stride_tricks.sliding_window_view(x, (size, size), axis=(1, 2))[:, ::stride, ::stride]
        if kernel.shape[1] == 1 and len(kernel) == len(x):
            sums = np.einsum("crwyx,cyx->crw", seen, kernel[:, 0])
        else:
            sums = np.einsum("irwyx,oiyx->orw", seen, kernel)
        gamma, beta, mean, var = (
            state[f"{norm}.{what}"][:, None, None].astype(np.float64)
            for what in ("weight", "bias", "running_mean", "running_var")
        )
        found = (sums - mean) / np.sqrt(var + 1e-3) * gamma + beta
        return np.clip(found, 0, 6) if relu else found

    x = convolve(image, "_conv_stem", "_bn0", 2)
    for number, stride in enumerate(STRIDES):
        name, y = f"_blocks.{number}", x
        if number > 0:
            y = convolve(y, f"{name}._expand_conv", f"{name}._bn0")
        y = convolve(y, f"{name}._depthwise_conv", f"{name}._bn1", stride)
        y = convolve(y, f"{name}._project_conv", f"{name}._bn2", relu=False)
        x = x + y if x.shape == y.shape else y
    return convolve(x, "_conv_head", "_bn1")


def run(model, image):
    import onnxruntime

    session = onnxruntime.InferenceSession(model.SerializeToString())
    return session.run(["features"], {"image": image[np.newaxis].astype(np.float32)})[0][0]


@pytest.mark.parametrize("around", [True, False])
def test_the_network_is_that_of_plain_sums(example, state, around):
    image = np.random.default_rng(5).normal(size=(3, 64, 96))
    expected = forward(state, image, around=around)
    assert expected.shape == (12, 2, 3)
    assert (expected > 0).mean() > 0.05, "features that tell something"
    np.testing.assert_allclose(run(example["network"](state, around=around), image), expected, rtol=1e-3, atol=1e-4)


def test_its_features_roll_with_the_panorama_to_the_bit_and_it_keeps_the_contract(example, state, tmp_path):
    image = np.random.default_rng(6).normal(size=(3, 64, 128))
    model = example["network"](state)
    assert np.array_equal(run(model, np.roll(image, 32, axis=2)), np.roll(run(model, image), 1, axis=2))
    onnx.save(model, str(tmp_path / "small.onnx"))
    (tmp_path / "small.toml").write_text(example["CARD"], "utf-8")
    assert load_card(tmp_path / "small.toml").licence == "Apache-2.0"
    check_descriptor(Network(tmp_path / "small.onnx"))


@pytest.mark.parametrize("page", ["networks.md", "method.md"])
def test_the_cards_on_the_pages_are_cards(page, tmp_path):
    cards = [block for block in blocks(ROOT / "docs" / page, "toml") if "output =" in block.text]
    assert cards
    for number, block in enumerate(cards):
        file = tmp_path / f"{number}.toml"
        file.write_text(block.text, "utf-8")
        assert load_card(file).rows > 0, block.where


def test_weights_of_another_network_are_refused(example, state):
    fewer = {name: values for name, values in state.items() if name != "_blocks.15._expand_conv.weight"}
    del fewer["_blocks.15._project_conv.weight"]
    with pytest.raises(ValueError, match=r"needs _blocks\.15\._project_conv"):
        example["network"](fewer)
    more = state | {"_blocks.3._se_reduce.weight": np.zeros((2, 6, 1, 1), np.float32)}
    with pytest.raises(ValueError, match=r"has no _blocks\.3\._se_reduce\.kernel"):
        example["network"](more)


class Storage:
    """Numbers that a made-up file of torch keeps outside the pickle."""

    def __init__(self, key, numbers):
        self.key, self.numbers = key, numbers


class Tensor:
    """A tensor of such numbers."""

    def __init__(self, storage, offset, shape, strides):
        hooks: OrderedDict[str, object] = OrderedDict()
        self.made_of = (storage, offset, shape, strides, False, hooks)


@pytest.fixture
def written(monkeypatch):
    """A function that writes tensors as torch did before version 1.6, whose names are made up here."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    kinds = {}
    for name, dtype in (("FloatStorage", "<f4"), ("LongStorage", "<i8")):
        kinds[dtype] = type(name, (), {"__module__": "torch"})
        setattr(torch, name, kinds[dtype])

    def _rebuild_tensor_v2():
        """Known by its name alone."""

    _rebuild_tensor_v2.__module__ = "torch._utils"
    _rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    vars(utils)["_rebuild_tensor_v2"] = _rebuild_tensor_v2
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "torch._utils", utils)

    class Writer(pickle.Pickler):
        def persistent_id(self, given):
            if not isinstance(given, Storage):
                return None
            kind = kinds[given.numbers.dtype.str]
            return ("storage", kind, given.key, "cpu", len(given.numbers), None)

        def reducer_override(self, given):
            return (_rebuild_tensor_v2, given.made_of) if isinstance(given, Tensor) else NotImplemented

    def write(tensors, *, short=0):
        file = io.BytesIO()
        for head in (0x1950A86A20F9469CFC6C, 1001, {"little_endian": True}):
            pickle.dump(head, file, 2)
        Writer(file, 2).dump(OrderedDict(tensors))
        storages = {one.made_of[0].key: one.made_of[0] for one in tensors.values() if isinstance(one, Tensor)}
        pickle.dump(sorted(storages), file, 2)
        for key in sorted(storages):
            file.write(len(storages[key].numbers).to_bytes(8, "little") + storages[key].numbers.tobytes())
        return io.BytesIO(file.getvalue()[: len(file.getvalue()) - short])

    return write


def test_weights_are_read_by_shape_and_stride(example, written):
    numbers = np.arange(12, dtype="<f4")
    shared = Storage("7", numbers)
    tensors = {
        "turned": Tensor(shared, 0, (3, 4), (1, 3)),
        "part": Tensor(shared, 6, (2, 3), (3, 1)),
        "count": Tensor(Storage("8", np.array([41], "<i8")), 0, (), ()),
    }
    state = example["read_state"](written(tensors))
    assert np.array_equal(state["turned"], numbers.reshape(4, 3).T)
    assert np.array_equal(state["part"], [[6, 7, 8], [9, 10, 11]])
    assert state["count"] == 41


@pytest.mark.parametrize(
    ("offset", "shape", "strides"), [(9, (2, 2), (2, 1)), (0, (3, 5), (4, 1)), (-1, (2,), (1,)), (4, (3,), (-2,))]
)
def test_a_tensor_beyond_its_numbers_is_refused(example, written, offset, shape, strides):
    tensors = {"far": Tensor(Storage("7", np.arange(12, dtype="<f4")), offset, shape, strides)}
    with pytest.raises(ValueError, match="a tensor lies beyond its storage"):
        example["read_state"](written(tensors))


def test_what_is_no_weight_is_refused_before_it_is_called(example, written, tmp_path):
    touched = tmp_path / "touched"

    class Harm:
        def __reduce__(self):
            return Path.touch, (touched,)

    with pytest.raises(pickle.UnpicklingError, match="weights must not need "):
        example["read_state"](written({"harm": Harm()}))
    assert not touched.exists()
    tensors = {"short": Tensor(Storage("7", np.arange(12, dtype="<f4")), 0, (12,), (1,))}
    with pytest.raises(ValueError, match="the file ends within storage 7"):
        example["read_state"](written(tensors, short=4))
    with pytest.raises(ValueError, match="not a file of weights"):
        example["read_state"](io.BytesIO(pickle.dumps(1) + pickle.dumps(2) + pickle.dumps({})))


@pytest.mark.slow
def test_the_real_weights_see_a_palace_and_a_daisy_and_make_a_descriptor(tmp_path):
    model = tmp_path / "lite0.onnx"
    made = subprocess.run(
        [sys.executable, str(SCRIPT), "--out", str(model)], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert made.returncode == 0, made.stderr
    assert "china.jpg: palace" in made.stdout
    assert "flower.jpg: daisy" in made.stdout
    check_descriptor(Network(model))
