"""A plain, slow second implementation of the mapping method, written from its description alone.

It is the oracle the fast mapper is compared with: loops instead of vectors, explicit inverse matrices, every roll
tried, every model refitted from scratch, float64 throughout. The method is that of doi 10.3390/app10186480.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.errors import ConfigError
from omnieval.mapping.roman2020.settings import Roman2020Settings
from tests.reference.curve import Image, find_peaks, prominence, similarities
from tests.reference.node import ReferenceNode, Vector

Event = tuple[str, int, int | None, tuple[int, ...]]


class ReferenceMapper:
    """Feed it images with `step`, then ask `finish` for the partition."""

    def __init__(self, config: Roman2020Settings) -> None:
        self.config = config
        self.images: list[Image] = []
        self.nodes: dict[int, ReferenceNode] = {}
        self.created = 0
        self.run: list[int] = []
        self.placements: list[str] = []
        self.events: list[Event] = []

    def step(self, position: NDArray[np.floating], orientation: NDArray[np.floating]) -> dict[str, Any]:
        """Decide about the next image; returns everything that was computed (None where not reached)."""
        frame = len(self.images)
        self.images.append(Image.of(position, orientation))
        self.placements.append("unassigned")
        self.events = []
        found = self.initial(frame) if frame < self.config.n_init else self.decide(frame)
        return found | {
            "events": self.events,
            "active": len(self.active()),
            "pending": len(self.pending()),
        }

    # --- the state machine (section 5) ---

    def initial(self, frame: int) -> dict[str, Any]:
        """Collect the first n_init images, which make node 1."""
        self.placements[frame] = "founding"
        if frame == self.config.n_init - 1:
            node = self.create(list(range(self.config.n_init)))
            self.activate(node)
        return NOTHING | {"verdict": "initial", "node": 1}

    def decide(self, frame: int) -> dict[str, Any]:
        """Try the active nodes, then the pending ones, else let the image wait in the run."""
        image = self.images[frame]
        found = self.judge(image)
        if found["verdict"] == "assigned":
            return self.join(found, frame, self.nodes[found["node"]], "loop-closure")
        taker = self.nearest_pending(image, found["x"])
        if taker is not None:
            return self.join(found | {"verdict": "pending"}, frame, taker, "pending")
        return self.refuse(found, frame)

    def join(self, found: dict[str, Any], frame: int, node: ReferenceNode, placement: str) -> dict[str, Any]:
        """Put the image into the node and let the node settle."""
        self.run = []
        self.placements[frame] = placement
        node.frames.append(frame)
        node.fit(self.positions(), self.config)
        home = self.settle(node, just_created=False)
        return found | {"node": home.id, "run": 0}

    def refuse(self, found: dict[str, Any], frame: int) -> dict[str, Any]:
        """Let the image wait; a full run makes a node."""
        if self.config.run_counts == "refused" or found["verdict"] == "no-candidate":
            self.run.append(frame)
        length = len(self.run)
        node_id = None
        if length == self.config.n_new:
            frames, self.run = self.run, []
            for member in frames:
                self.placements[member] = "founding"
            home = self.settle(self.create(frames), just_created=True)
            node_id = home.id
        return found | {"node": node_id, "run": length}

    def create(self, frames: list[int]) -> ReferenceNode:
        """Make the next node out of `frames`, pending until something else is decided."""
        self.created += 1
        node = ReferenceNode(self.created, list(frames))
        node.fit(self.positions(), self.config, created=True)
        self.nodes[node.id] = node
        self.events.append(("created", node.id, None, tuple(frames)))
        return node

    def settle(self, node: ReferenceNode, *, just_created: bool) -> ReferenceNode:
        """Merge or activate a node that was created or has grown; returns the node its images are in then."""
        if just_created or self.config.merge_when == "always":
            absorber = self.absorber_of(node)
            if absorber is not None:
                return self.merge(node, absorber)
        if not node.active and self.stands_apart(node):
            self.activate(node)
        return node

    def merge(self, node: ReferenceNode, absorber: ReferenceNode) -> ReferenceNode:
        """Move the images of `node` to `absorber`, which may then merge in its turn."""
        del self.nodes[node.id]
        absorber.frames.extend(node.frames)
        absorber.fit(self.positions(), self.config)
        self.events.append(("merged", node.id, absorber.id, ()))
        if self.config.merge_when == "always":
            return self.settle(absorber, just_created=False)
        return absorber

    def absorber_of(self, node: ReferenceNode) -> ReferenceNode | None:
        """The best of the active nodes that are similar to `node` (Eq. 11), ties to the lower id."""
        best, best_ratio = None, np.inf
        for other in self.active():
            if other is node:
                continue
            ratio = other.signed_ratio(node.representative)
            gated = abs(ratio) if self.config.merge_gate == "two-sided" else ratio
            if gated <= self.config.merge_y and ratio < best_ratio:
                best, best_ratio = other, ratio
        return best

    def stands_apart(self, node: ReferenceNode) -> bool:
        """Whether a node is as far from the active nodes as these are from each other, on average."""
        others = [other for other in self.active() if other is not node]
        if len(others) < 2:
            return True
        own = [distance(node, other) for other in others]
        among = [distance(a, b) for i, a in enumerate(others) for b in others[i + 1 :]]
        return bool(np.mean(own) >= np.mean(among))

    def activate(self, node: ReferenceNode) -> None:
        node.active = True
        self.events.append(("activated", node.id, None, ()))

    # --- what is asked about one image (sections 3 and 4) ---

    def judge(self, image: Image) -> dict[str, Any]:
        """Both loop closures, prominence and centroid against the active nodes; changes nothing."""
        active = self.active()
        x = max(self.config.omega, 3.05 - 0.15 * len(active))
        ratios = [self.gate_ratio(node, image) for node in active]
        candidates = [node for node, ratio in zip(active, ratios, strict=True) if ratio <= x]
        found = NOTHING | {
            "x": x,
            "nodes": [node.id for node in active],
            "ratios": ratios,
            "ratio_scales": [(node.delta(image.position) + node.mu_ns) / node.sigma_ns for node in active],
            "candidates": [node.id for node in candidates],
        }
        if not candidates:
            return found | {"verdict": "no-candidate"}
        found |= self.match(image, candidates)
        if not self.stands_out(found):
            return found | {"verdict": "prominence"}
        node = self.nodes[found["best_node"]]
        found |= {"centroid_shift": centroid_shift(node, image), "centroid_bound": self.centroid_bound(node)}
        if not found["centroid_shift"] <= found["centroid_bound"]:
            return found | {"verdict": "centroid"}
        return found | {"verdict": "assigned", "node": node.id}

    def gate_ratio(self, node: ReferenceNode, image: Image) -> float:
        """The ratio the node-level gate compares with x (Eq. 4)."""
        ratio = node.signed_ratio(image.position)
        return abs(ratio) if self.config.node_gate == "two-sided" else ratio

    def match(self, image: Image, candidates: list[ReferenceNode]) -> dict[str, Any]:
        """The similarity curve over the whole map, its best image, and the prominences."""
        keys = [(node.id, frame) for node in candidates for frame in node.frames]
        position, orientation, product, shifts = similarities(image, [self.images[k] for _, k in keys])
        everything = self.map_images()
        slots = [everything.index(key) for key in keys]
        curve = [0.0] * (len(everything) + 2)
        for slot, value in zip(slots, product, strict=True):
            curve[slot + 1] = value
        top = max(curve)
        peaks = find_peaks(curve)
        total = sum(prominence(curve, peak) for peak in peaks)
        count = len(peaks) if self.config.prominence_mean == "peaks" else len(keys)
        best = product.index(top)
        return {
            "frames": [frame for _, frame in keys],
            "slots": slots,
            "map_size": len(everything),
            "position_similarities": position,
            "orientation_similarities": orientation,
            "similarities": product,
            "shifts": shifts,
            "best_node": keys[best][0],
            "best_frame": keys[best][1],
            "shift": shifts[best],
            "position_similarity": position[best],
            "orientation_similarity": orientation[best],
            "similarity": product[best],
            "prominence": prominence(curve, curve.index(top)),
            "prominence_mean": total / count,
            "peaks": len(peaks),
        }

    def stands_out(self, found: dict[str, Any]) -> bool:
        """The prominence condition."""
        if found["peaks"] < 2:
            return self.config.single_peak == "accept"
        return bool(found["prominence"] >= self.config.gamma * found["prominence_mean"])

    def centroid_bound(self, node: ReferenceNode) -> float:
        """The largest shift of the node's mean when one of its images is left out (Eq. 9)."""
        reaches = [np.linalg.norm(self.images[k].position - node.representative) for k in node.frames]
        return float(max(reaches)) / (len(node.frames) - 1)

    def nearest_pending(self, image: Image, x: float) -> ReferenceNode | None:
        """The nearest pending node that passes the gate, ties to the lower id."""
        best, best_ratio = None, np.inf
        for node in self.pending():
            ratio = node.signed_ratio(image.position)
            if self.gate_ratio(node, image) <= x and ratio < best_ratio:
                best, best_ratio = node, ratio
        return best

    # --- the end of the sequence ---

    def finish(self) -> dict[str, Any]:
        """The partition: labels (0 = unassigned), placements, and the ids of the nodes."""
        if len(self.images) < self.config.n_init:
            raise ConfigError(f"{len(self.images)} images are fewer than n_init={self.config.n_init}; lower it")
        labels = [0] * len(self.images)
        placements = list(self.placements)
        for node_id, frame in self.map_images():
            labels[frame] = node_id
        if self.config.leftovers == "retest":
            for frame, placement in enumerate(self.placements):
                if placement == "unassigned":
                    labels[frame], placements[frame] = self.place_leftover(self.images[frame])
        return {
            "labels": labels,
            "placements": placements,
            "nodes": sorted(self.nodes),
            "active": [node.id for node in self.active()],
            "representatives": [self.nodes[node_id].representative for node_id in sorted(self.nodes)],
        }

    def place_leftover(self, image: Image) -> tuple[int, str]:
        """Test a leftover once more against the frozen map; place it by force if it is refused again."""
        found = self.judge(image)
        if found["verdict"] == "assigned":
            return found["node"], "retest"
        taker = self.nearest_pending(image, found["x"])
        if taker is not None:
            return taker.id, "retest"
        keys = self.map_images()
        _, _, product, _ = similarities(image, [self.images[frame] for _, frame in keys])
        return keys[product.index(max(product))][0], "forced"

    # --- what the map consists of ---

    def active(self) -> list[ReferenceNode]:
        return [self.nodes[i] for i in sorted(self.nodes) if self.nodes[i].active]

    def pending(self) -> list[ReferenceNode]:
        return [self.nodes[i] for i in sorted(self.nodes) if not self.nodes[i].active]

    def map_images(self) -> list[tuple[int, int]]:
        """(node, frame) of every image in the map, by node and then frame: the order of the curve."""
        return [(node_id, frame) for node_id in sorted(self.nodes) for frame in self.nodes[node_id].frames]

    def positions(self) -> list[Vector]:
        return [image.position for image in self.images]


NOTHING: dict[str, Any] = dict.fromkeys(
    (
        *("verdict", "node", "x", "nodes", "ratios", "ratio_scales", "candidates", "frames", "slots", "map_size"),
        *("position_similarities", "orientation_similarities", "similarities", "shifts"),
        *("best_node", "best_frame", "shift", "position_similarity", "orientation_similarity", "similarity"),
        *("prominence", "prominence_mean", "peaks", "centroid_shift", "centroid_bound"),
    )
) | {"run": 0}
"""A step in which nothing was reached."""


def distance(a: ReferenceNode, b: ReferenceNode) -> float:
    """Distance between the representatives of two nodes."""
    return float(np.linalg.norm(a.representative - b.representative))


def centroid_shift(node: ReferenceNode, image: Image) -> float:
    """How far the node's mean would move if it took the image (Eq. 9)."""
    return float(np.linalg.norm(image.position - node.representative)) / (len(node.frames) + 1)
