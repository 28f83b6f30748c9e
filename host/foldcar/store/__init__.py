"""The results store, one SQLite file: schema, reading, writing of runs and of trials."""
