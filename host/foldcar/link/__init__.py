"""The host's side of the link to a car: ports, packets, commands, parameters, logs (docs/link.md)."""
