"""An ablation: each row is that of an independent replay, whatever the processes, and however often it was stopped."""

import json
import os
from pathlib import Path

import polars as pl
import pytest

import omnieval
from omnieval.ablation.driver import best_run
from omnieval.ablation.grid import parse_axis
from omnieval.ablation.jobs import describe
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import job_states, run_plan
from omnieval.ablation.summary import best_and_median
from omnieval.config import Setting
from omnieval.datasets.cachedir import cache_dir
from omnieval.descriptors.stored import StoredDescriptions
from omnieval.errors import ConfigError, ResultError
from omnieval.material.opening import opened
from omnieval.metrics.evaluation import METRICS
from omnieval.report.evidence import position_descriptors
from omnieval.report.sources import open_sources
from omnieval.results.manifest import read_manifest
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import ablation_schema
from tests.results.test_inside import report

BASE = {"n_init": 10, "n_new": 10, "gamma": 1.0}
AXES = {"omega": "0.5:3.5:3", "merge_y": [0.5, 20, 1000]}


def plan_of(panoramas, axes=("omega=0.5,3.5", "merge_y=0.5,20,1000"), **changes):
    settings = [Setting(name, value, "test") for name, value in {**BASE, **changes}.items()]
    return make_plan([panoramas], [parse_axis(axis) for axis in axes], settings)


def part_of(folder, job):
    (part,) = (folder / "parts").glob(f"{job:05d}-*.json")
    return part


def results(table):
    return table.drop("seconds")


def stop_after(jobs):
    """A progress callback that presses Ctrl-C when so many jobs of the six have ended."""

    def progress(done, total):
        if total == 6 and done == jobs:
            raise KeyboardInterrupt

    return progress


