"""The order in which a car is put together, and the proof that each of its parts has a way in."""
