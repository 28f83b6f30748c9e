"""A folded car's pieces as sheets for a cutter: flat outlines, folds, labels, nesting, SVG, DXF and PDF."""
