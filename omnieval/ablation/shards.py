"""Shards: an ablation in so many commands that know nothing of each other, such as the tasks of a job array."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from omnieval.ablation.jobs import dataset_key
from omnieval.ablation.plan import Plan
from omnieval.ablation.tree import plant, shares
from omnieval.errors import ConfigError
from omnieval.source_code import digest_of


@dataclass(frozen=True)
class Shard:
    """One of so many, from 1."""

    number: int
    of: int

    @staticmethod
    def parse(text: str) -> Shard:
        """Read ``2/5``.

        Raises
        ------
        ConfigError
            If it is not understood.
        """
        number, _, of = text.partition("/")
        try:
            shard = Shard(int(number), int(of))
        except ValueError:
            shard = Shard(0, 0)
        if not 1 <= shard.number <= shard.of:
            raise ConfigError(f"--shard {text!r}: expected NUMBER/OF, from 1/5 to 5/5 for five of them")
        return shard

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


def shard_of(plan: Plan, shard: Shard, tune_by: str) -> Plan:
    """Return the plan with the jobs of one shard alone: whole trees, the same whoever asks.

    The trees go, the largest first, to the shard that has least to do so far. `tune_by` is what parameters will be
    chosen by when the shards are merged, if they are.
    """
    trees = plant(plan.jobs, [dataset_key(job) for job in plan.jobs], shard.of)
    own = {job.number for tree in shares(trees, shard.of)[shard.number - 1] for job in tree}
    return replace(plan, jobs=tuple(job for job in plan.jobs if job.number in own), shard=_about(plan, shard, tune_by))


def _about(plan: Plan, shard: Shard, tune_by: str) -> dict[str, Any]:
    return {
        "number": shard.number,
        "of": shard.of,
        "jobs": len(plan.jobs),
        "plan": digest_of([job.key for job in plan.jobs]),
        "tuned_on": list(plan.tuned_on),
        "tune_by": tune_by,
    }
