"""Environments as Scenic programs: compiled, sampled and checked into scenes of plain JSON."""
