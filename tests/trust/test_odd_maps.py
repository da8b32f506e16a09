"""Maps at the edge of what a map can be: they are results, with null metrics and reasons where there is no value."""

from __future__ import annotations

import json
from typing import Any, get_args

import numpy as np
import polars.selectors as cs
import pytest

from omnieval.mapping.roman2020.settings import Roman2020Settings
from omnieval.mapping.step import Placement
from omnieval.metrics.evaluation import METRICS, evaluate
from omnieval.results.run_folder import open_run
from tests.trust.inputs import CommandLine

COVARIANCES = get_args(Roman2020Settings.model_fields["covariance"].annotation)
SHARES = {name for name in METRICS if name.startswith("share_")}
OVER_POSITIONS = {name for name in METRICS if name.startswith("silhouette")}
OVER_ROOMS = {name for name in METRICS if name.startswith("rooms")}


@pytest.fixture
def command(capfd, tmp_path):
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


@pytest.fixture
def mapped(command, tmp_path):
    """Maps an archive of these arrays and returns the manifest of the run; small nodes unless settings say else."""

    def run(arrays: dict[str, Any], *settings: str) -> dict[str, Any]:
        with (tmp_path / "d.npz").open("wb") as stream:
            np.savez(stream, **arrays)
        assignments = [part for setting in ("n_init=10", "n_new=10", *settings) for part in ("--set", setting)]
        outcome = command("map", tmp_path / "d.npz", *assignments, "--out", "run", "--overwrite", "--json")
        assert (outcome.code, outcome.err) == (0, "")
        content: dict[str, Any] = json.loads(outcome.out)
        for table in (open_run(tmp_path / "cwd" / "run").steps, open_run(tmp_path / "cwd" / "run").nodes):
            for column in table.select(cs.float()).iter_columns():
                assert not column.is_nan().any(), column.name
        return content

    return run


def _places(count: int, each: int, *, dimensions: int = 12, spread: float = 0.05) -> dict[str, Any]:
    """Descriptors of some places, `each` images of one after the other, with true positions and rooms."""
    rng = np.random.default_rng(1)
    place = np.repeat(np.arange(count), each)
    position = rng.normal(size=(count, dimensions))[place] + spread * rng.normal(size=(len(place), dimensions))
    orientation = rng.random((count, 8, 4))[place] + spread * rng.random((len(place), 8, 4))
    return {
        "position": position.astype(np.float32),
        "orientation": orientation.astype(np.float32),
        "xy": np.column_stack([10.0 * place, np.zeros(len(place))]) + 0.1 * rng.normal(size=(len(place), 2)),
        "room": np.array([f"R{number}" for number in place]),
    }


def _null(manifest: dict[str, Any]) -> set[str]:
    """Names of the null silhouettes and agreements; each null metric has its reason, and no other has one."""
    null = {name for name, value in manifest["metrics"].items() if value is None}
    assert set(manifest["null_reasons"]) == null
    assert all(manifest["null_reasons"].values())
    return null & (OVER_POSITIONS | OVER_ROOMS)


def test_one_final_node_has_no_silhouette(mapped):
    manifest = mapped(_places(1, 40), "leftovers=retest")
    assert manifest["metrics"]["nodes"] == 1
    assert _null(manifest) == OVER_POSITIONS
    assert manifest["null_reasons"]["silhouette"] == "a silhouette needs at least two nodes, the map has 1"


def test_all_but_the_first_node_unassigned(mapped):
    arrays = _places(40, 1)
    manifest = mapped(arrays, "n_new=100", "leftovers=unassigned", "omega=0.01")
    assert manifest["metrics"]["nodes"] == 1
    assert manifest["metrics"]["share_unassigned"] >= 0.5
    assert _null(manifest) == OVER_POSITIONS


def test_no_image_assigned_at_all():
    nothing = np.zeros(30, np.int64)
    evaluation = evaluate(
        nothing, [Placement.UNASSIGNED] * 30, np.random.default_rng(0).normal(size=(30, 2)), rooms=["R"] * 30, seed=0
    )
    assert evaluation.metrics["share_unassigned"] == 1.0
    assert {name for name, value in evaluation.metrics.items() if value is None} >= OVER_POSITIONS | OVER_ROOMS
    assert (evaluation.metrics["components"], evaluation.metrics["loops"]) == (0, 0)
    assert evaluation.reasons["silhouette"] == "a silhouette needs at least two nodes, the map has 0"
    assert evaluation.reasons["rooms_ari"] == "no image has both a room label and a node"


def test_every_image_a_node_of_its_own(command, tmp_path):
    with (tmp_path / "d.npz").open("wb") as stream:
        np.savez(stream, **_places(5, 4))
    outcome = command("baseline", tmp_path / "d.npz", "--method", "kmeans", "--k", "20", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    row = json.loads(outcome.out)["rows"][0]
    assert row["k"] == 20
    assert row["silhouette"] is None or np.isfinite(row["silhouette"])
    assert row["rooms_homogeneity"] == pytest.approx(1.0)


def test_true_positions_that_are_all_one_place(mapped):
    arrays = _places(3, 14)
    manifest = mapped(arrays | {"xy": np.zeros((42, 2))}, "merge_y=0", "omega=3")
    if manifest["metrics"]["nodes"] > 1:
        assert "silhouette_positions" in _null(manifest)
        assert manifest["null_reasons"]["silhouette_positions"] == "there are fewer different positions than nodes"


def test_positions_of_some_images_only_are_judged_by_these(mapped):
    arrays = _places(3, 14)
    arrays["xy"][5] = np.nan
    manifest = mapped(arrays, "merge_y=0")
    assert not _null(manifest) & OVER_POSITIONS
    assert (manifest["metrics"]["posed"], manifest["frames"]) == (41, 42)


def test_positions_of_no_building(mapped):
    """What cannot be metres is a finding of the check; it must not bring a replay down."""
    arrays = _places(3, 14)
    manifest = mapped(arrays | {"xy": arrays["xy"] * 1e300}, "merge_y=0")
    assert _null(manifest) >= OVER_POSITIONS


@pytest.mark.parametrize("covariance", COVARIANCES)
@pytest.mark.parametrize("dimensions", [1, 2, 500])
def test_more_dimensions_than_images_and_fewer(covariance, dimensions, mapped):
    manifest = mapped(_places(3, 14, dimensions=dimensions), f"covariance={covariance}")
    assert manifest["frames"] == 42


@pytest.mark.parametrize("covariance", COVARIANCES)
@pytest.mark.parametrize(
    "spoil",
    [
        np.zeros_like,
        np.ones_like,
        lambda array: np.repeat(array[:21], 2, axis=0),
        lambda array: np.tile(array[:1], (42, *[1] * (array.ndim - 1))),
    ],
    ids=["all 0", "all 1", "pairs of equals", "all equal"],
)
def test_descriptors_without_any_difference(covariance, spoil, mapped):
    arrays = _places(3, 14)
    spoilt = {name: spoil(arrays[name]) for name in ("position", "orientation")}
    assert mapped(arrays | spoilt, f"covariance={covariance}")["frames"] == 42


@pytest.mark.parametrize("covariance", COVARIANCES)
@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1e12, 1e30])
def test_descriptors_of_another_scale(covariance, scale, mapped):
    arrays = _places(3, 14)
    scaled = {name: (arrays[name] * scale).astype(np.float32) for name in ("position", "orientation")}
    assert mapped(arrays | scaled, f"covariance={covariance}")["frames"] == 42
