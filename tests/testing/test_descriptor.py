"""The contract of descriptors: ours and a third party's pass, and every way to break it is called by its name."""

import dataclasses
import math

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.descriptors.gist import Gist, GistSettings
from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.errors import ConfigError
from omnieval.testing import check_descriptor


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


class Bare:
    """Nothing but what a descriptor must have."""

    def describe(self, panorama):
        return Brightness().describe(panorama)


class Counts(Bare):
    described = 0

    def describe(self, panorama):
        self.described += 1
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


class Batched(Brightness):
    batch = 4

    def describe_batch(self, panoramas):
        return [self.describe(panorama) for panorama in panoramas]


class Unoriented(Brightness):
    """A descriptor with a position part alone."""

    def describe(self, panorama):
        return Description(super().describe(panorama).position, np.ones((1, 1), np.float32))


class Coloured(Brightness):
    colour = True

    def describe(self, panorama):
        assert panorama.shape == (128, 512, 3)
        return super().describe(panorama[:, :, 2])


class LooksAside(Batched):
    def describe_batch(self, panoramas):
        among = np.float32(np.mean(panoramas))
        return [Description(one.position + among, one.orientation) for one in super().describe_batch(panoramas)]


class Forgets(Batched):
    def describe_batch(self, panoramas):
        return super().describe_batch(panoramas[:3])


class OneMovingCell(Brightness):
    def describe(self, panorama):
        return Description(super().describe(panorama).position, np.full((1, 1), panorama.mean(), np.float32))


class UnorientedFront(Unoriented):
    def describe(self, panorama):
        return super().describe(panorama[:, :256])


def with_attributes(**attributes):
    descriptor = Brightness()
    for name, value in attributes.items():
        setattr(descriptor, name, value)
    return descriptor


@pytest.mark.parametrize(
    "descriptor",
    [
        Hog(),
        Hog(HogSettings(kernel="sobel", binning="linear", normalisation="global-l2", orientation_cells=64)),
        Gist(),
        Gist(GistSettings(prefilter="local-contrast", normalisation="global-l2", orientation_width=32, padding=32)),
        Brightness(),
        Batched(),
        Unoriented(),
        Coloured(),
    ],
    ids=lambda descriptor: descriptor.name,
)
def test_a_sound_descriptor_passes(descriptor):
    check_descriptor(descriptor)


def test_a_descriptor_needs_neither_name_nor_settings():
    check_descriptor(Bare())


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
        (with_attributes(settings=["stride"]), "settings must be a dict or a pydantic model, got list"),
        (LooksAside(), "describe_batch must give 1 panoramas what describe gives each of them"),
        (Forgets(), "describe_batch gave 3 descriptions of 4 panoramas"),
        (OneMovingCell(), "an orientation descriptor of one cell must always be the same"),
        (UnorientedFront(), r"a panorama rolled by 1 column\(s\) must keep the position descriptor"),
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
        (Counts(), "name and settings must stay as they are"),
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
    coarse = Gist(GistSettings(levels=3))  # a cell is 2 columns, half a pixel of its coarsest level
    with pytest.raises(AssertionError, match="must keep the position descriptor"):
        check_descriptor(coarse)
    check_descriptor(coarse, tolerance=0.01)
