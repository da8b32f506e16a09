"""Decisions of a run, from its tables alone: no image is needed, nothing is decided again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import polars as pl

from omnieval.config import Config
from omnieval.errors import ResultError
from omnieval.explain.capture import Capture
from omnieval.explain.decision import BestMatch, Decision, decision, shift_degrees
from omnieval.explain.flips import Flip, flips
from omnieval.explain.page import Line, final_text, lines
from omnieval.explain.revisit import Revisit, Revisits
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Placement, Step
from omnieval.results.run_folder import Run
from omnieval.results.tables import step_from_row
from omnieval.wording import did_you_mean, shown


@dataclass(frozen=True)
class Explanation:
    """A decision of a run, what would have changed it, and what the end made of the image.

    Attributes
    ----------
    decision
        The step with its surroundings.
    flips
        What would have turned each comparison.
    node_final, placement
        Where the image ended and how it came there; None if it belongs to no node, or the run did not reach its end.
    rooms_final
        Rooms of that node with the shares of its images.
    images_final
        Number of its images.
    """

    decision: Decision
    flips: tuple[Flip, ...]
    node_final: int | None
    placement: Placement | None
    images_final: int | None
    rooms_final: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class _Past:
    """Of a step: the node its best match was in (0 without one), and the image it revisits."""

    best_node: int
    revisit: Revisit | None


class RunExplainer:
    """Explains the steps of one run.

    Raises
    ------
    ResultError
        If the run has no steps.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._steps = run.steps
        if self._steps.is_empty():
            raise ResultError(f"{run.folder} has no steps; replay the sequence again")
        settings = run.manifest["configuration"]
        self.config = Config.model_validate(settings).mapper
        self._cells: int | None = run.manifest.get("orientation_cells")

    def __len__(self) -> int:
        return len(self._steps)

    def find(self, step: str) -> int:
        """Return the number of a step that is named by itself or by its image file.

        Raises
        ------
        ResultError
            If the run has no such step.
        """
        if step.removeprefix("-").isascii() and step.removeprefix("-").isdigit():
            return self._checked(int(step))
        files = self._steps["file"].to_list()
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
        row = self._steps.row(self._checked(frame), named=True)
        decided = decision(step_from_row(row), self.capture(frame), self.match(frame), self._past[frame].revisit)
        return Explanation(
            decision=decided,
            flips=flips(decided, self.config),
            node_final=row["node_final"],
            placement=Placement(row["placement"]) if row["placement"] is not None else None,
            **self._final_node(row["node_final"]),
        )

    def decisions(self) -> Iterator[tuple[Step, Decision]]:
        """Yield every step, without its match, and the same with its surroundings, in their order."""
        for row in self._steps.iter_rows(named=True):
            step = step_from_row(row)
            frame = step.frame
            yield step, decision(step, self.capture(frame), self.match(frame), self._past[frame].revisit)

    def capture(self, frame: int) -> Capture:
        """Return what is known of the image of a step."""
        row = self._captures.row(frame, named=True)
        return Capture(**row)

    def match(self, frame: int) -> BestMatch | None:
        """Return the best match of a step; None without candidate."""
        row = self._steps.row(frame, named=True)
        if row["best_frame"] is None:
            return None
        here, best = self.capture(frame), self.capture(row["best_frame"])
        return BestMatch(
            capture=best,
            node=self._past[frame].best_node,
            distance=here.distance(best),
            shift=row["shift"],
            shift_degrees=shift_degrees(row["shift"], self._cells),
            position=row["similarity_position"],
            orientation=row["similarity_orientation"],
            similarity=row["similarity"],
            prominence=row["prominence"],
            prominence_mean=row["prominence_mean"],
            prominence_ratio=row["prominence_ratio"],
            peaks=row["peaks"],
        )

    @cached_property
    def _captures(self) -> pl.DataFrame:
        return self._steps.select(
            "frame", "file", pl.col("time").cast(pl.Int64).alias("time_ns"), "x", "y", "yaw", "room"
        )

    @cached_property
    def _past(self) -> list[_Past]:
        """What the map was when each step was taken, as far as explanations need it."""
        partition, revisits, past = Partition(), Revisits(self.config.n_new), []
        for row in self._steps.iter_rows(named=True):
            best = row["best_frame"]
            node = int(partition.labels[best]) if best is not None else 0
            past.append(_Past(node, revisits.find(self.capture(row["frame"]), partition)))
            partition.apply(step_from_row(row))
        return past

    def _final_node(self, node: int | None) -> dict[str, Any]:
        if node is None:
            return {"images_final": None, "rooms_final": ()}
        row = self._run.nodes.filter(pl.col("id") == node).row(0, named=True)
        rooms = tuple((share["room"], share["share"]) for share in row["rooms"] or ())
        return {"images_final": row["images"], "rooms_final": rooms}

    def _checked(self, frame: int) -> int:
        if not 0 <= frame < len(self):
            raise ResultError(f"{self._run.folder} has no step {frame}; its steps are 0 to {len(self) - 1}")
        return frame


def explanation_lines(explanation: Explanation, config: MapperConfig) -> list[Line]:
    """Return an explanation as lines of a page: what was compared, and what the end made of the image."""
    text = final_text(explanation.node_final, explanation.placement)
    page = [*lines(explanation.decision, config), ("final map", text)]
    if explanation.images_final is not None:
        rooms = ", ".join(f"{room} {100 * share:.0f} %" for room, share in explanation.rooms_final)
        page.append(("", f"that node: {explanation.images_final} images{f', {rooms}' if rooms else ''}"))
    return page
