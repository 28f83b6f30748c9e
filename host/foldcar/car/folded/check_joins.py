"""Checks of joins: edges meet, tabs lie on the faces they are glued to, tongues go through their slots.

Input: placed faces of one body and the car's joins. Output: findings.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import EdgeRef, FoldedCar, Join
from foldcar.car.folded.placed import PlacedFace

CLOSURE_MM = 0.05
# The area of a tab that may lie beside its face or over a hole in it.
TAB_OVER_MM2 = 0.05

Index = Mapping[tuple[str, str], Sequence[PlacedFace]]


def check_joins(car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]]) -> Iterator[Finding]:
    """Findings about every join, in each body that has both its faces."""
    index = _index(bodies)
    for join in car.joins:
        first = index.get((join.piece_a, join.a.face), [])
        second = index.get((join.piece_b, join.b.face), [])
        if not first or not second:
            yield Finding("join", f"join {join.number}", f"{join.a.face} or {join.b.face} is nowhere in the car")
        elif join.kind in ("tab", "lap", "rim"):
            for a, b in _pairs(first, second):
                yield from _tab(join, a, b)
        elif join.kind == "tab_slot":
            for a, b in _pairs(first, second):
                yield from _tongue(join, a, b)
    yield from _laminates(car, index)


def worst_gap_mm(car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]]) -> float:
    """The widest gap between edges that should meet (mm)."""
    index = _index(bodies)
    return max(
        (
            _gap_mm(a, join.a, b, join.b)
            for join in car.joins
            if join.kind in ("tab", "lap", "rim")
            for a, b in _pairs(index.get((join.piece_a, join.a.face), []), index.get((join.piece_b, join.b.face), []))
        ),
        default=0.0,
    )


def _index(bodies: Mapping[str, Sequence[PlacedFace]]) -> dict[tuple[str, str], list[PlacedFace]]:
    """All copies of each face, by the names of piece and face."""
    index: dict[tuple[str, str], list[PlacedFace]] = {}
    for face in (face for faces in bodies.values() for face in faces):
        index.setdefault((face.piece.name, face.face.name), []).append(face)
    return index


def _pairs(first: Sequence[PlacedFace], second: Sequence[PlacedFace]) -> Iterator[tuple[PlacedFace, PlacedFace]]:
    """Pairs of copies in the same body."""
    for a in first:
        for b in second:
            if a.body == b.body:
                yield a, b


def _edge(face: PlacedFace, ref: EdgeRef) -> NDArray[np.float64]:
    corners = face.corners_mm
    return corners[[ref.index, (ref.index + 1) % len(corners)]]


def _gap_mm(a: PlacedFace, edge_a: EdgeRef, b: PlacedFace, edge_b: EdgeRef) -> float:
    """The larger distance between the ends of two edges (mm), in the better of the two directions."""
    first, second = _edge(a, edge_a), _edge(b, edge_b)
    ends = [np.max(np.linalg.norm(first - other, axis=1)) for other in (second, second[::-1])]
    return float(min(ends))


def _tab(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    place = f"join {join.number}: {a.title} on {b.title}"
    gap = _gap_mm(a, join.a, b, join.b)
    if gap > CLOSURE_MM:
        yield Finding("closure", place, f"the edges are {gap:.3f} mm apart, the limit is {CLOSURE_MM:g} mm")
    local = b.in_face(a.corners_mm)
    height = float(np.abs(local[:, 2]).max())
    # A rim's lap bends with the curve of the rim, so its tab may stand off the flat facet by 1 mm.
    limit = CLOSURE_MM if b.face.role != "rim" else 1.0
    if height > limit:
        yield Finding(
            "tab", place, f"the tab stands {height:.3f} mm off the face it is glued to, the limit is {limit:g} mm"
        )
        return
    over = shapely.Polygon(local[:, :2]).difference(b.polygon)
    # Shrinking removes the slivers that a tab as wide as its face leaves.
    if over.buffer(-CLOSURE_MM).area > TAB_OVER_MM2:
        yield Finding("tab", place, f"{over.area:.2f} mm² of the tab lie beside its face or over a hole in it")


def _tongue(join: Join, a: PlacedFace, b: PlacedFace) -> Iterator[Finding]:
    place = f"join {join.number}: {a.title} through {b.title}"
    slot = next((hole for hole in b.face.holes if hole.name == join.slot), None)
    if slot is None:
        yield Finding("slot", place, f'there is no slot "{join.slot}"')
        return
    tip = _edge(a, join.a)
    local = b.in_face(tip)
    end_mm = float(np.max(local[:, 2]))
    if end_mm > -b.piece.thickness_mm / 2:
        yield Finding("slot", place, f"the tongue ends {end_mm:.2f} mm inside the slot")
        return
    half = a.piece.thickness_mm / 2
    section = shapely.LineString(local[:, :2]).buffer(half, cap_style="flat")
    outside = section.difference(shapely.Polygon(slot.outline_mm))
    if outside.area > 1e-6:
        yield Finding("slot", place, f"{outside.area:.3f} mm² of the tongue's section do not go through {slot.name}")


def _laminates(car: FoldedCar, index: Index) -> Iterator[Finding]:
    """Findings for copies of laminated pieces that do not lie on a face they are joined to with their holes aligned."""
    joins: dict[tuple[str, str], list[Join]] = {}
    for join in car.joins:
        if join.kind == "laminate":
            joins.setdefault((join.piece_a, join.a.face), []).append(join)
    for key, several in joins.items():
        onto = [face for join in several for face in index.get((join.piece_b, join.b.face), ())]
        for a in index.get(key, ()):
            if not any(_lies_on(a, b) for b in onto):
                others = ", ".join(sorted({b.title for b in onto}))
                yield Finding("laminate", a.title, f"does not lie flat, holes on holes, on {others}")


def _lies_on(a: PlacedFace, b: PlacedFace) -> bool:
    local = b.in_face(a.corners_mm)
    heights = np.abs(local[:, 2])
    layers = heights.mean() / ((a.piece.thickness_mm + b.piece.thickness_mm) / 2)
    if np.ptp(local[:, 2]) > CLOSURE_MM or not 0.8 < layers < 6:
        return False
    outline = shapely.Polygon(local[:, :2])
    holes = [shapely.Polygon(b.in_face(a.in_car(hole.outline_mm))[:, :2]) for hole in a.face.holes]
    mine = outline.difference(shapely.union_all(holes))
    shared = outline.intersection(shapely.Polygon(b.face.outline_mm))
    if shared.area < 1:
        return False
    # Within the shared area the holes of both must agree.
    return bool(
        mine.intersection(shared).difference(b.polygon).area < 1
        and b.polygon.intersection(shared).difference(mine).area < 1
    )
