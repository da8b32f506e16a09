"""The parameters of the mapping method, their types, ranges and meaning.

Names follow V. Román, S. Cebollada, L. Payá, O. Reinoso, *Creating Incremental Models of Indoor Environments
through Omnidirectional Imaging*, Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480. Where the paper is
silent the choice is a named option, its default first.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Covariance = Literal["diagonal", "ledoit-wolf", "ridge", "pinv", "identity"]
Split = Literal["chronological", "interleaved", "random"]
Sides = Literal["two-sided", "one-sided"]

SMALLEST_NODE = 10


class Roman2020Settings(BaseModel):
    """Parameters of `Roman2020`, validated and frozen."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    omega: float = Field(
        2.3, gt=0, le=100, description="floor of the node-level gate x(C) = max(omega, 3.05 - 0.15 C) (Eq. 4)"
    )
    merge_y: float = Field(
        1.5,
        ge=0,
        le=1000,
        description="a new node merges when its gate ratio is at most this (Eq. 11); higher merges more",
    )
    gamma: float = Field(5.0, ge=0, le=1000, description="the best match's prominence must reach gamma times the mean")
    n_init: int = Field(20, ge=SMALLEST_NODE, le=100_000, description="images of the first node")
    n_new: int = Field(
        20, ge=SMALLEST_NODE, le=100_000, description="consecutive unassigned images that make a new node"
    )
    covariance: Covariance = Field("diagonal", description="how a node's singular covariance is regularised")
    split: Split = Field(
        "chronological", description="which 20 % of a node's images are held out for its gate statistics"
    )
    gate_refit: Literal["insertion", "creation"] = Field(
        "insertion",
        description="when mu_ns and sigma_ns are fitted: again at every insertion, or once, at the node's creation",
    )
    node_gate: Sides = Field(
        "two-sided",
        description="node-level gate: |Delta - mu_ns| <= x sigma_ns (Eq. 4), or without the modulus",
    )
    merge_gate: Sides = Field(
        "one-sided",
        description="merging gate: Delta <= mu_ns + y sigma_ns, or |Delta - mu_ns| <= y sigma_ns (Eq. 11 literally)",
    )
    merge_when: Literal["creation", "always"] = Field(
        "creation", description="nodes are tested for merging when created, or whenever one grows"
    )
    prominence_mean: Literal["peaks", "candidates"] = Field(
        "peaks",
        description="mean prominence over the local peaks, or over all candidate images with 0 for non-peaks",
    )
    single_peak: Literal["accept", "reject"] = Field(
        "accept", description="the prominence condition when the curve has fewer than two peaks"
    )
    run_counts: Literal["refused", "no-candidate"] = Field(
        "refused",
        description="what counts towards a new node: any refused image, or only one without a candidate node",
    )
    leftovers: Literal["retest", "unassigned"] = Field(
        "retest",
        description="images of broken runs: tested once more against the final map and placed by force, or left out",
    )
    seed: int = Field(0, ge=0, le=2**63 - 1, description="root of every random choice (random split, k-means controls)")


PRESETS: dict[str, dict[str, object]] = {
    "recommended": {},
    "paper-literal": {
        "merge_gate": "two-sided",
        "covariance": "pinv",
        "prominence_mean": "candidates",
        "leftovers": "unassigned",
    },
}
"""Named sets of parameters; what a preset does not name keeps its default."""
