"""The images of one sequence looked for in the map that a job's mapper makes of another."""

from __future__ import annotations

from typing import Any

import numpy as np

from omnieval.ablation.jobs import Described
from omnieval.components.component import Component
from omnieval.localization.answers import Query, answers
from omnieval.localization.measures import measure
from omnieval.localization.strategies import COARSE, LEVELS, STRATEGIES, has_levels
from omnieval.localization.table import queries_frame
from omnieval.loop import mapped
from omnieval.mapping.map import TopologicalMap, arrays_of
from omnieval.results.map_file import UNTIMED
from omnieval.results.schemas import FOUND

WITHIN_M = 0.5
"""Up to how many metres two images show the same place, as in `localize`."""


def found_in(mapper: Component, in_map: Described, query: Described) -> dict[str, Any]:
    """Return the metrics of localising one sequence in the map of another (`schemas.FOUND`), and the strategy.

    It is the mapper's own levels where it has some, else coarse to fine.

    Parameters
    ----------
    mapper
        Makes the map.
    in_map
        The images it makes it of.
    query
        The images to find.
    """
    map_ = _map_of(mapper, in_map)
    strategy = LEVELS if has_levels(mapper) else COARSE
    finder = STRATEGIES[strategy](map_, mapper)
    asked = Query("query", query.frames, list(query.descriptions))
    table = queries_frame(list(answers(finder, asked, WITHIN_M)))
    values = measure(table, WITHIN_M, len(map_)).values
    return {"strategy": strategy, **{name: values[name] for name in FOUND}}


def _map_of(mapper: Component, described: Described) -> TopologicalMap:
    final = mapped(mapper, described.descriptions).finish()
    frames = described.frames
    positions = described.positions
    unknown = np.full((len(frames), 2), np.nan)
    return TopologicalMap(
        files=np.array([frame.file for frame in frames], np.str_),
        times=np.array([UNTIMED if frame.time_ns is None else frame.time_ns for frame in frames], np.int64),
        xy=unknown if positions is None else np.array(positions),
        yaws=np.array([np.nan if frame.pose is None else frame.pose.yaw for frame in frames]),
        rooms=np.array([frame.room or "" for frame in frames], np.str_),
        orientations=np.array(described.descriptions.array("orientation")),
        **arrays_of(final, np.array(described.descriptions.array("position"))),
        about={},
    )
