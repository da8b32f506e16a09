"""The way of a drive through a building: which rooms in which order, where in them, and how fast."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.building import SHELL, Building, Opening, Room
from omnieval.datasets.synthetic.furnish import depth_at
from omnieval.datasets.synthetic.furniture import solids_of
from omnieval.datasets.synthetic.solids import Solid
from omnieval.seeding import named_generator

Point = tuple[float, float]
Floats = NDArray[np.float64]

STEP = 0.02
"""Metres between the points of a way."""
_TURN, _WIDEST = 0.4, 0.9
"""The smallest and the largest radius of a turn in a room, metres."""
_ROBOT = 0.4
"""What the robot's centre keeps from what stands at the walls of a room, metres."""
_KERNEL = 25
"""A moving average over so many points, twice, rounds corners into curves that a robot can drive."""
_ISLAND = 1.0
"""What stands so far from its wall stands in the middle of the room, metres."""
_CHAIR = 0.5
"""How much farther than a desk its chair may stand from the wall, metres."""


@dataclass(frozen=True)
class Route:
    """The corridors' middles as a graph.

    Attributes
    ----------
    links
        From each node its neighbours with their distances, metres.
    doors
        Of each room the node before its door.
    """

    links: dict[Point, dict[Point, float]]
    doors: dict[str, Point]

    def between(self, start: Point, end: Point, toll: dict[frozenset[Point], float]) -> list[Point]:
        """Return the shortest way between two nodes, links being longer by their toll (Dijkstra)."""
        best: dict[Point, Point | None] = {}
        queue: list[tuple[float, Point, Point | None]] = [(0.0, start, None)]
        while queue:
            length, node, before = heapq.heappop(queue)
            if node in best:
                continue
            best[node] = before
            if node == end:
                break
            for other, distance in self.links[node].items():
                heapq.heappush(queue, (length + distance * toll.get(frozenset((node, other)), 1.0), other, node))
        way, at = [], end
        while True:
            way.append(at)
            if (previous := best[at]) is None:
                return way[::-1]
            at = previous


def route(building: Building) -> Route:
    """Return the graph of a building's corridors."""
    corridors = [room for room in building.rooms if room.corridor]
    on: dict[str, set[Point]] = {room.code: set() for room in corridors}
    doors: dict[str, Point] = {}
    links: dict[Point, dict[Point, float]] = {}
    for room in building.rooms:
        if not room.corridor:
            corridor, place = _before(building, room, door_of(building, room))
            on[corridor.code].add(place)
            doors[room.code] = place
    for first, second in itertools.combinations(corridors, 2):
        for opening in building.openings:
            if opening.kind == "passage" and _joins(opening, first) and _joins(opening, second):
                meeting = _crossing(first, second)
                on[first.code].add(meeting)
                on[second.code].add(meeting)
    for places in on.values():
        for a, b in itertools.pairwise(sorted(places)):
            distance = math.dist(a, b)
            links.setdefault(a, {})[b] = distance
            links.setdefault(b, {})[a] = distance
    return Route(links, doors)


def door_of(building: Building, room: Room) -> Opening:
    """Return the opening through which a room is entered."""
    return next(o for o in building.openings if o.kind in ("door", "passage") and _joins(o, room))


def _joins(opening: Opening, room: Room) -> bool:
    """Tell whether an opening is in one of the room's walls."""
    middle = (opening.start + opening.end) / 2
    place = (middle, opening.at) if opening.axis == "x" else (opening.at, middle)
    return room.distance(*place) < 2 * SHELL


def _before(building: Building, room: Room, door: Opening) -> tuple[Room, Point]:
    """Return the corridor before a door, and the place on its middle."""
    corridor = next(other for other in building.rooms if other.corridor and _joins(door, other))
    middle = round((door.start + door.end) / 2, 6)
    x, y = _middle(corridor)
    return corridor, (middle, y) if door.axis == "x" else (x, middle)


def _middle(room: Room) -> Point:
    return round((room.x0 + room.x1) / 2, 6), round((room.y0 + room.y1) / 2, 6)


def _crossing(first: Room, second: Room) -> Point:
    """Return where the middles of two corridors at right angles meet."""
    flat, upright = (first, second) if first.x1 - first.x0 > first.y1 - first.y0 else (second, first)
    return _middle(upright)[0], _middle(flat)[1]


@dataclass(frozen=True)
class Plan:
    """What a light's drive does: rooms in order, the tolls of the corridors, how it moves in rooms."""

    stops: tuple[str, ...]
    toll: dict[frozenset[Point], float]
    key: str


