"""Reading a recording back, as the viewer would."""

from collections import defaultdict
from typing import Any

from rerun.chunk import RrdReader


def rows_per_entity(path, timeline="step"):
    """Number of rows of every entity that has rows on the timeline."""
    counts: dict[str, int] = defaultdict(int)
    for chunk in RrdReader(path).stream():
        if timeline in chunk.timeline_names:
            counts[chunk.entity_path] += chunk.num_rows
    return dict(counts)


def static_entities(path):
    return {chunk.entity_path for chunk in RrdReader(path).stream() if chunk.is_static}


def column(path, entity, component):
    """Values of a component of an entity, by step."""
    values: dict[int | None, Any] = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path != entity:
            continue
        batch = chunk.to_record_batch()
        if component not in batch.schema.names:
            continue
        steps = batch.column("step").to_pylist() if "step" in chunk.timeline_names else [None] * batch.num_rows
        values.update(zip(steps, batch.column(component).to_pylist(), strict=True))
    return values
