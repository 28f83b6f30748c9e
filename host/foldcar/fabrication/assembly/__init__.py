"""What is made of a folded car besides its sheets: meshes, FOLD, lists, wiring, guide and view."""
