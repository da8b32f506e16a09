"""Floor plans from a number: corridors in the form of an L, a ring or an H, and rooms in strips along them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from omnieval.datasets.synthetic.building import SHELL, Building, Opening, Room
from omnieval.datasets.synthetic.first import FIRST
from omnieval.datasets.synthetic.furnish import furnished
from omnieval.seeding import named_generator

_GAP = 2 * SHELL
"""Between the insides of neighbouring rooms, metres."""
_DOOR = 1.0
_NARROWEST = 2.7
_ROOMS = (6, 14)
"""How few and how many rooms a building has, corridors not counted."""
_SCALES = (0.7, 0.85, 1.0, 1.15)
"""How large a building is; 1 has about ten rooms."""
_FORMS: tuple[Literal["L", "ring", "H"], ...] = ("L", "ring", "H")

Side = Literal["N", "E", "S", "W"]
Rectangle = tuple[float, float, float, float]
"""x0, x1, y0, y1."""


@dataclass(frozen=True, slots=True)
class _Slot:
    """Where a room goes: its bounds, on which of its walls the corridor lies, and the strip it is part of."""

    bounds: Rectangle
    side: Side
    strip: int

    @property
    def width(self) -> float:
        """Extent along the corridor, metres."""
        x0, x1, y0, y1 = self.bounds
        return x1 - x0 if self.side in "NS" else y1 - y0


@dataclass(frozen=True, slots=True)
class _Style:
    """What a kind of room looks like: code, wall, floor, tint of its lamps (BGR)."""

    code: str
    walls: tuple[str, ...]
    floors: tuple[str, ...]
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


_WARM, _GREENISH = (0.8, 0.95, 1.0), (0.75, 1.1, 0.8)
_OFFICE = ("plaster-cream", "paper-stripes", "panelling", "plaster-dado")
_STYLES: dict[str, _Style] = {
    "1PO": _Style("1PO", _OFFICE, ("parquet", "carpet-blue", "linoleum"), _WARM),
    "2PO": _Style("2PO", _OFFICE, ("carpet-blue", "carpet-grey", "parquet")),
    "CNR": _Style("CNR", ("panelling", "plaster-cream"), ("carpet-grey", "parquet"), _WARM),
    "KT": _Style("KT", ("tiles-green", "tiles-white"), ("checker", "tiles-large")),
    "PA": _Style("PA", ("plaster-dado", "plaster-cream"), ("linoleum", "tiles-large")),
    "TL": _Style("TL", ("tiles-white", "tiles-green"), ("tiles-small", "tiles-large"), _GREENISH),
    "ST": _Style("ST", ("bricks", "concrete-wall"), ("concrete", "linoleum"), _GREENISH),
    "LO": _Style("LO", ("paper-flowers", "paper-stripes"), ("planks", "parquet"), _WARM),
    "LAB": _Style("LAB", ("concrete-wall", "plaster-dado"), ("tiles-large", "linoleum")),
    "OP": _Style("OP", ("plaster-cream", "concrete-wall"), ("carpet-grey", "carpet-blue")),
}
_OTHERS = ("PA", "TL", "1PO", "KT", "ST", "LO", "1PO", "LAB", "2PO", "1PO", "ST")
"""What rooms become beyond the pair of twins, the meeting room and the open plan."""


@lru_cache(maxsize=8)
def building(number: int) -> Building:
    """Return a building by its number: 1 is drawn by hand, the others are made from it as a seed."""
    return FIRST if number == 1 else _made(number)


def _made(number: int) -> Building:
    rng = named_generator(number, "floor-plan")
    form = _FORMS[number % len(_FORMS)]
    corridors, joints, slots = _laid_out(form, rng)
    while len(slots) < _ROOMS[0]:
        corridors, joints, slots = _laid_out(form, rng)
    slots = _thinned(slots, rng)
    twins = _twin_slots(slots)
    slots = _evened(slots, twins)
    kinds = _kinds(slots, twins, rng)
    rooms, openings = list(_corridor_rooms(corridors, rng)), list(joints)
    relative = float(rng.uniform(0.3, 0.7))
    look: dict[str, Room] = {}
    for slot, (kind, code) in zip(slots, kinds, strict=True):
        room = _room(slot, kind, code, rng)
        if kind == "2PO" and slots.index(slot) in twins:
            first = look.setdefault("twin", room)
            room = replace(room, wall=first.wall, floor=first.floor)
        rooms.append(room)
        at = relative if slots.index(slot) in twins else float(rng.uniform(0.25, 0.75))
        openings += _towards_corridor(slot, kind, at)
    pair = (kinds[twins[0]][1], kinds[twins[1]][1])
    for room in tuple(rooms):
        alike = pair[0] if room.code in pair else room.code
        openings += _windows(room, rooms, openings, named_generator(number, f"windows-{alike}"))
    bare = Building(number, tuple(rooms), tuple(openings), (), pair)
    return replace(bare, furniture=furnished(bare, rng))


def _laid_out(
    form: Literal["L", "ring", "H"], rng: np.random.Generator
) -> tuple[list[Rectangle], list[Opening], list[_Slot]]:
    """Return corridors, the openings between them, and where rooms go."""
    w = round(float(rng.uniform(2.2, 2.6)), 2)
    scale = float(rng.choice(_SCALES))
    deep = [round(float(d), 2) for d in rng.uniform(4.2, 5.0, 6)]
    slots: list[_Slot] = []
    if form == "L":
        long, tall = (round(float(v), 2) for v in scale * rng.uniform((12.0, 9.0), (15.0, 12.0)))
        left = long + _GAP
        corridors = [(0.0, long, 0.0, w), (left, left + w, 0.0, tall)]
        joints = [Opening("y", long + SHELL, 0.15, w - 0.15, "passage", 0.0, 2.3)]
        slots += _strip(0, (0.0, long, -_GAP - deep[0], -_GAP), "N", rng)
        slots += _strip(1, (0.0, long - deep[2] - _GAP, w + _GAP, w + _GAP + deep[1]), "S", rng)
        slots += _strip(2, (long - deep[2], long, w + _GAP, tall), "E", rng)
        slots += _strip(3, (left + w + _GAP, left + w + _GAP + deep[3], 0.0, tall), "W", rng)
    elif form == "ring":
        wide, core = round(scale * float(rng.uniform(13.0, 15.0)), 2), round(float(rng.uniform(4.4, 5.0)), 2)
        low, high = w + _GAP, w + _GAP + core
        inner = (w + _GAP, wide - w - _GAP)
        corridors = [
            (0.0, wide, 0.0, w),
            (0.0, wide, high + _GAP, high + _GAP + w),
            (0.0, w, low, high),
            (wide - w, wide, low, high),
        ]
        joints = [
            Opening("x", at, x + 0.15, x + w - 0.15, "passage", 0.0, 2.3)
            for at in (w + SHELL, high + SHELL)
            for x in (0.0, wide - w)
        ]
        slots += _strip(0, (0.0, wide, -_GAP - deep[0], -_GAP), "N", rng)
        slots += _strip(1, (*inner, low, high), "S" if rng.random() < 0.5 else "N", rng)
        slots += _strip(2, (0.0, wide, high + 2 * _GAP + w, high + 2 * _GAP + w + deep[1]), "S", rng)
    else:
        wide, tall = (round(float(v), 2) for v in scale * rng.uniform((9.0, 10.5), (11.0, 12.5)))
        middle = round(tall / 2 - w / 2, 2)
        inner = (w + _GAP, w + _GAP + wide)
        right = inner[1] + _GAP
        corridors = [(0.0, w, 0.0, tall), (right, right + w, 0.0, tall), (*inner, middle, middle + w)]
        joints = [
            Opening("y", at, middle + 0.15, middle + w - 0.15, "passage", 0.0, 2.3) for at in (w + SHELL, right - SHELL)
        ]
        slots += _strip(0, (-_GAP - deep[0], -_GAP, 0.0, tall), "E", rng)
        slots += _strip(1, (right + w + _GAP, right + w + _GAP + deep[1], 0.0, tall), "W", rng)
        slots += _strip(2, (*inner, middle + w + _GAP, tall), "S", rng)
        slots += _strip(3, (*inner, 0.0, middle - _GAP), "N", rng)
    return corridors, joints, slots


def _strip(number: int, bounds: Rectangle, side: Side, rng: np.random.Generator) -> list[_Slot]:
    """Cut a strip beside a corridor into rooms of uneven width."""
    x0, x1, y0, y1 = bounds
    start, end = (x0, x1) if side in "NS" else (y0, y1)
    count = max(1, round((end - start) / float(rng.uniform(3.6, 4.8))))
    while count > 1 and (end - start - (count - 1) * _GAP) / count < _NARROWEST + 0.3:
        count -= 1
    shares = rng.uniform(0.75, 1.35, count)
    free = end - start - (count - 1) * _GAP
    widths = _NARROWEST + (free - count * _NARROWEST) * shares / shares.sum()
    slots, edge = [], start
    for width in widths:
        a, b = round(edge, 3), round(edge + float(width), 3)
        slots.append(_Slot((a, b, y0, y1) if side in "NS" else (x0, x1, a, b), side, number))
        edge = b + _GAP
    return slots


def _thinned(slots: list[_Slot], rng: np.random.Generator) -> list[_Slot]:
    """Leave rooms out until there are no more than a building has."""
    kept = list(slots)
    while len(kept) > _ROOMS[1]:
        kept.pop(int(rng.integers(len(kept))))
    return kept


def _twin_slots(slots: list[_Slot]) -> tuple[int, int]:
    """Return the two neighbours that are most nearly alike and wide enough to be offices for two."""
    pairs = [i for i in range(len(slots) - 1) if slots[i].strip == slots[i + 1].strip]
    best = min(pairs, key=lambda i: abs((slots[i].width + slots[i + 1].width) / 2 - 3.7))
    return best, best + 1


def _evened(slots: list[_Slot], twins: tuple[int, int]) -> list[_Slot]:
    """Make the twins equally wide by moving the wall between them."""
    first, second = (slots[i] for i in twins)
    even = list(slots)
    if first.side in "NS":
        x0, x1, y0, y1 = first.bounds[0], second.bounds[1], first.bounds[2], first.bounds[3]
        half = (x1 - x0 - _GAP) / 2
        bounds = (x0, x0 + half, y0, y1), (x1 - half, x1, y0, y1)
    else:
        x0, x1, y0, y1 = first.bounds[0], first.bounds[1], first.bounds[2], second.bounds[3]
        half = (y1 - y0 - _GAP) / 2
        bounds = (x0, x1, y0, y0 + half), (x0, x1, y1 - half, y1)
    for index, each in zip(twins, bounds, strict=True):
        even[index] = replace(slots[index], bounds=each)
    return even


def _kinds(slots: list[_Slot], twins: tuple[int, int], rng: np.random.Generator) -> list[tuple[str, str]]:
    """Return kind and code of every room: the widest is an open plan, the next one the meeting room."""
    rest = sorted((i for i in range(len(slots)) if i not in twins), key=lambda i: -slots[i].width)
    kinds = dict.fromkeys(twins, "2PO") | {rest[0]: "OP", rest[1]: "CNR"}
    others = [rest[2:][int(i)] for i in rng.permutation(len(rest) - 2)]
    kinds |= {i: _OTHERS[k % len(_OTHERS)] for k, i in enumerate(others)}
    named = []
    for i in range(len(slots)):
        alike = [j for j in range(len(slots)) if kinds[j] == kinds[i]]
        code = kinds[i] if len(alike) == 1 else f"{kinds[i]}{alike.index(i) + 1}"
        named.append((kinds[i], code))
    return named


def _corridor_rooms(corridors: list[Rectangle], rng: np.random.Generator) -> list[Room]:
    """Return the corridors as rooms, lamps along their middle."""
    wall = ("plaster-dado", "panelling", "plaster-cream", "concrete-wall")[int(rng.integers(4))]
    floor = ("linoleum", "parquet", "tiles-large", "planks")[int(rng.integers(4))]
    rooms = []
    for number, (x0, x1, y0, y1) in enumerate(corridors, start=1):
        along = max(y1 - y0, x1 - x0)
        count = max(1, round(along / 4.5))
        places = [(i + 0.5) / count for i in range(count)]
        flat = x1 - x0 > y1 - y0
        lamps = tuple(
            (x0 + p * (x1 - x0), (y0 + y1) / 2) if flat else ((x0 + x1) / 2, y0 + p * (y1 - y0)) for p in places
        )
        code = f"CR{number}" if len(corridors) > 1 else "CR"
        rooms.append(Room(code, x0, x1, y0, y1, wall, floor, lamps))
    return rooms


def _room(slot: _Slot, kind: str, code: str, rng: np.random.Generator) -> Room:
    style = _STYLES[kind]
    x0, x1, y0, y1 = slot.bounds
    columns, rows = max(1, round((x1 - x0) / 2.6)), max(1, round((y1 - y0) / 2.8))
    lamps = tuple(
        (x0 + (i + 0.5) / columns * (x1 - x0), y0 + (j + 0.5) / rows * (y1 - y0))
        for j in range(rows)
        for i in range(columns)
    )
    wall = style.walls[int(rng.integers(len(style.walls)))]
    floor = style.floors[int(rng.integers(len(style.floors)))]
    return Room(code, x0, x1, y0, y1, wall, floor, lamps, style.tint)


def _towards_corridor(slot: _Slot, kind: str, relative: float) -> list[Opening]:
    """Return the door of a room, wide and without a leaf for an open plan, and the glass beside a meeting room's."""
    x0, x1, y0, y1 = slot.bounds
    axis: Literal["x", "y"] = "x" if slot.side in "NS" else "y"
    at = {"N": y1 + SHELL, "S": y0 - SHELL, "E": x1 + SHELL, "W": x0 - SHELL}[slot.side]
    start, end = (x0, x1) if axis == "x" else (y0, y1)
    if kind == "OP":
        middle, half = (start + end) / 2, min(1.2, (end - start) / 2 - 0.5)
        return [Opening(axis, at, middle - half, middle + half, "passage", 0.0, 2.3)]
    if kind == "CNR":
        door = start + 0.35
        return [
            Opening(axis, at, door, door + _DOOR, "door"),
            Opening(axis, at, door + _DOOR + 0.2, end - 0.25, "glass", 0.1, 2.3),
        ]
    middle = start + 0.85 + relative * (end - start - 1.7)
    return [Opening(axis, at, middle - _DOOR / 2, middle + _DOOR / 2, "door")]


