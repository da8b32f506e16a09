"""The first building, drawn by hand: a corridor along x with ten rooms, two of them alike."""

from __future__ import annotations

from dataclasses import replace

from omnieval.datasets.synthetic.building import Building, Opening, Placed, Room


def _grid(x0: float, x1: float, y0: float, y1: float) -> tuple[tuple[float, float], ...]:
    """Return the places of four lamps."""
    return tuple((x, y) for y in (y0, y1) for x in (x0, x1))


ROOMS: tuple[Room, ...] = (
    Room("CR", 0.0, 20.0, -1.0, 1.0, "plaster-dado", "linoleum", ((2.5, 0.0), (7.5, 0.0), (12.5, 0.0), (17.5, 0.0))),
    Room("1PO", 0.0, 3.45, 1.15, 6.0, "paper-stripes", "parquet", ((1.7, 3.5),)),
    Room("2PO1", 3.6, 7.25, 1.15, 6.0, "plaster-cream", "carpet-blue", ((5.4, 2.5), (5.4, 4.8))),
    Room("2PO2", 7.4, 11.05, 1.15, 6.0, "plaster-cream", "carpet-blue", ((9.2, 2.5), (9.2, 4.8))),
    Room("CNR", 11.2, 16.05, 1.15, 6.0, "panelling", "carpet-grey", _grid(12.6, 14.6, 2.6, 4.6)),
    Room("KT", 16.2, 20.0, 1.15, 6.0, "tiles-green", "checker", ((18.1, 2.6), (18.1, 4.6))),
    Room("PA", 0.0, 4.0, -5.4, -1.15, "plaster-dado", "linoleum", ((2.0, -3.2),)),
    Room("TL", 4.15, 6.45, -5.4, -1.15, "tiles-white", "tiles-small", ((5.3, -2.2), (5.3, -4.2))),
    Room("ST", 6.6, 9.2, -5.4, -1.15, "bricks", "concrete", ((7.9, -3.2),)),
    Room("LO", 9.35, 14.25, -5.4, -1.15, "paper-flowers", "planks", ((10.8, -3.2), (12.9, -3.2))),
    Room(
        "LAB",
        14.4,
        20.0,
        -5.4,
        -1.15,
        "concrete-wall",
        "tiles-large",
        _grid(15.8, 18.4, -4.3, -2.4),
    ),
)
TWINS = ("2PO1", "2PO2")
"""Two rooms alike on purpose: what is in one is in the other, shifted by `TWIN_SHIFT` along x."""
TWIN_SHIFT = 3.8

_NORTH, _SOUTH, _OUT_NORTH, _OUT_SOUTH = 1.075, -1.075, 6.075, -5.475
OPENINGS: tuple[Opening, ...] = (
    Opening("x", _NORTH, 2.1, 3.1, "door"),
    Opening("x", _NORTH, 4.0, 5.0, "door"),
    Opening("x", _NORTH, 7.8, 8.8, "door"),
    Opening("x", _NORTH, 11.5, 12.5, "door"),
    Opening("x", _NORTH, 12.7, 15.8, "glass", 0.1, 2.3),
    Opening("x", _NORTH, 16.8, 17.8, "door"),
    Opening("x", _SOUTH, 0.9, 3.1, "passage", 0.0, 2.3),
    Opening("x", _SOUTH, 4.8, 5.8, "door"),
    Opening("x", _SOUTH, 7.4, 8.4, "door"),
    Opening("x", _SOUTH, 9.8, 11.2, "passage", 0.0, 2.2),
    Opening("x", _SOUTH, 15.5, 16.5, "door"),
    Opening("x", _OUT_NORTH, 0.8, 2.6, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 4.2, 6.6, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 8.0, 10.4, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 11.8, 15.5, "window", 0.5, 2.2),
    Opening("x", _OUT_NORTH, 17.2, 19.2, "window", 1.1, 2.1),
    Opening("x", _OUT_SOUTH, 1.0, 2.6, "window", 0.9, 2.1),
    Opening("x", _OUT_SOUTH, 4.9, 5.7, "window", 1.5, 2.1),
    Opening("x", _OUT_SOUTH, 9.9, 13.7, "window", 0.25, 2.2),
    Opening("x", _OUT_SOUTH, 15.0, 16.9, "window", 0.9, 2.1),
    Opening("x", _OUT_SOUTH, 17.5, 19.4, "window", 0.9, 2.1),
    Opening("y", 20.075, -0.7, 0.7, "window", 0.8, 2.2),
    Opening("y", -0.075, -0.7, 0.7, "window", 0.1, 2.1),
)

