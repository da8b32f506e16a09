"""The contract suite: ours and a third party's pass, and every way to break the contract is called by its name."""

import dataclasses
import hashlib
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from omnieval import Mapper, MapperConfig
from omnieval.datasets import load
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.descriptors.description import Description
from omnieval.descriptors.gist import Gist, GistConfig
from omnieval.descriptors.hog import Hog, HogConfig
from omnieval.errors import ConfigError, DatasetError
from omnieval.mapping.step import EventKind, FinalMap, Margin, NodeEvent, NodeGate, Placement, Step, Verdict
from omnieval.testing import check_dataset, check_descriptor, check_mapper
from tests.datasets.trees import cold_names, make_cold, make_folder

# -- descriptors --------------------------------------------------------------------------------------------


class Brightness:
    """A third party's descriptor: mean grey level of every row, and of every eighth column."""

    name = "brightness"

    def __init__(self):
        self.settings = {"stride": 8}

    def describe(self, panorama):
        position = panorama.mean(axis=1).astype(np.float32)
        return Description(position, panorama.mean(axis=0)[::8, np.newaxis].astype(np.float32))


def brightness(**changes):
    """A `Brightness` whose describe is followed by a change of its arrays."""

    class Changed(Brightness):
        def describe(self, panorama):
            description = super().describe(panorama)
            replaced = {field: change(getattr(description, field)) for field, change in changes.items()}
            return dataclasses.replace(description, **replaced)

    return Changed()


class Paints(Brightness):
    def describe(self, panorama):
        panorama[0] = 0
        return super().describe(panorama)


class Remembers(Brightness):
    seen = 0

    def describe(self, panorama):
        self.seen += 1
        description = super().describe(panorama)
        return Description(description.position + np.float32(self.seen), description.orientation)


class Recycles(Brightness):
    buffer = np.empty(128, np.float32)

    def describe(self, panorama):
        self.buffer[:] = super().describe(panorama).position
        return Description(self.buffer, super().describe(panorama).orientation)


class Learns(Brightness):
    def describe(self, panorama):
        self.settings = {"stride": 8, "seen": True}
        return super().describe(panorama)


class DividesByContrast(Brightness):
    def describe(self, panorama):
        description = super().describe(panorama)
        with np.errstate(invalid="ignore"):
            return Description(description.position / np.float32(panorama.std()), description.orientation)


class LooksAtTheFirstColumns(Brightness):
    def describe(self, panorama):
        return Description(super().describe(panorama[:, :64]).position, super().describe(panorama).orientation)


class RunsBackwards(Brightness):
    def describe(self, panorama):
        return Description(super().describe(panorama).position, super().describe(panorama[:, ::-1]).orientation)


class ReturnsATuple(Brightness):
    def describe(self, panorama):
        description = super().describe(panorama)
        return description.position, description.orientation


def with_attributes(**attributes):
    descriptor = Brightness()
    for name, value in attributes.items():
        setattr(descriptor, name, value)
    return descriptor


@pytest.mark.parametrize(
    "descriptor",
    [
        Hog(),
        Hog(HogConfig(kernel="sobel", binning="linear", normalisation="global-l2", orientation_cells=64)),
        Gist(),
        Gist(GistConfig(prefilter="local-contrast", normalisation="global-l2", orientation_width=32, padding=32)),
        Brightness(),
    ],
    ids=lambda descriptor: descriptor.name,
)
def test_a_sound_descriptor_passes(descriptor):
    check_descriptor(descriptor)


