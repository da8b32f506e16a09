"""Decisions in words and numbers: what was compared, the result, and what would have changed it."""
