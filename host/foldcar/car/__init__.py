"""A design: its parameters, its folded car, its body for the simulator, its firmware parameters."""