def test_panoramas_of_ones_own_can_be_given():
    panoramas = np.random.default_rng(0).integers(0, 256, (2, 32, 64)).astype(np.uint8)
    check_descriptor(Brightness(), panoramas)
    with pytest.raises(ConfigError, match="at least two panoramas, got 1"):
        check_descriptor(Brightness(), panoramas[:1])


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (with_attributes(name="two words"), "name must be a plain word, got 'two words'"),
        (with_attributes(settings={"weights": np.ones(2)}), "settings must be plain values that JSON can hold"),
        (with_attributes(settings={"scale": math.nan}), "settings must be plain values that JSON can hold"),
        (with_attributes(settings=["stride"]), "settings must be a dict, got list"),
        (ReturnsATuple(), "describe must return a Description"),
        (brightness(position=np.float64), "position descriptor of panorama 0 must be float32, got float64"),
        (brightness(orientation=np.ravel), r"must have 2 dimension\(s\), got shape \(64,\)"),
        (brightness(position=lambda array: array / np.float32(0)), "position descriptor of panorama 0 has NaN"),
        (DividesByContrast(), "constant grey level 0 has NaN or infinite"),
        (brightness(position=lambda array: array[array > array.mean()]), "has shape .*, that of others"),
        (brightness(orientation=lambda array: array[:60]), "number of cells that divides 512 columns, got 60"),
        (Paints(), "describe must not change the panorama, but changed panorama 0"),
        (Remembers(), "equal panoramas must give equal arrays"),
        (Recycles(), "must not be written again by a later call"),
        (Learns(), "name and settings must stay as they are"),
        (brightness(position=np.zeros_like), "different panoramas must differ, but all have the same position"),
        (brightness(orientation=np.ones_like), "different panoramas must differ, but all have the same orientation"),
        (LooksAtTheFirstColumns(), r"rolled by 1 cell\(s\) must keep the position descriptor"),
        (RunsBackwards(), "must roll the orientation descriptor by 1, but it changed by"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_a_broken_descriptor_is_told_what_is_wrong(broken, message):
    with pytest.raises(AssertionError, match=message) as raised:
        check_descriptor(broken)
    assert "\n" not in str(raised.value)


def test_how_much_a_rotation_may_change_is_the_callers_to_say():
    coarse = Gist(GistConfig(levels=3))  # a cell is 2 columns, half a pixel of its coarsest level
    with pytest.raises(AssertionError, match="must keep the position descriptor"):
        check_descriptor(coarse)
    check_descriptor(coarse, tolerance=0.01)


# -- datasets -----------------------------------------------------------------------------------------------

FOLDER_POSES = "file,x,y,yaw,room,time\n" + "".join(f"{i}.png,{i},0,0,CR,{i}\n" for i in range(1, 13))


def ours(root, kind):
    if kind == "cold":
        return load(f"cold:{make_cold(root, cold_names(12))}")
    poses = FOLDER_POSES if kind == "folder" else None
    return load(f"folder:{make_folder(root, [f'{i}.png' for i in range(1, 13)], poses)}")


@pytest.mark.parametrize("kind", ["cold", "folder", "folder-without-poses"])
def test_our_sequences_pass_whole_and_cut(kind, tmp_path):
    sequence = ours(tmp_path / "sequence", kind)
    check_dataset(sequence)
    check_dataset(sequence.cut(start=2, stride=3))
    check_dataset(sequence.cut(limit=1))


def load_raw(source):
    """A third party's dataset: ``raw:PATH``, files ``<milliseconds>.raw`` that begin with x, y, yaw."""
    root = Path(source.removeprefix("raw:"))
    files = sorted(root.glob("*.raw"), key=lambda file: int(file.stem))
    frames = tuple(
        Frame(file, file.name, int(file.stem) * 10**6, Pose(*struct.unpack("3d", file.read_bytes()[:24])), "hall")
        for file in files
    )
    return Sequence(root.name, source, root, frames, Camera("panoramic"))


@pytest.fixture
def raw(tmp_path):
    for number in range(9):
        (tmp_path / f"{100 * number}.raw").write_bytes(struct.pack("3d", number, 0.5, 0.1) + b"pixels")
    return load_raw(f"raw:{tmp_path}")


def test_a_third_partys_sequence_passes(raw):
    check_dataset(raw, load=load_raw)


def test_a_source_nobody_can_load_is_refused(raw):
    with pytest.raises(DatasetError, match="unknown source"):
        check_dataset(raw)


def with_frame(sequence, index, **changes):
    frames = list(sequence.frames)
    frames[index] = dataclasses.replace(frames[index], **changes)
    return dataclasses.replace(sequence, frames=tuple(frames))


class Noisy(Frame):
    def read(self):
        noise = hashlib.sha256(np.random.default_rng().bytes(8)).digest()
        return super().read() + noise


class WithoutCut(Sequence):
    def cut(self, *, start=0, stride=1, limit=None):
        return self


class AnyCut(Sequence):
    def cut(self, *, start=0, stride=1, limit=None):
        kept = self.frames[start::stride][:limit]
        return dataclasses.replace(self, frames=kept, cut_from=(start, stride, limit))


def as_kind(kind, sequence):
    return kind(**{field.name: getattr(sequence, field.name) for field in dataclasses.fields(sequence)})


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda raw: dataclasses.replace(raw, name="a/b"), "name must be a plain file name, got 'a/b'"),
        (lambda raw: dataclasses.replace(raw, frames=()), "the sequence has no frames"),
        (lambda raw: with_frame(raw, 3, file="100.raw"), "unique files, but '100.raw' occurs twice"),
        (lambda raw: with_frame(raw, 3, file="/data/300.raw"), "relative to the sequence, .* got '/data/300.raw'"),
        (lambda raw: with_frame(raw, 3, file="../300.raw"), "relative to the sequence"),
        (lambda raw: with_frame(raw, 3, file="raw\\300.raw"), "with / as separator"),
        (lambda raw: with_frame(raw, 3, pose=Pose(0, math.nan, 0)), r"300\.raw: a pose must be finite or None"),
        (lambda raw: with_frame(raw, 3, pose=Pose(0, 0, 4)), r"300\.raw: yaw must lie in \(-pi, pi\], got 4"),
        (lambda raw: with_frame(raw, 3, room=""), "an unknown room must be None, not empty"),
        (lambda raw: with_frame(raw, 3, time_ns=0.3), "time_ns must be an int, got 0.3"),
        (lambda raw: with_frame(raw, 3, time_ns=0), r"order of capture, but '300\.raw' is earlier than '200\.raw'"),
        (lambda raw: dataclasses.replace(raw, frames=raw.frames[::-1]), "order of capture"),
        (lambda raw: dataclasses.replace(raw, frames=raw.frames[1:]), "must load the same sequence again"),
        (lambda raw: with_frame(raw, 3, room="kitchen"), "must load the same sequence again"),
        (lambda raw: as_kind(WithoutCut, raw), r"cut\(start=1, stride=2, limit=3\) must keep those frames"),
        (lambda raw: as_kind(AnyCut, raw), r"cut\(start=9\) leaves no frame and must raise DatasetError"),
    ],
)
def test_a_broken_sequence_is_told_what_is_wrong(break_it, message, raw):
    with pytest.raises(AssertionError, match=message) as raised:
        check_dataset(break_it(raw), load=load_raw)
    assert "\n" not in str(raised.value)


def test_images_are_read(raw):
    raw.frames[-1].path.write_bytes(b"")
    with pytest.raises(AssertionError, match=r"800\.raw: read must give the bytes of an image"):
        check_dataset(raw, load=lambda _: raw)
    raw.frames[-1].path.unlink()
    with pytest.raises(DatasetError, match=r"800\.raw"):
        check_dataset(raw, load=lambda _: raw)


def test_an_image_that_changes_between_readings_is_noticed(raw):
    first = raw.frames[0]
    noisy = Noisy(first.path, first.file, first.time_ns, first.pose, first.room)
    with pytest.raises(AssertionError, match=r"0\.raw: read must give the same bytes twice"):
        check_dataset(dataclasses.replace(raw, frames=(noisy, *raw.frames[1:])), load=load_raw)


# -- mappers ------------------------------------------------------------------------------------------------


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
