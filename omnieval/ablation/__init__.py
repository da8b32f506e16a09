"""Sweeps of parameters: one replay per point of a grid, one row per replay."""
