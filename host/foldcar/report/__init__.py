"""The report of a study: the store's runs and trials counted (series), drawn (plots) and laid out on one page."""
