"""Poses from anywhere: whatever a SLAM system, a motion capture or a spreadsheet left, joined to images."""
