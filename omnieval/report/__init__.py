"""Figures, tables and the one self-contained page of runs, sweeps and baselines."""
