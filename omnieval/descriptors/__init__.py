"""Holistic descriptors of panoramas, their distance and their cache."""
