"""The components that cars are made of."""
