"""A listing's experiments: families of designs in environments, planned, split into chunks and simulated."""
