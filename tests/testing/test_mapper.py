"""The contract of mappers: ours and a third party's pass, and every way to break it is called by its name."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest
from pydantic import BaseModel, Field

from omnieval.descriptors.description import Description
from omnieval.mapping.interface import Column, Gate
from omnieval.mapping.leader import Leader, LeaderSettings
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
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
def test_the_papers_method_passes(settings):
    check_mapper(lambda: Roman2020(Roman2020Settings(**settings)))


def test_the_leader_passes():
    check_mapper(Leader)
    check_mapper(lambda: Leader(LeaderSettings(radius=1.2)))


def test_descriptions_of_ones_own_can_be_given():
    rng = np.random.default_rng(0)
    check_mapper(Leader, [Description(rng.random(3, np.float32), rng.random((8, 2), np.float32)) for _ in range(60)])


class Slices:
    """A third party's mapper: every 25 images make a node, known from the first of them."""

    LENGTH = 25
    settings: ClassVar[dict[str, int]] = {"length": 25}
    gates: ClassVar[tuple[Gate, ...]] = (Gate(name="length", value="images", threshold="length"),)
    columns: ClassVar[tuple[Column, ...]] = (
        Column(name="since", type="int", meaning="images since the node was made"),
        Column(name="limit", type="float", meaning="where it ends", threshold_of="length"),
    )
    curves: ClassVar[tuple[str, ...]] = ("nearness",)

    def __init__(self):
        self.positions = []

    def step(self, description):
        frame = len(self.positions)
        self.positions.append(description.position.astype(np.float64))
        node, since = frame // self.LENGTH + 1, frame % self.LENGTH
        created = NodeEvent(EventKind.CREATED, node, frames=(frame,))
        return Step(
            frame=frame,
            verdict="taken" if since else "new",
            role=Role.JOINED if since else Role.REFUSED,
            node=node,
            match=Match(frame - 1, node) if since else None,
            events=() if since else (created, NodeEvent(EventKind.ACTIVATED, node)),
            comparisons=(Comparison("length", (since,), 25, since, np.inf, "length"),),
            measured={"since": since},
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
        self.measured = {"since": Guesses.instances}

    def step(self, description):
        return dataclasses.replace(super().step(description), measured=self.measured)


class Revises(Slices):
    """Rewrites an earlier step when it knows better."""

    def __init__(self):
        super().__init__()
        self.measured = {"since": 0}

    def step(self, description):
        step = super().step(description)
        if step.frame == 200:
            self.measured["since"] = 1
        return dataclasses.replace(step, measured=self.measured) if step.frame == 20 else step


class Restarts(Slices):
    """Forgets at `finish` how far it was."""

    finished = False

    def step(self, description):
        step = super().step(description)
        return dataclasses.replace(step, measured={"since": 99}) if self.finished else step

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


def compared(**changes):
    """Change what the seventh step compared."""
    one = Comparison("length", (7,), 25, 7, np.inf, "length")
    return at(7, comparisons=(dataclasses.replace(one, **changes),))


def drawn(**changes):
    """Let the seventh step draw a curve."""
    two = {"frames": np.arange(2), "slots": np.arange(2), "size": 9, "values": {"nearness": np.array([0.5, 1.0])}}
    return at(7, curves=Curves(**{**two, "best": 1, **changes}))


def test_a_third_partys_mapper_passes():
    check_mapper(Slices)
    check_mapper(drawn())


def test_one_that_declares_and_compares_nothing_passes():
    class Silent(Slices):
        gates = ()
        columns = ()
        curves = ()

        def step(self, description):
            return dataclasses.replace(super().step(description), comparisons=(), measured={})

    check_mapper(Silent)


@pytest.mark.parametrize(
    ("factory", "message"),
    [
        (at(7, frame=8), "numbered from 0, but step 7 has frame 8"),
        (slices(step=lambda step: step.frame), "step 0: step must return a Step, got int"),
        (at(7, verdict=""), "step 7: verdict must be text, got ''"),
        (at(7, verdict=None), "step 7: verdict must be text, got None"),
        (at(7, role="accepted"), "step 7: role must be a Role, got 'accepted'"),
        (at(7, node=None), "step 7: role joined and node None do not go together"),
        (at(7, role=Role.REFUSED), "step 7: role refused and node 1 do not go together"),
        (at(7, role=Role.UNASSIGNED), "step 7: role unassigned and node 1 do not go together"),
        (at(7, node=3), "step 7: its node 3 does not exist after the step"),
        (compared(gate="width"), r"step 7: the comparison at gate 'width' names none of the gates .*, \['length'\]"),
        (compared(values=()), r"gate 'length' must have finite values, got \(\)"),
        (compared(values=(7, np.nan)), r"gate 'length' must have finite values, got \(7, nan\)"),
        (compared(values=(7, 8)), "say what its values belong to, got 0 nodes or images for 2 values"),
        (compared(of=(1, 2)), "say what its values belong to, got 2 nodes or images for 1 values"),
        (compared(high=20), "must have its threshold between low 7 and high 20, but it is 25"),
        (compared(high=25), "must have its threshold between low 7 and high 25, but it is 25"),
        (compared(low=25, reaches=True), "must have its threshold between low 25 and high inf, but it is 25"),
        (compared(parameter="width"), "names parameter 'width', which is none of the mapper's settings"),
        (compared(threshold=26), "must have the threshold that length gives, 25, but it is 26"),
        (at(7, measured={"wide": 1}), "step 7: measured wide, but the mapper declares no such column"),
        (at(7, measured={"limit": 25.0}), "step 7: measured limit, but the mapper declares no such column"),
        (at(7, measured={"since": 1.5}), "step 7: since must be a whole number or None, got 1.5"),
        (at(7, match=Match(7, 1)), "step 7: the match must be an earlier image, got 7"),
        (at(30, match=Match(3, 2)), "step 30: the match, image 3, was in node 1, but the step says 2"),
        (drawn(values={"farness": np.ones(2)}), r"curves \['farness'\], but the mapper declares \['nearness'\]"),
        (drawn(slots=np.arange(3)), "curves must have a value for each of their 2 images"),
        (drawn(best=0), "the best image must be the maximum of the first curve, but index 0 is not"),
        (drawn(size=1), "slots must lie on the curve over 1 images"),
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
        (in_the_end(labels=lambda final: final.labels[1:]), r"one entry per image, 240, got \(239,\)"),
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
            r"image 7 is placed as forced, which does not follow from its step \(joined\)",
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


class Bent(BaseModel, frozen=True):
    radius: float = Field(3.0, gt=0)
    bend: float = Field(1.0, gt=0)


class Cheats(Leader):
    """A parameter does more than its comparisons say."""

    name = "cheats"
    Settings = Bent  # type: ignore[assignment]
    swept = ("radius", "bend")  # type: ignore[assignment]

    def decide(self, frame):
        step = super().decide(frame)
        return dataclasses.replace(step, verdict="bent") if frame == 9 and self.settings.bend > 1.5 else step


def test_a_swept_parameter_may_act_through_comparisons_alone():
    with pytest.raises(AssertionError) as raised:
        check_mapper(Cheats)
    assert str(raised.value) == (
        "swept parameters must act through comparisons alone, but with {'bend': 2.0} step 9 is near in a sweep and "
        "bent alone, or differs in numbers"
    )


def test_a_swept_parameter_must_be_a_setting():
    class Lost(Leader):
        swept = ("radius", "reach")  # type: ignore[assignment]

    with pytest.raises(AssertionError, match="reach is swept, but none of the mapper's settings"):
        check_mapper(Lost)


def test_a_comparison_that_is_wider_than_it_is_true_is_found_by_a_sweep():
    class Wide(Leader):
        def decide(self, frame):
            step = super().decide(frame)
            wide = tuple(dataclasses.replace(one, low=-np.inf, high=np.inf) for one in step.comparisons)
            return dataclasses.replace(step, comparisons=wide)

    with pytest.raises(AssertionError, match=r"must act through comparisons alone, but with \{'radius'"):
        check_mapper(Wide)
