"""Colours that everybody can tell apart and read, computed."""

import itertools

import numpy as np
import pytest

from omnieval.palette import (
    BATCH,
    CIVIDIS,
    CONTROL,
    NODE_COLORS,
    OURS,
    UNASSIGNED,
    VIRIDIS,
    contrast,
    ink_on,
    luminance,
    node_color,
    node_shape,
    shade,
)
from omnieval.recording import styles

PAPERS = ("#ffffff", "#14181d", f"#{styles.BACKGROUND_COLOR >> 8:06x}")
"""Of a report, light and dark, and the ground of the viewer's map."""
# Machado, Oliveira, Fernandes 2009 (doi 10.1109/TVCG.2009.113), severity 1, on linear RGB.
SIGHTS = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def lab(color, sight):
    """CIE L*a*b* of ``#rrggbb`` as somebody sees it."""
    channels = np.array([int(color[start : start + 2], 16) for start in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    scaled = XYZ @ np.clip(sight @ linear, 0, 1) / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(scaled > 0.008856, np.cbrt(scaled), 7.787 * scaled + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("sight", SIGHTS)
def test_node_colours_differ_for_every_sight(sight):
    seen = np.array([lab(color, SIGHTS[sight]) for color in NODE_COLORS])
    for one, other in itertools.combinations(range(len(seen)), 2):
        apart = other - one
        if apart <= 5 or (apart < 30 and node_shape(one + 1) == node_shape(other + 1)):
            assert np.linalg.norm(seen[one] - seen[other]) > 20  # a just noticeable difference is about 2.3


def test_all_node_colours_differ_where_a_shape_cannot_help():
    seen = [lab(color, SIGHTS["normal"]) for color in NODE_COLORS]
    assert min(np.linalg.norm(one - other) for one, other in itertools.combinations(seen, 2)) > 9


def test_nodes_have_the_same_colours_in_viewer_and_report():
    assert [f"{styles.node_color(node):08X}" for node in range(50)] == [
        node_color(node)[1:].upper() + "FF" for node in range(50)
    ]


@pytest.mark.parametrize("sight", SIGHTS)
def test_colours_of_one_figure_differ_for_every_sight(sight):
    seen = [lab(color, SIGHTS[sight]) for color in (OURS, BATCH, CONTROL)]
    assert min(np.linalg.norm(one - other) for one, other in itertools.combinations(seen, 2)) > 20


@pytest.mark.parametrize("paper", PAPERS)
@pytest.mark.parametrize("color", [*NODE_COLORS, UNASSIGNED, OURS, BATCH, CONTROL])
def test_marks_stand_out_of_every_ground(color, paper):
    assert contrast(color, paper) >= 3


def test_two_hundred_nodes_are_told_apart_and_keep_their_looks():
    looks = [(node_color(node), node_shape(node)) for node in range(1, 211)]
    assert len(set(looks)) == 210
    assert looks[0] == (node_color(211), node_shape(211))
    assert node_color(0) == UNASSIGNED


@pytest.mark.parametrize("colors", [CIVIDIS, VIRIDIS])
def test_scales_rise_in_lightness_for_every_sight(colors):
    for sight in SIGHTS.values():
        lightness = [lab(color, sight)[0] for color in colors]
        assert lightness == sorted(lightness)
    assert [luminance(color) for color in colors] == sorted(luminance(color) for color in colors)


@pytest.mark.parametrize("colors", [CIVIDIS, VIRIDIS])
def test_values_can_be_read_on_every_shade(colors):
    for step in range(101):
        color = shade(step, 0, 100, colors)
        assert contrast(ink_on(color), color) >= 4.5


def test_a_shade_lies_between_its_neighbours():
    assert shade(0, 0, 10, ("#000000", "#ff0000", "#ffffff")) == "#000000"
    assert shade(2.5, 0, 10, ("#000000", "#ff0000", "#ffffff")) == "#800000"
    assert shade(10, 0, 10, ("#000000", "#ff0000", "#ffffff")) == "#ffffff"
    assert shade(3, 3, 3, ("#000000", "#ff0000", "#ffffff")) == "#ff0000"


def test_contrast_is_that_of_wcag():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)
