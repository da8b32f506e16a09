"""Decisions of a run, from its tables alone: no image is needed, nothing is decided again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import polars as pl

from omnieval.datasets.sequence import Frame
from omnieval.errors import ResultError
from omnieval.explain.flips import Flip, flips
from omnieval.explain.page import Line, lines, placement_text
from omnieval.explain.revisit import Revisit, Revisits
from omnieval.explain.scene import Scene
from omnieval.mapping.interface import Method
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Placement, Step
from omnieval.results.run_folder import Run
from omnieval.results.tables import read_steps
from omnieval.wording import did_you_mean, shown


@dataclass(frozen=True)
class Explanation:
    """A decision of a run, what would have changed it, and what the end made of the image.

    Attributes
    ----------
    scene
        The step with its surroundings.
    flips
        What would have changed the outcome of each comparison.
    node_final, placement
        Where the image ended and how it came there; None if it belongs to no node, or the run did not reach its end.
    images_final, rooms_final
        Number of that node's images, and its rooms with their shares of them.
    """

    scene: Scene
    flips: tuple[Flip, ...]
    node_final: int | None
    placement: Placement | None
    images_final: int | None = None
    rooms_final: tuple[tuple[str, float], ...] = ()


class RunExplainer:
    """Explains the steps of one run.

    Raises
    ------
    ResultError
        If the run has no steps.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._table = run.steps
        if self._table.is_empty():
            raise ResultError(f"{run.folder} has no steps; replay the sequence again")
        self.method: Method = run.method
        self._cells: int | None = run.manifest.get("orientation_cells")

    def __len__(self) -> int:
        return len(self._table)

    def find(self, step: str) -> int:
        """Return the number of a step that is named by itself or by its image file.

        Raises
        ------
        ResultError
            If the run has no such step.
        """
        if step.removeprefix("-").isascii() and step.removeprefix("-").isdigit():
            return self._checked(int(step))
        files = self._table["file"].to_list()
        named = [frame for frame, file in enumerate(files) if step in (file, file.rsplit("/", 1)[-1])]
        if len(named) == 1:
            return named[0]
        if named:
            raise ResultError(
                f"{shown(step)} names the steps {named[0]} and {named[1]} of {self._run.folder}; choose one"
            )
        hint = did_you_mean(step, files, otherwise=f"name a step, 0 to {len(files) - 1}, or an image file")
        raise ResultError(f"{self._run.folder} has no image {shown(step)}; {hint}")

    def explain(self, frame: int) -> Explanation:
        """Return the explanation of a step.

        Raises
        ------
        ResultError
            If the run has no such step.
        """
        scene = self.scene(self._checked(frame))
        node, placement = self._table.select("node_final", "placement").row(frame)
        return Explanation(
            scene,
            flips(scene.step, self.method),
            node,
            Placement(placement) if placement is not None else None,
            **self._final_node(node),
        )

    def scenes(self) -> Iterator[Scene]:
        """Yield every step with its surroundings, in their order."""
        return map(self.scene, range(len(self)))

    def scene(self, frame: int) -> Scene:
        """Return a step with its surroundings."""
        step, image = self._steps[frame]
        best = self._steps[step.match.frame][1] if step.match is not None else None
        return Scene(step, image, best, self._revisits[frame], self._cells)

    @cached_property
    def _steps(self) -> list[tuple[Step, Frame]]:
        return list(read_steps(self._table, self.method.columns))

    @cached_property
    def _revisits(self) -> list[Revisit | None]:
        partition, revisits, found = Partition(), Revisits(), []
        for step, image in self._steps:
            found.append(revisits.find(image, partition))
            partition.apply(step)
        return found

    def _final_node(self, node: int | None) -> dict[str, Any]:
        if node is None:
            return {}
        row = self._run.nodes.filter(pl.col("id") == node).row(0, named=True)
        rooms = tuple((share["room"], share["share"]) for share in row["rooms"] or ())
        return {"images_final": row["images"], "rooms_final": rooms}

    def _checked(self, frame: int) -> int:
        if not 0 <= frame < len(self):
            raise ResultError(f"{self._run.folder} has no step {frame}; its steps are 0 to {len(self) - 1}")
        return frame


def explanation_lines(explanation: Explanation, method: Method) -> list[Line]:
    """Return an explanation as lines of a page: what was compared, and what the end made of the image."""
    text = placement_text(explanation.node_final, explanation.placement)
    page = [*lines(explanation.scene, method), ("final map", text)]
    if explanation.images_final is not None:
        rooms = ", ".join(f"{room} {100 * share:.0f} %" for room, share in explanation.rooms_final)
        page.append(("", f"that node: {explanation.images_final} images{f', {rooms}' if rooms else ''}"))
    return page
