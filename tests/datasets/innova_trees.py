"""Small sequences in shapes that a set of images with ground truth plausibly has."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tests.datasets.trees import make_folder

CAPTURES = 12


def make_innova(
    root: Path, *, card: str = "", files: Mapping[str, str | bytes] | None = None, images: str = "im{}.png"
) -> Path:
    """A folder with 12 images, numbered from 1, a card of its own (if any) and further files."""
    root.mkdir(parents=True)
    for number in range(1, CAPTURES + 1):
        image = root / images.format(number)
        make_folder(image.parent, [image.name])
    if card:
        (root / "innova.toml").write_text(card)
    for name, content in (files or {}).items():
        (root / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return root


def make_named(root: Path) -> Path:
    """The shape in which rows name their images, with room and time."""
    card = "[layout.ground_truth]\nfile = 'gt.csv'\ncolumns = ['file', 'x', 'y', 'yaw', 'room', 'time']\n"
    rows = "".join(f"{i}.png,{i},0,0,CR,{i}\n" for i in range(1, CAPTURES + 1))
    return make_innova(root, card=card, files={"gt.csv": rows}, images="{}.png")
