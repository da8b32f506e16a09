"""The replay as a whole: tables that say what was decided, deterministic, causal, the same with or without a view."""

import dataclasses
import json
import math

import cv2
import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.archiving import describe_archive
from omnieval.datasets import load
from omnieval.datasets.sequence import Pose
from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.loop import replay
from omnieval.recording import RecordingOptions
from omnieval.render import render
from omnieval.results.run_folder import RunWriter, open_run
from omnieval.results.schemas import NODES, TRANSITIONS, steps_schema
from omnieval.results.tables import read_steps
from omnieval.wording import counted
from tests.testing.test_mapper import Slices

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "first"
    config = omnieval.configure(CONFIG)
    return replay(panoramas, config=config, out=out, recording=RecordingOptions())


def decisions(run):
    """The columns that two runs of the same images and components share to the bit."""
    return run.steps.drop("milliseconds")


def test_three_places_are_found_and_closed_again(run):
    assert run.status == "complete"
    verdicts = set(run.steps["verdict"])
    assert {"initial", "assigned", "no-candidate"} <= verdicts
    majority = run.steps.group_by("node_final", "room").len().group_by("node_final").agg(pl.col("len").max())
    assert majority["len"].sum() >= 0.95 * len(run.steps)
    assert run.metrics["nodes"] >= 3
    assert run.metrics["silhouette"] > 0.6 > run.metrics["silhouette_time_slices"]


def test_tables_have_their_schemas(run):
    assert run.steps.schema == steps_schema(run.method.columns)
    assert "centroid_shift" in run.steps.columns
    assert run.nodes.schema == NODES
    assert run.transitions.schema == TRANSITIONS


def test_the_tables_agree_with_each_other(run):
    steps, nodes = run.steps, run.nodes
    counted = steps.group_by("node_final").len().sort("node_final")
    present = nodes.filter(pl.col("merged").is_null()).sort("id")
    assert counted["node_final"].to_list() == present["id"].to_list()
    assert counted["len"].to_list() == present["images"].to_list()
    assert run.metrics["nodes"] == len(present)
    assert run.transitions["count"].sum() == (steps["node_final"].diff().drop_nulls() != 0).sum()
    shares = [value for name, value in run.metrics.items() if name.startswith("share_")]
    assert sum(shares) == pytest.approx(1.0)
    assert present["representative_frame"].to_list() == [
        frame for frame in present["representative_frame"] if steps["node_final"][frame] in present["id"]
    ]


def test_every_verdict_follows_from_the_numbers_beside_it(run):
    gamma = run.config.settings["gamma"]
    for (step, _), row in zip(read_steps(run.steps, run.method.columns), run.steps.iter_rows(named=True), strict=True):
        if row["verdict"] == "initial":
            continue
        node = step.compared("node")
        assert node is not None
        assert node.threshold == row["x_gate"]
        pairs = zip(node.of, node.values, strict=True)
        assert node.passing == tuple(one for one, ratio in pairs if ratio <= node.threshold)
        assert (row["best_frame"] is None) == (not node.passing)
        if row["verdict"] == "prominence":
            assert row["prominence_ratio"] < gamma
        if row["verdict"] == "assigned":
            assert row["peaks"] < 2 or row["prominence_ratio"] >= gamma
            assert row["centroid_shift"] <= row["centroid_bound"]
            assert row["node"] is not None
        assert step.margin is not None
        assert row["margin"] == step.margin.value >= 0


@pytest.mark.parametrize("merge_y", [0.5, 1000.0])
def test_a_new_node_merges_if_the_ratio_beside_it_is_small_enough(panoramas, tmp_path, merge_y):
    config = omnieval.configure(CONFIG | {"merge_y": merge_y})
    rows = list(replay(panoramas, config=config, out=tmp_path / "run").steps.iter_rows(named=True))
    compared = [row for row in rows if row["merge_ratio"] is not None]
    assert compared
    for row in compared:
        kinds = [event["kind"] for event in row["event"]]
        assert "created" in kinds
        assert ("merged" in kinds) == (row["merge_ratio"] <= merge_y)
    founding = next(row for row in rows if row["event"])
    assert founding["merge_ratio"] is None  # there was no other node


