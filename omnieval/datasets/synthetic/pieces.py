"""Kinds of furniture, each built of solids about its own origin: back at y = 0, +y into the room, x along the wall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from omnieval.datasets.synthetic.solids import Solid, box, pillar


def _cabinet(w: float, d: float, z0: float, z1: float, front: str, top: str = "wood-light") -> list[Solid]:
    """Return a closed cabinet whose front texture covers each face once."""
    return [replace(box(-w / 2, w / 2, 0.01, d, z0, z1, front, top), fit=True)]


def _table(w: float, d: float, h: float, top: str = "wood-light", legs: str = "metal") -> list[Solid]:
    """Return a table: a plate on four legs."""
    solids = [box(-w / 2, w / 2, 0.02, d, h - 0.04, h, top)]
    for x in (-w / 2 + 0.06, w / 2 - 0.06):
        solids += [box(x - 0.025, x + 0.025, y - 0.025, y + 0.025, 0.0, h - 0.04, legs) for y in (0.08, d - 0.06)]
    return solids


def _chair(fabric: str = "fabric-blue") -> list[Solid]:
    """Return an office chair with its back towards the room, its seat towards the wall."""
    return [
        pillar(0.0, 0.25, 0.46, 0.03, 0.08, "plastic-black"),
        pillar(0.0, 0.25, 0.06, 0.08, 0.42, "metal"),
        box(-0.23, 0.23, 0.03, 0.46, 0.42, 0.49, fabric),
        box(-0.21, 0.21, 0.45, 0.50, 0.55, 0.98, fabric),
    ]


def _stool() -> list[Solid]:
    """Return a plain wooden chair without arms."""
    legs = [
        box(x - 0.02, x + 0.02, y - 0.02, y + 0.02, 0, 0.43, "wood-dark") for x in (-0.17, 0.17) for y in (0.06, 0.4)
    ]
    return [
        *legs,
        box(-0.2, 0.2, 0.03, 0.44, 0.43, 0.47, "wood-dark"),
        box(-0.2, 0.2, 0.42, 0.45, 0.47, 0.85, "wood-dark"),
    ]


def _desk() -> list[Solid]:
    """Return a workplace and its chair."""
    return [*_workplace(), *(s.moved(-0.05, 0.62) for s in _chair())]


def _workplace() -> list[Solid]:
    """Return a desk with a screen, a drawer unit and papers."""
    return [
        *_table(1.5, 0.78, 0.74),
        replace(box(0.3, 0.7, 0.1, 0.65, 0.0, 0.6, "drawers", "wood-light"), fit=True),
        box(-0.1, 0.1, 0.2, 0.4, 0.74, 0.77, "plastic-black"),
        box(-0.03, 0.03, 0.25, 0.29, 0.77, 0.9, "plastic-black"),
        replace(box(-0.28, 0.28, 0.29, 0.33, 0.84, 1.22, "screen", "plastic-black"), fit=True),
        box(0.35, 0.6, 0.3, 0.6, 0.74, 0.79, "paper"),
        box(-0.25, 0.2, 0.5, 0.65, 0.74, 0.76, "plastic-black"),
    ]


def _sofa(w: float, fabric: str) -> list[Solid]:
    """Return a sofa with arms."""
    return [
        box(-w / 2, w / 2, 0.02, 0.25, 0.08, 0.82, fabric),
        box(-w / 2 + 0.16, w / 2 - 0.16, 0.25, 0.85, 0.08, 0.43, fabric),
        box(-w / 2, -w / 2 + 0.16, 0.25, 0.85, 0.05, 0.6, fabric),
        box(w / 2 - 0.16, w / 2, 0.25, 0.85, 0.05, 0.6, fabric),
    ]


def _plant(height: float) -> list[Solid]:
    """Return a potted plant: leaves in three tiers."""
    return [
        pillar(0.0, 0.25, 0.32, 0.0, 0.34, "terracotta", "soil"),
        pillar(0.0, 0.25, 0.06, 0.34, 0.6, "wood-dark"),
        pillar(0.0, 0.25, 0.44, 0.55, 0.5 + 0.35 * height, "leaves"),
        pillar(0.03, 0.27, 0.34, 0.5 + 0.35 * height, 0.75 * height + 0.2, "leaves"),
        pillar(-0.02, 0.22, 0.2, 0.75 * height + 0.2, height, "leaves"),
    ]


def _printer() -> list[Solid]:
    """Return a floor-standing copier."""
    return [
        replace(box(-0.33, 0.33, 0.03, 0.65, 0.0, 0.72, "drawers", "plastic-grey"), fit=True),
        box(-0.33, 0.33, 0.03, 0.65, 0.72, 0.9, "plastic-black", "plastic-grey"),
        box(-0.3, 0.3, 0.03, 0.6, 0.9, 1.08, "plastic-grey"),
        box(0.33, 0.6, 0.15, 0.55, 0.6, 0.64, "plastic-grey"),
        box(0.02, 0.28, 0.6, 0.68, 1.0, 1.12, "screen"),
    ]


def _kitchen() -> list[Solid]:
    """Return a kitchen counter with sink and coffee machine under wall cabinets."""
    return [
        replace(box(-1.3, 1.3, 0.01, 0.6, 0.1, 0.86, "cabinet-row", "stone"), fit=True),
        box(-1.3, 1.3, 0.01, 0.55, 0.0, 0.1, "plastic-black"),
        box(-1.32, 1.32, 0.01, 0.62, 0.86, 0.9, "stone"),
        box(-0.5, 0.0, 0.12, 0.5, 0.9, 0.905, "steel"),
        box(0.6, 0.9, 0.15, 0.5, 0.9, 1.28, "plastic-black"),
        pillar(0.2, 0.3, 0.16, 0.9, 1.15, "steel"),
        replace(box(-1.3, -0.75, 0.01, 0.35, 1.45, 2.1, "doors-white", "wood-light"), fit=True),
    ]


def _rack(contents: str) -> list[Solid]:
    """Return an open storage rack, 1.2 m wide, with what it carries."""
    posts = [box(x - 0.02, x + 0.02, y, y + 0.04, 0.0, 2.0, "metal") for x in (-0.58, 0.58) for y in (0.02, 0.44)]
    boards = [box(-0.6, 0.6, 0.02, 0.48, z, z + 0.03, "metal") for z in (0.15, 0.75, 1.35, 1.95)]
    loads = [
        box(-0.5, -0.1, 0.06, 0.42, 0.18, 0.55, contents),
        box(0.05, 0.5, 0.08, 0.4, 0.18, 0.42, "plastic-red"),
        box(-0.45, 0.15, 0.06, 0.4, 0.78, 1.12, "cardboard"),
        box(0.22, 0.52, 0.1, 0.4, 0.78, 1.2, contents),
        box(-0.52, -0.15, 0.1, 0.4, 1.38, 1.7, "plastic-red"),
        box(-0.05, 0.5, 0.08, 0.42, 1.38, 1.78, "cardboard"),
    ]
    return posts + boards + loads


def _cabins() -> list[Solid]:
    """Return two toilet cabins, 2.3 m wide and 1.45 m deep, with their doors."""
    return [
        replace(box(-1.15, 1.15, 1.42, 1.45, 0.15, 2.0, "cabin-doors", "frame-white"), fit=True),
        box(-0.02, 0.02, 0.02, 1.42, 0.15, 2.0, "plastic-grey"),
    ]


def _basins() -> list[Solid]:
    """Return two wash basins below a mirror."""
    return [
        box(-0.7, 0.7, 0.01, 0.45, 0.78, 0.85, "ceramic"),
        replace(box(-0.7, 0.7, 0.01, 0.03, 1.05, 1.85, "mirror", "frame-white"), fit=True),
        *(box(x - 0.05, x + 0.05, 0.05, 0.2, 0.0, 0.78, "ceramic") for x in (-0.35, 0.35)),
        box(0.85, 1.1, 0.01, 0.2, 1.1, 1.45, "plastic-grey"),
    ]


def _bench() -> list[Solid]:
    """Return a laboratory bench with instruments and a shelf above."""
    return [
        *_table(1.6, 0.75, 0.9, "stone", "frame-white"),
        box(-0.7, -0.25, 0.15, 0.6, 0.9, 1.3, "plastic-grey"),
        replace(box(-0.1, 0.3, 0.3, 0.35, 0.95, 1.25, "screen", "plastic-black"), fit=True),
        box(0.45, 0.7, 0.2, 0.5, 0.9, 1.1, "plastic-blue"),
        pillar(0.35, 0.2, 0.1, 0.9, 1.2, "steel"),
    ]


def _meeting() -> list[Solid]:
    """Return a meeting table, 1.9 m by 1.5 m, with chairs along both sides."""
    plate = box(-0.95, 0.95, 0.5, 2.0, 0.7, 0.75, "wood-red")
    feet = [box(x - 0.3, x + 0.3, 1.15, 1.35, 0.0, 0.7, "wood-dark") for x in (-0.45, 0.45)]
    far = [s.moved(x, 1.85) for x in (-0.6, 0.0, 0.6) for s in _chair("fabric-red")]
    near = [s.moved(x, 0.65, 3.141592653589793) for x in (-0.6, 0.0, 0.6) for s in _chair("fabric-red")]
    return [
        plate,
        *feet,
        *far,
        *near,
        pillar(0.1, 1.2, 0.12, 0.75, 0.95, "steel"),
        box(-0.5, -0.2, 1.5, 1.7, 0.75, 0.77, "paper"),
    ]


def _panel(w: float, z0: float, z1: float, texture: str) -> list[Solid]:
    """Return something flat on the wall."""
    return [replace(box(-w / 2, w / 2, 0.0, 0.025, z0, z1, texture, "frame-dark"), fit=True)]


def _cooler() -> list[Solid]:
    """Return a water cooler with its bottle."""
    return [
        box(-0.16, 0.16, 0.02, 0.34, 0.0, 0.95, "plastic-grey"),
        pillar(0.0, 0.18, 0.27, 0.95, 1.35, "plastic-blue"),
    ]


def _leaf(width: float) -> list[Solid]:
    """Return an open door leaf; its hinge is at the origin, it stands along +y."""
    leaf = replace(box(-0.02, 0.02, 0.0, width, 0.01, 2.0, "door-leaf", "frame-dark"), fit=True)
    return [leaf, box(-0.07, 0.07, width - 0.12, width - 0.06, 1.0, 1.03, "metal")]


PIECES: dict[str, Callable[[], list[Solid]]] = {
    "basins": _basins,
    "bench": _bench,
    "bin": lambda: [pillar(0.0, 0.17, 0.28, 0.0, 0.5, "plastic-black")],
    "books": lambda: _cabinet(1.0, 0.3, 0.0, 2.0, "books"),
    "books-wide": lambda: _cabinet(1.9, 0.32, 0.0, 1.15, "books"),
    "boxes": lambda: [
        box(-0.5, 0.05, 0.03, 0.5, 0.0, 0.4, "cardboard"),
        box(-0.4, 0.0, 0.06, 0.45, 0.4, 0.75, "cardboard"),
        box(0.12, 0.6, 0.03, 0.5, 0.0, 0.55, "cardboard"),
    ],
    "cabins": _cabins,
    "chair": _chair,
    "coats": lambda: _panel(1.1, 1.3, 1.8, "coats"),
    "coffee-table": lambda: _table(1.1, 0.6, 0.42, "glass-table", "wood-dark"),
    "cooler": _cooler,
    "cupboard": lambda: _cabinet(0.95, 0.42, 0.0, 1.9, "doors-wood"),
    "cupboard-grey": lambda: _cabinet(0.95, 0.42, 0.0, 1.95, "doors-grey", "metal"),
    "desk": _desk,
    "extinguisher": lambda: [pillar(0.0, 0.1, 0.16, 0.55, 1.05, "plastic-red")],
    "fridge": lambda: _cabinet(0.62, 0.62, 0.0, 1.8, "fridge", "plastic-grey"),
    "kitchen": _kitchen,
    "leaf": lambda: _leaf(0.88),
    "locker": lambda: _cabinet(1.2, 0.4, 0.0, 1.75, "lockers", "metal"),
    "meeting": _meeting,
    "noticeboard": lambda: _panel(1.5, 1.0, 1.9, "noticeboard"),
    "pigeonholes": lambda: _cabinet(1.4, 0.32, 0.0, 1.6, "pigeonholes"),
    "plant": lambda: _plant(1.5),
    "plant-low": lambda: _plant(1.05),
    "poster-1": lambda: _panel(0.7, 1.1, 2.0, "poster-1"),
    "poster-2": lambda: _panel(1.0, 1.2, 1.9, "poster-2"),
    "poster-3": lambda: _panel(0.8, 1.0, 2.05, "poster-3"),
    "poster-4": lambda: _panel(1.3, 1.15, 1.95, "poster-4"),
    "printer": _printer,
    "rack": lambda: _rack("plastic-blue"),
    "radiator": lambda: [replace(box(-0.6, 0.6, 0.02, 0.12, 0.12, 0.72, "radiator", "metal"), fit=True)],
    "sideboard": lambda: _cabinet(1.6, 0.42, 0.0, 0.8, "cabinet-row"),
    "sofa-green": lambda: _sofa(2.0, "fabric-green"),
    "sofa-red": lambda: _sofa(1.4, "fabric-red"),
    "stool": _stool,
    "table": lambda: _table(1.3, 0.8, 0.75, "wood-red", "wood-dark"),
    "television": lambda: _panel(1.5, 0.95, 1.8, "screen"),
    "workplace": _workplace,
    "whiteboard": lambda: _panel(1.9, 0.9, 2.0, "whiteboard"),
}
"""Every kind of furniture by name."""