def _windows(room: Room, rooms: list[Room], openings: list[Opening], rng: np.random.Generator) -> list[Opening]:
    """Return a window in every outer wall that is whole; in a long one it is wide."""
    found = []
    walls: tuple[tuple[Literal["x", "y"], float, float, float, float], ...] = (
        ("x", room.y1 + SHELL, room.x0, room.x1, 1.0),
        ("x", room.y0 - SHELL, room.x0, room.x1, -1.0),
        ("y", room.x1 + SHELL, room.y0, room.y1, 1.0),
        ("y", room.x0 - SHELL, room.y0, room.y1, -1.0),
    )
    for axis, at, start, end, out in walls:
        share, shift = rng.uniform(0.35, 0.6), rng.uniform(-0.1, 0.1)
        sill = float(rng.choice([1.1, 1.2, 1.3, 1.4]))
        if (room.corridor and end - start > 4.0) or room.code.startswith("ST"):
            continue
        middle, half = (start + end) / 2 + shift, (end - start) / 2 * share
        sides = [(middle + k * half, at + out * d) for k in (-1.0, 0.0, 1.0) for d in (0.3, 1.5)]
        places = sides if axis == "x" else [(y, x) for x, y in sides]
        taken = any(o.axis == axis and abs(o.at - at) < 0.2 and start < o.end and o.start < end for o in openings)
        if taken or any(other.distance(*place) == 0.0 for place in places for other in rooms):
            continue
        half = math.floor(half * 20) / 20
        found.append(Opening(axis, at, middle - half, middle + half, "window", sill, 2.1))
    return found
