"""What stands in a chart."""

from omnieval.report.draw import spec_of
from omnieval.report.figure import Block, Figure


def figure_of(block: Block) -> Figure:
    """Return a block that must be a figure."""
    assert isinstance(block, Figure)
    return block


def rows_of(figure):
    """Return all rows of all data sets of a figure's chart."""
    return [row for rows in spec_of(figure.chart)["datasets"].values() for row in rows]
