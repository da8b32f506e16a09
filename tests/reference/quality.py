"""The quality of a map in plain loops over pairs: the oracle of `omnieval.metrics.quality`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

ROUNDING = 1e-9
Point = Sequence[float]


def within(p: Point, q: Point, theta: float) -> bool:
    return math.dist(p, q) <= theta + ROUNDING


def pair_counts(
    positions: Sequence[Point], stamps: Sequence[int], labels: Sequence[int], apart: int, theta: float
) -> tuple[int, int, int]:
    """Pairs of one node, pairs within theta, and pairs that are both, of images more than `apart` apart in time."""
    pairs = [(i, j) for i, j in combinations(range(len(labels)), 2) if abs(stamps[i] - stamps[j]) > apart]
    together = {(i, j) for i, j in pairs if labels[i] == labels[j] > 0}
    near = {(i, j) for i, j in pairs if within(positions[i], positions[j], theta)}
    return len(together), len(near), len(together & near)


def linked(members: Sequence[int], links: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Groups of members that links join, one after another."""
    groups = {member: {member} for member in members}
    for i, j in links:
        if groups[i] is not groups[j]:
            merged = groups[i] | groups[j]
            for member in merged:
                groups[member] = merged
    return [sorted(group) for group in {id(group): group for group in groups.values()}.values()]


def false_merges(positions: Sequence[Point], labels: Sequence[int], theta: float, smallest: int) -> tuple[int, int]:
    """Nodes that lie in several groups of at least `smallest` images, and their images."""
    merged = []
    for node in sorted({label for label in labels if label > 0}):
        members = [i for i, label in enumerate(labels) if label == node]
        links = [(i, j) for i, j in combinations(members, 2) if within(positions[i], positions[j], theta)]
        if sum(len(group) >= smallest for group in linked(members, links)) > 1:
            merged.append(len(members))
    return len(merged), sum(merged)


def nodes_per_place(
    positions: Sequence[Point], stamps: Sequence[int], labels: Sequence[int], apart: int, theta: float
) -> tuple[float | None, int]:
    """Mean number of nodes over the places seen again, and how many these are."""
    images = range(len(labels))
    links = [
        (i, j)
        for i, j in combinations(images, 2)
        if abs(stamps[i] - stamps[j]) > apart and within(positions[i], positions[j], theta)
    ]
    groups = [group for group in linked(images, links) if len(group) > 1]
    counts = [len(nodes) for group in groups if (nodes := {labels[i] for i in group if labels[i] > 0})]
    return (sum(counts) / len(counts), len(counts)) if counts else (None, 0)


def reentries(
    positions: Sequence[Point], stamps: Sequence[int], labels: Sequence[int], apart: int, theta: float
) -> tuple[int, int, int, int]:
    """Right re-entries, re-entries, right ones with an opportunity, visits with an opportunity."""
    visits: list[list[int]] = []
    for image, label in enumerate(labels):
        if label == 0:
            continue
        if visits and labels[visits[-1][-1]] == label:
            visits[-1].append(image)
        else:
            visits.append([image])
    counts = [0, 0, 0, 0]
    for number, visit in enumerate(visits):
        first = visit[0]
        earlier = [other for other in visits[:number] if labels[other[0]] == labels[first]]
        again = any(stamps[first] - stamps[other[-1]] > apart for other in earlier)
        right = again and any(within(positions[first], positions[i], theta) for other in earlier for i in other)
        chance = any(
            stamps[first] - stamps[i] > apart and within(positions[first], positions[i], theta) for i in range(first)
        )
        for place, counted in enumerate((right, again, right and chance, chance)):
            counts[place] += counted
    return counts[0], counts[1], counts[2], counts[3]


def shortest(count: int, edges: dict[tuple[int, int], float]) -> list[list[float]]:
    """Lengths of all shortest ways (Floyd 1962, doi 10.1145/367766.368168)."""
    ways = [[0.0 if i == j else math.inf for j in range(count)] for i in range(count)]
    for (i, j), length in edges.items():
        ways[i][j] = ways[j][i] = min(ways[i][j], length)
    for k in range(count):
        for i in range(count):
            for j in range(count):
                ways[i][j] = min(ways[i][j], ways[i][k] + ways[k][j])
    return ways


def true_ways(positions: Sequence[Point], step: float) -> list[list[float]]:
    """Lengths of the ways through the images, linked when successive or within `step`."""
    images = range(len(positions))
    edges = {
        (i, j): math.dist(positions[i], positions[j])
        for i, j in combinations(images, 2)
        if j == i + 1 or within(positions[i], positions[j], step)
    }
    return shortest(len(positions), edges)


def most_matched(ones: Sequence[int], others: Sequence[int], apart: int) -> int:
    """The largest number of pairs, one to one, at most `apart` apart."""
    if not ones:
        return 0
    rest = most_matched(ones[1:], others, apart)
    taken = [
        1 + most_matched(ones[1:], [*others[:j], *others[j + 1 :]], apart)
        for j, other in enumerate(others)
        if abs(ones[0] - other) <= apart
    ]
    return max([rest, *taken])
