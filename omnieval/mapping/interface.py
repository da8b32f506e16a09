"""What can stand in the place of the mapper."""

from __future__ import annotations

from typing import Protocol

from omnieval.descriptors.description import Description
from omnieval.mapping.step import FinalMap, Step


class IncrementalMapper(Protocol):
    """A mapper: `omnieval.Mapper`, or one's own; `omnieval.testing.check_mapper` checks its contract."""

    def step(self, description: Description) -> Step:
        """Decide about the next image."""
        ...

    def finish(self) -> FinalMap:
        """Return the partition of all images so far."""
        ...
