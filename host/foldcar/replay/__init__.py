"""Runs and trials to be watched on a page: simulated again as stored, their paths and grounds as compact bytes."""
