"""Checks of flat pieces: valid outlines, no overlaps, no line cut twice, a distance between holes and folds.

Input: a piece. Output: findings.
"""

import math
from collections.abc import Iterator

import shapely
from shapely.affinity import affine_transform

from foldcar.car.folded.model import Face, Piece
from foldcar.car.folded.placed import Finding, polygon
from foldcar.car.folded.pose import apply, edge, folded

# Without a grid, an edge that two faces share but for rounding can make GEOS return the wrong side of it.
GRID_MM = 1e-6
# Overlaps up to this are rounding errors.
OVERLAP_MM2 = 1e-3
EDGE_TOLERANCE_MM = 0.05
CUT_TWICE_MM = 1e-3


def check_flat(piece: Piece, hole_to_fold_mm: float) -> Iterator[Finding]:
    """Findings about the flat piece; every hole must be ``hole_to_fold_mm`` or more from every fold."""
    unsound = [finding for face in piece.faces for finding in _outlines(piece, face)]
    yield from unsound
    faces = {face.name: face for face in piece.faces}
    for crease in piece.creases:
        parent, child = (math.dist(*edge(faces, ref)) for ref in (crease.parent, crease.child))
        if abs(parent - child) > EDGE_TOLERANCE_MM:
            told = f"its edges are {parent:.3f} and {child:.3f} mm long, {abs(parent - child):.3f} mm apart"
            yield Finding("fold", f"{piece.name}: {crease.name}", f"{told}; limit {EDGE_TOLERANCE_MM:g} mm")
    yield from _holes_at_folds(piece, hole_to_fold_mm)
    if not unsound:
        yield from _overlaps(piece)
    yield from _cut_twice(piece)


def flat_polygons(piece: Piece) -> dict[str, shapely.Polygon]:
    """The faces in the flat layout (mm), by name."""
    poses = folded(piece, 0.0)
    flat = {}
    for face in piece.faces:
        (a, b, _, x), (c, d, _, y), *_ = poses[face.name]
        flat[face.name] = affine_transform(polygon(face), (a, b, c, d, x, y))
    return flat


def _outlines(piece: Piece, face: Face) -> Iterator[Finding]:
    place = f"{piece.name}: {face.name}"
    outline = shapely.Polygon(face.outline_mm)
    if not outline.is_valid or not shapely.is_ccw(outline.exterior):
        yield Finding("outline", place, "its outline crosses itself or runs clockwise")
        return
    taken: shapely.Geometry = shapely.Polygon()
    for hole in face.holes:
        shape = shapely.Polygon(hole.outline_mm)
        if not shape.is_valid or shape.area <= 0:
            yield Finding("outline", f"{place}: {hole.name}", "the hole's outline crosses itself")
        elif not outline.contains(shape):
            yield Finding("outline", f"{place}: {hole.name}", "the hole is not inside its face")
        elif shape.intersects(taken):
            yield Finding("outline", f"{place}: {hole.name}", "the hole runs into another one")
        taken = shapely.union(taken, shape)


def _holes_at_folds(piece: Piece, least_mm: float) -> Iterator[Finding]:
    faces = {face.name: face for face in piece.faces}
    folds: dict[str, list[shapely.LineString]] = {}
    for crease in piece.creases:
        for ref in () if crease.bend else (crease.parent, crease.child):
            if faces[ref.face].holes:
                folds.setdefault(ref.face, []).append(shapely.LineString(edge(faces, ref)))
    for name, lines in folds.items():
        for hole in faces[name].holes:
            nearest = min(line.distance(shapely.Polygon(hole.outline_mm)) for line in lines)
            if nearest < least_mm - 1e-6:
                place = f"{piece.name}: {name}: {hole.name}"
                yield Finding("hole", place, f"is {nearest:.2f} mm from a fold, the limit is {least_mm:g} mm")


def _overlaps(piece: Piece) -> Iterator[Finding]:
    flat = flat_polygons(piece)
    names, shapes = list(flat), list(flat.values())
    tree = shapely.STRtree(shapes)
    for i, k in tree.query(shapes, predicate="intersects").T.tolist():
        area = shapely.intersection(shapes[i], shapes[k], grid_size=GRID_MM).area if i < k else 0.0
        if area > OVERLAP_MM2:
            yield Finding("overlap", f"{piece.name}: {names[i]}", f"overlaps {names[k]} by {area:.2f} mm² in the flat")


def _cut_twice(piece: Piece) -> Iterator[Finding]:
    """Findings for outer edges that coincide, which the cutter would cut twice."""
    creased = {(ref.face, ref.index) for crease in piece.creases for ref in (crease.parent, crease.child)}
    poses = folded(piece, 0.0)
    seen: dict[tuple[tuple[int, int], ...], str] = {}
    for face in piece.faces:
        points = [apply(poses[face.name], *point) for point in face.outline_mm]
        for index in range(len(points)):
            if (face.name, index) in creased:
                continue
            ends = points[index], points[(index + 1) % len(points)]
            key = tuple(sorted((round(x / CUT_TWICE_MM), round(y / CUT_TWICE_MM)) for x, y, _ in ends))
            if key in seen:
                yield Finding("duplicate", f"{piece.name}: {face.name}", f"shares a cut with {seen[key]} but no fold")
            seen[key] = face.name
