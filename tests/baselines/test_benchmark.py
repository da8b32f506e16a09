"""Baselines over a sequence: one row per partition, the metrics of a replay, a folder that is never half-written."""

import json
import shutil

import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.archiving import describe_archive
from omnieval.benchmark import run_baseline
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.metrics import evaluation
from omnieval.metrics.evaluation import METRICS, Evaluation
from omnieval.results.manifest import read_manifest
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import PARTITIONS


@pytest.fixture(scope="module")
def archive(panoramas, tmp_path_factory):
    file = tmp_path_factory.mktemp("archives") / "three.npz"
    describe_archive(omnieval.load(panoramas), file)
    return file


def manifest(folder):
    return json.loads((folder / "run.json").read_text())


@pytest.mark.parametrize("method", ["spectral", "kmeans", "agglomerative", "positions"])
def test_three_places_are_found_from_images(panoramas, method, tmp_path):
    table = omnieval.baseline(panoramas, method=method, ks=[2, 3, 4], out=tmp_path / "out")
    assert table.schema == PARTITIONS
    assert table["k"].to_list() == table["nodes"].to_list() == [2, 3, 4]
    best = table.row(1, named=True)
    assert best["rooms_ari"] == best["rooms_purity"] == 1.0
    assert best["silhouette"] == pytest.approx(best["silhouette_positions"])
    assert best["silhouette"] > best["silhouette_time_slices"]
    assert (table["seconds"] > 0).all()


def test_the_table_on_disk_is_the_table(archive, tmp_path):
    run = run_baseline(archive, ks=[3], out=tmp_path / "out")
    assert pl.read_parquet(run.folder / "baseline.parquet").equals(run.table)
    row = run.table.row(0, named=True)
    assert (row["dataset"], row["descriptor"], row["method"]) == ("three", "archive", "spectral")
    assert row["similarity"] == "gaussian-median"
    assert read_manifest(run.folder, "baseline")["status"] == "complete"
    assert manifest(run.folder) == run.manifest
    assert sorted(path.name for path in run.folder.iterdir()) == ["baseline.parquet", "run.json"]


def test_images_and_their_archive_have_the_same_rows(panoramas, archive, tmp_path):
    names = ["k", *METRICS]
    images = omnieval.baseline(panoramas, ks=[3, 8], out=tmp_path / "images")
    assert images.select(names).equals(omnieval.baseline(archive, ks=[3, 8], out=tmp_path / "archive").select(names))


def test_a_row_is_the_same_alone_and_among_others_and_twice(archive, tmp_path):
    def rows(name, ks):
        return omnieval.baseline(archive, ks=ks, out=tmp_path / name).drop("seconds").filter(pl.col("k") == 6)

    assert rows("one", [6]).equals(rows("many", [2, 6, 30]))
    first, second = (run_baseline(archive, ks=[2, 7], out=tmp_path / name) for name in "ab")
    assert first.table.drop("seconds").equals(second.table.drop("seconds"))
    assert first.manifest["identity"] == second.manifest["identity"]


def test_two_to_forty_clusters_by_default_and_no_more_than_images(panoramas, archive, tmp_path):
    assert omnieval.baseline(archive, method="time-slices", out=tmp_path / "all")["k"].to_list() == list(range(2, 41))
    short = omnieval.load(panoramas).cut(limit=12)
    assert omnieval.baseline(short, method="time-slices", out=tmp_path / "short")["k"].to_list() == list(range(2, 13))


def test_time_slices_and_positions_are_the_controls_of_the_metrics(archive, tmp_path):
    slices = omnieval.baseline(archive, method="time-slices", ks=[3, 7], out=tmp_path / "slices")
    assert slices["silhouette"].to_list() == slices["silhouette_time_slices"].to_list()
    positions = omnieval.baseline(archive, method="positions", ks=[3, 7], out=tmp_path / "positions")
    assert positions["silhouette"].to_list() == positions["silhouette_positions"].to_list()


def test_the_rooms_agree_with_themselves(archive, tmp_path):
    row = omnieval.baseline(archive, method="rooms", out=tmp_path / "out").row(0, named=True)
    assert (row["k"], row["nodes"], row["similarity"]) == (None, 3, None)
    assert row["rooms_ari"] == row["rooms_nmi"] == 1.0


