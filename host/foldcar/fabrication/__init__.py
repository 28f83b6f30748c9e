"""What a car is built from: the folder of its sheets, meshes, lists and guide."""