def test_a_second_replay_decides_the_same_and_reads_no_image(run, panoramas, tmp_path, monkeypatch):
    def refuse(_):
        raise AssertionError("an image was read although its description is cached")

    monkeypatch.setattr("omnieval.datasets.sequence.Frame.read", refuse)
    again = replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "again")
    assert decisions(again).equals(decisions(run))
    assert again.nodes.equals(run.nodes)
    assert again.metrics == run.metrics
    assert again.manifest["identity"] == run.manifest["identity"]


def test_the_identity_covers_what_determines_the_result(run, panoramas, tmp_path):
    other = replay(panoramas, config=omnieval.configure({**CONFIG, "merge_y": 0.1}), out=tmp_path / "parameter")
    shorter = replay(load(panoramas).cut(limit=70), config=omnieval.configure(CONFIG), out=tmp_path / "images")
    hog = Hog(HogSettings(bins=8))
    descriptor = replay(panoramas, config=omnieval.configure(CONFIG), descriptor=hog, out=tmp_path / "descriptor")
    identities = {one.manifest["identity"] for one in (run, other, shorter, descriptor)}
    assert len(identities) == 4


@pytest.mark.parametrize("limit", [11, 37, 64])
def test_steps_depend_on_earlier_frames_only(run, panoramas, tmp_path, limit):
    prefix = replay(load(panoramas).cut(limit=limit), config=omnieval.configure(CONFIG), out=tmp_path / "prefix")
    late = ("node_final", "placement", "forced")
    assert decisions(prefix).drop(late).equals(decisions(run).head(limit).drop(late))


def test_without_poses_position_metrics_are_null_with_a_reason(panoramas, tmp_path):
    for image in panoramas.glob("*.png"):
        (tmp_path / "bare").mkdir(exist_ok=True)
        (tmp_path / "bare" / image.name).write_bytes(image.read_bytes())
    config = omnieval.configure(CONFIG)
    run = replay(tmp_path / "bare", config=config, out=tmp_path / "run", recording=RecordingOptions())
    assert run.metrics["silhouette"] is None
    assert "no poses" in run.manifest["null_reasons"]["silhouette"]
    assert run.steps["x"].null_count() == len(run.steps)
    assert run.manifest["recording_failure"] is None
    assert run.recording.exists()


def test_poses_that_cannot_be_used_are_left_out_and_the_others_counted(panoramas, tmp_path):
    frames = list(load(panoramas).frames)
    for number, x in ((3, math.nan), (5, math.inf), (7, 1e9)):
        frames[number] = dataclasses.replace(frames[number], pose=Pose(x, 0.0, 0.0))
    frames[9] = dataclasses.replace(frames[9], pose=None)
    sequence = dataclasses.replace(load(panoramas), frames=tuple(frames))
    run = replay(sequence, config=omnieval.configure(CONFIG), out=tmp_path / "run")
    assert run.metrics["posed"] == 76
    assert run.metrics["silhouette"] is not None


def test_the_reason_tells_missing_poses_from_such_as_cannot_be_used(panoramas, tmp_path):
    frames = [dataclasses.replace(frame, pose=None) for frame in load(panoramas).frames]
    for number, x in ((3, math.nan), (5, math.inf), (7, 1e9)):
        frames[number] = dataclasses.replace(frames[number], pose=Pose(x, 0.0, 0.0))
    sequence = dataclasses.replace(load(panoramas), frames=tuple(frames))
    run = replay(sequence, config=omnieval.configure(CONFIG), out=tmp_path / "run")
    reason = (
        "77 of 80 images have no pose; 2 of 80 images have a pose that is not finite; "
        "1 of 80 images have a pose too far away to be metres"
    )
    assert run.metrics["silhouette"] is None
    assert run.manifest["null_reasons"]["silhouette"] == reason
    with pytest.raises(DatasetError, match=f"{reason}; method positions needs"):
        omnieval.baseline(sequence, method="positions", out=tmp_path / "baseline")


