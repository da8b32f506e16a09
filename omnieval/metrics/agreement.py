"""Agreement of a map with room labels: how far nodes and rooms divide the images in the same way.

Rand index adjusted for chance: Hubert and Arabie 1985, doi 10.1007/BF01908075. Mutual information normalised by the
arithmetic mean of the entropies: Vinh, Epps and Bailey 2010, JMLR 11. Homogeneity and completeness: Rosenberg and
Hirschberg 2007, EMNLP-CoNLL. Purity: Manning, Raghavan and Schütze 2008, Introduction to Information Retrieval, 16.3.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class RoomAgreement:
    """How far nodes and rooms divide the images in the same way; every number is 1 when they do exactly.

    Attributes
    ----------
    rooms_ari
        Adjusted Rand index: pairs of images on which nodes and rooms agree, 0 in expectation for random nodes.
    rooms_nmi
        Normalised mutual information, 2 I(rooms; nodes) / (H(rooms) + H(nodes)).
    rooms_homogeneity
        1 - H(rooms | nodes) / H(rooms): a node lies in one room.
    rooms_completeness
        1 - H(nodes | rooms) / H(nodes): a room lies in one node.
    rooms_purity
        Share of the images whose room is the commonest one of their node.
    """

    rooms_ari: float
    rooms_nmi: float
    rooms_homogeneity: float
    rooms_completeness: float
    rooms_purity: float


def room_agreement(labels: NDArray[np.int64], rooms: Sequence[str | None]) -> RoomAgreement:
    """Compare a partition with room labels, over the images that have both a node and a label.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    rooms
        Room of every image, None where unknown, length n.

    Raises
    ------
    ValueError
        If no image has both, or the lengths differ.
    """
    from sklearn import metrics

    counted = [(room, node) for room, node in zip(rooms, labels.tolist(), strict=True) if room is not None and node > 0]
    if not counted:
        raise ValueError("agreement needs at least one image with a room label and a node")
    names, nodes = zip(*counted, strict=True)
    truth = np.unique(names, return_inverse=True)[1]
    found = np.unique(nodes, return_inverse=True)[1]
    with warnings.catch_warnings():
        # Nearly every image its own node is a legitimate, if poor, map; scikit-learn takes it for a regression target.
        warnings.filterwarnings("ignore", "The number of unique classes", UserWarning)
        return RoomAgreement(
            rooms_ari=float(metrics.adjusted_rand_score(truth, found)),
            rooms_nmi=float(metrics.normalized_mutual_info_score(truth, found)),
            rooms_homogeneity=float(metrics.homogeneity_score(truth, found)),
            rooms_completeness=float(metrics.completeness_score(truth, found)),
            rooms_purity=_purity(truth, found),
        )


def _purity(truth: NDArray[np.int64], found: NDArray[np.int64]) -> float:
    contingency = np.zeros((found.max() + 1, truth.max() + 1), np.int64)
    np.add.at(contingency, (found, truth), 1)
    return float(contingency.max(axis=1).sum() / len(truth))