def planned(building: Building, light: str, lights: Sequence[str]) -> Plan:
    """Return the plan of a light's drive.

    Every light has its own order; each leaves out one room that another one visits, and goes twice into some.
    """
    graph = route(building)
    rng = named_generator(building.number, f"route-{light}")
    around = _around(building, [room.code for room in building.rooms if not room.corridor])
    solitary = named_generator(building.number, "solitary")
    ordinary = [code for code in around if code not in building.twins]
    only = ordinary[int(solitary.integers(len(ordinary)))]
    seen_by = lights[int(solitary.integers(len(lights)))]
    rooms = [code for code in around if code != only or light == seen_by]
    first = int(rng.integers(len(rooms)))
    order = rooms[first:] + rooms[:first]
    if lights.index(light) % 2:
        order.reverse()
    for _ in range(len(order) // 5):
        i = int(rng.integers(len(order) - 1))
        order[i], order[i + 1] = order[i + 1], order[i]
    again = rng.permutation(np.array(order[1:-1]))[:2].tolist()
    toll = {
        frozenset((a, b)): float(rng.uniform(0.7, 1.4))
        for a in sorted(graph.links)
        for b in sorted(graph.links[a])
        if a < b
    }
    return Plan((*order, *again), toll, light)


def _around(building: Building, codes: Iterable[str]) -> list[str]:
    """Return rooms in the order in which their doors lie around the building."""
    places = {code: route(building).doors[code] for code in codes}
    x, y = np.mean(list(places.values()), axis=0)
    return sorted(places, key=lambda code: (math.atan2(places[code][1] - y, places[code][0] - x), code))


def nominal(building: Building, plan: Plan) -> Floats:
    """Return the way down the corridors' middles and through the rooms, closed, every `STEP`, shape (m, 2)."""
    graph = route(building)
    corners: list[Point] = []
    for number, (stop, following) in enumerate(zip(plan.stops, (*plan.stops[1:], plan.stops[0]), strict=True)):
        rng = named_generator(building.number, f"turn-{plan.key}", number)
        corners += _through(building, building.room(stop), graph.doors[stop], rng)
        corners += graph.between(graph.doors[stop], graph.doors[following], plan.toll)[1:-1]
    return rounded(resampled(np.array(corners)))


def _through(building: Building, room: Room, before: Point, rng: np.random.Generator) -> list[Point]:
    """Return the way from the corridor through a room and back: in by the door, round an ellipse, out."""
    door = door_of(building, room)
    x0, x1, y0, y1 = _clear(building, room, door)
    rx = float(np.clip(rng.uniform(0.6, 1.0) * (x1 - x0) / 2, _TURN, _WIDEST))
    ry = float(np.clip(rng.uniform(0.6, 1.0) * (y1 - y0) / 2, _TURN, _WIDEST))
    cx = float(rng.uniform(min(x0 + rx, (x0 + x1) / 2), max(x1 - rx, (x0 + x1) / 2)))
    cy = float(rng.uniform(min(y0 + ry, (y0 + y1) / 2), max(y1 - ry, (y0 + y1) / 2)))
    middle = (door.start + door.end) / 2
    if door.axis == "x":
        inside = (middle, room.y1 - 0.45) if door.at > room.y1 else (middle, room.y0 + 0.45)
    else:
        inside = (room.x1 - 0.45, middle) if door.at > room.x1 else (room.x0 + 0.45, middle)
    away = math.atan2(inside[1] - cy, inside[0] - cx)
    way = 1.0 if rng.random() < 0.5 else -1.0
    turn = [away + way * math.radians(angle) for angle in range(40, 321, 40)]
    return [before, inside, *((cx + rx * math.cos(t), cy + ry * math.sin(t)) for t in turn), inside, before]


def _clear(building: Building, room: Room, door: Opening) -> tuple[float, float, float, float]:
    """Return x0, x1, y0, y1 of where the robot may turn in a room: beside what stands in its middle."""
    here = [piece for piece in building.furniture if piece.room == room.code]

    def kept(wall: str) -> float:
        desks = any(piece.wall == wall and piece.kind == "workplace" for piece in here)
        at_wall = [piece for piece in here if piece.gap < _ISLAND]
        return max(depth_at(room, wall, at_wall) + (_CHAIR if desks else 0.0), 0.15) + _ROBOT

    x0, x1, y0, y1 = room.x0 + kept("W"), room.x1 - kept("E"), room.y0 + kept("S"), room.y1 - kept("N")
    x0, x1 = (x0, x1) if x0 < x1 else ((x0 + x1) / 2,) * 2
    y0, y1 = (y0, y1) if y0 < y1 else ((y0 + y1) / 2,) * 2
    for piece in here:
        if piece.gap >= _ISLAND:
            x0, x1, y0, y1 = _beside((x0, x1, y0, y1), solids_of(room, piece))
    return x0, x1, y0, y1


def _beside(free: tuple[float, float, float, float], solids: Sequence[Solid]) -> tuple[float, float, float, float]:
    """Return the largest of the four rectangles that something leaves of a rectangle."""
    x0, x1, y0, y1 = free
    reach = [max(solid.width, solid.depth) / 2 + _ROBOT for solid in solids]
    left = min(s.x - r for s, r in zip(solids, reach, strict=True))
    right = max(s.x + r for s, r in zip(solids, reach, strict=True))
    low = min(s.y - r for s, r in zip(solids, reach, strict=True))
    high = max(s.y + r for s, r in zip(solids, reach, strict=True))
    if left > x1 or right < x0 or low > y1 or high < y0:
        return free
    rest = [(x0, left, y0, y1), (right, x1, y0, y1), (x0, x1, y0, low), (x0, x1, high, y1)]
    return max(rest, key=lambda r: min(r[1] - r[0], 1.0) * min(r[3] - r[2], 1.0) if r[1] > r[0] and r[3] > r[2] else -1)


def resampled(corners: Floats) -> Floats:
    """Return a closed polyline resampled at `STEP`."""
    closed = np.vstack([corners, corners[:1]])
    closed = closed[np.append(True, np.hypot(*np.diff(closed, axis=0).T) > 1e-9)]
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    grid = np.arange(0.0, at[-1], STEP)
    return np.column_stack([np.interp(grid, at, closed[:, i]) for i in range(2)])


def rounded(points: Floats) -> Floats:
    """Return a closed way with its corners rounded."""
    half = _KERNEL // 2
    kernel = np.ones(_KERNEL) / _KERNEL
    for _ in range(2):
        padded = np.concatenate([points[-half:], points, points[:half]])
        points = np.column_stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(2)])
    return points