@pytest.fixture(scope="module")
def ablation(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("ablations") / "whole"
    return run_plan(plan_of(panoramas), out=out, keep_steps=True, csv=True, record_best=True)


def test_the_table_has_its_schema_and_order(ablation, panoramas):
    table = ablation.table
    assert table.schema == ablation_schema(plan_of(panoramas).grid["types"])
    assert table["job"].to_list() == list(range(6))
    assert list(zip(table["omega"], table["merge_y"], strict=True)) == [
        (omega, merge_y) for omega in (0.5, 3.5) for merge_y in (0.5, 20, 1000)
    ]
    assert table["n_new"].unique().to_list() == [10]
    assert (table["seconds"] > 0).all()
    assert ablation.failed == 0
    assert pl.read_parquet(ablation.folder / "ablation.parquet").equals(table)
    assert len(pl.read_csv(ablation.folder / "ablation.csv")) == 6
    assert not (ablation.folder / "descriptors").exists()


def test_jobs_read_descriptors_in_the_cache_and_without_one_come_to_the_same(
    ablation, panoramas, tmp_path, monkeypatch
):
    with opened(panoramas, omnieval.configure()) as material:
        described = describe(material, tmp_path / "own")
    assert isinstance(described.descriptions, StoredDescriptions)
    assert {Path(one).parents[2] for one in described.descriptions.segments} == {cache_dir()}
    assert not (tmp_path / "own").exists()
    monkeypatch.setenv("OMNIEVAL_CACHE", "/dev/null/none")
    table = run_plan(plan_of(panoramas), out=tmp_path / "out").table
    assert results(table).equals(results(ablation.table))
    assert not (tmp_path / "out" / "descriptors").exists()


def test_every_row_is_that_of_an_independent_replay(ablation, panoramas, tmp_path):
    assert ablation.table["nodes"].n_unique() > 1
    for row in ablation.table.iter_rows(named=True):
        config = omnieval.configure(BASE, omega=row["omega"], merge_y=row["merge_y"])
        run = omnieval.replay(panoramas, config=config, out=tmp_path / str(row["job"]))
        assert {name: row[name] for name in METRICS} == run.metrics
        margin = run.manifest["smallest_margin"]
        assert (row["smallest_margin"], row["smallest_margin_frame"]) == (margin["value"], margin["frame"])
        steps = pl.read_parquet(ablation.folder / "steps" / f"{part_of(ablation.folder, row['job']).stem}.parquet")
        assert steps.drop("milliseconds").equals(run.steps.drop("milliseconds"))


def test_batch_clustering_stands_beside_at_the_same_number_of_nodes(ablation, panoramas, tmp_path):
    ks = sorted(set(ablation.table["nodes"]))
    batch = omnieval.baseline(panoramas, ks=ks, out=tmp_path / "batch")
    expected = dict(batch.select("k", "silhouette").iter_rows())
    for nodes, silhouette in ablation.table.select("nodes", "batch_silhouette").iter_rows():
        assert silhouette == pytest.approx(expected[nodes])


def test_the_best_run_is_recorded(ablation):
    best = ablation.table.row(best_run(ablation.table), named=True)
    assert best["silhouette"] == ablation.table["silhouette"].max()
    run = open_run(ablation.folder / "best")
    assert run.recording.exists()
    assert run.metrics["silhouette"] == best["silhouette"]


def test_the_summary_names_best_and_median(ablation):
    summary = best_and_median(ablation.table, ["omega", "merge_y"])
    assert len(summary) == 1
    row = summary.row(0, named=True)
    assert (row["runs"], row["failed"]) == (6, 0)
    assert row["silhouette"] == ablation.table["silhouette"].max()
    assert row["median_silhouette"] == ablation.table["silhouette"].median()
    best = ablation.table.filter(pl.col("omega") == row["omega"], pl.col("merge_y") == row["merge_y"])
    assert best["silhouette"][0] == row["silhouette"]


def test_processes_change_nothing_but_the_seconds(ablation, panoramas, tmp_path):
    table = omnieval.ablate(panoramas, AXES, settings=BASE, jobs=2, out=tmp_path / "two")
    assert results(table).equals(results(ablation.table))


def test_an_interrupted_ablation_resumes_to_the_same_table(ablation, panoramas, tmp_path):
    out = tmp_path / "interrupted"
    with pytest.raises(KeyboardInterrupt):
        run_plan(plan_of(panoramas), out=out, progress=stop_after(2))
    assert read_manifest(out, "ablation")["status"] == "interrupted"
    assert sorted(path.name for path in out.iterdir()) == ["parts", "run.json"]
    states = [state for _, state in job_states(plan_of(panoramas), out, keep_steps=False)]
    kept = states.count("done")
    assert 2 <= kept < 6
    before = {path: path.read_bytes() for path in (out / "parts").iterdir()}
    assert len(before) == kept
    resumed = run_plan(plan_of(panoramas), out=out, resume=True)
    assert results(resumed.table).equals(results(ablation.table))
    assert all(path.read_bytes() == content for path, content in before.items())
    assert read_manifest(out, "ablation")["status"] == "complete"


def test_ctrl_c_ends_processes_too(panoramas, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run_plan(plan_of(panoramas), jobs=2, out=tmp_path / "out", progress=stop_after(1))
    assert read_manifest(tmp_path / "out", "ablation")["status"] == "interrupted"
    assert any((tmp_path / "out" / "parts").iterdir())


def test_a_damaged_part_is_run_again(ablation, panoramas, tmp_path):
    first = run_plan(plan_of(panoramas), out=tmp_path / "out")
    part_of(first.folder, 3).write_text('{"job": 3, "nod')
    states = [state for _, state in job_states(plan_of(panoramas), first.folder, keep_steps=False)]
    assert states == ["done"] * 3 + ["not started"] + ["done"] * 2
    assert results(run_plan(plan_of(panoramas), out=first.folder, resume=True).table).equals(results(ablation.table))


def out_of_memory(*arguments):
    raise MemoryError("Unable to allocate 12 GiB")


def end_the_process(*arguments):
    os._exit(9)


@pytest.mark.parametrize(
    ("jobs", "batch", "reason"),
    [
        (1, out_of_memory, "MemoryError: Unable to allocate 12 GiB"),
        (2, end_the_process, "a worker process was killed, perhaps for lack of memory"),
    ],
)
def test_a_finished_sweep_is_not_lost_with_what_stands_beside_it(
    ablation, panoramas, tmp_path, monkeypatch, jobs, batch, reason
):
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr("omnieval.ablation.crew.batch_silhouettes", batch)
        lacking = run_plan(plan_of(panoramas), out=out, jobs=jobs, csv=True)
    assert lacking.lacking == reason
    assert lacking.table["batch_silhouette"].null_count() == 6
    assert results(lacking.table).equals(
        results(ablation.table.with_columns(batch_silhouette=pl.lit(None, pl.Float64)))
    )
    assert pl.read_parquet(out / "ablation.parquet").equals(lacking.table)
    content = read_manifest(out, "ablation")
    assert (content["status"], content["null_reasons"]) == ("complete", {"batch_silhouette": reason})
    resumed = run_plan(plan_of(panoramas), out=out, resume=True)
    assert results(resumed.table).equals(results(ablation.table))
    assert read_manifest(out, "ablation")["null_reasons"] == {}


def test_the_table_is_there_before_what_stands_beside_it(panoramas, tmp_path, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("omnieval.ablation.driver.Work.with_batch", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run_plan(plan_of(panoramas), out=tmp_path / "out")
    assert read_manifest(tmp_path / "out", "ablation")["status"] == "interrupted"
    assert len(pl.read_parquet(tmp_path / "out" / "ablation.parquet")) == 6


@pytest.fixture
def small(panoramas, tmp_path):
    out = tmp_path / "small"
    run_plan(plan_of(panoramas, ["omega=2.5,3.5"]), out=out)
    return out


def test_another_grid_is_refused_by_name(small, panoramas):
    with pytest.raises(ResultError, match=r"grid\.axes\.omega was \[2\.5, 3\.5\], now \[2\.5\]"):
        run_plan(plan_of(panoramas, ["omega=2.5"]), out=small, resume=True)
    with pytest.raises(ResultError, match=r"grid\.parameters\.n_new was 10, now 12"):
        run_plan(plan_of(panoramas, ["omega=2.5,3.5"], n_new=12), out=small, resume=True)
    with pytest.raises(ResultError, match="keep_steps was false, now true"):
        run_plan(plan_of(panoramas, ["omega=2.5,3.5"]), out=small, resume=True, keep_steps=True)


@pytest.mark.parametrize(("name", "value"), [("code", "other"), ("versions", {"omnieval": "0.0.1"})])
def test_other_code_is_refused_by_name(small, panoramas, name, value):
    manifest = small / "run.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {name: value}))
    with pytest.raises(ResultError, match=f"cannot be resumed: {name}"):
        run_plan(plan_of(panoramas, ["omega=2.5,3.5"]), out=small, resume=True)


def test_another_dataset_is_refused_by_name(small, panoramas):
    manifest = small / "run.json"
    content = json.loads(manifest.read_text())
    content["dataset_fingerprints"] = dict.fromkeys(content["dataset_fingerprints"], "other")
    manifest.write_text(json.dumps(content))
    with pytest.raises(ResultError, match=r"dataset_fingerprints\.folder:.* was \"other\""):
        run_plan(plan_of(panoramas, ["omega=2.5,3.5"]), out=small, resume=True)
    assert json.loads(manifest.read_text()) == content
    assert not (small / "descriptors").exists()


def test_what_was_never_started_is_started_by_resuming(panoramas, tmp_path):
    plan = plan_of(panoramas, ["omega=2.5"])
    (tmp_path / "empty").mkdir()
    for out in (tmp_path / "none", tmp_path / "empty"):
        assert len(run_plan(plan, out=out, resume=True).table) == 1
        assert read_manifest(out, "ablation")["status"] == "complete"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(ResultError, match="not an ablation of omnieval"):
        run_plan(plan, out=tmp_path / "mine", resume=True)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]


def test_nothing_is_replaced_unasked(small, panoramas):
    plan = plan_of(panoramas, ["omega=2.5"])
    with pytest.raises(ResultError, match="--overwrite"):
        run_plan(plan, out=small)
    assert len(run_plan(plan, out=small, overwrite=True).table) == 1
    assert [path.name[:6] for path in (small / "parts").iterdir()] == ["00000-"]
    with pytest.raises(ConfigError, match="--resume"):
        run_plan(plan, resume=True)
    with pytest.raises(ConfigError, match="--jobs"):
        run_plan(plan, jobs=0)


def test_an_ablation_written_anew_has_no_best_run_or_report_of_before(small, panoramas):
    plan = plan_of(panoramas, ["omega=2.5"])
    run_plan(plan, out=small, overwrite=True, record_best=True, keep_steps=True, csv=True)
    for folder in (small, small / "best"):
        report(folder / "report")
    (small / "best" / "notes.txt").write_text("mine")
    (small / "descriptors" / "0").mkdir(parents=True)
    (small / "descriptors" / "0" / "position.npy").write_bytes(b"of a killed one")
    run_plan(plan, out=small, overwrite=True)
    left = sorted(path.relative_to(small).as_posix() for path in small.rglob("*") if path.is_file())
    part = part_of(small, 0).relative_to(small).as_posix()
    assert left == ["ablation.parquet", "best/notes.txt", part, "run.json"]


def test_descriptors_of_an_archive_are_those_of_no_component(panoramas, tmp_path):
    archive = tmp_path / "three.npz"
    omnieval.describe_archive(panoramas, archive)
    out = tmp_path / "out"
    table = omnieval.ablate([panoramas, archive], {"omega": [2.5, 3.5]}, settings=BASE, out=out, keep_steps=True)
    assert table["descriptor"].to_list() == ["hog", "hog", "archive", "archive"]
    assert table["hog.bins"].to_list() == [16, 16, None, None]
    assert table["silhouette"].to_list()[:2] == table["silhouette"].to_list()[2:]
    run = omnieval.replay(archive, config=BASE, omega=2.5, out=tmp_path / "run")
    assert run.metrics["silhouette"] == table["silhouette"][2]
    alone = omnieval.ablate(archive, {"omega": [2.5]}, settings=BASE, out=tmp_path / "alone", record_best=True)
    assert alone["descriptor"].to_list() == ["archive"]
    assert open_run(tmp_path / "alone" / "best").manifest["descriptor"]["name"] == "archive"
    with pytest.raises(ConfigError, match="leave the descriptor out"):
        omnieval.ablate(archive, descriptor="hog,gist", settings=BASE, out=tmp_path / "refused")
    (sweep,) = open_sources([out]).sweeps
    assert len(sweep.replays) == 2
    assert all(len(position_descriptors(one)) == 80 for one in sweep.replays)


@pytest.mark.parametrize("axes", [{"mapper": "roman2020,leader"}, {"mapper": ["leader", "roman2020"]}])
def test_components_are_axes_and_a_parameter_is_that_of_one(panoramas, tmp_path, axes):
    vary = {"omega": [2.5, 3.5], "radius": [2, 4, 6]}
    table = omnieval.ablate(panoramas, vary, **axes, descriptor="hog,gist", settings=BASE, out=tmp_path / "out")
    rows = set(table.select("mapper", "descriptor", "omega", "radius").iter_rows())
    assert len(rows) == len(table) == 10
    assert rows == {
        *(("roman2020", one, omega, None) for one in ("hog", "gist") for omega in (2.5, 3.5)),
        *(("leader", one, None, radius) for one in ("hog", "gist") for radius in (2, 4, 6)),
    }
    leader = omnieval.replay(panoramas, mapper="leader", descriptor="gist", radius=4, out=tmp_path / "run")
    (row,) = table.filter(mapper="leader", descriptor="gist", radius=4).iter_rows(named=True)
    assert {name: row[name] for name in METRICS} == leader.metrics


def test_too_many_images_for_batch_clustering_cost_no_row(ablation, panoramas, tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.baselines.similarity.MOST_IMAGES", 10)
    found = run_plan(plan_of(panoramas), out=tmp_path / "out")
    assert "80 images" in (found.lacking or "")
    assert found.table["batch_silhouette"].null_count() == 6
    assert read_manifest(tmp_path / "out", "ablation")["null_reasons"] == {"batch_silhouette": found.lacking}
    assert found.table.drop("seconds", "batch_silhouette").equals(ablation.table.drop("seconds", "batch_silhouette"))
    assert read_manifest(tmp_path / "out", "ablation")["status"] == "complete"
