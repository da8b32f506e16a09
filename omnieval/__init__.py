"""omnieval replays incremental topological mapping over omnidirectional images and keeps every decision's evidence.

>>> import omnieval
>>> run = omnieval.replay("synthetic:night", mapper="leader", radius=4.0, limit=300)  # doctest: +SKIP
>>> run.steps.filter(role="refused")  # doctest: +SKIP

The public names below are loaded when they are first used, so that importing the package is instant.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omnieval.ablation.run import ablate
    from omnieval.archiving import describe_archive
    from omnieval.benchmark import baseline
    from omnieval.config import Config, configure
    from omnieval.datasets import load
    from omnieval.descriptors.archive import load_archive
    from omnieval.descriptors.description import Description, Descriptor
    from omnieval.descriptors.gist import Gist, GistSettings
    from omnieval.descriptors.hog import Hog, HogSettings
    from omnieval.explain.refused import refused_closures
    from omnieval.explain.run import RunExplainer
    from omnieval.exports.write import Exported, export
    from omnieval.localization.run import Localization, localize, open_localization
    from omnieval.loop import replay
    from omnieval.mapping.birch import Birch, BirchSettings
    from omnieval.mapping.geodesic.mapper import Geodesic
    from omnieval.mapping.geodesic.settings import GeodesicSettings
    from omnieval.mapping.interface import BranchingMapper, Column, Gate, Mapper
    from omnieval.mapping.leader import Leader, LeaderSettings
    from omnieval.mapping.map import TopologicalMap
    from omnieval.mapping.roman2020.mapper import Roman2020
    from omnieval.mapping.roman2020.settings import Roman2020Settings
    from omnieval.mapping.step import (
        Comparison,
        Curves,
        EventKind,
        FinalMap,
        Match,
        NodeEvent,
        Placement,
        Role,
        Step,
    )
    from omnieval.mapping.valley import Valley, ValleySettings
    from omnieval.metrics.metric import Judged
    from omnieval.recording import RecordingOptions
    from omnieval.regression.gate import check
    from omnieval.report.write import write_report
    from omnieval.results.compare import compare
    from omnieval.results.run_folder import Run, open_run

__version__ = "0.2.0"

_HOMES = {
    "ablate": "ablation.run",
    "baseline": "benchmark",
    "Config": "config",
    "configure": "config",
    "load": "datasets",
    "load_archive": "descriptors.archive",
    "Description": "descriptors.description",
    "Descriptor": "descriptors.description",
    "Gist": "descriptors.gist",
    "GistSettings": "descriptors.gist",
    "Hog": "descriptors.hog",
    "HogSettings": "descriptors.hog",
    "refused_closures": "explain.refused",
    "RunExplainer": "explain.run",
    "Localization": "localization.run",
    "localize": "localization.run",
    "open_localization": "localization.run",
    "Exported": "exports.write",
    "export": "exports.write",
    "describe_archive": "archiving",
    "replay": "loop",
    "Birch": "mapping.birch",
    "BirchSettings": "mapping.birch",
    "BranchingMapper": "mapping.interface",
    "Column": "mapping.interface",
    "Gate": "mapping.interface",
    "Mapper": "mapping.interface",
    "Geodesic": "mapping.geodesic.mapper",
    "GeodesicSettings": "mapping.geodesic.settings",
    "Leader": "mapping.leader",
    "LeaderSettings": "mapping.leader",
    "TopologicalMap": "mapping.map",
    "Roman2020": "mapping.roman2020.mapper",
    "Roman2020Settings": "mapping.roman2020.settings",
    "Comparison": "mapping.step",
    "Curves": "mapping.step",
    "EventKind": "mapping.step",
    "FinalMap": "mapping.step",
    "Match": "mapping.step",
    "NodeEvent": "mapping.step",
    "Placement": "mapping.step",
    "Role": "mapping.step",
    "Step": "mapping.step",
    "Valley": "mapping.valley",
    "ValleySettings": "mapping.valley",
    "Judged": "metrics.metric",
    "RecordingOptions": "recording",
    "check": "regression.gate",
    "write_report": "report.write",
    "compare": "results.compare",
    "Run": "results.run_folder",
    "open_run": "results.run_folder",
}
"""The modules in which the public names live."""

__all__ = [
    "Birch",
    "BirchSettings",
    "BranchingMapper",
    "Column",
    "Comparison",
    "Config",
    "Curves",
    "Description",
    "Descriptor",
    "EventKind",
    "Exported",
    "FinalMap",
    "Gate",
    "Geodesic",
    "GeodesicSettings",
    "Gist",
    "GistSettings",
    "Hog",
    "HogSettings",
    "Judged",
    "Leader",
    "LeaderSettings",
    "Localization",
    "Mapper",
    "Match",
    "NodeEvent",
    "Placement",
    "RecordingOptions",
    "Role",
    "Roman2020",
    "Roman2020Settings",
    "Run",
    "RunExplainer",
    "Step",
    "TopologicalMap",
    "Valley",
    "ValleySettings",
    "ablate",
    "baseline",
    "check",
    "compare",
    "configure",
    "describe_archive",
    "export",
    "load",
    "load_archive",
    "localize",
    "open_localization",
    "open_run",
    "refused_closures",
    "replay",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'omnieval' has no attribute {name!r}")
    return getattr(import_module(f"omnieval.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
