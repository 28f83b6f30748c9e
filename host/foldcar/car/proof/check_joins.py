"""Checks of joins (edges meet, tabs lie on their faces, tongues go through their slots) and of the skin they make.

Input: placed faces and the car's joins. Output: findings and volumes. A body opens: its lid and what is tucked into it
need not be tight, but every edge must be folded, glued or tucked, but for those of notches.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from foldcar.car.folded.model import FoldedCar, Join, Piece
from foldcar.car.folded.placed import Bodies, Finding, PlacedFace
from foldcar.car.folded.pose import side

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
                # Hooks of wheels turn behind the film: check_wheels.
                if join.kind not in ("tab_slot", "lock") or not a.body.startswith("wheel"):
                    yield from checks[join.kind](join, a, b)
    layers: dict[tuple[str, str], list[PlacedFace]] = defaultdict(list)
    for join in (join for join in car.joins if join.kind == "laminate"):
        layers[join.piece_a, join.a.face] += index[join.piece_b, join.b.face]
    for key, onto in layers.items():
        others = ", ".join(sorted({b.title for b in onto}))
        for a in (a for a in index[key] if not any(_lies_on(a, b) for b in onto)):
            yield Finding("laminate", a.title, f"does not lie flat, holes on holes, on {others}")


def worst_gap_mm(car: FoldedCar, bodies: Bodies) -> float:
    """The widest gap between edges that should meet (mm)."""
    index, tabs = _index(bodies), [join for join in car.joins if join.kind in ("tab", "lap")]
    return max((_gap_mm(join, a, b) for join in tabs for a, b in _pairs(join, index)), default=0.0)


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


VOLUME_TOLERANCE = 1e-3


def check_skin(car: FoldedCar, bodies: Bodies, volumes_mm3: Mapping[str, float]) -> Iterator[Finding]:
    """Findings for each segment whose skin has a loose edge or, where ``volumes_mm3`` gives one, another volume."""
    for body, faces in bodies.items():
        if body.startswith("wheel"):
            continue
        skin = skin_of(car, faces)
        if not skin:
            yield Finding("skin", body, "has no faces that are glued to a skin")
            continue
        loose = _loose_edges(car, skin, faces)
        for face, index in loose[:3]:
            more = f" (and {len(loose) - 3} more)" if len(loose) > 3 else ""
            yield Finding("skin", f"{body}: {face.title}", f"edge {index} meets no other face{more}")
        volume, expected = volume_mm3(skin), volumes_mm3.get(body)
        if expected is not None and abs(volume - expected) > VOLUME_TOLERANCE * expected:
            told = f"encloses {volume:.0f} mm³ instead of {expected:.0f}, the limit is {VOLUME_TOLERANCE:.1%}"
            yield Finding("volume", body, told)


def skin_of(car: FoldedCar, faces: Sequence[PlacedFace]) -> list[PlacedFace]:
    """The panels of the pieces that tabs join, without those that hang inside on one fold, as a lid's flap.

    Laminated or inserted pieces are not part of the skin.
    """
    tabbed = {name for join in car.joins if join.kind in ("tab", "lap") for name in (join.piece_a, join.piece_b)}
    joined = {(piece, face) for piece, face, _ in _joined_edges(car)}

    def hangs(piece: Piece, face: str) -> bool:
        tabs = {one.name for one in piece.faces if one.role == "tab"}
        folds = ({crease.parent.face, crease.child.face} for crease in piece.creases)
        return sum(face in ends and not ends & tabs for ends in folds) == 1

    panels = [face for face in faces if face.piece.name in tabbed and face.face.role != "tab"]
    return [one for one in panels if (one.piece.name, one.face.name) in joined or not hangs(one.piece, one.face.name)]


def volume_mm3(skin: Sequence[PlacedFace]) -> float:
    """The volume (mm³) of the convex hull of the faces: what a body, which is convex, encloses; 0 without faces."""
    return float(ConvexHull(np.concatenate([face.corners_mm for face in skin])).volume) if skin else 0.0


def _joined_edges(car: FoldedCar) -> Iterator[tuple[str, str, int]]:
    """Edges that a tab is glued along, or that are tucked: (piece, face, index)."""
    for join in car.joins:
        if join.kind in ("tab", "tuck"):
            yield join.piece_b, join.b.face, join.b.index
        if join.kind == "tuck":
            yield join.piece_a, join.a.face, join.a.index


def _loose_edges(car: FoldedCar, skin: Sequence[PlacedFace], faces: Sequence[PlacedFace]) -> list[tuple[PlacedFace, int]]:
    """Edges of the skin that are not joined and do not coincide with an edge of another face.

    Edges off the convex hull of their face are those of a notch, which is open like a hole.
    """
    held, loose = set(_joined_edges(car)), []
    backward = np.array([one.edge_mm(i)[::-1] for one in faces for i in range(len(one.corners_mm))])
    for face in skin:
        hull = shapely.Polygon(face.face.outline_mm).convex_hull.exterior
        for index in range(len(face.corners_mm)):
            middle = shapely.LineString(side(face.face.outline_mm, index)).centroid
            if hull.distance(middle) > CLOSURE_MM or (face.piece.name, face.face.name, index) in held:
                continue
            if not (np.abs(backward - face.edge_mm(index)).max(axis=(1, 2)) <= CLOSURE_MM).any():
                loose.append((face, index))
    return loose
