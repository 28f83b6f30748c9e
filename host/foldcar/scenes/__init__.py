"""Scenic programs compiled and sampled into scenes, which are checked and written as JSON."""
