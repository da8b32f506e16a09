"""Runs beside each other: their metrics in a table, and the first step at which two of them differ."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.config import flattened
from omnieval.errors import ConfigError
from omnieval.mapping.partition import Partition
from omnieval.metrics.catalogue import TELLING, UPKEEP
from omnieval.results.run_folder import Run
from omnieval.results.tables import read_steps
from omnieval.wording import did_you_mean, shown

_NOT_OF_THE_STEP = frozenset({"node_final", "placement", "forced", "milliseconds"})
"""Columns of what only the end tells, and of what the clock says."""


@dataclass(frozen=True)
class Difference:
    """The first step at which two runs differ.

    Attributes
    ----------
    frame
        Number of the step; of the first missing one where a run is a prefix of the other.
    file
        Its image.
    columns
        Both values of every column that differs there; empty where a run has ended.
    settings
        Both values of all that determines a run and differs between the two (`determining`).
    """

    frame: int
    file: str
    columns: dict[str, tuple[Any, Any]]
    settings: dict[str, tuple[Any, Any]]


@dataclass(frozen=True)
class Agreement:
    """How far two runs over the same images agree, step by step.

    Attributes
    ----------
    verdicts
        Whether each shared step has the same verdict in both, shape (n,).
    partitions
        Whether the images so far are divided in the same way, whatever the nodes are called, shape (n,).
    final_ari
        Adjusted Rand index of the two final maps (each unassigned image by itself); None unless both runs are complete
        and of equal length.
    """

    verdicts: NDArray[np.bool_]
    partitions: NDArray[np.bool_]
    final_ari: float | None

    @property
    def first_parted(self) -> int | None:
        """The first step with another verdict or another partition; None if there is none."""
        parted = np.flatnonzero(~self.both)
        return int(parted[0]) if parted.size else None

    @property
    def both(self) -> NDArray[np.bool_]:
        """Whether verdict and partition are the same, shape (n,)."""
        both: NDArray[np.bool_] = self.verdicts & self.partitions
        return both


def agreement(one: Run, other: Run) -> Agreement | None:
    """Hold two runs against each other, over the steps that both have; None if they are not over the same images."""
    left, right = one.steps, other.steps
    shared = min(len(left), len(right))
    if not left["file"].head(shared).equals(right["file"].head(shared)):
        return None
    verdicts = (left["verdict"].head(shared) == right["verdict"].head(shared)).to_numpy()
    partitions = np.zeros(shared, np.bool_)
    mine, theirs = Partition(), Partition()
    steps = (read_steps(table.head(shared), run.method.columns) for table, run in ((left, one), (right, other)))
    for frame, ((step, _), (step_of_other, _)) in enumerate(zip(*steps, strict=True)):
        mine.apply(step)
        theirs.apply(step_of_other)
        partitions[frame] = same_partition(mine.labels, theirs.labels)
    whole = len(left) == len(right) and one.status == other.status == "complete"
    return Agreement(verdicts, partitions, _final_ari(left, right) if whole else None)


def same_partition(one: NDArray[np.int64], other: NDArray[np.int64]) -> bool:
    """Return whether two labellings divide the images in the same way, up to the names of the nodes.

    Parameters
    ----------
    one, other
        Node of every image, shape (n,); unassigned images are 0 in both or the labellings differ.
    """
    if not np.array_equal(one == 0, other == 0):
        return False
    pairs = one * (int(other.max(initial=0)) + 1) + other
    count = len(np.unique(pairs))
    return count == len(np.unique(one)) == len(np.unique(other))


def matched_nodes(one: NDArray[np.int64], other: NDArray[np.int64]) -> dict[int, int]:
    """Return which node of one map is which of another: the pairing that shares the most images.

    Parameters
    ----------
    one, other
        Node of every image, shape (n,), 0 where unassigned.

    Returns
    -------
    dict
        Node of `other` -> node of `one`; nodes without a partner are left out.
    """
    from scipy.optimize import linear_sum_assignment

    shared = np.zeros((int(other.max(initial=0)) + 1, int(one.max(initial=0)) + 1), np.int64)
    np.add.at(shared, (other, one), (other > 0) & (one > 0))
    pairs = zip(*linear_sum_assignment(shared, maximize=True), strict=True)
    return {int(theirs): int(mine) for theirs, mine in pairs if shared[theirs, mine]}


def first_difference(one: Run, other: Run) -> Difference | None:
    """Return where two runs first differ, None if all bits of all steps are equal."""
    left, right = one.steps, other.steps
    settled = [name for name in left.columns if name in right.columns and name not in _NOT_OF_THE_STEP]
    left, right = left.select(settled), right.select(settled)
    shared = min(len(left), len(right))
    frame = _first_unequal(left.head(shared), right.head(shared))
    if frame is None and len(left) == len(right):
        return None
    settings = differing(determining(one), determining(other))
    if frame is None:
        longer = left if len(left) > shared else right
        return Difference(shared, longer["file"][shared], {}, settings)
    here, there = left.row(frame, named=True), right.row(frame, named=True)
    return Difference(frame, here["file"], differing(here, there), settings)


def compare(runs: Sequence[Run], columns: Sequence[str] | None = None) -> pl.DataFrame:
    """Return one row per run: its folder, all in which the runs differ that determines them, and all metrics.

    The most telling metrics come first. The time of the mapper for an image (`catalogue.UPKEEP`) is there if it is
    named.

    Parameters
    ----------
    runs
        At least one run.
    columns
        What to show of each besides its folder; default: source, status, what differs, and all metrics. Parameters in
        which the runs are equal can be named as well.

    Raises
    ------
    ConfigError
        If a column is neither a parameter nor a metric.
    """
    settings = [determining(run) for run in runs]
    names = dict.fromkeys(name for one in settings for name in one)
    varied = [name for name in names if any(one.get(name) != settings[0].get(name) for one in settings)]
    rows = [
        {
            "run": str(run.folder),
            "source": run.manifest["source"],
            "status": run.status,
            **{name: _text(one.get(name)) for name in (varied if columns is None else names)},
            **{name: run.metrics[name] for name in TELLING if name in run.metrics},
            **run.metrics,
            **{name: run.manifest["timings"][name] for name in UPKEEP if name in run.manifest.get("timings", {})},
        }
        for run, one in zip(runs, settings, strict=True)
    ]
    table = pl.DataFrame(rows, infer_schema_length=None)
    if columns is None:
        return table.drop(UPKEEP, strict=False)
    for name in columns:
        if name not in table.columns:
            raise ConfigError(f"runs have no column {shown(name)}; {did_you_mean(name, table.columns)}")
    return table.select("run", *(name for name in dict.fromkeys(columns) if name != "run"))


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return both values of every key whose values differ."""
    keys = [*one, *(key for key in other if key not in one)]
    return {key: (one.get(key), other.get(key)) for key in keys if one.get(key) != other.get(key)}


