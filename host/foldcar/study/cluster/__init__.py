"""Chunks of runs on other machines, through a Dask scheduler."""
