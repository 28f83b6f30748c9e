"""Products of a folded car besides its sheets: meshes, FOLD files, parts list, wiring, guide and view."""
