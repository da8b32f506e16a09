"""Trajectories, tables and pictures, as their readers find them."""

import io
import json
import math
from typing import Any

import cv2
import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.errors import ResultError
from omnieval.exports.flat import flat_csv
from omnieval.exports.trajectory import trajectory
from omnieval.results.run_folder import TABLES
from tests.cli.test_cli import in_process
from tests.exports.conftest import replayed


def path(rows):
    schema: Any = {"frame": pl.Int32, "time": pl.Datetime("ns"), "x": pl.Float64, "y": pl.Float64, "yaw": pl.Float64}
    return pl.DataFrame(rows, schema=schema, orient="row")


def pixels(file):
    picture = cv2.imread(str(file))
    assert picture is not None
    return picture


def numbers(text):
    return np.loadtxt(io.StringIO(text), ndmin=2)


def test_a_trajectory_has_time_position_and_the_heading_as_a_quaternion():
    text, notes = trajectory(
        path([(0, 1_152_904_932_211_896_321, 1.0, 2.0, 0.0), (1, 10**9, 3.0, -4.5, math.pi / 2)]), "r"
    )
    assert notes == ()
    assert "1152904932.211896321 1.0 2.0 0 0 0 0.0 1.0" in text
    half = math.sqrt(0.5)
    assert numbers(text)[1] == pytest.approx([1.0, 3.0, -4.5, 0, 0, 0, half, half])


def test_what_a_trajectory_lacks_is_said_in_it():
    text, notes = trajectory(path([(0, None, 0.0, 0.0, None), (1, None, None, None, None), (2, 5, 1.0, 0.0, 1.0)]), "r")
    assert numbers(text)[:, 0].tolist() == [0, 2]
    assert numbers(text)[0, 4:].tolist() == [0, 0, 0, 1]
    for words, note in zip(("1 of 3 images", "frame numbers", "1 of 2 headings"), notes, strict=True):
        assert words in note
        assert f"# {note}" in text.splitlines()


def test_the_trajectory_of_a_run_is_its_true_path(run, tmp_path):
    (file,) = omnieval.export(run, "tum", out=tmp_path / "path.tum").files
    read = numbers(file.read_text())
    assert np.array_equal(read[:, 1:3], run.steps.select("x", "y").to_numpy())
    assert 2 * np.arctan2(read[:, 6], read[:, 7]) == pytest.approx(run.steps["yaw"].to_numpy())


def test_a_trajectory_without_poses_is_refused(unposed, tmp_path):
    with pytest.raises(ResultError, match="needs true positions, bare-hog has none"):
        omnieval.export(unposed, "tum", out=tmp_path / "path.tum")


def test_lists_and_structures_are_joined():
    table = pl.DataFrame(
        {
            "n": [[1, 2], [], None],
            "rooms": [[{"room": "A", "of": [1, 2]}, {"room": "B", "of": None}], None, []],
            "text": ['a,"b"', None, "c"],
        },
        schema={
            "n": pl.List(pl.Int32),
            "rooms": pl.List(pl.Struct({"room": pl.String, "of": pl.List(pl.Int32)})),
            "text": pl.String,
        },
    )
    read = pl.read_csv(io.StringIO(flat_csv(table)), infer_schema=False)
    assert read.rows() == [("1 2", "room=A of=1,2; room=B", 'a,"b"'), ("", None, None), (None, "", "c")]


def test_every_table_of_a_run_has_a_csv_with_its_columns_and_rows(run, tmp_path):
    made = omnieval.export(run, "csv", out=tmp_path / "tables")
    assert [file.name for file in made.files] == [f"{table}.csv" for table in TABLES]
    for file in made.files:
        read, table = pl.read_csv(file, infer_schema=False), getattr(run, file.stem)
        assert (read.columns, len(read)) == (table.columns, len(table))
    steps = pl.read_csv(made.files[0], infer_schema=False)
    assert steps["x"].cast(pl.Float64).to_list() == run.steps["x"].to_list()
    assert steps["verdict"].to_list() == run.steps["verdict"].to_list()
    compared = run.steps["comparisons"].list.len().to_list()
    assert [text.count("gate=") if text else 0 for text in steps["comparisons"]] == compared


def test_the_table_of_a_sweep_is_exported_and_its_map_refused(panoramas, tmp_path):
    omnieval.ablate(panoramas, {"radius": [2.0, 4.0]}, mapper="leader", limit=20, out=tmp_path / "sweep")
    made = in_process("export", "sweep", "--format", "csv", "--json", cwd=tmp_path)
    assert json.loads(made.stdout) == {"schema_version": 1, "files": ["sweep.csv"], "notes": []}
    assert len(pl.read_csv(tmp_path / "sweep.csv")) == 2
    refused = in_process("export", "sweep", "--format", "graphml", cwd=tmp_path)
    assert refused.returncode == 2
    assert "an ablation, which has no map; export it with --format csv" in refused.stderr


def test_every_node_has_the_picture_of_its_representative(run, panoramas, tmp_path):
    made = omnieval.export(run, images=tmp_path / "nodes")
    nodes = run.nodes.filter(pl.col("merged").is_null())
    assert [file.name for file in made.files] == [f"node-{number:03d}.jpg" for number in nodes["id"]]
    for file, frame in zip(made.files, nodes["representative_frame"], strict=True):
        picture = pixels(file)
        sources = [cv2.resize(pixels(panoramas / name), picture.shape[1::-1]) for name in run.steps["file"]]
        away = [np.abs(picture.astype(int) - one).mean() for one in sources]
        assert int(np.argmin(away)) == frame
        assert away[frame] < 6


def test_pictures_of_images_that_were_replaced_are_refused(panoramas, tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    for number in range(60):
        (images / f"image{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    made = replayed(images, tmp_path / "run")
    (images / "image7.png").write_bytes((panoramas / "image40.png").read_bytes())
    with pytest.raises(ResultError, match="are not those that"):
        omnieval.export(made, images=tmp_path / "nodes")


def test_an_archive_has_a_map_and_a_path_and_no_pictures(panoramas, tmp_path):
    omnieval.describe_archive(panoramas, tmp_path / "three.npz")
    made = replayed(f"npz:{tmp_path / 'three.npz'}", tmp_path / "run")
    for format_ in ("graphml", "geojson", "json", "tum"):
        assert omnieval.export(made, format_, out=f"{tmp_path}/").files[0].stat().st_size > 100
    with pytest.raises(ResultError, match="replayed from descriptors; it has no images"):
        omnieval.export(made, images=tmp_path / "nodes")