def test_as_many_clusters_as_a_run_has_nodes(archive, tmp_path):
    config = omnieval.configure(n_init=10, n_new=10, gamma=1.0, omega=3.5, merge_y=0.5)
    run = omnieval.replay(archive, config=config, out=tmp_path / "run")
    nodes = run.metrics["nodes"]
    alone = omnieval.baseline(archive, at_k_of=run.folder, out=tmp_path / "alone")
    assert alone["k"].to_list() == [nodes]
    both = omnieval.baseline(archive, ks=[20], at_k_of=run.folder, out=tmp_path / "both")
    assert both["k"].to_list() == [nodes, 20]
    assert alone["silhouette_time_slices"][0] == run.metrics["silhouette_time_slices"]
    assert alone["silhouette_positions"][0] == run.metrics["silhouette_positions"]


def test_without_poses_and_rooms_metrics_are_null_with_a_reason(tmp_path):
    points = np.random.default_rng(0).normal(size=(30, 4)).astype(np.float32)
    np.savez(tmp_path / "bare.npz", position=points, orientation=points.reshape(30, 2, 2))
    run = run_baseline(tmp_path / "bare.npz", ks=[2, 3], out=tmp_path / "out")
    assert run.table["silhouette"].null_count() == run.table["rooms_ari"].null_count() == 2
    assert "no poses" in run.manifest["null_reasons"]["silhouette"]
    assert "no room labels" in run.manifest["null_reasons"]["rooms_ari"]
    for method, lack in (("positions", "no poses"), ("rooms", "no room labels")):
        with pytest.raises(DatasetError, match=lack):
            run_baseline(tmp_path / "bare.npz", method=method, out=tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "spectal"}, "did you mean spectral"),
        ({"similarity": "gaussian"}, "did you mean gaussian-median"),
        ({"method": "kmeans", "similarity": "knn"}, "uses no similarity"),
        ({"method": "rooms", "ks": [3]}, "takes no number of clusters"),
        ({"ks": [0, 3]}, "must be 1 or more, got 0, 3"),
        ({"ks": []}, "got none"),
        ({"ks": [3, 81]}, "81 clusters need as many images, there are 80"),
    ],
)
def test_slips_are_told_before_anything_is_written(archive, options, words, tmp_path):
    with pytest.raises(ConfigError, match=words):
        run_baseline(archive, out=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_only_a_baseline_is_overwritten_and_only_when_asked(archive, tmp_path):
    out = tmp_path / "out"
    run_baseline(archive, ks=[2, 3], out=out)
    with pytest.raises(ResultError, match="holds a baseline already"):
        run_baseline(archive, ks=[4], out=out)
    assert run_baseline(archive, ks=[4], out=out, overwrite=True).table["k"].to_list() == [4]
    run = tmp_path / "run"
    omnieval.replay(archive, config=omnieval.configure(n_init=10), out=run)
    with pytest.raises(ResultError, match="not a baseline"):
        run_baseline(archive, ks=[4], out=run, overwrite=True)
    assert len(open_run(run).steps) == 80


@pytest.mark.parametrize(
    ("stop", "status", "reason"),
    [
        (KeyboardInterrupt(), "interrupted", "interrupted by the user"),
        (DatasetError("gone"), "failed", "gone"),
        (MemoryError("24 GiB"), "failed", "MemoryError: 24 GiB"),
        (np.linalg.LinAlgError("no convergence"), "failed", "LinAlgError: no convergence"),
    ],
)
def test_a_baseline_that_is_stopped_keeps_its_rows_and_says_so(archive, stop, status, reason, tmp_path, monkeypatch):
    whole: list[Evaluation] = []

    def evaluate(*arguments, **options):
        if len(whole) == 2:
            raise stop
        whole.append(evaluation.evaluate(*arguments, **options))
        return whole[-1]

    monkeypatch.setattr("omnieval.benchmark.evaluate", evaluate)
    with pytest.raises(type(stop)):
        run_baseline(archive, ks=[2, 3, 4], out=tmp_path / "out")
    assert (manifest(tmp_path / "out")["status"], manifest(tmp_path / "out")["reason"]) == (status, reason)
    assert pl.read_parquet(tmp_path / "out" / "baseline.parquet")["k"].to_list() == [2, 3]
    monkeypatch.undo()
    assert len(omnieval.baseline(archive, ks=[2, 3, 4], out=tmp_path / "out", overwrite=True)) == 3


def test_paths_may_be_text_and_start_at_home(archive, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run_baseline(archive, ks=[3], out="~/out").folder == tmp_path / "out"


@pytest.mark.parametrize(
    "options", [{}, {"similarity": "local-scaling"}, {"similarity": "knn"}, {"method": "agglomerative"}], ids=str
)
def test_too_many_images_for_all_pairs_are_refused_before_the_work(panoramas, tmp_path, monkeypatch, options):
    def refuse(*arguments, **options):
        raise AssertionError("images were described although there are too many")

    monkeypatch.setattr("omnieval.baselines.similarity.MOST_IMAGES", 79)
    monkeypatch.setattr("omnieval.benchmark._describe", refuse)
    with pytest.raises(ConfigError, match="80 images are too many for the similarities of all pairs") as caught:
        run_baseline(panoramas, **options, out=tmp_path / "out")
    assert caught.value.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_many_images_are_clustered_by_a_sparse_graph_which_is_said(archive, tmp_path, monkeypatch, caplog):
    dense = run_baseline(archive, similarity="knn", ks=[3], out=tmp_path / "dense")
    monkeypatch.setattr("omnieval.baselines.similarity.MANY_IMAGES", 79)
    monkeypatch.setattr("omnieval.baselines.similarity.MOST_IMAGES", 79)
    run = run_baseline(archive, ks=[3], out=tmp_path / "sparse")
    assert "80 images are many; the similarity is a sparse graph of neighbours (knn)" in caplog.text
    assert run.table["similarity"].to_list() == ["knn"]
    assert run.manifest["baseline"]["similarity"] == "knn"
    assert run.table["silhouette"].to_list() == pytest.approx(dense.table["silhouette"].to_list())
    with pytest.raises(ConfigError, match="takes more with the similarity knn"):
        run_baseline(archive, similarity="local-scaling", ks=[3], out=tmp_path / "refused")


@pytest.mark.parametrize("method", ["kmeans", "time-slices", "positions", "rooms"])
def test_methods_that_need_no_pairs_take_any_number_of_images(archive, tmp_path, monkeypatch, method):
    monkeypatch.setattr("omnieval.baselines.similarity.MOST_IMAGES", 10)
    ks = None if method == "rooms" else [3]
    assert len(omnieval.baseline(archive, method=method, ks=ks, out=tmp_path / "out")) == 1


def test_images_that_are_not_fit_for_use_are_left_out_when_asked(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    (images / "image33.png").write_bytes(b"")
    with pytest.raises(DatasetError, match=r"image33\.png"):
        run_baseline(images, ks=[3], out=tmp_path / "refused")
    run = run_baseline(images, ks=[3], skip_bad=True, out=tmp_path / "out")
    assert [bad["file"] for bad in run.manifest["skipped"]] == ["image33.png"]
    assert run.manifest["frames"] == 79
    mapped = omnieval.replay(images, mapper="leader", skip_bad=True, out=tmp_path / "run")
    assert run.manifest["dataset_fingerprint"] == mapped.manifest["dataset_fingerprint"]
    beside = run_baseline(images, at_k_of=mapped.folder, method="time-slices", skip_bad=True, out=tmp_path / "beside")
    assert beside.table["k"].to_list() == [mapped.metrics["nodes"]]
    assert beside.table["silhouette"].to_list() == [mapped.metrics["silhouette_time_slices"]]


def test_another_descriptor_is_called_by_its_name_and_known_by_its_identity(panoramas, tmp_path):
    one, other = (
        run_baseline(panoramas, ks=[3], config=omnieval.configure({"gist.orientations": count}, descriptor="gist"),
                     out=tmp_path / str(count))
        for count in (4, 8)
    )  # fmt: skip
    assert one.table["descriptor"].to_list() == ["gist"]
    assert one.manifest["dataset_fingerprint"] == other.manifest["dataset_fingerprint"]
    assert one.manifest["descriptor"]["identity"] != other.manifest["descriptor"]["identity"]
    assert one.manifest["identity"] != other.manifest["identity"]
