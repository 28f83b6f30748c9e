"""Simulator parameters inferred from trials of built cars: priors, simulations, posterior, advice, calibrated sweeps."""
