"""Splits strips longer than a sheet across, with an overlap for glue.

Input: a FlatPiece and the sheet's usable area. Output: one FlatPiece, or several labelled "1 of 3" and so on. Only strips
(faces with the role rim) are split, between their teeth.
"""

import itertools
import math
from dataclasses import replace
from typing import Any

import shapely
from shapely.geometry import LineString, Polygon, box
from shapely.geometry import Point as ShapelyPoint

from foldcar.fabrication.patterns.drawing import Point
from foldcar.fabrication.patterns.flat_piece import FlatPiece, Fold, moved_to_origin
from foldcar.fabrication.patterns.nesting import fits
from foldcar.fabrication.patterns.options import Options

# Length of the overlap of two glued parts.
OVERLAP_MM = 12.0
# The overlap is narrower than the strip by this on each side, so that it clears the teeth.
OVERLAP_STEP_MM = 0.5


def split_to_fit(flat: FlatPiece, chosen: Options) -> tuple[FlatPiece, ...]:
    """The piece itself if it fits or is not a strip, else its parts from left to right."""
    flat = moved_to_origin(flat)
    x0, y0, x1, y1 = flat.outline.bounds
    if fits((x1 - x0, y1 - y0), chosen.sheet_size_mm, chosen.margin_mm):
        return (flat,)
    strip = [face.outline.bounds for face in flat.faces if face.role == "rim"]
    if not strip or x1 - x0 < y1 - y0:
        return (flat,)
    band = (min(low for _, low, _, _ in strip), max(high for _, _, _, high in strip))
    limit = max(side - 2 * chosen.margin_mm for side in chosen.sheet_size_mm) - chosen.kerf_mm
    ends = _ends(flat, x0, x1, limit)
    if ends is None:
        return (flat,)
    count = len(ends) - 1
    return tuple(_part(flat, band, ends[i], ends[i + 1], i, count) for i in range(count))


def _ends(flat: FlatPiece, x0: float, x1: float, limit: float) -> list[float] | None:
    """The x (mm) of the cuts, ends included, such that each part with overlap is within ``limit``; None if impossible."""
    least = math.ceil((x1 - x0 - OVERLAP_MM) / max(limit - OVERLAP_MM, 1.0))
    # Cuts move to the next gap between teeth, which may require more parts.
    for count in range(least, least + 3):
        ends = [x0, *(_gap_near(flat, x0 + (x1 - x0) * i / count) for i in range(1, count)), x1]
        lengths = [b - a + (OVERLAP_MM if b < x1 else 0.0) for a, b in itertools.pairwise(ends)]
        if max(lengths) <= limit and min(lengths) > OVERLAP_MM:
            return ends
    return None


def _gap_near(flat: FlatPiece, wanted: float) -> float:
    """The x (mm) nearest to ``wanted`` that cuts no tooth."""
    teeth = sorted((f.outline.bounds[0], f.outline.bounds[2]) for f in flat.faces if f.role == "tab")
    edges = [wanted]
    for low, high in teeth:
        edges += [low - 1e-3, high + 1e-3]
    free = [x for x in edges if not any(low < x < high for low, high in teeth)]
    return min(free, key=lambda x: (abs(x - wanted), x), default=wanted)


def _part(
    flat: FlatPiece, band: tuple[float, float], left: float, right: float, index: int, count: int
) -> FlatPiece:
    low, high = band
    window = box(left, flat.outline.bounds[1] - 1, right, flat.outline.bounds[3] + 1)
    outline: Any = flat.outline.intersection(window)
    marks: tuple[tuple[Point, Point], ...] = ()
    if index < count - 1:
        lap = box(right - 1e-3, low + OVERLAP_STEP_MM, right + OVERLAP_MM, high - OVERLAP_STEP_MM)
        outline = shapely.union_all([outline, lap], grid_size=1e-4)
        marks = (((right, low + OVERLAP_STEP_MM), (right, high - OVERLAP_STEP_MM)),)
    folds = []
    for fold in flat.folds:
        line = LineString([fold.a, fold.b]).intersection(window)
        if isinstance(line, LineString) and line.length > 0.05:
            (ax, ay), (bx, by) = line.coords
            folds.append(Fold(fold.kind, (ax, ay), (bx, by)))
    faces = []
    for face in flat.faces:
        kept = face.outline.intersection(window)
        if isinstance(kept, Polygon) and kept.area > 1e-3:
            inside = {i: (a, b) for i, (a, b) in face.edges.items() if left < (a[0] + b[0]) / 2 < right}
            faces.append(replace(face, outline=kept, edges=inside))
    return moved_to_origin(
        replace(
            flat,
            name=f"{flat.name}, part {index + 1}",
            label=f"{flat.label}, {index + 1} of {count}",
            outline=shapely.geometry.polygon.orient(outline),
            circles=tuple((p, d) for p, d in flat.circles if window.contains(ShapelyPoint(p))),
            slits=tuple(s for s in flat.slits if window.contains(LineString(s))),
            folds=tuple(folds),
            faces=tuple(faces),
            marks=marks,
        )
    )
