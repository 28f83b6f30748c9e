"""The folder that a car is built from: sheets, meshes, lists and guide."""
