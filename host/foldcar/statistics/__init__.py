"""Statistics of runs and trials on plain arrays: intervals of rates, comparisons, smooth success, effects, times."""
