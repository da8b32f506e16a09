"""Decisions in words and numbers: what was compared, what came of it, and what would have changed it."""
