"""Makes the pictures of the documentation anew, all from the synthetic building: ``python docs/pictures/make.py``.

Takes a few minutes, and for the viewer a Vulkan driver; see `viewer`. Besides pictures it writes ``explained.txt``, the
decision that the README shows as text.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from viewer import take_picture

HERE = Path(__file__).parent
CLOSED, REFUSED = 856, 859
"""Steps of the replay with default parameters: the robot is back in a room after 663 steps, and then refused."""

WINDOW = (1600, 1000)
TITLE_BAR = 36
"""Rows of the viewer's window that show the machine and not the recording."""

BUDGET = 150_000
"""Bytes of a picture, so that the repository stays small."""

LOST, OTHER_BUILDING = 300, 1000
"""A step of the localisation by night, and one of the replay of building 4 by night."""

FIGURES = {
    "cloudy": {"map": "report-map", "batch": "report-batch", "similarity": "report-similarity"},
    "night": {"sweep-hog": "report-sweep"},
    "building-4": {"map": "report-map-4"},
    "found": {"cumulative": "report-cumulative"},
    "three-mappers": {"methods": "report-methods", "ranks": "report-ranks"},
}
"""Of each report: which figure becomes which picture."""


def main() -> None:
    """Replay, report, take pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--work", type=Path, help="keep the runs here, and use those that are there")
    given = parser.parse_args().work
    with tempfile.TemporaryDirectory() as temporary:
        work = given or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        make(work)


def make(work: Path) -> None:
    """Make every picture, from runs in a folder."""
    runs = work / "runs"
    cloudy, loose = runs / "synthetic-cloudy-hog", runs / "omega-2.6"
    prepare(work)
    write_text("explained.txt", omnieval(work, "explain", "runs/synthetic-cloudy-hog", str(REFUSED)))
    write_screenshot("viewer-closed.jpg", [cloudy / "replay.rrd"], CLOSED)
    write_screenshot("viewer-refused.jpg", [cloudy / "replay.rrd"], REFUSED)
    both = work / "both.rrd"
    omnieval(work, "diff", cloudy.relative_to(work), loose.relative_to(work), "--rrd", both.name, "--overwrite")
    write_screenshot("viewer-two-runs.jpg", [both], REFUSED)
    write_screenshot("viewer-building-4.jpg", [runs / "building-4" / "replay.rrd"], OTHER_BUILDING)
    write_screenshot("viewer-localized.jpg", [runs / "found" / "localization.rrd"], LOST)
    for report, figures in FIGURES.items():
        for figure, picture in figures.items():
            source = next((work / report / "figures").glob(f"*-{figure}*.png"))
            write_figure(f"{picture}.png", source)


def prepare(work: Path) -> None:
    """Run what the pictures show, unless it is there."""
    buildings = [f"synthetic:{light}:{number}" for number in (2, 3, 4, 5, 6) for light in ("cloudy", "night")]
    for name, command in {
        "synthetic-cloudy-hog": ["replay"],
        "omega-2.6": ["replay", "--set", "omega=2.6", "--no-images"],
        "night": ["ablate", "synthetic:night", "--preset", "figures-9-10"],
        "building-4": ["replay", "synthetic:night:4"],
        "found": ["localize", "runs/synthetic-cloudy-hog", "synthetic:night"],
        "three-mappers": ["ablate", *buildings, "--mapper", "roman2020,geodesic,leader"],
    }.items():
        if not (work / "runs" / name).exists():
            omnieval(work, *command, "--out", f"runs/{name}")
    if not (work / "runs" / "found" / "localization.rrd").exists():
        omnieval(work, "render", "runs/found", "--every", "10")
    for report in FIGURES:
        run = "synthetic-cloudy-hog" if report == "cloudy" else report
        omnieval(work, "report", f"runs/{run}", "--out", report, "--overwrite")


def omnieval(work: Path, *arguments: str | Path) -> str:
    """Run a command in a folder and return what it prints."""
    command = [sys.executable, "-m", "omnieval", *map(str, arguments)]
    print("omnieval", *arguments)
    return subprocess.run(command, cwd=work, check=True, stdout=subprocess.PIPE, text=True).stdout


def write_text(name: str, text: str) -> None:
    """Keep what a command printed."""
    (HERE / name).write_text(text, "utf-8")


def write_screenshot(name: str, recordings: list[Path], step: int) -> None:
    """Write a picture of the viewer, as large as the budget allows."""
    window = cv2.imdecode(np.frombuffer(take_picture(recordings, step, size=WINDOW), np.uint8), cv2.IMREAD_COLOR)
    if window is None:
        raise RuntimeError("the viewer gave no picture")
    views = window[TITLE_BAR:].astype(np.uint8)
    for quality in range(90, 40, -5):
        encoded = cv2.imencode(".jpg", scaled(views, 1280), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        if len(encoded) <= BUDGET:
            (HERE / name).write_bytes(encoded.tobytes())
            return
    raise RuntimeError(f"{name} is larger than {BUDGET} bytes; take a smaller window")


def write_figure(name: str, source: Path) -> None:
    """Write a figure of a report, as wide as the budget allows."""
    figure = cv2.imread(str(source), cv2.IMREAD_COLOR)
    if figure is None:
        raise RuntimeError(f"cannot read {source}")
    for width in range(1000, 500, -50):
        encoded = cv2.imencode(".png", few_colours(scaled(figure.astype(np.uint8), width)))[1]
        if len(encoded) <= BUDGET:
            (HERE / name).write_bytes(encoded.tobytes())
            return
    raise RuntimeError(f"{name} is larger than {BUDGET} bytes; draw it simpler")


def scaled(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """Return a picture of another width, in proportion."""
    height = picture.shape[0] * width // picture.shape[1]
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8)


def few_colours(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture with 16 levels a channel, white as it is; lines and text need no more."""
    levels = (picture // 16) * 16 + 8
    levels[picture > 247] = 255
    return levels.astype(np.uint8)


if __name__ == "__main__":
    main()
