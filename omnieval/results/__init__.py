"""The record of a run: its folder, its tables and where they come from."""
