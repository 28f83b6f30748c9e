"""Search for the best designs of a family, with simulation as the oracle (docs/optimize.md)."""
