"""Trials of built cars: placement of obstacles, the car's identity, driving, and the simulated counterpart."""
