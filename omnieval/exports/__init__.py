"""Runs for other programs: graphs, trajectories, tables and pictures, each in a form that is somebody else's."""
