"""A small world in which the commands of the documentation run: what stands there for what a reader has."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import cv2
import numpy as np

from omnieval.datasets.cachedir import cache_dir
from omnieval.datasets.synthetic import LIGHTS, synthesize
from omnieval.datasets.synthetic.facts import RENDERER_VERSION
from tests.cli.test_cli import in_process
from tests.datasets.streams.made import START_NS, STEP_NS, Maker, make_video, read_image

FRAMES = 45
"""Images of the synthetic building in the tests: the first node, and one more."""

STEP = 30
"""What a step of the whole building stands for."""

STANDS_FOR = {
    "cold:/data/cold-freiburg/part_a/seq2_cloudy3": "cold:{site}/cold-freiburg/part_a/seq2_cloudy3",
    "cold:/data/seq2_night2": "cold:{site}/cold-freiburg/part_a/seq2_cloudy3",
    "cold:/data/seq2_cloudy3": "cold:{site}/cold-freiburg/part_a/seq2_cloudy3",
    "cold:data/seq2_cloudy3": "cold:{site}/cold-freiburg/part_a/seq2_cloudy3",
    "/data/panoramas": "{site}/data/house",
    "/data/tour": "{site}/data/tour",
    "/data/recording": "{site}/data/recording",
    "--decode-every 5": "--decode-every 2",
    "innova:/data/innova": "innova:{site}/innova",
    "docs/examples/": "{root}/docs/examples/",
    "docs/templates/": "{root}/docs/templates/",
    "mine.py:Mine": "{root}/docs/examples/bands.py:Bands",
    # A grid as large as the paper's is no better a test than a small one.
    "figures-9-10": "figures-9-10 --vary omega=1.7,2.3 --vary merge_y=0.75,2.25",
    "omega=1.7:2.3:0.15": "omega=1.7,2.3",
    "merge_y=0.75:2.25:0.25": "merge_y=0.75,2.25",
    "n_new=10:50:10": "n_new=10,20",
    "n_new=10:40:10": "n_new=10,20",
    # To render a whole building takes longer than all other commands together.
    "replay synthetic:night:3": "replay synthetic:night",
    # Processes start slowly; that they change nothing is tested elsewhere.
    "--jobs 2": "--jobs 1",
    "--replicates 20": "--replicates 2",
    # Of the few images there most must stay.
    "start=0:30": "start=0:3",
    "stride=1:2": "stride=1:1",
    "start=12": "start=2",
    ", jobs=2)": ")",
    "runs/house": "runs/mine",
    # The pages render other buildings; a small world has only the first.
    "synthetic:night:4": "synthetic:night",
    "runs/three-mappers": "runs/ablation",
    # The first images of the building are all of one room.
    "--without-room 2PO2": "--map-limit 40",
    # Steps of the whole building.
    "runs/light 300": f"runs/light {STEP}",
    " 859": f" {STEP}",
    " 412": f" {STEP}",
    "t1152904943.245808_x1.162911_y3.838699_a-2.971792.jpeg": f"{STEP}",
    "--k 2:60": "--k 2:20",
    "--frames 300": "--frames 12",
}
"""What stands in a command, and what is put in its place."""


def substituted(text: str, site: Path, root: Path) -> str:
    """Return a command or a program with everything put in its place."""
    for said, put in STANDS_FOR.items():
        text = text.replace(said, put.format(site=site, root=root))
    return text


def build(site: Path) -> None:
    """Put there what a reader has: sequences, and the results that pages start from (after `furnish_cache`)."""
    _sequences(site)
    for arguments in (
        ["replay"],
        ["replay", "synthetic:night", "--no-images"],
        ["replay", "--set", "gamma=20", "--no-images", "--out", "runs/a"],
        ["replay", "--no-images", "--out", "runs/b"],
        ["replay", "--no-rrd", "--out", "runs/mine"],
        ["replay", "--no-rrd", "--out", "runs/synthetic-cloudy-hog-2"],
        ["baseline", "--k", "2:5"],
        ["ablate", "--vary", "gamma=4,5", "--out", "runs/ablation"],
        ["describe", "--out", "mine.npz"],
        ["check", "synthetic", "synthetic:night", "--reference", "runs/reference/synthetic.toml", "--update"],
        ["check", "synthetic", "--reference", "mine.toml", "--update"],
    ):
        result = in_process(*arguments, cwd=site)
        assert result.returncode == 0, (arguments, result.stderr)
    (site / "axes.toml").write_text('merge_y = "0.5:1.5:0.5"\n')


def furnish_cache() -> None:
    """Put the beginning of the synthetic building where the whole of it is looked for."""
    for light in LIGHTS:
        synthesize(_rendered(light), light=light, frames=FRAMES)


def _streams(site: Path) -> None:
    """Put a video, two bags and a folder with a trajectory there, of the same images."""
    paths = sorted((_rendered(LIGHTS[0]) / "omni_cam").iterdir())
    images = [read_image(path) for path in paths]
    make_video(site / "data" / "tour.mp4", images)
    (site / "data" / "tour").mkdir()
    times = [f"{START_NS / 1e9 + number / 5:.6f}" for number in range(len(paths))]
    for time, path in zip(times, paths, strict=True):
        shutil.copy(path, site / "data" / "tour" / f"{time}{path.suffix}")
    rows = [f"{time} {number / 10} 0 0 0 0 0 1\n" for number, time in enumerate(times)]
    (site / "data" / "tour.tum").write_text("".join(rows))
    for name, kind in (("tour.bag", "ros1"), ("recording", "mcap")):
        with Maker(site / "data" / name, kind) as bag:
            for number, path in enumerate(paths):
                taken = START_NS + number * STEP_NS
                bag.compressed("/image", taken, path.read_bytes(), "jpeg")
                bag.odometry("/odom", taken, 0.1 * number, 0.0, 0.0)


def _rendered(light: str) -> Path:
    return cache_dir() / "synthetic" / f"v{RENDERER_VERSION}-{light}"


def _sequences(site: Path) -> None:
    shutil.copytree(_rendered(LIGHTS[0]), site / "cold-freiburg" / "part_a" / "seq2_cloudy3")
    (site / "data").mkdir()
    _streams(site)
    _panoramas(site / "data" / "house", "poses.csv", heading=True)
    _panoramas(site / "innova", "truth.csv", heading=False)
    card = "[layout]\nkind = 'panoramic'\n[layout.ground_truth]\nfile = 'truth.csv'\n"
    (site / "innova" / "innova.toml").write_text(card + "columns = ['file', 'x', 'y', 'yaw']\n")


def _panoramas(folder: Path, truth: str, *, heading: bool) -> None:
    """Write panoramas that a robot sees that drives along a wall."""
    folder.mkdir()
    wall = np.repeat(np.repeat(np.random.default_rng(1).integers(0, 255, (16, 120), np.uint8), 4, 0), 8, 1)
    with (folder / truth).open("w", newline="") as stream:
        table = csv.writer(stream)
        if heading:
            table.writerow(["file", "x", "y", "yaw"])
        for number in range(FRAMES):
            cv2.imwrite(str(folder / f"{number}.png"), wall[:, 16 * number : 16 * number + 256])
            table.writerow([f"{number}.png", f"{number / 10:.2f}", "0.00", "0.00"])
