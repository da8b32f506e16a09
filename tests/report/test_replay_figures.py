"""The figures of a replay show what its tables and descriptors say."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from omnieval.descriptors.cache import DescriptorCache
from omnieval.errors import DatasetError, ResultError
from omnieval.mapping.roman2020.conditions import gate_threshold
from omnieval.mapping.step import Match
from omnieval.metrics.silhouette import silhouettes
from omnieval.palette import node_color, node_shape
from omnieval.report.batch import SPECTRAL, batch_at, batch_figure, computed, recorded
from omnieval.report.curves import curve_rows, curves_figure, node_borders
from omnieval.report.evidence import (
    batch_curve,
    descriptions,
    loop_closures,
    moments,
    positions_of,
    similarity_curve,
    telling_step,
)
from omnieval.report.figure import Skipped
from omnieval.report.maps import map_figure, progress_figure
from omnieval.report.replays import draw_replay
from omnieval.report.series import gate_figure, step_times, time_figure, visited_gates
from omnieval.report.sources import open_sources
from tests.report.charts import figure_of, rows_of
from tests.report.conftest import replay_of


@pytest.fixture(scope="session")
def replay(run):
    return open_sources([run]).replays[0]


@pytest.fixture(scope="session")
def described(replay):
    with DescriptorCache() as cache:
        return list(descriptions(replay, cache))


@pytest.fixture(scope="session")
def telling(replay, described):
    step = telling_step(replay.steps)
    assert step is not None
    return step, *similarity_curve(replay, described, step)


def test_the_map_shows_every_image_in_the_colour_of_its_node(replay):
    figure = figure_of(map_figure(replay))
    final = replay.steps["node_final"].fill_null(0).to_list()
    positions = positions_of(replay.steps)
    drawn = {(row["frame"], row["x"], row["y"], row["node"], row["color"], row["shape"]) for row in rows_of(figure)}
    for frame, node in enumerate(final):
        x, y = (round(float(value), 3) for value in positions[frame])
        assert (frame, x, y, node, node_color(node), node_shape(node)) in drawn
    assert "final map" in str(figure.chart.to_dict())
    assert figure.data.filter(pl.col("map") == "final")["images"].sum() == len(final)


def test_ten_panels_have_the_same_metres_for_a_pixel_in_both_directions(replay):
    panels = figure_of(map_figure(replay)).chart.to_dict()["concat"]
    assert len(panels) == 10
    for panel in panels:
        encoding = panel["layer"][0]["encoding"]
        (left, right), (low, high) = (encoding[axis]["scale"]["domain"] for axis in "xy")
        assert panel["width"] / (right - left) == pytest.approx(panel["height"] / (high - low))
    assert [panel["title"].split(":")[0] for panel in panels] == [
        *(f"{part} %" for part in range(10, 100, 10)),
        "final map",
    ]


def test_an_interrupted_replay_has_no_final_map(run, tmp_path):
    interrupted = open_sources([run]).replays[0]
    half = replace(interrupted, steps=interrupted.steps.head(40), metrics={}, status="interrupted")
    figure = figure_of(map_figure(half))
    assert "The replay is interrupted, so there is no final map" in figure.caption
    assert "final" not in figure.data["map"].to_list()


def test_labels_are_replayed_to_what_the_end_says(replay):
    last = list(moments(replay.steps))[-1]
    placed = replay.steps["placement"].is_in(["loop-closure", "founding", "pending"]).to_numpy()
    assert (last.labels[placed] == replay.steps["node_final"].fill_null(0).to_numpy()[placed]).all()
    assert (last.labels[~placed] == 0).all()


def test_nodes_and_silhouette_go_on_as_the_map_grows(replay):
    figure = progress_figure(replay)
    last = figure.data.row(-1, named=True)
    labels = list(moments(replay.steps))[-1].labels
    placed = labels > 0
    assert last["nodes"] == len(np.unique(labels[placed]))
    assert last["silhouette"] == silhouettes(positions_of(replay.steps)[placed], labels[placed]).silhouette
    assert figure.data["nodes"][0] <= 1


def test_the_telling_step_is_the_loop_closure_with_the_most_candidate_images(replay, telling):
    step, match, _ = telling
    counted = loop_closures(replay.steps)
    closed = replay.steps.filter(pl.col("verdict") == "assigned")["frame"].to_list()
    assert step in closed
    assert counted[step] == len(match.frames) == max(counted[frame] for frame in closed)


def test_the_curves_are_those_the_mapper_saw(replay, telling):
    step, match, labels = telling
    row = replay.steps.row(step, named=True)
    assert match.best_frame == row["best_frame"]
    assert match.similarity[match.best] == row["similarity"]
    assert match.prominence == row["prominence"]
    figure = curves_figure(replay, step, match, labels, chosen=False)
    data = figure.data
    assert data.filter("best")["image"].to_list() == [row["best_frame"]]
    assert data["peak"].sum() == row["peaks"]
    assert data.filter(pl.col("product") > 0)["node"].unique().sort().to_list() == sorted(row["candidates"])
    drawn = sorted(value["value"] for value in rows_of(figure) if "value" in value)
    assert drawn == sorted([*data["position"], *data["orientation"], *data["product"]])
    assert "most candidate images" in figure.caption
    assert "most candidate images" not in curves_figure(replay, step, match, labels, chosen=True).caption


def test_a_curve_by_hand():
    # Nodes 2 (images 0, 1), 1 (image 2) and 4 (images 3, 4); candidates are nodes 2 and 4.
    labels = np.array([2, 2, 1, 4, 4])
    match = Match(
        frames=np.array([0, 1, 3, 4]),
        slots=np.array([1, 2, 3, 4]),
        map_size=5,
        position=np.array([0.1, 0.4, 0.2, 0.3]),
        orientation=np.array([0.1, 0.3, 0.2, 0.4]),
        similarity=np.array([0.01, 0.12, 0.04, 0.1]),
        shifts=np.zeros(4, np.int64),
        best=1,
        node=2,
        prominence=0.12,
        prominence_mean=0.09,
        peaks=2,
    )
    rows = curve_rows(match, labels)
    assert rows["image"].to_list() == [2, 0, 1, 3, 4]
    assert rows["product"].to_list() == [0.0, 0.01, 0.12, 0.04, 0.1]
    assert rows["peak"].to_list() == [False, False, True, False, True]
    assert rows["best"].to_list() == [False, False, True, False, False]
    assert [(one["node"], one["start"], one["end"]) for one in node_borders(labels)] == [
        (1, 0, 1),
        (2, 1, 3),
        (4, 3, 5),
    ]


def test_a_step_without_a_curve_is_refused(replay, described):
    with pytest.raises(ResultError, match="no node was a candidate"):
        similarity_curve(replay, described, 0)
    with pytest.raises(ResultError, match="ends at step 79, it has no step 80"):
        similarity_curve(replay, described, 80)


def test_the_gate_shows_each_number_of_nodes_the_replay_met(replay):
    figure = figure_of(gate_figure(replay))
    asked = replay.steps.drop_nulls("gate_nodes")
    assert figure.data["steps"].sum() == len(asked)
    for nodes, x, _ in visited_gates(replay.steps).iter_rows():
        assert x == gate_threshold(replay.config.mapper.omega, nodes)
        assert {"nodes": nodes, "x": x} in rows_of(figure)
    assert isinstance(gate_figure(replace(replay, steps=replay.steps.head(5))), Skipped)


def test_times_have_the_running_median_of_their_neighbourhood():
    steps = pl.DataFrame({"frame": range(101), "milliseconds": [float(number) for number in range(101)]})
    times = step_times(steps)
    assert times["median"][50] == 50
    assert times["median"][0] == 12.5  # of the first 26
    assert step_times(steps.with_columns(milliseconds=pl.lit(None, pl.Float64))).is_empty()


def test_times_are_drawn_as_recorded(replay):
    figure = figure_of(time_figure(replay))
    assert [row["ms"] for row in rows_of(figure)] == [round(time, 4) for time in replay.steps["milliseconds"]]


def test_batch_silhouettes_are_those_of_a_baseline(replay, described, baseline):
    positions = np.stack([one.position for one in described])
    curve = batch_curve(positions, positions_of(replay.steps), range(2, 9), seed=replay.config.mapper.seed)
    table = open_sources([baseline]).baselines[0].table
    assert curve["silhouette"].to_list() == table["silhouette"].to_list()
    assert curve["time_slices"].to_list() == pytest.approx(table["silhouette_time_slices"].to_list())
    assert batch_curve(positions[:1], np.zeros((1, 2)), [1, 2], seed=0).is_empty()


def test_the_incremental_run_is_marked_at_its_nodes(replay, baseline):
    curves = recorded(open_sources([baseline]).baselines)
    figure = batch_figure(curves, [replay], "three places, hog")
    marks = [row for row in rows_of(figure) if row["method"] == "incremental"]
    assert {(mark["k"], mark["silhouette"]) for mark in marks} == {(replay.nodes, replay.metrics["silhouette"])}
    assert batch_at(curves, replay.nodes) == curves.table.filter(pl.col("k") == replay.nodes)["silhouette"][0]
    assert batch_at(curves, 999) is None
    assert baseline.name in figure.caption


def test_methods_are_told_apart_by_their_dashes_too(replay, described):
    positions = np.stack([one.position for one in described])
    curves = computed(batch_curve(positions, positions_of(replay.steps), [2, 3], seed=0))
    encoding = batch_figure(curves, [], "x").chart.to_dict()["layer"][0]["encoding"]
    dashes = encoding["strokeDash"]["scale"]["range"]
    assert encoding["strokeDash"]["field"] == "method"
    assert len({tuple(dash) for dash in dashes}) == len(dashes) == 2
    assert curves.table["method"].unique(maintain_order=True).to_list()[0] == SPECTRAL


def test_a_replay_without_poses_says_what_is_missing(unposed):
    (replay,) = open_sources([unposed]).replays
    with DescriptorCache() as cache:
        drawn = draw_replay(replay, [], cache, step=None, figures=True)
    missing = {block.title: block.reason for block in drawn.blocks if isinstance(block, Skipped)}
    assert set(missing) == {"The map at ten moments", "Batch clustering over the number of clusters"}
    assert all("no poses" in reason for reason in missing.values())
    assert drawn.batch is None


@pytest.fixture
def orphan(panoramas, tmp_path):
    """A replay whose images are gone."""
    images = tmp_path / "images"
    images.mkdir()
    for file in panoramas.iterdir():
        (images / file.name).write_bytes(file.read_bytes())
    folder = replay_of(images, tmp_path / "orphan").folder
    for file in images.iterdir():
        file.unlink()
    images.rmdir()
    return open_sources([folder]).replays[0]


def test_a_replay_whose_images_are_gone_is_drawn_from_its_tables(orphan):
    with DescriptorCache() as cache:
        with pytest.raises(DatasetError):
            list(descriptions(orphan, cache))
        drawn = draw_replay(orphan, [], cache, step=None, figures=True)
    missing = [block for block in drawn.blocks if isinstance(block, Skipped)]
    assert len(missing) == 2
    assert all("cannot be described again" in one.reason for one in missing)
    assert "omnieval baseline" in missing[0].reason
    assert len(drawn.blocks) == 6


def test_descriptors_that_decide_otherwise_are_not_drawn(replay):
    other = replace(replay, steps=replay.steps.with_columns(best_frame=pl.col("best_frame") * 0 + 1))
    with DescriptorCache() as cache:
        drawn = draw_replay(other, [], cache, step=None, figures=False)
        blocks = draw_replay(other, [], cache, step=None, figures=True).blocks
    assert drawn.batch is None
    assert sum("replay the sequence again" in block.reason for block in blocks if isinstance(block, Skipped)) == 2


def test_other_images_than_the_replays_are_refused(replay):
    renamed = replace(replay, steps=replay.steps.with_columns(file=pl.col("file").str.replace("image7", "other")))
    with DescriptorCache() as cache, pytest.raises(ResultError, match="not those of the replay any more"):
        list(descriptions(renamed, cache))
