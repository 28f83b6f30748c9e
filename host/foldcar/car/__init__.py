"""A car as designed: its parameters, its folded form, what the simulator and the firmware must know of it."""
