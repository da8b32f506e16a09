"""Descriptors by a network: one of a single convolution, made here, against its sums on paper, and the contract."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from omnieval.components.component import resolve_component
from omnieval.descriptors.network import Card, Network, as_input
from omnieval.errors import ConfigError, ResultError
from omnieval.testing import check_descriptor

CARD = """
input = "image"
output = "features"
rows = 32
columns = 128
padding = 8
mean = [0.4, 0.5, 0.6]
std = [0.2, 0.2, 0.25]
licence = "none"
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A convolution of 4 x 4 pixels every 4 pixels, and what is below zero cut off."""
    kernel = np.random.default_rng(0).normal(size=(6, 3, 4, 4)).astype(np.float32)
    graph = helper.make_graph(
        [
            helper.make_node("Conv", ["image", "kernel"], ["sums"], strides=[4, 4]),
            helper.make_node("Relu", ["sums"], ["features"]),
        ],
        "small",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, ["images", 3, "rows", "columns"])],
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, None)],
        [numpy_helper.from_array(kernel, "kernel")],
    )
    file = tmp_path / "Small net.onnx"
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9), str(file))
    file.with_suffix(".toml").write_text(CARD, "utf-8")
    return file


def panorama(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (32, 128, 3), np.uint8)


def test_it_keeps_the_contract(model: Path) -> None:
    check_descriptor(Network(model))


def test_batches_are_filled_up_and_change_no_bit(model: Path) -> None:
    panoramas = [panorama(seed) for seed in range(5)]
    alone = [Network(model).describe(one) for one in panoramas]
    model.with_suffix(".toml").write_text(f"{CARD}batch = 3\n", "utf-8")
    batched = Network(model)
    assert batched.batch == 3
    check_descriptor(batched)
    for one, other in zip(batched.describe_batch(panoramas), alone, strict=True):
        assert one.position.tobytes() == other.position.tobytes()
        assert one.orientation.tobytes() == other.orientation.tobytes()


def test_a_network_whose_features_depend_on_the_batch_is_refused(model: Path) -> None:
    network = onnx.load(str(model))
    network.graph.node[-1].input[0] = "centred"
    network.graph.node.insert(1, helper.make_node("ReduceMean", ["sums"], ["mean"], axes=[0], keepdims=1))
    network.graph.node.insert(2, helper.make_node("Sub", ["sums", "mean"], ["centred"]))
    onnx.save(network, str(model))
    model.with_suffix(".toml").write_text(f"{CARD}batch = 3\n", "utf-8")
    with pytest.raises(ConfigError, match="other features by its place in a batch of 3; write batch = 1"):
        Network(model).describe(panorama())


def test_a_vector_is_a_position_descriptor_without_orientation(model: Path) -> None:
    network = onnx.load(str(model))
    network.graph.node.extend(
        [
            helper.make_node("GlobalAveragePool", ["features"], ["pooled"]),
            helper.make_node("Flatten", ["pooled"], ["vector"]),
        ]
    )
    network.graph.output[0].CopyFrom(helper.make_tensor_value_info("vector", TensorProto.FLOAT, ["images", 6]))
    onnx.save(network, str(model))
    model.with_suffix(".toml").write_text(CARD.replace('"features"', '"vector"'), "utf-8")
    described = Network(model).describe(panorama())
    assert described.position.shape == (6,)
    assert np.linalg.norm(described.position) == pytest.approx(1)
    assert described.orientation.tolist() == [[1]]


def test_both_parts_are_pooled_from_the_features(model: Path) -> None:
    described = Network(model).describe(panorama())
    card = Card(input="image", output="features", rows=32, columns=128, mean=(0.4, 0.5, 0.6), std=(0.2, 0.2, 0.25))
    given = as_input(panorama(), card)[0].astype(np.float64)
    weights = numpy_helper.to_array(onnx.load(str(model)).graph.initializer[0]).astype(np.float64)
    patches = given.reshape(3, 8, 4, 32, 4)
    features = np.maximum(np.einsum("kryqx,okyx->orq", patches, weights), 0)
    position = (np.maximum(features, 1e-6) ** 3).mean(axis=(1, 2)) ** (1 / 3)
    np.testing.assert_allclose(described.position, position / np.linalg.norm(position), rtol=1e-4)
    orientation = features.mean(axis=1).T
    assert described.orientation.shape == (32, 6)
    np.testing.assert_allclose(described.orientation, orientation / np.linalg.norm(orientation), rtol=1e-3, atol=1e-6)


def test_the_input_is_in_the_order_of_colours_and_goes_on_around() -> None:
    card = Card(input="i", output="o", rows=1, columns=4, padding=2)
    row = np.arange(12, dtype=np.uint8).reshape(1, 4, 3)
    given = as_input(row, card)
    assert given.shape == (1, 3, 1, 8)
    assert np.rint(given[0, 0, 0] * 255).tolist() == [8, 11, 2, 5, 8, 11, 2, 5], "red is the last of BGR"
    grey = as_input(row[:, :, 0], card.model_copy(update={"layout": "nhwc", "padding": 0}))
    assert np.rint(grey[0, 0] * 255).tolist() == [[0, 0, 0], [3, 3, 3], [6, 6, 6], [9, 9, 9]]


def test_card_and_weights_are_its_identity(model: Path) -> None:
    spec = f"onnx:{model}"
    one = resolve_component("descriptor", spec)
    assert (one.name, one.spec) == ("small-net", spec)
    assert one.settings["padding"] == 8
    again = type(one).of_run("descriptor", one.about).again()
    assert again.identity == one.identity
    other = pickle.loads(pickle.dumps(one.make())).describe(panorama())
    assert other.position.tobytes() == one.make().describe(panorama()).position.tobytes()
    model.with_suffix(".toml").write_text(CARD.replace("padding = 8", "padding = 16"), "utf-8")
    assert resolve_component("descriptor", spec).identity != one.identity
    with pytest.raises(ResultError, match="cannot be made again"):
        type(one).of_run("descriptor", one.about).again()


@pytest.mark.slow
def test_another_process_describes_to_the_bit_the_same(model: Path) -> None:
    np.save(model.with_name("panorama.npy"), panorama())
    program = (
        "import sys, numpy; from omnieval.descriptors.network import Network; "
        "one = Network(sys.argv[1]).describe(numpy.load(sys.argv[2])); "
        "sys.stdout.write((one.position.tobytes() + one.orientation.tobytes()).hex())"
    )
    command = [sys.executable, "-c", program, str(model), str(model.with_name("panorama.npy"))]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    one = Network(model).describe(panorama())
    assert said == (one.position.tobytes() + one.orientation.tobytes()).hex()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"features"', '"sum"', "has no output 'sum'; it has features; correct its card"),
        ("padding = 8", "padding = 6", "must be multiples of the network's stride"),
        ("rows = 32", "", "rows: Field required"),
        ("rows = 32", "rows = 32\nbatch = 0", "batch: Input should be greater than"),
        ("input", "=", "is not valid TOML"),
    ],
)
def test_a_wrong_card_is_told(model: Path, old: str, new: str, said: str) -> None:
    model.with_suffix(".toml").write_text(CARD.replace(old, new, 1), "utf-8")
    with pytest.raises(ConfigError, match=said):
        Network(model).describe(panorama())


def test_a_network_for_another_number_of_panoramas_is_told(model: Path) -> None:
    network = onnx.load(str(model))
    network.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 4
    onnx.save(network, str(model))
    with pytest.raises(ConfigError, match="takes 4 at once; write batch = 4 in its card"):
        Network(model)


def test_a_file_that_is_no_network_is_told(model: Path) -> None:
    model.write_bytes(b"not a network")
    with pytest.raises(ConfigError, match="cannot load the network"):
        Network(model)
    model.unlink()
    with pytest.raises(ConfigError, match="cannot read the network"):
        Network(model)
    with pytest.raises(ConfigError, match="the card of the network"):
        Network(model.with_name("none.onnx"))
