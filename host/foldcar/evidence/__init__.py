"""Advice on a study: what trials say of its simulation, and which designs to build next."""
