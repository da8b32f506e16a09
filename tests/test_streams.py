"""A run over a video or a bag decides what one over its images in a folder decides, and can be opened again like it."""

import shutil

import cv2
import numpy as np
import polars as pl
import pytest

from omnieval.datasets import load
from omnieval.loop import replay
from omnieval.recording.viewer import check_recording
from tests.cli.test_cli import in_process
from tests.datasets.streams.made import KINDS, START_NS, STEP_NS, Maker, make_video, read_image

SMALL = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}
OPTIONS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
FRAMES = 60


@pytest.fixture(scope="module")
def images(panoramas):
    """Grey panoramas of three places, in the order in which they were taken."""
    return [read_image(panoramas / f"image{number}.png") for number in range(FRAMES)]


@pytest.fixture(scope="module")
def video(images, tmp_path_factory):
    return make_video(tmp_path_factory.mktemp("video") / "tour.mp4", images)


def decisions(run):
    return run.steps.drop("file", "time", "x", "y", "yaw", "room", "milliseconds")


def agree(run, other):
    assert decisions(run).equals(decisions(other))
    assert run.nodes.select("id", "images", "created").equals(other.nodes.select("id", "images", "created"))
    assert run.steps["role"].n_unique() > 2


def test_a_video_decides_as_its_frames_in_a_folder(video, tmp_path):
    capture = cv2.VideoCapture(str(video))
    folder = tmp_path / "frames"
    folder.mkdir()
    while (found := capture.read())[0]:
        cv2.imwrite(str(folder / f"{len(list(folder.iterdir()))}.png"), found[1])
    run = replay(video, config=SMALL, out=tmp_path / "run")
    agree(run, replay(folder, config=SMALL, out=tmp_path / "other"))
    assert run.manifest["source"] == f"video:{video}"
    assert run.manifest["frames"] == FRAMES


@pytest.fixture(scope="module")
def run_of_folder(images, tmp_path_factory):
    folder = tmp_path_factory.mktemp("images")
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / f"{number}.png"), image)
    return replay(folder, config=SMALL, out=tmp_path_factory.mktemp("run") / "run")


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_decides_as_its_images_in_a_folder(kind, images, run_of_folder, tmp_path):
    with Maker(tmp_path / ("tour.bag" if kind == "ros1" else "tour"), kind) as bag:
        for number, image in enumerate(images):
            time = START_NS + number * STEP_NS
            bag.image("/omni/image_raw", time, cv2.cvtColor(image, cv2.COLOR_BGR2RGB), "rgb8")
            bag.odometry("/odom", time, float(number), 0.0, 0.0)
    options = {"topic": "/omni/image_raw", "pose-topic": "/odom"}
    source = f"bag:{bag.path}#" + ",".join(f"{name}={value}" for name, value in options.items())
    run = replay(source, config=SMALL, out=tmp_path / "run")
    agree(run, run_of_folder)
    assert run.steps["x"].to_list() == pytest.approx(np.arange(FRAMES))
    assert run.manifest["metrics"]["silhouette"] is not None


def test_a_run_over_a_video_is_opened_again_even_after_the_cache_was_emptied(video, tmp_path):
    made = in_process("replay", video, "--decode-every", 2, *OPTIONS, "--out", "run", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert made.stderr.startswith(f"omnieval: decoding {video} into the cache, once\n")
    recording = tmp_path / "run" / "replay.rrd"
    steps = check_recording(recording)
    assert steps == FRAMES // 2
    shutil.rmtree(load(f"video:{video}#every=2").root)
    for command in (
        ("render", "run"),
        ("check", "run", "--reference", "mine.toml", "--update"),
        ("check", "--reference", "mine.toml"),
        ("dataset", "check", f"{video}#every=2"),
        ("describe", video, "--decode-every", "2", "--out", "video.npz"),
        (
            "ablate",
            video,
            "--decode-every",
            "2",
            "--vary",
            "merge_gate=two-sided,one-sided",
            *OPTIONS,
            "--out",
            "sweep",
        ),
    ):
        done = in_process(*command, cwd=tmp_path)
        assert done.returncode == 0, (command, done.stderr)
    assert check_recording(recording) == steps
    assert f'source = "video:{video}#every=2"' in (tmp_path / "mine.toml").read_text()
    assert pl.read_parquet(tmp_path / "sweep" / "ablation.parquet")["source"].unique().to_list() == [
        f"video:{video}#every=2"
    ]


@pytest.mark.slow
def test_a_run_over_a_video_is_reported(video, tmp_path, few_clusters):
    replay(video, config=SMALL, out=tmp_path / "run")
    done = in_process("report", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "report" / "index.html").is_file()


def test_a_run_whose_video_was_replaced_is_not_opened(video, images, tmp_path):
    own = shutil.copy(video, tmp_path / "tour.mp4")
    assert in_process("replay", own, *OPTIONS, "--out", "run", cwd=tmp_path).returncode == 0
    before = (tmp_path / "run" / "replay.rrd").read_bytes()
    make_video(own, images[::-1])
    done = in_process("render", "run", cwd=tmp_path)
    assert done.returncode == 2
    assert "again" in done.stderr
    assert (tmp_path / "run" / "replay.rrd").read_bytes() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("synthetic", "--topic", "/image"), "--topic is only for bags, and synthetic is something else"),
        (("tour.mp4", "--pose-topic", "/tf"), "--pose-topic is only for bags, and tour.mp4 is something else"),
        (("folder:.", "--decode-every", "2"), "--decode-every is only for videos and bags, and folder:. is"),
        (("tour.mp4",), "tour.mp4: no such file"),
    ],
)
def test_what_does_not_fit_the_source_is_refused(options, words, tmp_path):
    done = in_process("replay", *options, cwd=tmp_path)
    assert done.returncode in {2, 3}
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
