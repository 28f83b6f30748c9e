"""Checks of film: pieces as they are cut, and that none passes through other film of the folded car but through slots.

Input: a piece; placed faces, hinges flat. Output: findings.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.affinity import affine_transform

from foldcar.car.folded.model import Face, FoldedCar, Piece
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace, polygon
from foldcar.car.folded.pose import apply, compose, edge, folded, folded_back

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
    refs = (ref for crease in piece.creases if not crease.bend for ref in (crease.parent, crease.child))
    lines: dict[str, list[shapely.LineString]] = defaultdict(list)
    for ref in refs:
        lines[ref.face].append(shapely.LineString(edge(faces, ref)))
    for name, several in lines.items():
        for hole in faces[name].holes:
            nearest = min(line.distance(shapely.Polygon(hole.outline_mm)) for line in several)
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


# Faces are shrunk by this before they are intersected, so that faces that meet at an edge do not cross.
SHRINK_MM = 0.3
LEAST_MM = 0.2
PARALLEL = 1e-3
TOUCH_MM = 1e-6
# Layers lie on each other closer than their thickness by less than this.
LAYER_MM = 0.01
LEAST_MM2 = 0.2


def check_crossings(faces: Sequence[PlacedFace]) -> Iterator[Finding]:
    """A finding for each pair of a body's faces that cross, or of parallel ones of which one lies in the other's film."""
    for one, other, length in crossings(faces, faces):
        yield Finding("crossing", one.title, f"runs through {other.title} over {length:.2f} mm")
    thickest = max(face.piece.thickness_mm for face in faces)
    for one, other in _near(faces, faces, thickest, parallel=True):
        local = one.in_face(other.corners_mm)
        apart = (one.piece.thickness_mm + other.piece.thickness_mm) / 2
        if float(np.abs(local[:, 2]).max()) <= apart - LAYER_MM:
            shape = shapely.Polygon(local[:, :2]).buffer(-SHRINK_MM)
            area = shape.intersection(one.polygon.buffer(-SHRINK_MM)).area
            if area > LEAST_MM2:
                yield Finding("crossing", one.title, f"lies in the film of {other.title} over {area:.1f} mm²")


def crossings(
    first: Sequence[PlacedFace], second: Sequence[PlacedFace]
) -> Iterator[tuple[PlacedFace, PlacedFace, float]]:
    """Pairs of crossing faces, one of each group, and the crossing's length (mm); each pair once within one group."""
    for a, b in _near(first, second, TOUCH_MM, parallel=False):
        heights = b.in_face(a.corners_mm)[:, 2], a.in_face(b.corners_mm)[:, 2]
        # A face that lies on one side of the other's plane cannot cross it.
        if any(np.min(h) > -SHRINK_MM or np.max(h) < SHRINK_MM for h in heights):
            continue
        direction = np.cross(a.normal, b.normal)
        spans = []
        for one, other in ((a, b), (b, a)):
            ends = one.cut(other.normal, float(other.normal @ other.matrix[:3, 3]), SHRINK_MM) @ direction
            spans.append(shapely.union_all([shapely.LineString([(x, 0.0), (y, 0.0)]) for x, y in ends.reshape(-1, 2)]))
        length = float(shapely.intersection(*spans).length / np.linalg.norm(direction))
        if length > LEAST_MM:
            yield a, b, length


def check_hinges(car: FoldedCar, bodies: Bodies, wheel_distance_mm: float) -> Iterator[Finding]:
    """Findings for each hinge at both limits, all others flat: segments collide, wheels come closer than that distance.

    Hinge strips bend and are not checked.
    """
    strips = {piece.name for piece in car.pieces if any(crease.flexure for crease in piece.creases)}
    for hinge in car.hinges:
        front, rear = (
            [face for face in bodies[body] if face.piece.name not in strips] for body in (hinge.front, hinge.rear)
        )
        for angle in (hinge.min_rad, hinge.max_rad):
            turn = folded_back(hinge, angle)
            moved = [replace(face, pose=compose(turn, face.pose)) for face in rear]
            place = f"between {hinge.front} and {hinge.rear}, folded by {math.degrees(angle):.1f} degrees"
            for one, other, length in crossings(front, moved):
                yield Finding("hinge", place, f"{one.title} runs through {other.title} over {length:.2f} mm")
            for a, b in ((a, b) for a in car.axles for b in car.axles if a.side == b.side):
                if (a.body, b.body) == (hinge.front, hinge.rear):
                    x, _, z = apply(turn, *b.center_mm)
                    gap = math.hypot(x - a.center_mm[0], z - a.center_mm[2]) - a.radius_mm - b.radius_mm
                    if gap < wheel_distance_mm - 1e-6:
                        told = f"{a.wheel} is {gap:.2f} mm from {b.wheel}, the limit is {wheel_distance_mm:g} mm"
                        yield Finding("hinge", place, told)


def _near(
    first: Sequence[PlacedFace], second: Sequence[PlacedFace], margin_mm: float, parallel: bool
) -> Iterator[tuple[PlacedFace, PlacedFace]]:
    """Pairs of faces, parallel or not, whose bounds are no farther apart; each pair once within one group."""
    if not first or not second:
        return
    low, high = (np.array([pick(face.corners_mm, axis=0) for face in second]) for pick in (np.min, np.max))
    normals = np.array([face.normal for face in second])
    for i, face in enumerate(first):
        least, most = face.corners_mm.min(axis=0) - margin_mm, face.corners_mm.max(axis=0) + margin_mm
        near = (low <= most).all(axis=1) & (high >= least).all(axis=1)
        near &= (np.linalg.norm(np.cross(normals, face.normal), axis=1) <= PARALLEL) == parallel
        if first is second:
            near[: i + 1] = False
        for k in np.flatnonzero(near).tolist():
            yield face, second[k]
