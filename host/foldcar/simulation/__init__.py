"""Runs carsim in batches or steps, with Scenic beside it for dynamic programs; results of runs."""
