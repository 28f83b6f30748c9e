"""Products of a folded car besides its sheets: meshes, parts list, wiring, guide and view."""
