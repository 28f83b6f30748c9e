"""The report of a study: one page with a replay, figures for papers, and the export of runs and trials."""
