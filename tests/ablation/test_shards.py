"""Shards of a sweep, and the whole that they are merged to."""

import json
import shutil

import polars as pl
import pytest

import omnieval
from omnieval.ablation.grid import parse_axis
from omnieval.ablation.jobs import dataset_key
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import run_plan
from omnieval.ablation.shards import Shard, shard_of
from omnieval.ablation.tree import plant, shares, weight
from omnieval.comparison.records import read_records
from omnieval.config import Setting
from omnieval.errors import ConfigError, ResultError
from tests.cli.test_cli import fails, in_process

BASE = [Setting(name, value, "test") for name, value in {"n_init": 10, "n_new": 10, "gamma": 1.0}.items()]
AXES = ("mapper=leader,roman2020", "radius=1,2,4", "omega=2.5,3.5")


@pytest.fixture(scope="module")
def plan(panoramas, tmp_path_factory):
    other = shutil.copytree(panoramas, tmp_path_factory.mktemp("tuned") / "other")
    return make_plan([panoramas], [parse_axis(axis) for axis in AXES], BASE, tune_on=[other])


@pytest.fixture(scope="module")
def whole(plan, tmp_path_factory):
    return run_plan(plan, out=tmp_path_factory.mktemp("shards") / "whole", tune_by="pair_f1")


@pytest.fixture(scope="module")
def halves(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("halves")
    return [
        run_plan(shard_of(plan, Shard(number, 2), "pair_f1"), out=folder / str(number), tune_by="pair_f1").folder
        for number in (1, 2)
    ]


def test_every_job_is_in_one_shard_with_its_tree(plan):
    for count in (1, 2, 3, 5, 20):
        shards = [shard_of(plan, Shard(number, count), "") for number in range(1, count + 1)]
        assert sorted(job.number for shard in shards for job in shard.jobs) == list(range(10))
        assert [shard_of(plan, Shard(1, count), "").jobs for _ in range(2)] == [shards[0].jobs] * 2


def test_trees_come_largest_first_and_go_to_who_has_least(plan):
    trees = plant(plan.jobs, [dataset_key(job) for job in plan.jobs], 2)
    sizes = [weight(tree) for tree in trees]
    assert sizes == sorted(sizes, reverse=True)
    assert [[len(tree) for tree in share] for share in shares(trees, 3)] == [[3], [3], [2, 2]]


def test_merged_shards_are_the_ablation_that_was_never_divided(halves, whole, tmp_path):
    for half in halves:
        assert pl.read_parquet(half / "ablation.parquet")["batch_silhouette"].null_count() == 5
        with pytest.raises(ResultError, match="is a shard"):
            read_records([half])
    merged = in_process("ablate", "--merge", *reversed(halves), "--out", "all", "--csv", cwd=tmp_path)
    assert (merged.returncode, merged.stderr) == (0, "")
    table = pl.read_parquet(tmp_path / "all" / "ablation.parquet")
    assert table.drop("seconds").equals(whole.table.drop("seconds"))
    told, expected = (json.loads((one / "run.json").read_text()) for one in (tmp_path / "all", whole.folder))
    different = {"started", "finished", "timings", "process", "content_hashes", "shards"}
    assert {name for name in told.keys() | expected if told.get(name) != expected.get(name)} <= different
    assert told["tuned"] == whole.tuned.to_dicts()
    assert whole.tuned.drop("dataset").equals(pl.DataFrame(told["tuned"], infer_schema_length=None).drop("dataset"))


def test_what_cannot_be_merged_is_refused_with_its_number(halves, whole, tmp_path):
    one, two = halves

    def refused(*arguments, code=2, words):
        fails(in_process("ablate", "--merge", *arguments, "--out", "out", cwd=tmp_path), code, words)
        assert not (tmp_path / "out").exists()

    refused(two, words="of 2 shards 1 is missing")
    refused(one, one, words="named twice")
    again = shutil.copytree(one, tmp_path / "again")
    refused(one, again, words="shard 1 of 2 is there twice")
    refused(one, whole.folder, words="is not a shard")
    refused(one, two, "--set", "omega=2", words="leave --set out")
    refused(code=2, words="--out")
    manifest = json.loads((again / "run.json").read_text())
    (again / "run.json").write_text(json.dumps(manifest | {"status": "interrupted"}))
    refused(again, two, words=f"shard 1 of 2, {again}, is interrupted")
    (again / "run.json").write_text(json.dumps(manifest | {"keep_steps": True}))
    refused(again, two, words="are not of one plan: keep_steps is True and False")
    prints = dict.fromkeys(manifest["dataset_fingerprints"], "other")
    (again / "run.json").write_text(json.dumps(manifest | {"dataset_fingerprints": prints}))
    fails(in_process("ablate", "--merge", again, two, "--out", "other", cwd=tmp_path), 2, "the images of")
    (again / "run.json").write_text(json.dumps(manifest))
    next((again / "parts").iterdir()).unlink()
    refused(again, two, words="1 jobs are in no shard")


def test_without_the_images_the_rows_are_merged_and_the_reason_said(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    for number in (1, 2):
        omnieval.ablate(images, {"radius": [2, 4]}, mapper="leader", shard=f"{number}/2", out=tmp_path / str(number))
    shutil.rmtree(images)
    merged = in_process("ablate", "--merge", "1", "2", "--out", "all", "--json", cwd=tmp_path)
    assert merged.returncode == 0
    assert "batch_silhouette is missing" in merged.stderr
    assert [row["radius"] for row in json.loads(merged.stdout)["rows"]] == [2.0, 4.0]


def test_a_shard_goes_on_as_itself_or_as_the_whole(plan, whole, halves, tmp_path):
    folder = shutil.copytree(halves[0], tmp_path / "half")
    with pytest.raises(ResultError, match='shard was "1/2", now "2/2"'):
        run_plan(shard_of(plan, Shard(2, 2), "pair_f1"), out=folder, resume=True)
    grown = run_plan(plan, out=folder, resume=True, tune_by="pair_f1")
    assert grown.table.drop("seconds").equals(whole.table.drop("seconds"))


@pytest.mark.parametrize("text", ["", "2", "0/3", "4/3", "a/b", "1/0", "1/2/3"])
def test_a_shard_that_makes_no_sense_is_refused(text):
    with pytest.raises(ConfigError, match="expected NUMBER/OF"):
        Shard.parse(text)


def test_a_shard_records_no_best_run(plan, tmp_path):
    with pytest.raises(ConfigError, match="when the shards are merged"):
        run_plan(shard_of(plan, Shard(1, 2), ""), out=tmp_path / "out", record_best=True)
