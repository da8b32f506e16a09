"""The contract of mappers: ours and a third party's pass, and every way to break it is called by its name."""

import dataclasses

import numpy as np
import pytest

from omnieval import Mapper, MapperConfig
from omnieval.descriptors.description import Description
from omnieval.mapping.step import EventKind, FinalMap, Margin, NodeEvent, NodeGate, Placement, Step, Verdict
from omnieval.testing import check_mapper


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"n_init": 10, "n_new": 10, "gamma": 1.0, "merge_when": "always", "merge_y": 3.0},
        {"split": "random", "covariance": "ledoit-wolf", "leftovers": "unassigned"},
    ],
    ids=str,
)
def test_our_mapper_passes(settings):
    check_mapper(lambda: Mapper(MapperConfig(**settings)))


def test_descriptions_of_ones_own_can_be_given():
    rng = np.random.default_rng(0)
    check_mapper(Mapper, [Description(rng.random(3, np.float32), rng.random((8, 2), np.float32)) for _ in range(60)])


class Slices:
    """A third party's mapper: every 25 images make a node, known from the first of them."""

    LENGTH = 25

    def __init__(self):
        self.positions = []

    def step(self, description):
        frame = len(self.positions)
        self.positions.append(description.position.astype(np.float64))
        node = frame // self.LENGTH + 1
        first = frame % self.LENGTH == 0
        created = NodeEvent(EventKind.CREATED, node, frames=(frame,))
        return Step(
            frame=frame,
            verdict=Verdict.NO_CANDIDATE if first else Verdict.ASSIGNED,
            node=node,
            gate=None,
            match=None,
            centroid=None,
            run=int(first),
            events=(created, NodeEvent(EventKind.ACTIVATED, node)) if first else (),
            active=node,
            pending=0,
            margin=None,
        )

    def finish(self):
        frames = np.arange(len(self.positions))
        labels = frames // self.LENGTH + 1
        nodes = tuple(range(1, int(labels[-1]) + 1))
        return FinalMap(
            labels=labels,
            placements=tuple(
                Placement.LOOP_CLOSURE if frame % self.LENGTH else Placement.FOUNDING for frame in frames.tolist()
            ),
            nodes=nodes,
            active=frozenset(nodes),
            representatives=np.array([np.array(self.positions)[labels == node].mean(axis=0) for node in nodes]),
        )


def slices(step=lambda step: step, final=lambda final: final):
    """A factory of `Slices` whose steps and final map are changed."""

    class Changed(Slices):
        def step(self, description):
            return step(super().step(description))

        def finish(self):
            return final(super().finish())

    return Changed


def at(number, /, **changes):
    """Change one step, the others stay."""
    return slices(step=lambda step: dataclasses.replace(step, **changes) if step.frame == number else step)


def in_the_end(**changes):
    return slices(
        final=lambda final: dataclasses.replace(final, **{name: change(final) for name, change in changes.items()})
    )


def put(values, index, value):
    changed = np.array(values, object) if isinstance(values, tuple) else values.copy()
    changed[index] = value
    return tuple(changed) if isinstance(values, tuple) else changed


class Overwrites(Slices):
    def step(self, description):
        description.orientation[:] = 0
        return super().step(description)


class Guesses(Slices):
    instances = 0

    def __init__(self):
        super().__init__()
        Guesses.instances += 1
        self.margin = Margin(float(Guesses.instances), "node")

    def step(self, description):
        return dataclasses.replace(super().step(description), margin=self.margin)


class Revises(Slices):
    """Rewrites an earlier step when it knows better."""

    def __init__(self):
        super().__init__()
        self.ratios = np.zeros(1)

    def step(self, description):
        step = super().step(description)
        if step.frame == 200:
            self.ratios[:] = 1
        gate = NodeGate(2.0, np.array([1]), self.ratios) if step.frame == 20 else None
        return dataclasses.replace(step, gate=gate)