def _final_ari(left: pl.DataFrame, right: pl.DataFrame) -> float:
    from sklearn.metrics import adjusted_rand_score

    one, other = (_singled(steps["node_final"].fill_null(0).cast(pl.Int64).to_numpy()) for steps in (left, right))
    with warnings.catch_warnings():
        # Nearly every image its own node is a legitimate, if poor, map; scikit-learn takes it for a regression target.
        warnings.filterwarnings("ignore", "The number of unique classes", UserWarning)
        return float(adjusted_rand_score(one, other))


def _singled(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give every unassigned image a label of its own: no two of them are in the same place."""
    return np.where(labels == 0, -1 - np.arange(len(labels)), labels)


def _first_unequal(left: pl.DataFrame, right: pl.DataFrame) -> int | None:
    """Return the first row at which two tables of equal shape differ, by bisection over prefixes."""
    if left.equals(right):
        return None
    equal, unequal = 0, len(left)
    while unequal - equal > 1:
        middle = (equal + unequal) // 2
        if left.slice(equal, middle - equal).equals(right.slice(equal, middle - equal)):
            equal = middle
        else:
            unequal = middle
    return equal


def determining(run: Run) -> dict[str, Any]:
    """Return everything that determines a run, by name: images and cut, camera, components with code and parameters."""
    manifest, config = run.manifest, run.config
    camera = manifest["camera"] or {}
    return {
        "mapper": config.mapper.name,
        "descriptor": config.descriptor.name,
        "frames": manifest["frames"],
        **({"continues": told["digest"]} if (told := manifest.get("continues")) else {}),
        **{f"cut.{name}": value for name, value in manifest["cut"].items()},
        "skipped": len(manifest.get("skipped") or ()),
        **config.settings,
        **{f"camera.{name}": value for name, value in flattened(camera) if name not in ("origin", "mask_file")},
        **{
            f"{one.kind}.{what}": one.identity[what]
            for one in (config.mapper, config.descriptor)
            for what in ("code", "weights")
        },
        "images": manifest.get("dataset_fingerprint"),
    }


def _text(value: Any) -> str | None:
    return None if value is None else str(value)
