"""A small made-up replay in which everything happens that a recording has to show."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from omnieval.datasets.sequence import Frame, Pose
from omnieval.explain.scene import Scene
from omnieval.mapping.interface import Method
from omnieval.mapping.leader import Leader
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.step import (
    Comparison,
    Curves,
    EventKind,
    FinalMap,
    Match,
    NodeEvent,
    Placement,
    Role,
    Step,
)
from omnieval.recording.compression import step_images
from omnieval.recording.recorder import RecordingInfo
from omnieval.recording.rows import Row

GAMMA = 5.0
CELLS = 256
N_INIT = 10
CYCLE = 20

PANORAMA_SHAPE = (32, 128, 3)
METHOD = Method.of(Roman2020, "roman2020", {"omega": 2.0, "gamma": GAMMA, "seed": 0})
LEADER = Method.of(Leader, "leader", {"radius": 3.0})


def info(steps, recording_id="a-run", **changes):
    values = {
        "name": "made-up - hog",
        "recording_id": recording_id,
        "steps": steps,
        "method": METHOD,
        "cells": CELLS,
        "description": "# made-up\n\nbefore",
        "properties": {"omega": 2.0, "descriptor": "hog", "seed": 0},
        "extent": (-1.0, -2.0, 12.0, 6.0),
    }
    return RecordingInfo(**(values | changes))


def curves(size, *, best=0, level: float | None = 0.5, names=METHOD.curves):
    """Curves over the whole map of `size` images, numbered as they stand on them."""
    frames = np.arange(size)
    similarity = 1.0 + np.cos(np.arange(size)) / 2
    similarity[best] = 9.0
    return Curves(
        frames, frames, size, {name: similarity / (1 + number) for number, name in enumerate(names)}, best, level
    )


def compared(gate, values, threshold, *, of=(), reaches=False, parameter=None, counts=False):
    """A comparison whose decision any other threshold would turn."""
    values = tuple(map(float, values))
    return Comparison(gate, values, threshold, threshold, threshold, parameter, reaches=reaches, of=of, counts=counts)


FAR = compared("node", [2.31], 1.85, of=(1,), parameter="omega")
NEAR = compared("node", [0.5, 40.0], 1.85, of=(1, 2), parameter="omega")


def prominence(ratio):
    return compared("prominence", [ratio], GAMMA, reaches=True, parameter="gamma")


def centroid(shift):
    return compared("centroid", [shift], 0.02)


def step(frame, verdict, role, node=None, **evidence):
    return Step(frame, verdict, role, node, **evidence)


def steps(count):
    """`N_INIT` initial images, then cycles of: ten that join, three refused, one pending, six without candidate.

    The last six of each cycle become a node, which merges into node 1 in every other cycle.
    """
    return [_initial(frame) if frame < N_INIT else _later(frame) for frame in range(count)]


def _initial(frame):
    events: tuple[NodeEvent, ...] = ()
    if frame == N_INIT - 1:
        created = NodeEvent(EventKind.CREATED, 1, frames=tuple(range(N_INIT)))
        events = (created, NodeEvent(EventKind.ACTIVATED, 1))
    return step(frame, "initial", Role.FOUNDING, 1, events=events)


def _later(frame):
    cycle, phase = divmod(frame - N_INIT, CYCLE)
    matched: dict[str, Any] = {"match": Match(0, 1, 3), "curves": curves(N_INIT)}
    if phase < 10:
        return step(frame, "assigned", Role.JOINED, 1, comparisons=(NEAR, prominence(8.0), centroid(0.01)), **matched)
    if phase < 12:
        return step(frame, "prominence", Role.REFUSED, comparisons=(NEAR, prominence(3.1)), **matched)
    if phase == 12:
        return step(frame, "centroid", Role.REFUSED, comparisons=(NEAR, prominence(8.0), centroid(0.03)), **matched)
    if phase == 13:
        return step(frame, "pending", Role.PENDING, 1, comparisons=(FAR,))
    if phase < CYCLE - 1:
        return step(frame, "no-candidate", Role.REFUSED, comparisons=(FAR,))
    node = cycle + 2
    created = NodeEvent(EventKind.CREATED, node, frames=tuple(range(frame - 5, frame + 1)))
    if cycle % 2:
        events = (created, NodeEvent(EventKind.MERGED, node, into=1))
        return step(frame, "no-candidate", Role.REFUSED, 1, comparisons=(FAR,), events=events)
    return step(frame, "no-candidate", Role.REFUSED, node, comparisons=(FAR,), events=(created,))


def by_entity(rows: Iterable[tuple[str, Row]]) -> dict[str, Any]:
    """Rows by entity; of whatever kind the entity shows."""
    return dict(rows)


def image(frame, *, poses=True, room=True):
    """Where and when the image of a step was taken: on an ellipse that takes 126 steps."""
    angle = frame / 20
    return Frame(
        Path(),
        f"image-{frame}.jpeg",
        1_152_904_768_000_000_000 + 200_000_000 * frame if poses else None,
        Pose(6 + 5 * math.cos(angle), 2 + 3 * math.sin(angle), angle) if poses else None,
        ("KT" if frame % 60 < 30 else "LR") if room else None,
    )


def scene(a_step, revisit=None, **surroundings):
    """A step with its surroundings, and those of its best match."""
    best = None if a_step.match is None else image(a_step.match.frame, **surroundings)
    return Scene(a_step, image(a_step.frame, **surroundings), best, revisit, CELLS)


def picture(shape, seed):
    """Something as detailed as a photograph: smooth surfaces, edges and some noise."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 255, (shape[0] // 16 + 1, shape[1] // 16 + 1, 3), np.uint8)
    image = cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return cv2.add(image, rng.integers(0, 12, shape, np.uint8))


def images(a_step, *, shape=PANORAMA_SHAPE, omnidirectional=(48, 64, 3)):
    a_match = picture(shape, a_step.match.frame) if a_step.match is not None else None
    camera = None if omnidirectional is None else picture(omnidirectional, a_step.frame)
    shift = a_step.match.shift if a_step.match is not None else 0
    return step_images(picture(shape, a_step.frame), camera, a_match, shift=shift, cells=CELLS)


def final(labels, *, nodes=(1, 2), active=(1,)):
    labels = np.asarray(labels, np.int64)
    placements = tuple(Placement.FOUNDING if label else Placement.UNASSIGNED for label in labels)
    return FinalMap(labels, placements, nodes, frozenset(active), np.zeros((len(nodes), 4)))
