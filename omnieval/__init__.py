"""omnieval replays incremental topological mapping over omnidirectional images and keeps every decision's evidence.

The public names below are loaded when they are first used, so that importing the package is instant.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omnieval.ablation.run import ablate
    from omnieval.benchmark import baseline
    from omnieval.config import Config, configure
    from omnieval.datasets import load
    from omnieval.descriptors.description import Description, Descriptor
    from omnieval.loop import map_archive, replay
    from omnieval.mapping.config import MapperConfig
    from omnieval.mapping.mapper import Mapper
    from omnieval.regression.check import check
    from omnieval.report.write import write_report
    from omnieval.results.run_folder import Run, open_run

__version__ = "0.1.0"

__all__ = [
    "Config",
    "Description",
    "Descriptor",
    "Mapper",
    "MapperConfig",
    "Run",
    "ablate",
    "baseline",
    "check",
    "configure",
    "load",
    "map_archive",
    "open_run",
    "replay",
    "write_report",
]

_HOMES = {
    "ablate": "omnieval.ablation.run",
    "baseline": "omnieval.benchmark",
    "Config": "omnieval.config",
    "configure": "omnieval.config",
    "load": "omnieval.datasets",
    "Description": "omnieval.descriptors.description",
    "Descriptor": "omnieval.descriptors.description",
    "map_archive": "omnieval.loop",
    "replay": "omnieval.loop",
    "MapperConfig": "omnieval.mapping.config",
    "Mapper": "omnieval.mapping.mapper",
    "check": "omnieval.regression.check",
    "write_report": "omnieval.report.write",
    "Run": "omnieval.results.run_folder",
    "open_run": "omnieval.results.run_folder",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'omnieval' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