def test_the_mapper_alone_on_an_archive_decides_the_same(run, panoramas, tmp_path):
    archive = tmp_path / "three.npz"
    describe_archive(load(panoramas), archive)
    mapped = replay(f"npz:{archive}", config=omnieval.configure(CONFIG), out=tmp_path / "mapped")
    assert decisions(mapped).equals(decisions(run))
    assert mapped.metrics == run.metrics
    with pytest.raises(ResultError, match="exists"):
        describe_archive(load(panoramas), archive)
    with np.load(archive, allow_pickle=False) as arrays:
        assert set(arrays.files) == {"position", "orientation", "file", "xy", "yaw", "room", "time_ns"}


def test_without_evidence_the_decisions_and_the_map_are_the_same(run, panoramas, tmp_path):
    config = omnieval.configure(CONFIG)
    bare = replay(panoramas, config=config, out=tmp_path / "bare", evidence=False)
    said = ["frame", "verdict", "role", "node", "best_frame", "best_node", "shift", "node_final", "placement", "event"]
    assert bare.steps.select(said).equals(run.steps.select(said))
    assert bare.map.digest == run.map.digest
    assert bare.metrics == run.metrics
    assert bare.steps.select("x_gate", "similarity", "prominence_ratio", "margin").null_count().row(0) == (80,) * 4
    assert bare.manifest["evidence"] is False
    assert bare.manifest["identity"] != run.manifest["identity"]  # the tables are others


def test_evidence_that_is_needed_is_not_left_out(panoramas, tmp_path):
    with pytest.raises(ConfigError, match="the mapper leader decides by its evidence"):
        replay(panoramas, mapper="leader", out=tmp_path / "leader", evidence=False)
    with pytest.raises(ConfigError, match="a recording shows the evidence"):
        replay(panoramas, out=tmp_path / "recorded", recording=True, evidence=False)
    assert not list(tmp_path.iterdir())


