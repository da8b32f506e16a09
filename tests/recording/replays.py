"""A small made-up replay in which everything happens that a recording has to show."""

import math
from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np

from omnieval.explain.decision import best_match, decision
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import (
    Centroid,
    EventKind,
    FinalMap,
    Margin,
    Match,
    NodeEvent,
    NodeGate,
    Placement,
    Step,
    Verdict,
)
from omnieval.recording.pictures import step_images
from omnieval.recording.records import RecordingInfo, StepView
from omnieval.recording.rows import Row

GAMMA = 5.0
CELLS = 256
N_INIT = 10
CYCLE = 20

PANORAMA_SHAPE = (32, 128, 3)


def info(steps, recording_id="a-run", **changes):
    values = {
        "name": "made-up - hog",
        "recording_id": recording_id,
        "steps": steps,
        "mapper": MapperConfig(gamma=GAMMA),
        "cells": CELLS,
        "description": "# made-up\n\nbefore",
        "properties": {"omega": 2.0, "descriptor": "hog", "seed": 0},
        "extent": (-1.0, -2.0, 12.0, 6.0),
    }
    return RecordingInfo(**(values | changes))


def match(size, *, best=0, prominence=8.0, mean=1.0, peaks=5, node=1):
    """A match over the whole map of `size` images, numbered as they stand on the curve."""
    frames = np.arange(size)
    similarity = 1.0 + np.cos(np.arange(size)) / 2
    similarity[best] = 9.0
    return Match(
        frames=frames,
        slots=frames,
        map_size=size,
        position=similarity / similarity.sum(),
        orientation=similarity / similarity.sum(),
        similarity=similarity,
        shifts=np.full(size, 3),
        best=best,
        node=node,
        prominence=prominence,
        prominence_mean=mean,
        peaks=peaks,
    )


def step(frame, verdict, node=None, **evidence):
    values = {"gate": None, "match": None, "centroid": None, "run": 0, "events": (), "active": 1, "pending": 0}
    return Step(frame=frame, verdict=verdict, node=node, **({"margin": None} | values | evidence))


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
    return step(frame, Verdict.INITIAL, 1, events=events, active=int(bool(events)))


def _later(frame):
    cycle, phase = divmod(frame - N_INIT, CYCLE)
    far = NodeGate(1.85, np.array([1]), np.array([2.31]))
    near = NodeGate(1.85, np.array([1, 2]), np.array([0.5, 40.0]))
    evidence = {"gate": near, "margin": Margin(0.25, "node")}
    if phase < 10:
        close = Centroid(0.01, 0.02)
        return step(frame, Verdict.ASSIGNED, 1, match=match(N_INIT), centroid=close, **evidence)
    if phase < 12:
        return step(frame, Verdict.PROMINENCE, match=match(N_INIT, prominence=3.1), run=phase - 9, **evidence)
    if phase == 12:
        return step(frame, Verdict.CENTROID, match=match(N_INIT), centroid=Centroid(0.03, 0.02), run=3, **evidence)
    if phase == 13:
        return step(frame, Verdict.PENDING, 1, gate=far)
    run = phase - 13
    if phase < CYCLE - 1:
        return step(frame, Verdict.NO_CANDIDATE, gate=far, run=run)
    node = cycle + 2
    created = NodeEvent(EventKind.CREATED, node, frames=tuple(range(frame - 5, frame + 1)))
    if cycle % 2:
        events = (created, NodeEvent(EventKind.MERGED, node, into=1))
        return step(frame, Verdict.NO_CANDIDATE, 1, gate=far, run=run, events=events)
    return step(frame, Verdict.NO_CANDIDATE, node, gate=far, run=run, events=(created,), pending=1)


def by_entity(rows: Iterable[tuple[str, Row]]) -> dict[str, Any]:
    """Rows by entity; of whatever kind the entity shows."""
    return dict(rows)


def view(a_step, *, poses=True, room=True, silhouette=0.25):
    angle = a_step.frame / 20
    return StepView(
        step=a_step,
        milliseconds=1.5,
        position=(6 + 5 * math.cos(angle), 2 + 3 * math.sin(angle)) if poses else None,
        yaw=angle if poses else None,
        room=("KT" if a_step.frame % 60 < 30 else "LR") if room else None,
        time_ns=1_152_904_768_000_000_000 + 200_000_000 * a_step.frame if poses else None,
        silhouette=silhouette,
        file=f"image-{a_step.frame}.jpeg",
    )


def decided(a_step, **surroundings):
    """A step with its surroundings, and those of its best match."""
    here = view(a_step, **surroundings).capture
    if a_step.match is None:
        return decision(a_step, here, None)
    there = view(step(a_step.match.best_frame, Verdict.INITIAL), **surroundings).capture
    return decision(a_step, here, best_match(a_step.match, here, there, CELLS))


def picture(shape, seed):
    """Something as detailed as a photograph: smooth surfaces, edges and some noise."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 255, (shape[0] // 16 + 1, shape[1] // 16 + 1, 3), np.uint8)
    image = cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return cv2.add(image, rng.integers(0, 12, shape, np.uint8))


def images(a_step, *, shape=PANORAMA_SHAPE, omnidirectional=(48, 64, 3)):
    a_match = picture(shape, a_step.match.best_frame) if a_step.match is not None else None
    camera = None if omnidirectional is None else picture(omnidirectional, a_step.frame)
    shift = a_step.match.shift if a_step.match is not None else 0
    return step_images(picture(shape, a_step.frame), camera, a_match, shift=shift, cells=CELLS)


def final(labels, *, nodes=(1, 2), active=(1,)):
    labels = np.asarray(labels, np.int64)
    placements = tuple(Placement.FOUNDING if label else Placement.UNASSIGNED for label in labels)
    return FinalMap(labels, placements, nodes, frozenset(active), np.zeros((len(nodes), 4)))
