"""Runs chunks on other machines, through a Dask scheduler."""
