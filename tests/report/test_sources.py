"""Folders of results are opened whatever their kind, and slips are named."""

import json
import shutil

import polars as pl
import pytest

from omnieval.errors import ResultError
from omnieval.material.source import Cut
from omnieval.report.published import PUBLISHED, route_of
from omnieval.report.sources import best_rows, open_sources
from tests.report.conftest import SMALL


def test_every_kind_is_recognised(run, sweep, baseline):
    sources = open_sources([sweep, baseline, run])
    assert [one.folder for one in sources.replays] == [run]
    assert [one.folder for one in sources.sweeps] == [sweep]
    assert [one.folder for one in sources.baselines] == [baseline]
    (replay,) = sources.replays
    assert (replay.title, replay.descriptor, replay.posed, replay.finished) == ("three-hog", "hog", True, True)
    assert len(replay.steps) == 80
    assert replay.nodes == replay.metrics["nodes"]
    assert replay.nodes > 1


def test_the_best_run_of_a_sweep_is_a_replay_with_its_own_parameters(sweep):
    (opened,) = open_sources([sweep]).sweeps
    (replay,) = opened.replays
    table = pl.read_parquet(sweep / "ablation.parquet")
    best = table.sort("silhouette", descending=True, maintain_order=True).row(0, named=True)
    assert replay.metrics["silhouette"] == best["silhouette"] == table["silhouette"].max()
    assert replay.config.settings["omega"] == best["omega"]
    assert replay.config.settings["merge_y"] == best["merge_y"]
    assert replay.config.settings["n_new"] == SMALL["n_new"]
    assert replay.cut == Cut()
    assert len(replay.steps) == 80


def test_a_sweep_that_was_stopped_shows_the_rows_it_came_to(sweep, tmp_path):
    stopped = tmp_path / "stopped"
    shutil.copytree(sweep, stopped)
    (stopped / "ablation.parquet").unlink()
    next((stopped / "parts").glob("00005-*.json")).unlink()
    (opened,) = open_sources([stopped]).sweeps
    assert opened.table["job"].to_list() == [0, 1, 2, 3, 4]


def test_the_best_rows_take_the_first_of_equals():
    table = pl.DataFrame(
        {
            "dataset": "d",
            "source": "s",
            "mapper": "roman2020",
            "descriptor": ["hog", "hog", "hog", "gist"],
            "silhouette": [0.1, 0.3, 0.3, None],
            "job": [0, 1, 2, 3],
        }
    )
    assert best_rows(table)["job"].to_list() == [1]


def test_what_is_no_result_is_refused_by_name(run, tmp_path):
    with pytest.raises(ResultError, match="nowhere is not a run folder"):
        open_sources([tmp_path / "nowhere"])
    with pytest.raises(ResultError, match="named twice"):
        open_sources([run, run / ".." / run.name])


@pytest.mark.parametrize(("kind", "words"), [("report", "is a report, not a replay"), ("photo", "is a photo")])
def test_other_kinds_are_refused(run, tmp_path, kind, words):
    other = tmp_path / "other"
    shutil.copytree(run, other)
    manifest = json.loads((other / "run.json").read_text())
    (other / "run.json").write_text(json.dumps(manifest | {"kind": kind}))
    with pytest.raises(ResultError, match=words):
        open_sources([other])


@pytest.mark.parametrize(
    ("which", "file", "words"),
    [
        ("run", "steps.parquet", "no steps yet"),
        ("baseline", "baseline.parquet", "no partitions yet"),
    ],
)
def test_what_is_still_empty_says_so(which, file, words, tmp_path, request):
    folder = tmp_path / "empty"
    shutil.copytree(request.getfixturevalue(which), folder)
    (folder / file).unlink()
    with pytest.raises(ResultError, match=words):
        open_sources([folder])


def test_a_damaged_table_and_unknown_parameters_are_named(run, baseline, tmp_path):
    damaged = tmp_path / "damaged"
    shutil.copytree(baseline, damaged)
    (damaged / "baseline.parquet").write_bytes(b"no table")
    with pytest.raises(ResultError, match="cannot read"):
        open_sources([damaged])
    foreign = tmp_path / "foreign"
    shutil.copytree(run, foreign)
    manifest = json.loads((foreign / "run.json").read_text())
    manifest["imaging"]["warp"] = 9
    (foreign / "run.json").write_text(json.dumps(manifest))
    with pytest.raises(ResultError, match="does not say what was run"):
        open_sources([foreign])


@pytest.mark.parametrize(
    ("source", "route"),
    [
        ("cold:/data/cold-freiburg/part_a/seq2_cloudy3", "Freiburg"),
        ("cold:/data/COLD-Saarbrucken/part_b/seq4_cloudy1", "Saarbrücken"),
        ("cold:/data/cold-freiburg/part_a/seq2_night1", None),
        ("innova:/data/route", "INNOVA"),
        ("folder:/data/cold-freiburg/seq2_cloudy3", None),
        ("synthetic:cloudy", None),
    ],
)
def test_the_papers_routes_are_recognised_by_their_source(source, route):
    assert route_of(source) == route


def test_every_route_was_published_with_both_descriptors():
    assert len({(one.route, one.descriptor) for one in PUBLISHED}) == len(PUBLISHED) == 6
    assert {str(one.batch_silhouette) for one in PUBLISHED} == {"0.13", "0.15", "0.38", "0.25"}