_TWIN: tuple[Placed, ...] = (
    Placed(TWINS[0], "workplace", "N", 4.55),
    Placed(TWINS[0], "workplace", "N", 6.3),
    Placed(TWINS[0], "cupboard", "W", 3.9),
    Placed(TWINS[0], "books", "E", 3.7),
    Placed(TWINS[0], "whiteboard", "E", 2.0),
    Placed(TWINS[0], "plant-low", "S", 6.85),
    Placed(TWINS[0], "poster-2", "W", 2.8),
)

FURNITURE: tuple[Placed, ...] = (
    *_TWIN,
    *(replace(p, room=TWINS[1], along=p.along + (TWIN_SHIFT if p.wall in "NS" else 0.0)) for p in _TWIN),
    Placed("CR", "plant", "N", 1.2),
    Placed("CR", "noticeboard", "S", 6.6),
    Placed("CR", "locker", "N", 6.3),
    Placed("CR", "extinguisher", "S", 9.1),
    Placed("CR", "poster-3", "N", 10.2),
    Placed("CR", "poster-1", "S", 12.4),
    Placed("CR", "sideboard", "S", 13.6),
    Placed("CR", "poster-4", "S", 18.2),
    Placed("CR", "plant-low", "S", 19.5),
    Placed("CR", "cooler", "N", 18.9),
    Placed("CR", "coats", "S", 3.9),
    Placed("1PO", "workplace", "N", 1.5),
    Placed("1PO", "books", "W", 2.4),
    Placed("1PO", "books", "W", 3.4),
    Placed("1PO", "sofa-red", "E", 4.3, 0.0),
    Placed("1PO", "poster-1", "E", 2.6),
    Placed("1PO", "plant", "S", 0.4),
    Placed("CNR", "meeting", "S", 13.95, 1.35),
    Placed("CNR", "whiteboard", "W", 3.4),
    Placed("CNR", "television", "E", 3.6),
    Placed("CNR", "plant", "N", 15.75),
    Placed("CNR", "poster-4", "W", 5.2),
    Placed("KT", "kitchen", "N", 17.6),
    Placed("KT", "fridge", "N", 19.6),
    Placed("KT", "table", "E", 2.9),
    Placed("KT", "stool", "E", 2.6, 0.7),
    Placed("KT", "stool", "E", 3.2, 0.7),
    Placed("KT", "noticeboard", "W", 3.4),
    Placed("KT", "cooler", "S", 18.6),
    Placed("KT", "bin", "W", 4.9),
    Placed("PA", "printer", "W", -2.2),
    Placed("PA", "printer", "W", -3.7),
    Placed("PA", "sideboard", "S", 1.9),
    Placed("PA", "pigeonholes", "E", -2.5),
    Placed("PA", "boxes", "E", -4.3),
    Placed("PA", "bin", "N", 3.6),
    Placed("TL", "cabins", "S", 5.3),
    Placed("TL", "basins", "E", -2.5),
    Placed("TL", "bin", "W", -3.4),
    Placed("ST", "rack", "W", -2.4),
    Placed("ST", "rack", "W", -3.7),
    Placed("ST", "rack", "E", -3.2),
    Placed("ST", "cupboard-grey", "E", -4.5),
    Placed("ST", "boxes", "S", 7.6),
    Placed("LO", "sofa-green", "S", 12.6),
    Placed("LO", "sofa-red", "E", -3.4),
    Placed("LO", "coffee-table", "S", 12.6, 1.15),
    Placed("LO", "books-wide", "N", 12.9),
    Placed("LO", "plant", "S", 10.9),
    Placed("LO", "plant-low", "E", -5.1),
    Placed("LO", "table", "W", -4.6),
    Placed("LO", "poster-3", "W", -2.9),
    Placed("LO", "poster-4", "E", -1.9),
    Placed("LAB", "workplace", "S", 15.9),
    Placed("LAB", "workplace", "S", 17.6),
    Placed("LAB", "cupboard-grey", "S", 19.3),
    Placed("LAB", "bench", "N", 17.95, 1.45),
    Placed("LAB", "rack", "W", -3.6),
    Placed("LAB", "books", "E", -3.7),
    Placed("LAB", "whiteboard", "N", 18.2),
    Placed("LAB", "poster-2", "E", -2.2),
    Placed("1PO", "radiator", "N", 2.85),
    Placed("CNR", "radiator", "N", 13.0),
    Placed("CNR", "radiator", "N", 14.4),
    Placed("LO", "radiator", "S", 11.2),
    Placed("LAB", "radiator", "S", 18.6),
)

FIRST = Building(1, ROOMS, OPENINGS, FURNITURE, TWINS)
