"""Sweeps of parameters: one replay a point of a grid, one row a replay."""
