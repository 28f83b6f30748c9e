"""The report of a study: what the store holds, counted (series), drawn (plots) and laid out on one page."""
