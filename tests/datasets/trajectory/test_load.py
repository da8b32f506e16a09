"""Poses beside images and poses that a source names: which are taken, and that a run of them can be opened again."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest

import omnieval
from omnieval.datasets import load
from omnieval.datasets.registry import canonical, place_of, posed_source
from omnieval.datasets.registry import scan as scan_source
from omnieval.datasets.sequence import Pose
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.material.opening import opened
from omnieval.material.reopened import reopened
from omnieval.material.source import archive_file
from tests.datasets.trajectory.drives import a_drive, euroc, kitti, lines, tum
from tests.datasets.trees import cold_names, make_cold, make_folder

DRIVE = a_drive()


def a_folder(path, poses=None):
    return make_folder(path, DRIVE.names, poses)


def kinds(sequence):
    return [(finding.severity, finding.code) for finding in sequence.findings]


def has_the_drive(sequence):
    np.testing.assert_allclose(sequence.positions, DRIVE.places, atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * sequence.yaws), np.exp(1j * DRIVE.yaws), atol=1e-9)


BESIDE = {
    "Poses.CSV": lines(DRIVE.names, *DRIVE.places.T, DRIVE.yaws, separator=",", heading="file,x,y,yaw"),
    "groundtruth.txt": tum(DRIVE),
    "mine.tum": tum(DRIVE),
    "CameraTrajectory.txt": tum(DRIVE),
    "poses.txt": kitti(DRIVE),
    "state_groundtruth_estimate0/data.csv": euroc(DRIVE),
}


@pytest.mark.parametrize(("name", "text"), BESIDE.items(), ids=BESIDE)
def test_what_lies_beside_the_images_is_found(name, text, tmp_path):
    root = a_folder(tmp_path / "tour")
    (root / name).parent.mkdir(exist_ok=True)
    (root / name).write_text(text)
    has_the_drive(load(f"folder:{root}"))


def test_poses_above_the_folder_of_images_are_found_in_the_layouts_of_euroc_and_tum(tmp_path):
    images = a_folder(tmp_path / "mav0" / "cam0" / "data")
    (tmp_path / "mav0" / "state_groundtruth_estimate0").mkdir()
    (tmp_path / "mav0" / "state_groundtruth_estimate0" / "data.csv").write_text(euroc(DRIVE))
    has_the_drive(load(images))
    images = a_folder(tmp_path / "tum" / "rgb")
    (tmp_path / "tum" / "groundtruth.txt").write_text(tum(DRIVE))
    has_the_drive(load(images))


def test_of_several_files_none_is_taken_but_poses_csv(tmp_path):
    root = a_folder(tmp_path / "tour")
    for name in ("groundtruth.txt", "trajectory.tum"):
        (root / name).write_text(tum(DRIVE))
    with pytest.raises(
        DatasetError, match=r"groundtruth.txt, trajectory.tum may all hold the poses; name one with --poses"
    ):
        load(root)
    has_the_drive(load(root, poses=root / "trajectory.tum"))
    (root / "poses.csv").write_text(BESIDE["Poses.CSV"])
    sequence = load(root)
    has_the_drive(sequence)
    assert kinds(sequence) == [("warning", "other-poses")]


def test_a_file_of_poses_that_is_not_read_is_said(tmp_path):
    root = a_folder(tmp_path / "tour")
    (root / "poses.json").write_text("[]")
    assert kinds(load(root)) == [("warning", "unread-poses"), ("info", "no-poses")]


def test_a_source_names_its_poses_whatever_the_images_have(tmp_path):
    (tmp_path / "truth.tum").write_text(tum(DRIVE))
    root = a_folder(tmp_path / "tour", "file,x,y\nnobody.png,zero,0\n")
    sequence = load(f"folder:{root}", poses=tmp_path / "truth.tum")
    assert sequence.source == f"folder:{root}#poses={tmp_path}/truth.tum"
    assert kinds(sequence) == [("info", "poses-read")]
    has_the_drive(sequence)
    has_the_drive(load(sequence.source))
    cold = make_cold(tmp_path / "seq", cold_names(12))
    table = lines(cold_names(12), *DRIVE.places.T, DRIVE.yaws, heading="name x y yaw")
    (tmp_path / "cold.txt").write_text(table)
    assert load(cold).frames[1].pose == Pose(0.1, 0.0, 0.785398)
    has_the_drive(load(cold, poses=tmp_path / "cold.txt"))


def test_the_source_is_canonical_with_its_poses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    a_folder(tmp_path / "tour")
    given = posed_source("folder:tour", "a,b#.tum", poses_interpolate=0.50)
    assert given == "folder:tour#poses=a%2Cb%23.tum,poses-interpolate=0.5"
    assert canonical(given) == f"folder:{tmp_path}/tour#poses={tmp_path}/a%2Cb%23.tum,poses-interpolate=0.5"
    assert canonical(canonical(given)) == canonical(given)
    assert place_of(canonical(given)) == tmp_path / "tour"
    (tmp_path / "a,b#.tum").write_text(tum(DRIVE))
    assert load(given).source == canonical(given)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("poses=", "option poses of .* has no value; write poses=VALUE"),
        ("poses-tolerance=soon", "poses-tolerance=soon in .* must be a number of seconds"),
        ("poses-interpolate=-1", "must be a number of seconds, 0 or more"),
        ("poses=none.tum", r"none.tum: no such file; check the path"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, words, tmp_path):
    root = a_folder(tmp_path / "tour")
    with pytest.raises(DatasetError, match=words):
        load(f"folder:{root}#{options}")


def test_gaps_in_the_names_of_cold_can_be_filled(tmp_path):
    root = a_folder(tmp_path / "tour", lines(DRIVE.names[::2], *DRIVE.places[::2].T, heading="file x y"))
    assert load(root).positions is not None
    filled = load(f"{root}#poses-interpolate=0.4")
    assert filled.positions is not None
    assert np.isfinite(filled.positions).all(axis=1).tolist() == [*[True] * 11, False]
    np.testing.assert_allclose(filled.positions[1], (DRIVE.places[0] + DRIVE.places[2]) / 2)
    codes = [finding.code for finding in filled.findings]
    assert codes.count("image-without-pose") == 1
    assert "poses-interpolated" in codes


def test_what_archives_and_loaded_sequences_have_of_their_own_is_not_given_anew(tmp_path):
    with pytest.raises(ConfigError, match="has poses of its own, xy and yaw"):
        archive_file("npz:mine.npz#poses=a.tum")
    for archive in ("npz:mine", "mine.npz", "MINE.NPZ"):
        with pytest.raises(ConfigError, match="only images can be perturbed"):
            archive_file(f"{archive}#noise=2,seed=3")
    with pytest.raises(ConfigError, match=r"give them to omnieval\.load"):
        omnieval.replay(load(a_folder(tmp_path / "tour")), poses="a.tum")


def test_a_run_of_other_poses_is_opened_again_and_missed_when_they_change(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images", ignore=shutil.ignore_patterns("poses.csv"))
    table = (panoramas / "poses.csv").read_text()
    truth = tmp_path / "truth.csv"
    truth.write_text(table)
    usual = omnieval.replay(panoramas, mapper="leader", out=tmp_path / "usual")
    run = omnieval.replay(images, mapper="leader", out=tmp_path / "run", poses=truth, poses_interpolate=1.0)
    assert run.manifest["source"] == f"folder:{images}#poses={truth},poses-interpolate=1"
    assert run.metrics == usual.metrics
    with reopened(run) as material:
        assert len(list(material.described)) == 80
    truth.write_text(re.sub(r"image3.png,[^,]*", "image3.png,5", table))
    with reopened(run) as material, pytest.raises(ResultError, match="the images, poses or labels of"):
        list(material.described)


def test_poses_without_headings_give_every_metric_over_positions(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images", ignore=shutil.ignore_patterns("poses.csv"))
    rows = [line.split(",")[:3] for line in (panoramas / "poses.csv").read_text().splitlines()[1:]]
    (images / "gt.csv").write_text(lines(*zip(*rows, strict=True), separator=";", heading="Image Name;X [m];Y [m]"))
    run = omnieval.replay(images, mapper="leader", radius=1.0, out=tmp_path / "run")
    assert run.metrics["posed"] == 80
    assert run.steps["yaw"].null_count() == 80
    assert run.metrics["silhouette"] is not None


def test_positions_as_large_as_of_utm_are_those_of_the_building(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images", ignore=shutil.ignore_patterns("poses.csv"))
    rows = [line.split(",")[:3] for line in (panoramas / "poses.csv").read_text().splitlines()[1:]]
    far = [(name, f"{float(x) + 465_000:.6f}", f"{float(y) + 5_249_000:.6f}") for name, x, y in rows]
    (images / "gt.csv").write_text(lines(*zip(*far, strict=True), separator=",", heading="file,easting,northing"))
    config = omnieval.configure(mapper="leader")
    with opened(images, config) as there, opened(panoramas, config) as here:
        assert there.positions is not None
        assert here.positions is not None
        np.testing.assert_allclose(there.positions - np.array([465_000, 5_249_000]), here.positions, atol=1e-8)


def test_the_check_tells_what_was_taken_for_what(tmp_path):
    (tmp_path / "truth.tum").write_text(tum(DRIVE))
    root = a_folder(tmp_path / "tour")
    (said,) = scan_source(f"folder:{root}#poses={tmp_path}/truth.tum").findings
    assert (said.where, said.code) == (f"{tmp_path}/truth.tum", "poses-read")
    assert said.message == (
        "TUM; ground x, y; ahead is x of the robot; 12 rows, joined by time (within 0.1 s): 12 of 12 images"
    )
    assert json.dumps(said.message)
