"""The silhouette gate: replays against a committed reference, so that a worse map is noticed."""
