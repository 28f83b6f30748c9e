"""Limits that a listing's keys and the options of commands share. It imports nothing, so that help is printed at once."""

# Sampled environments of an experiment, the samples 0 to MOST_ENVIRONMENTS - 1.
MOST_ENVIRONMENTS = 1_000_000
# SQLite's largest whole number.
GREATEST_SEED = 2**63 - 1
# Processes that simulate side by side.
MOST_JOBS = 256