def test_a_mapper_of_ones_own_is_replayed_recorded_and_rebuilt(run, panoramas, tmp_path):
    own = replay(panoramas, mapper=Slices(), out=tmp_path / "own", recording=RecordingOptions())
    assert (own.config.mapper.name, own.config.mapper.spec) == ("slices", "tests.testing.test_mapper:Slices")
    assert own.steps["node_final"].to_list() == [frame // 25 + 1 for frame in range(80)]
    assert own.metrics["nodes"] == len(own.nodes) == 4
    assert own.manifest["identity"] != run.manifest["identity"]
    assert own.manifest["recording_failure"] is None
    own.recording.unlink()
    assert render(own).exists()


def test_omnievals_mapper_may_be_given_too(run, panoramas, tmp_path):
    mapper = omnieval.Roman2020(omnieval.Roman2020Settings(**CONFIG))
    given = replay(panoramas, mapper=mapper, out=tmp_path / "given")
    assert given.manifest["mapper"] == run.manifest["mapper"]
    assert given.manifest["identity"] == run.manifest["identity"]
    assert decisions(given).equals(decisions(run))


def test_components_have_names_and_parameters_are_keywords(panoramas, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = {"radius": 4.0, "gist.levels": 1}
    run = replay(str(panoramas), config=settings, mapper="leader", descriptor="gist", start=2, limit=30)
    assert run.folder.as_posix() == "runs/three-places0-gist-leader"
    assert (run.config.settings["radius"], run.config.settings["gist.levels"]) == (4.0, 1)
    assert run.steps["file"].to_list() == [f"image{number}.png" for number in range(2, 32)]
    assert run.manifest["cut"] == {"start": 2, "stride": 1, "limit": 30}
    with pytest.raises(ConfigError, match="omega is a parameter of roman2020, which was not chosen"):
        replay(str(panoramas), mapper="leader", omega=2.0)
    assert "leader on gist" in run._repr_html_().replace("\n", " ")
    assert repr(run) == f"Run(runs/three-places0-gist-leader: complete, 30 frames, {counted(run.nodes.height, 'node')})"


def test_the_public_names_are_there(capsys):
    assert {"replay", "ablate", "check", "Mapper", "Roman2020", "Leader", "open_run"} <= set(dir(omnieval))
    for name in dir(omnieval):
        assert getattr(omnieval, name) is not None
    help(omnieval)
    assert "replay(source" in capsys.readouterr().out.replace("(\n        source", "(source")  # wrapped from 3.13 on
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = omnieval.nothing


def test_a_sequence_shorter_than_the_first_node_is_refused_before_anything_is_written(panoramas, tmp_path):
    with pytest.raises(ConfigError, match="needs n_init = 20 images but there are only 12"):
        replay(load(panoramas).cut(limit=12), out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_image_that_breaks_meanwhile_ends_the_run_but_keeps_its_steps(panoramas, tmp_path):
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in panoramas.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())

    def break_it(done, total):
        if done == 20:
            (copy / "image60.png").write_bytes(b"\x89PNG broken")

    with pytest.raises(DatasetError, match=r"image60\.png"):
        replay(copy, config=omnieval.configure(CONFIG), out=tmp_path / "run", progress=break_it)
    run = open_run(tmp_path / "run")
    assert run.status == "failed"
    assert "image60.png" in run.manifest["reason"]
    assert run.steps["frame"].to_list() == list(range(60))


def test_an_interrupted_run_keeps_its_steps(panoramas, tmp_path):
    def interrupt(done, total):
        if done == 42:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run", progress=interrupt)
    run = open_run(tmp_path / "run")
    assert (run.status, len(run.steps)) == ("interrupted", 42)
    shorter = replay(load(panoramas).cut(limit=42), config=omnieval.configure(CONFIG), out=tmp_path / "shorter")
    assert run.manifest["dataset_fingerprint"] == shorter.manifest["dataset_fingerprint"]
    assert render(run).exists()


def test_a_step_that_is_not_kept_is_not_in_the_fingerprint(panoramas, tmp_path, monkeypatch):
    kept = RunWriter.step

    def step(writer, row):
        if row["frame"] == 30:
            raise MemoryError
        kept(writer, row)

    with monkeypatch.context() as patch:
        patch.setattr(RunWriter, "step", step)
        with pytest.raises(MemoryError):
            replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run")
    run = open_run(tmp_path / "run")
    assert (run.status, len(run.steps)) == ("failed", 30)
    shorter = replay(load(panoramas).cut(limit=30), config=omnieval.configure(CONFIG), out=tmp_path / "shorter")
    assert run.manifest["dataset_fingerprint"] == shorter.manifest["dataset_fingerprint"]


def test_a_run_without_a_step_has_no_fingerprint(panoramas, tmp_path, monkeypatch):
    def step(writer, row):
        raise MemoryError

    monkeypatch.setattr(RunWriter, "step", step)
    with pytest.raises(MemoryError):
        replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run")
    assert "dataset_fingerprint" not in open_run(tmp_path / "run").manifest


def test_the_manifest_says_where_everything_comes_from(run, panoramas):
    manifest = json.loads((run.folder / "run.json").read_text())
    assert manifest["source"] == f"folder:{panoramas.resolve()}"
    assert manifest["mapper"]["settings"]["omega"] == 3.5
    assert {gate["name"] for gate in manifest["mapper"]["gates"]} >= {"node", "prominence", "centroid"}
    assert manifest["descriptor"]["name"] == "hog"
    assert manifest["camera"]["kind"] == "panoramic"
    assert manifest["versions"]["omnieval"] == omnieval.__version__
    assert manifest["smallest_margin"]["value"] == run.steps["margin"].min()


def test_an_image_of_another_size_in_the_middle_is_refused(panoramas, tmp_path):
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in panoramas.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    cv2.imwrite(str(copy / "image50.png"), np.zeros((32, 128), np.uint8))
    with pytest.raises(DatasetError, match=r"image50\.png is 128 x 32 pixels, most are 256 x 64"):
        replay(copy, config=omnieval.configure(CONFIG), out=tmp_path / "run")


def test_a_recording_that_fails_leaves_the_tables_as_they_are(run, panoramas, tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.sinks.RecordingSink.failure", "the viewer was lost")
    other = replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run", recording=RecordingOptions())
    assert decisions(other).equals(decisions(run))
    assert open_run(other.folder).manifest["recording_failure"] == "the viewer was lost"


def test_a_recording_that_cannot_be_opened_ends_the_run_before_it_began(panoramas, tmp_path):
    options = RecordingOptions(connect="rerun+http://127.0.0.1:1/proxy")
    with pytest.raises(ResultError):
        replay(panoramas, config=omnieval.configure(CONFIG), out=tmp_path / "run", recording=options)
    assert open_run(tmp_path / "run").status == "failed"
