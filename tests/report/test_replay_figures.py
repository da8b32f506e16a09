"""The figures of a replay show what its tables and descriptors say."""

import shutil
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.benchmark import run_baseline
from omnieval.errors import DatasetError, ResultError
from omnieval.mapping.roman2020.conditions import gate_threshold
from omnieval.mapping.step import Curves
from omnieval.metrics.silhouette import silhouettes
from omnieval.palette import node_color, node_shape
from omnieval.report.batch import SPECTRAL, batch_at, batch_figure, computed, recorded
from omnieval.report.curves import curve_rows, curves_figure, node_borders
from omnieval.report.evidence import (
    batch_curve,
    moments,
    position_descriptors,
    positions_of,
    step_again,
    telling_step,
)
from omnieval.report.figure import Skipped
from omnieval.report.maps import map_figure, progress_figure
from omnieval.report.replays import draw_replay
from omnieval.report.series import gate_figure, step_times, time_figure, visited_gates
from omnieval.report.sources import open_sources
from omnieval.results.summary import summary_fields
from tests.report.charts import figure_of, rows_of
from tests.report.conftest import SMALL, replay_of


@pytest.fixture(scope="session")
def replay(run):
    return open_sources([run]).replays[0]


@pytest.fixture(scope="session")
def described(replay):
    return position_descriptors(replay)


@pytest.fixture(scope="session")
def telling(replay):
    frame = telling_step(replay)
    assert frame is not None
    return step_again(replay, frame)


def passing(row):
    """The nodes that a row of the steps let in."""
    (asked,) = (one for one in row["comparisons"] if one["gate"] == "node")
    return [node for node, value in zip(asked["of"], asked["values"], strict=True) if value <= asked["threshold"]]


def skipped(drawn):
    """What a drawn replay left out: title and reason."""
    return {block.title: block.reason for block in drawn.blocks if isinstance(block, Skipped)}


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
    last = list(moments(replay))[-1]
    placed = replay.steps["placement"].is_in(["loop-closure", "founding", "pending"]).to_numpy()
    assert (last.labels[placed] == replay.steps["node_final"].fill_null(0).to_numpy()[placed]).all()
    assert (last.labels[~placed] == 0).all()


def test_nodes_and_silhouette_go_on_as_the_map_grows(replay):
    figure = progress_figure(replay)
    last = figure.data.row(-1, named=True)
    labels = list(moments(replay))[-1].labels
    placed = labels > 0
    assert last["nodes"] == len(np.unique(labels[placed]))
    assert last["silhouette"] == silhouettes(positions_of(replay.steps)[placed], labels[placed]).silhouette
    assert figure.data["nodes"][0] <= 1


def test_the_telling_step_is_the_loop_closure_with_the_most_candidate_images(replay, telling):
    step, labels = telling
    before = {moment.frame + 1: moment.labels for moment in moments(replay)}
    closed = replay.steps.filter(pl.col("verdict") == "assigned")
    images = {
        row["frame"]: int(np.isin(before[row["frame"]], passing(row)).sum()) for row in closed.iter_rows(named=True)
    }
    assert images[step.frame] == max(images.values())
    assert step.frame == min(frame for frame, count in images.items() if count == max(images.values()))
    assert len(step.curves.frames) == images[step.frame]
    assert (labels == before[step.frame]).all()


def test_the_curves_are_those_the_mapper_saw(replay, telling):
    step, labels = telling
    row = replay.steps.row(step.frame, named=True)
    curves = step.curves
    assert curves.frames[curves.best] == step.match.frame == row["best_frame"]
    assert curves.values["similarity"][curves.best] == row["similarity"]
    figure = curves_figure(replay, step, labels, chosen=False)
    data = figure.data
    assert data.filter("best")["image"].to_list() == [row["best_frame"]]
    assert data["peak"].sum() == row["peaks"]
    assert data.filter(pl.col("similarity") > 0)["node"].unique().sort().to_list() == sorted(passing(row))
    drawn = sorted(value["value"] for value in rows_of(figure) if "value" in value)
    assert drawn == sorted([*data["position"], *data["orientation"], *data["similarity"]])
    assert "most candidate images" in figure.caption
    assert "most candidate images" not in curves_figure(replay, step, labels, chosen=True).caption


