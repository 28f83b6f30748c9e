"""Checks of film: pieces as they are cut; joins of the folded car: edges meet, layers lie flat, tongues pass their slots.

Input: a piece; placed faces and the car's joins. Output: findings. A body opens: its lid and what is tucked into it need
not be tight.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import shapely
from shapely.affinity import affine_transform

from foldcar.car.folded.model import Face, FoldedCar, Join, Piece
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace, polygon
from foldcar.car.folded.pose import edge, folded

# Without a grid, an edge that two faces share but for rounding can make GEOS return the wrong side of it.
GRID_MM = 1e-6
# Overlaps up to this are rounding errors.
OVERLAP_MM2 = 1e-3


def check_flat(piece: Piece, hole_to_fold_mm: float) -> Iterator[Finding]:
    """Findings about the flat piece; every hole must be ``hole_to_fold_mm`` or more from every fold."""
    unsound = [finding for face in piece.faces for finding in _outlines(piece, face)]
    yield from unsound
    yield from _holes_at_folds(piece, hole_to_fold_mm)
    if not unsound:
        yield from _overlaps(piece)


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


CLOSURE_MM = 0.05
# Between films that lie on or inside each other.
FIT_MM = 0.3
# The area of a tab that may lie beside its face or over a hole in it.
TAB_OVER_MM2 = 0.05

Index = defaultdict[tuple[str, str], list[PlacedFace]]


def check_joins(car: FoldedCar, bodies: Bodies) -> Iterator[Finding]:
    """Findings about every join, in each body that has both its faces."""
    checks = {"tab": _tab, "lap": _tab, "tuck": _tucked, "tab_slot": _tongue, "lock": _tongue}
    index = _index(bodies)
    for join in car.joins:
        if not index[join.piece_a, join.a.face] or not index[join.piece_b, join.b.face]:
            yield Finding("join", f"join {join.number}", f"{join.a.face} or {join.b.face} is nowhere in the car")
        elif join.kind in checks:
            for a, b in _pairs(join, index):
                # Hooks of wheels turn behind the film.
                if join.kind not in ("tab_slot", "lock") or not a.body.startswith("wheel"):
                    yield from checks[join.kind](join, a, b)
    layers: dict[tuple[str, str], list[PlacedFace]] = defaultdict(list)
    for join in (join for join in car.joins if join.kind == "laminate"):
        layers[join.piece_a, join.a.face] += index[join.piece_b, join.b.face]
    for key, onto in layers.items():
        others = ", ".join(sorted({b.title for b in onto}))
        for a in (a for a in index[key] if not any(_lies_on(a, b) for b in onto)):
            yield Finding("laminate", a.title, f"does not lie flat, holes on holes, on {others}")


def _index(bodies: Bodies) -> Index:
    """All copies of each face, by the names of piece and face."""
    index: Index = defaultdict(list)
    for face in (face for faces in bodies.values() for face in faces):
        index[face.piece.name, face.face.name].append(face)
    return index


def _pairs(join: Join, index: Index) -> list[tuple[PlacedFace, PlacedFace]]:
    """The pairs of copies of a join's faces in the same body."""
    first, second = index[join.piece_a, join.a.face], index[join.piece_b, join.b.face]
    return [(a, b) for a in first for b in second if a.body == b.body]


def _gap_mm(join: Join, a: PlacedFace, b: PlacedFace) -> float:
    """The larger distance between the ends of two edges (mm), in the better of the two directions.

    A tab lies on the inside of a wall and may be narrower: its edge must lie along the wall's, seen across the wall.
    """
    first, second = a.edge_mm(join.a.index), b.edge_mm(join.b.index)
    if join.kind == "tab":
        line = shapely.LineString(b.in_face(second)[:, :2])
        return float(line.distance(shapely.points(b.in_face(first)[:, :2])).max())
    return float(min(np.max(np.linalg.norm(first - other, axis=1)) for other in (second, second[::-1])))


def _tab(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    place = f"join {join.number}: {a.title} on {b.title}"
    gap = _gap_mm(join, a, b)
    if gap > CLOSURE_MM:
        yield Finding("closure", place, f"the edges are {gap:.3f} mm apart, the limit is {CLOSURE_MM:g} mm")
    local = b.in_face(a.corners_mm)
    # A tab lies inside the wall, one film above it.
    layer = (a.piece.thickness_mm + b.piece.thickness_mm) / 2 if join.kind == "tab" else 0.0
    height = float(np.abs(local[:, 2] - layer).max())
    limit = FIT_MM if join.kind == "tab" else CLOSURE_MM
    if height > limit:
        told = f"the tab stands {height:.3f} mm off the face it is glued to, the limit is {limit:g} mm"
        yield Finding("tab", place, told)
        return
    over = shapely.Polygon(local[:, :2]).difference(b.polygon)
    # Shrinking removes the slivers that a tab as wide as its face leaves.
    if over.buffer(-CLOSURE_MM).area > TAB_OVER_MM2:
        yield Finding("tab", place, f"{over.area:.2f} mm² of the tab lie beside its face or over a hole in it")


def _tucked(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    """A finding if the edge of a is farther from the edge of b than the film between them and a clearance."""
    ends, (start, end) = a.edge_mm(join.a.index), b.edge_mm(join.b.index)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    share = np.clip((ends - start) @ along, 0.0, length)
    gap = float(np.max(np.linalg.norm(ends - start - share[:, None] * along, axis=1)))
    limit = max(a.piece.thickness_mm, b.piece.thickness_mm) + FIT_MM
    if gap > limit:
        place = f"join {join.number}: {a.title} inside {b.title}"
        yield Finding("tuck", place, f"the edges are {gap:.3f} mm apart, the limit is {limit:g} mm")


def _tongue(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    place = f"join {join.number}: {a.title} through {b.title}"
    slot = next((hole for hole in b.face.holes if hole.name == join.slot), None)
    local = b.in_face(a.edge_mm(join.a.index))
    end_mm = float(np.max(local[:, 2]))
    if slot is None:
        yield Finding("slot", place, f'there is no slot "{join.slot}"')
    elif end_mm > -b.piece.thickness_mm / 2:
        yield Finding("slot", place, f"the tongue ends {end_mm:.2f} mm inside the slot")
    else:
        section = shapely.LineString(local[:, :2]).buffer(a.piece.thickness_mm / 2, cap_style="flat")
        over = section.difference(shapely.Polygon(slot.outline_mm)).area
        if over > 1e-6:
            yield Finding("slot", place, f"{over:.3f} mm² of the tongue's section do not go through {slot.name}")


def _lies_on(a: PlacedFace, b: PlacedFace) -> bool:
    """Whether a face lies on another one, or on layers on that, with their holes aligned."""
    heights = b.in_face(a.corners_mm)[:, 2]
    layers = np.abs(heights).mean() / ((a.piece.thickness_mm + b.piece.thickness_mm) / 2)
    if np.ptp(heights) > CLOSURE_MM or not 0.8 < layers < 10:
        return False
    outline, *holes = (
        shapely.Polygon(b.in_face(a.in_car(one))[:, :2])
        for one in (a.face.outline_mm, *(hole.outline_mm for hole in a.face.holes))
    )
    mine = outline.difference(shapely.union_all(holes))
    shared = outline.intersection(shapely.Polygon(b.face.outline_mm))
    # Within the shared area the holes of both must agree.
    pairs = ((mine, b.polygon), (b.polygon, mine))
    return shared.area >= 1 and all(one.intersection(shared).difference(other).area < 1 for one, other in pairs)
