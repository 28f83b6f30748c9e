"""carsim as a program: batches and steps of it, with Scenic beside it where a program asks for that; results."""
