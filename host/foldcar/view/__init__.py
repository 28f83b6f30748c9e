"""A car's page with more than the car: a run that it replays, or a server that changes the design."""