class Restarts(Slices):
    """Forgets at `finish` how long its run was."""

    finished = False

    def step(self, description):
        step = super().step(description)
        return dataclasses.replace(step, run=99) if self.finished else step

    def finish(self):
        self.finished = True
        return super().finish()


class Tires(Slices):
    """Answers differently when asked again."""

    asked = 0

    def finish(self):
        self.asked += 1
        final = super().finish()
        return dataclasses.replace(final, representatives=final.representatives * (1 if self.asked < 3 else 2))


def event(kind, node, into=None):
    return (NodeEvent(kind, node, into=into, frames=()),)


def test_a_third_partys_mapper_passes():
    check_mapper(Slices)


@pytest.mark.parametrize(
    ("factory", "message"),
    [
        (at(7, frame=8), "numbered from 0, but step 7 has frame 8"),
        (at(7, verdict="accepted"), "step 7: verdict must be a Verdict, got 'accepted'"),
        (at(7, node=None), "step 7: verdict assigned and node None do not go together"),
        (at(7, verdict=Verdict.PROMINENCE), "step 7: verdict prominence and node 1 do not go together"),
        (at(7, node=3), "step 7: its node 3 does not exist after the step"),
        (at(7, active=2), "step 7: reports 2 active and 0 pending nodes, but its events leave 1 and 0"),
        (at(7, events=event(EventKind.CREATED, 1)), "step 7: created node 1, but ids are new and positive"),
        (at(7, events=event(EventKind.ACTIVATED, 1)), "step 7: node 1 was activated twice"),
        (at(7, events=event(EventKind.ACTIVATED, 5)), "step 7: node 5 was activated but does not exist"),
        (at(7, events=event(EventKind.MERGED, 1, 4)), "step 7: node 1 merged into 4, which does not exist"),
        (at(7, events=event(EventKind.MERGED, 1, 1)), "step 7: node 1 merged into 1, which does not exist"),
        (Overwrites, "must not change its input, but changed the arrays of image 0"),
        (Guesses, r"equal images must give equal steps, which stay as they are afterwards \(step 0\)"),
        (Revises, r"equal images must give equal steps, which stay as they are afterwards \(step 20\)"),
        (Restarts, r"finish must leave the map as it is, but later steps differ \(step 160\)"),
        (Tires, "finish must return the same when called twice"),
        (in_the_end(nodes=lambda final: final.nodes[:-1]), "finish: nodes must be those that events leave"),
        (in_the_end(active=lambda _: frozenset({1})), r"finish: active nodes .* got \[1\]"),
        (in_the_end(labels=lambda final: final.labels[1:]), r"one entry an image, 240, got \(239,\)"),
        (in_the_end(labels=lambda final: final.labels.astype(float)), r"labels \(int64\)"),
        (in_the_end(labels=lambda final: final.labels + 1), "labels must be 0 or nodes"),
        (in_the_end(labels=lambda final: np.minimum(final.labels, 2)), "no node be empty"),
        (in_the_end(representatives=lambda final: final.representatives[1:]), r"of shape \(10, 16\), got \(9, 16\)"),
        (in_the_end(representatives=lambda final: final.representatives * np.nan), "representatives must be finite"),
        (
            in_the_end(labels=lambda final: put(final.labels, 7, 2)),
            "image 7 got node 1, which ended as 1, but has label 2",
        ),
        (in_the_end(labels=lambda final: put(final.labels, 7, 0)), "image 7 is loop-closure but has label 0"),
        (
            in_the_end(placements=lambda final: put(final.placements, 7, Placement.FORCED)),
            r"image 7 is placed as forced, which does not follow from its step \(assigned\)",
        ),
        (
            in_the_end(placements=lambda final: put(final.placements, 25, Placement.LOOP_CLOSURE)),
            "image 25 is placed as loop-closure",
        ),
    ],
)
def test_a_broken_mapper_is_told_what_is_wrong(factory, message):
    with pytest.raises(AssertionError, match=message) as raised:
        check_mapper(factory)
    assert "\n" not in str(raised.value)
