"""Runs for other programs: graphs, trajectories, tables and pictures, in the formats of those programs."""
