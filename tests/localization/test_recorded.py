"""The recording of a localisation, compared with its table."""

from pathlib import Path

import polars as pl
import pytest

import omnieval
from omnieval.errors import DatasetError, ResultError
from omnieval.localization.recorded import record_localization
from omnieval.recording import viewer
from tests.cli.test_cli import in_process
from tests.recording.readback import column, rows_per_entity

SMALL = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture
def found(panoramas, tmp_path):
    """Every fourth image looked for in the map of all."""
    run = omnieval.replay(panoramas, config=omnieval.configure(SMALL), out=tmp_path / "run", recording=None)
    return omnieval.localize(run, str(panoramas), stride=4, out=tmp_path / "light")


def test_a_step_shows_each_query_with_what_was_found_and_how_far_off(found):
    path = record_localization(found)
    queries = len(found.table) // 3
    rows = rows_per_entity(path)
    for entity in ("/image/panorama", "/found/levels", "/found/nearest", "/map/found/coarse/line", "/why"):
        assert rows[entity] == queries, entity
    for strategy in ("levels", "nearest", "coarse"):
        errors = column(path, f"/plot/error/{strategy}", "Scalars:scalars")
        table = found.table.filter(strategy=strategy)
        shown = [None if one != one else one for step in sorted(errors) for one in errors[step]]
        assert shown == table["error"].to_list()
    said = column(path, "/log/decision", "TextLog:text")
    refused = found.table.filter(pl.col("strategy") == "levels", pl.col("node").is_null())
    assert refused["query"].to_list() == [step for step, text in sorted(said.items()) if "levels: " in text[0]]


def test_the_picture_is_that_of_the_image_where_the_map_has_its_name_twice(panoramas, darker, tmp_path):
    first = omnieval.replay(panoramas, mapper="leader", limit=8, out=tmp_path / "first", recording=False)
    both = omnieval.replay(darker, continuing=first, out=tmp_path / "both", recording=False)
    assert both.steps["file"].is_duplicated().sum() == 2 * 2
    found = omnieval.localize(both, str(panoramas), limit=5, strategies=["nearest"], out=tmp_path / "light")
    assert found.table["best_frame"].to_list() == list(range(5))
    path = record_localization(found)
    blob = "EncodedImage:blob"
    assert column(path, "/found/nearest", blob) == column(path, "/image/panorama", blob)


def test_the_command_makes_it_and_view_opens_it(found, tmp_path, monkeypatch):
    given: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", given.extend)
    missing = in_process("view", "light", cwd=tmp_path)
    assert missing.returncode == 2
    assert "make one with: omnieval render light" in missing.stderr
    assert in_process("render", "light", "--every", "10", cwd=tmp_path).stdout == "light/localization.rrd\n"
    assert in_process("view", "light", cwd=tmp_path).returncode == 0
    assert [path.name for path in given] == ["localization.rrd"]


def test_without_the_map_the_queries_are_recorded_and_a_sentence_says_so(found, tmp_path):
    (tmp_path / "run").rename(tmp_path / "elsewhere")
    said: list[str] = []
    path = record_localization(found, note=said.append)
    assert "the recording has nothing of the map but what was found" in said[0]
    assert rows_per_entity(path)["/image/panorama"] == len(found.table) // 3


def test_other_queries_than_those_leave_the_recording_as_it_was(panoramas, tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    for number in range(5):
        (images / f"image{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    run = omnieval.replay(panoramas, config=omnieval.configure(SMALL), out=tmp_path / "run", recording=None)
    found = omnieval.localize(run, str(images), strategies=["nearest"], out=tmp_path / "light")
    before = record_localization(found).read_bytes()
    (images / "image3.png").write_bytes((panoramas / "image40.png").read_bytes())
    with pytest.raises(ResultError, match="are not those that"):
        record_localization(found)
    (images / "image3.png").unlink()
    with pytest.raises((ResultError, DatasetError), match=r"image3\.png"):
        record_localization(found)
    assert (tmp_path / "light" / "localization.rrd").read_bytes() == before