def test_a_curve_by_hand():
    # Nodes 2 (images 0, 1), 1 (image 2) and 4 (images 3, 4); candidates are nodes 2 and 4.
    labels = np.array([2, 2, 1, 4, 4])
    curves = Curves(
        frames=np.array([0, 1, 3, 4]),
        slots=np.array([1, 2, 3, 4]),
        size=5,
        values={
            "similarity": np.array([0.01, 0.12, 0.04, 0.1]),
            "position": np.array([0.1, 0.4, 0.2, 0.3]),
            "orientation": np.array([0.1, 0.3, 0.2, 0.4]),
        },
        best=1,
    )
    rows = curve_rows(curves, labels)
    assert rows["image"].to_list() == [2, 0, 1, 3, 4]
    assert rows["similarity"].to_list() == [0.0, 0.01, 0.12, 0.04, 0.1]
    assert rows["peak"].to_list() == [False, False, True, False, True]
    assert rows["best"].to_list() == [False, False, True, False, False]
    assert [(one["node"], one["start"], one["end"]) for one in node_borders(labels)] == [
        (1, 0, 1),
        (2, 1, 3),
        (4, 3, 5),
    ]


def test_a_step_without_a_curve_is_refused(replay):
    with pytest.raises(ResultError, match="no node let it in"):
        step_again(replay, 0)
    with pytest.raises(ResultError, match="ends at step 79, it has no step 80"):
        step_again(replay, 80)


def test_the_gate_shows_each_number_of_nodes_the_replay_met(replay):
    figure = figure_of(gate_figure(replay))
    asked = [row for row in replay.steps["comparisons"].to_list() if any(one["gate"] == "node" for one in row)]
    assert figure.data["steps"].sum() == len(asked) > 0
    for nodes, x, _ in visited_gates(replay).iter_rows():
        assert x == gate_threshold(replay.config.settings["omega"], nodes)
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
    curve = batch_curve(described, positions_of(replay.steps), range(2, 9), seed=replay.config.seed)
    table = open_sources([baseline]).baselines[0].table
    assert curve["silhouette"].to_list() == table["silhouette"].to_list()
    assert curve["time_slices"].to_list() == pytest.approx(table["silhouette_time_slices"].to_list())
    assert batch_curve(described[:1], np.zeros((1, 2)), [1, 2], seed=0).is_empty()


def test_the_incremental_run_is_marked_at_its_nodes(replay, baseline):
    curves = recorded(open_sources([baseline]).baselines)
    figure = batch_figure(curves, [replay], "three places, hog")
    marks = [row for row in rows_of(figure) if row["method"] == "incremental"]
    assert {(mark["k"], mark["silhouette"]) for mark in marks} == {(replay.nodes, replay.metrics["silhouette"])}
    assert batch_at(curves, replay.nodes) == curves.table.filter(pl.col("k") == replay.nodes)["silhouette"][0]
    assert batch_at(curves, 999) is None
    assert baseline.name in figure.caption


def test_methods_are_told_apart_by_their_dashes_too(replay, described):
    curves = computed(batch_curve(described, positions_of(replay.steps), [2, 3], seed=0))
    encoding = batch_figure(curves, [], "x").chart.to_dict()["layer"][0]["encoding"]
    dashes = encoding["strokeDash"]["scale"]["range"]
    assert encoding["strokeDash"]["field"] == "method"
    assert len({tuple(dash) for dash in dashes}) == len(dashes) == 2
    assert curves.table["method"].unique(maintain_order=True).to_list()[0] == SPECTRAL


def test_a_replay_without_poses_says_what_is_missing(unposed):
    (replay,) = open_sources([unposed]).replays
    drawn = draw_replay(replay, [], step=None, figures=True)
    missing = skipped(drawn)
    assert set(missing) == {"The map at ten moments", "Batch clustering over the number of clusters"}
    assert all("no poses" in reason for reason in missing.values())
    assert drawn.batch is None


