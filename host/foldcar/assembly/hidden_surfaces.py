"""Which parts of flat faces in space an onlooker sees, exactly.

Input: Facets in millimetres and a Camera. Output: for each facet that is seen its visible region on the picture plane.
The depth of a flat face is linear over the picture, so a face hides of another one what their outlines share on that
side of a line where it is nearer; faces may cut each other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon, STRtree
from shapely.geometry.base import BaseGeometry

# Faces nearer to each other than this touch: neither hides the other.
TOUCHING_MM = 0.05
LEAST_AREA_MM2 = 0.02
# Without a grid, outlines that touch to within rounding can make wrong intersections.
GRID_MM = 1e-4
SLIVER_MM = 0.02

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Facet:
    """A flat polygon: ``rings_mm[0]`` is the outline (n, 3), the others are holes; any order of its points.

    ``key`` says what it is, to whoever draws it. ``closed``: it is the outside of a solid, its back is never seen.
    """

    key: str
    rings_mm: tuple[Vector, ...]
    normal: Vector
    closed: bool = False


@dataclass(frozen=True)
class Camera:
    """A parallel projection; ``right``, ``up`` and ``toward`` the onlooker are orthonormal."""

    right: Vector
    up: Vector
    toward: Vector

    def flat(self, points: Vector) -> Vector:
        """Where points (n, 3) are on the picture, (n, 2), up being positive."""
        return np.column_stack([points @ self.right, points @ self.up])


@dataclass(frozen=True)
class Seen:
    """A facet with what is seen of it on the picture, ``whole`` if nothing is hidden.

    ``lit`` from 0 to 1, ``front`` if its normal looks at us.
    """

    facet: Facet
    region: BaseGeometry
    whole: bool
    lit: float
    front: bool


def camera(azimuth_deg: float, elevation_deg: float) -> Camera:
    """Seen from this direction: azimuth counter-clockwise from +x, elevation over the horizon."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    toward = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return Camera(right, np.cross(toward, right), toward)


def seen_facets(facets: Sequence[Facet], view: Camera) -> list[Seen]:
    """The facets of which something is seen, farthest first."""
    facets = [facet for facet in facets if not facet.closed or facet.normal @ view.toward > 0]
    outlines = [Polygon(view.flat(f.rings_mm[0]), [view.flat(hole) for hole in f.rings_mm[1:]]) for f in facets]
    kept = [i for i, outline in enumerate(outlines) if outline.area > LEAST_AREA_MM2]
    # Rounding can let holes touch the outlines of faces that are seen from the edge.
    shapes = shapely.set_precision(shapely.make_valid([outlines[i] for i in kept]), GRID_MM)
    planes = [_depth(facets[i], view) for i in kept]
    hidden: list[list[BaseGeometry]] = [[] for _ in kept]
    first, second = STRtree(shapes).query(shapes, predicate="intersects")
    once = first < second
    first, second = first[once], second[once]
    shared = shapely.intersection(shapes[first], shapes[second], grid_size=GRID_MM)
    wide = shapely.area(shared) > LEAST_AREA_MM2
    for a, b, region in zip(first[wide], second[wide], shared[wide], strict=True):
        for one, other in ((a, b), (b, a)):
            part = _nearer(_polygons(region), planes[other] - planes[one])
            if part is not None:
                hidden[one].append(part)
    found = []
    for place, index in enumerate(kept):
        region = shapes[place]
        if hidden[place]:
            region = shapely.difference(region, shapely.union_all(hidden[place]), grid_size=GRID_MM)
            # Where hiding faces meet, rounding leaves slivers between them.
            region = region.buffer(-SLIVER_MM, join_style="mitre").buffer(SLIVER_MM, join_style="mitre")
        if region.area > LEAST_AREA_MM2:
            found.append(_seen(facets[index], region, not hidden[place], view))
    return sorted(found, key=lambda seen: _mean_depth(seen.facet, view))


def _depth(facet: Facet, view: Camera) -> Vector:
    """(c, a, b): the facet at picture point (u, v) is at depth c + a u + b v, nearer being more."""
    normal = facet.normal
    slope = normal @ view.toward
    a, b = -(normal @ view.right) / slope, -(normal @ view.up) / slope
    point = facet.rings_mm[0][0]
    return np.array([point @ view.toward - a * (point @ view.right) - b * (point @ view.up), a, b])


def _nearer(region: BaseGeometry, ahead: Vector) -> BaseGeometry | None:
    """The part of a region where ``ahead``, the depth by which a facet is nearer, is more than touching."""
    corners = shapely.get_coordinates(region)
    lead = ahead[0] + corners @ ahead[1:] - TOUCHING_MM
    if (lead <= 0).all():
        return None
    if (lead > 0).all():
        return region
    # The half plane, as a square on the line that is larger than the region.
    slope = math.hypot(ahead[1], ahead[2])
    along = np.array([-ahead[2], ahead[1]]) / slope
    inward = np.array([ahead[1], ahead[2]]) / slope
    middle = corners.mean(axis=0)
    middle = middle - inward * (ahead[0] + middle @ ahead[1:] - TOUCHING_MM) / slope
    size = 4 * (np.ptp(corners, axis=0).sum() + abs(lead).max() / slope)
    square = [middle + s * size * along + t * size * inward for s, t in ((-1, 0), (1, 0), (1, 1), (-1, 1))]
    return _polygons(shapely.intersection(region, Polygon(square), grid_size=GRID_MM))


def _polygons(geometry: BaseGeometry) -> BaseGeometry:
    """Without the points and lines in which outlines only touch."""
    if geometry.geom_type in ("Polygon", "MultiPolygon"):
        return geometry
    return shapely.MultiPolygon([part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"])


def _seen(facet: Facet, region: BaseGeometry, whole: bool, view: Camera) -> Seen:
    front = bool(facet.normal @ view.toward > 0)
    normal = facet.normal if front else -facet.normal
    light = view.toward + 0.6 * view.up - 0.35 * view.right
    return Seen(facet, region, whole, float(max(0.0, normal @ light / np.linalg.norm(light))), front)


def _mean_depth(facet: Facet, view: Camera) -> float:
    return float((facet.rings_mm[0] @ view.toward).mean())
