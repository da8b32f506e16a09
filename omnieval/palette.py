"""Colours that people with any colour vision can distinguish, on light and dark ground, and readable text on them.

A node has one colour in the viewer and in reports. It is never known by its colour alone: it also has its number, and
in reports a shape.
"""

from __future__ import annotations

from collections.abc import Sequence

INK = "#1b1f24"
MUTED = "#57606a"
GRID = "#d8dee4"
PAPER = "#fdfdfe"
"""Colours of text and lines, of secondary ones, of the grid, and of the halo of labels. The page gives these four other
values on dark paper, so nothing else may be drawn in them."""

# fmt: off
NODE_COLORS = (
    "#3366cc", "#d55e00", "#009e73", "#a0522d", "#3a9bdc", "#008b9e", "#d20afa", "#96960a", "#d20078",
    "#fa465a", "#506e28", "#c86ed2", "#5a50f0", "#b48214", "#96506e", "#e66e6e", "#a032be", "#9682b4",
    "#9632f0", "#f00a0a", "#be2864", "#aa8c50", "#9682fa", "#fa00b4", "#a000fa", "#6ea00a", "#32785a",
    "#0a781e", "#f032e6", "#be32a0", "#5a46fa", "#dc64a0", "#b47864", "#8c6428", "#828ce6", "#964696",
    "#d27800", "#b43c6e", "#789664", "#be3232", "#648cd2", "#1e64fa",
)
# fmt: on
"""Colours of nodes as they come: at least 3 : 1 against both papers and the viewer's ground, any six in succession far
apart for normal sight, protanopia and deuteranopia, and so are those of one shape among thirty in succession."""
NODE_SHAPES = ("circle", "square", "triangle-up", "diamond", "triangle-down")
"""As many as share no factor with the colours, so that 210 nodes differ in one or the other."""
UNASSIGNED = "#8b949e"

OURS = "#d55e00"
BATCH = "#3366cc"
CONTROL = "#8b949e"

CIVIDIS = ("#00224e", "#213769", "#434e6c", "#5e656e", "#777b78", "#928f76", "#afa66d", "#ccbb5f", "#e9d24c", "#fee838")
VIRIDIS = ("#440154", "#482777", "#3f4a8a", "#31678e", "#26838f", "#1f9d8a", "#6cce5a", "#b6de2b", "#fee825")
"""Dark to light, in even steps for any colour vision (J. R. Nuñez et al., doi 10.1371/journal.pone.0199239)."""

DARK_INK = "#000000"
LIGHT_INK = "#ffffff"


def node_color(node: int) -> str:
    """Return the colour of a node, always the same; 0 is not a node."""
    return NODE_COLORS[(node - 1) % len(NODE_COLORS)] if node else UNASSIGNED


def node_shape(node: int) -> str:
    """Return the shape of a node's images, always the same; 0 is not a node."""
    return NODE_SHAPES[(node - 1) % len(NODE_SHAPES)] if node else "cross"


def shade(value: float, low: float, high: float, colors: Sequence[str]) -> str:
    """Return the colour of a value on a scale of evenly spaced colours, mixed linearly in sRGB as a chart does."""
    share = (value - low) / (high - low) if high > low else 0.5
    place = min(max(share, 0.0), 1.0) * (len(colors) - 1)
    index = min(int(place), len(colors) - 2)
    weight = place - index
    pairs = zip(_channels(colors[index]), _channels(colors[index + 1]), strict=True)
    return "#" + "".join(f"{round(a + weight * (b - a)):02x}" for a, b in pairs)


def ink_on(color: str) -> str:
    """Return black or white, whichever is easier to read on `color`; the contrast is at least 4.5 : 1."""
    return max((DARK_INK, LIGHT_INK), key=lambda ink: contrast(ink, color))


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of two colours, 1 to 21 (WCAG 2.2, section 1.4.3)."""
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def luminance(color: str) -> float:
    """Return the relative luminance of ``#rrggbb``, 0 to 1 (WCAG 2.2)."""
    linear = [
        channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4
        for channel in (value / 255 for value in _channels(color))
    ]
    return sum(weight * value for weight, value in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def _channels(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)