def test_a_replay_with_some_poses_is_drawn_and_judged_over_these(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    table = (images / "poses.csv").read_text().splitlines(keepends=True)
    (images / "poses.csv").write_text("".join(table[:3] + table[6:]))
    run = replay_of(images, tmp_path / "run")
    known = run.steps.drop_nulls("x")
    assert run.metrics["posed"] == len(known) == 77
    labels = known["node_final"].to_numpy()
    assert run.metrics["silhouette"] == silhouettes(known.select("x", "y").to_numpy(), labels).silhouette
    assert ("  images", "77 of 80 have a position: silhouettes are over these") in list(summary_fields(run.manifest))
    assert run.nodes["center_x"].null_count() == run.nodes["merged"].drop_nulls().len()
    (drawn,) = open_sources([run.folder]).replays
    assert skipped(draw_replay(drawn, [], step=None, figures=True)) == {}
    figure = figure_of(map_figure(drawn))
    assert "77 of 80 images have a position." in figure.caption
    assert {row["frame"] for row in rows_of(figure)} == {*range(80)} - {2, 3, 4}


@pytest.fixture
def copied(panoramas, tmp_path):
    """A folder of images that may be touched, and a replay of it."""
    images = tmp_path / "images"
    images.mkdir()
    for file in panoramas.iterdir():
        (images / file.name).write_bytes(file.read_bytes())
    return images, open_sources([replay_of(images, tmp_path / "run").folder]).replays[0]


def test_a_replay_whose_images_are_gone_is_drawn_from_its_tables(copied):
    images, replay = copied
    for file in images.iterdir():
        file.unlink()
    images.rmdir()
    with pytest.raises(DatasetError):
        position_descriptors(replay)
    drawn = draw_replay(replay, [], step=None, figures=True)
    missing = skipped(drawn)
    assert missing.pop("The nodes").startswith("it cannot be drawn: ")
    assert len(missing) == 2
    assert all("cannot be described again" in reason for reason in missing.values())
    assert len(drawn.blocks) == 7


@pytest.mark.parametrize("change", ["renamed", "another picture"])
def test_other_images_than_the_replays_are_refused(copied, change):
    images, replay = copied
    if change == "renamed":
        (images / "image7.png").rename(images / "image7b.png")
    else:
        (images / "image7.png").write_bytes((images / "image60.png").read_bytes())
    with pytest.raises(ResultError):
        position_descriptors(replay)
    drawn = draw_replay(replay, [], step=None, figures=True)
    missing = skipped(drawn)
    assert missing.pop("The nodes").startswith("it cannot be drawn: ")
    assert len(missing) == 2
    assert all("cannot be described again" in reason for reason in missing.values())


def test_evidence_that_was_not_decided_so_is_not_drawn(replay):
    other = replace(replay, steps=replay.steps.with_columns(best_frame=pl.col("best_frame") * 0 + 1))
    (reason,) = skipped(draw_replay(other, [], step=None, figures=True)).values()
    assert "replay the sequence again" in reason


def test_an_object_that_is_not_found_again_leaves_out_only_what_needs_it(panoramas, tmp_path):
    class Local:
        """A descriptor that no later process can make."""

        def describe(self, panorama):
            values = panorama[:4].mean(axis=1)
            return omnieval.Description(values, values[None])

    run = omnieval.replay(panoramas, mapper="leader", descriptor=Local(), out=tmp_path / "run", recording=None)
    drawn = draw_replay(open_sources([run.folder]).replays[0], [], step=None, figures=True)
    assert "Batch clustering over the number of clusters" in skipped(drawn)
    assert any(not isinstance(block, Skipped) for block in drawn.blocks)


def test_too_many_images_leave_out_the_batch_clustering_alone(replay, monkeypatch):
    monkeypatch.setattr("omnieval.baselines.similarity.MOST_IMAGES", 10)
    missing = skipped(draw_replay(replay, [], step=None, figures=True))
    assert set(missing) == {"Batch clustering over the number of clusters"}
    assert "80 images" in next(iter(missing.values()))


def test_another_mapper_has_the_figures_that_are_not_the_papers(panoramas, tmp_path):
    run = omnieval.replay(panoramas, mapper="leader", out=tmp_path / "run", recording=None)
    drawn = draw_replay(open_sources([run.folder]).replays[0], [], step=None, figures=True)
    titles = {block.title for block in drawn.blocks}
    assert "The gate x over the number of nodes" not in titles
    assert list(skipped(drawn).values()) == ["the mapper leader has none"]
    (times,) = (block for block in drawn.blocks if block.title == "Time per step")
    assert "of the paper" not in figure_of(times).caption


def test_only_a_baseline_of_images_described_in_the_same_way_stands_beside(replay, panoramas, baseline, tmp_path):
    def origin(folder):
        drawn = draw_replay(replay, open_sources([folder]).baselines, step=None, figures=True)
        (figure,) = (block for block in drawn.blocks if block.title.startswith("Batch clustering"))
        return figure_of(figure).caption

    assert "Taken from spectral." in origin(baseline)
    config = omnieval.configure({"hog.bins": 8})
    finer = run_baseline(panoramas, ks=[2, 3], config=config, out=tmp_path / "finer")
    assert "Taken from" not in origin(finer.folder)
    short = run_baseline(omnieval.load(panoramas).cut(limit=70), ks=[2], out=tmp_path / "short")
    assert "Taken from" not in origin(short.folder)


def test_a_replay_of_what_was_left_whole_is_drawn_whole(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    (images / "image40.png").write_bytes(b"")
    run = omnieval.replay(images, config=SMALL, skip_bad=True, out=tmp_path / "run")
    drawn = draw_replay(open_sources([run.folder]).replays[0], [], step=None, figures=True)
    assert skipped(drawn) == {}
    assert drawn.batch is not None
