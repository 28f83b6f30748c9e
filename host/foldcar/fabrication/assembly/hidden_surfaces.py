"""Computes the visible regions of flat faces in space exactly.

Input: Facets in millimetres and a Camera. Output: for each visible facet its visible region on the picture plane. The
depth of a flat face is linear over the picture. So, of the common part of two outlines, a face hides the side of a line
where it is nearer. Faces may intersect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon, STRtree
from shapely.geometry.base import BaseGeometry

# Faces closer to each other than this are in contact: neither hides the other.
TOUCHING_MM = 0.05
MIN_AREA_MM2 = 0.02
# Rounded, so that outlines that coincide do so exactly.
GRID_DECIMALS = 4
SLIVER_MM = 0.02

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Facet:
    """A flat polygon.

    ``rings_mm[0]`` is its outline (n, 3), the others are its holes; the points may run in any direction.

    ``key`` identifies it. If it is ``closed``, it is a part of the outside of a solid, so that its back is never
    visible.
    """

    key: str
    rings_mm: tuple[Vector, ...]
    normal: Vector
    material: str = "film"
    closed: bool = False


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    ``right``, ``up`` and ``toward``, which points to the camera, are orthonormal vectors (3,).
    """

    right: Vector
    up: Vector
    toward: Vector

    def flat(self, points: Vector) -> Vector:
        """Return the projections, (n, 2), of points (n, 3): right and up are positive."""
        return np.column_stack([points @ self.right, points @ self.up])


@dataclass(frozen=True)
class VisibleFacet:
    """A facet, and the ``region`` of the picture in which it is visible.

    The region is ``whole`` if nothing of the facet is hidden. ``lit`` is its brightness from 0 to 1. ``front`` is
    whether its normal points to the camera.
    """

    facet: Facet
    region: BaseGeometry
    whole: bool
    lit: float
    front: bool


def camera(azimuth_deg: float, elevation_deg: float) -> Camera:
    """Return the camera that looks from this direction: azimuth counter-clockwise from +x, elevation above the
    horizon.
    """
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    toward = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return Camera(right, np.cross(toward, right), toward)


def visible_facets(facets: Sequence[Facet], view: Camera) -> list[VisibleFacet]:
    """Return the facets that are at least partly visible, the farthest first.

    Each facet is projected onto the picture plane. Its region is the projected polygon without the regions of facets
    that are nearer there.
    """
    facets = [facet for facet in facets if not facet.closed or facet.normal @ view.toward > 0]
    outlines = _projected(facets, view)
    # Facets that are seen edge-on have no area in the picture.
    in_picture = np.flatnonzero(shapely.area(outlines) > MIN_AREA_MM2)
    # Rounding can make holes touch the outlines of faces seen almost edge-on.
    shapes = shapely.make_valid(outlines[in_picture])
    planes = np.array([_depth(facets[index], view) for index in in_picture]).reshape(-1, 3)
    visible = []
    for number, hiding_regions in _hiding_regions(shapes, planes).items():
        facet, region = facets[in_picture[number]], shapes[number]
        remaining = region
        if hiding_regions:
            remaining = _polygons(shapely.difference(region, shapely.union_all(hiding_regions)))
        is_whole = region.area - remaining.area < MIN_AREA_MM2
        if not is_whole:
            region = _without_slivers(remaining)
        if region.area > MIN_AREA_MM2:
            visible.append(_visible_facet(facet, region, is_whole, view))
    return sorted(visible, key=lambda seen: float((seen.facet.rings_mm[0] @ view.toward).mean()))


def _projected(facets: Sequence[Facet], view: Camera) -> NDArray[np.object_]:
    """Return the projections of facets onto the picture plane, with their holes, as an array (n,) of polygons."""
    rings = [ring for facet in facets for ring in facet.rings_mm]
    corners = np.round(view.flat(np.concatenate(rings)), GRID_DECIMALS)
    # The index of the ring to which each corner belongs, and that of the facet to which each ring belongs.
    ring_of_corner = np.repeat(range(len(rings)), [len(ring) for ring in rings])
    facet_of_ring = np.repeat(range(len(facets)), [len(facet.rings_mm) for facet in facets])
    loops = shapely.linearrings(corners, indices=ring_of_corner)
    polygons: NDArray[np.object_] = shapely.polygons(loops, indices=facet_of_ring)
    return polygons


def _without_slivers(region: BaseGeometry) -> BaseGeometry:
    """Return a region without the narrow slivers that rounding leaves between adjacent hiding faces."""
    return region.buffer(-SLIVER_MM, join_style="mitre").buffer(SLIVER_MM, join_style="mitre")


def _hiding_regions(shapes: NDArray[np.object_], planes: Vector) -> dict[int, list[BaseGeometry]]:
    """Return the regions of the picture in which each outline is hidden by others, by the outline's number.

    Outlines that are hidden completely are not in the result. ``planes`` (n, 3) are the depths of the outlines (see
    ``_depth``).
    """
    overlaps = _overlapping(shapes, planes)
    # An outline is hidden completely if another one is nearer everywhere and covers it. It then hides nothing that the
    # other one does not hide, so it is left out of all that follows.
    candidates = overlaps.selected(overlaps.nearer_everywhere)
    is_covered = shapely.covers(shapes[candidates.ahead], shapes[candidates.behind])
    covered = candidates.behind[is_covered]
    remaining = np.setdiff1d(range(len(shapes)), covered)
    hiding: dict[int, list[BaseGeometry]] = {int(number): [] for number in remaining}
    has_covered = np.isin(overlaps.behind, covered) | np.isin(overlaps.ahead, covered)
    for behind, ahead, is_nearer_everywhere in zip(*overlaps.selected(~has_covered), strict=True):
        region = shapes[ahead]
        if not is_nearer_everywhere:
            common = _polygons(shapely.intersection(shapes[behind], region))
            region = _nearer_part(common, planes[ahead] - planes[behind])
        hiding[behind].append(region)
    return hiding


class Overlaps(NamedTuple):
    """Pairs of outlines of which one hides a part of the other, as arrays (n,).

    ``behind`` and ``ahead`` are the indices of the two outlines. ``nearer_everywhere`` says whether the outline ahead is
    nearer in the whole region that both have in common.
    """

    behind: NDArray[np.intp]
    ahead: NDArray[np.intp]
    nearer_everywhere: NDArray[np.bool_]

    def selected(self, is_selected: NDArray[np.bool_]) -> "Overlaps":
        """Return the pairs for which the array (n,) has the value True."""
        return Overlaps(self.behind[is_selected], self.ahead[is_selected], self.nearer_everywhere[is_selected])


def _overlapping(shapes: NDArray[np.object_], planes: Vector) -> Overlaps:
    """Return the pairs of outlines that overlap, and of which one hides a part of the other.

    ``planes`` (outlines, 3) are the depths of the outlines over the picture (see ``_depth``), where a larger depth is
    nearer. The *lead* of an outline over another one is the difference of their depths. It is linear over the picture. So
    within any outline it lies between its minimum and its maximum at the corners of this outline.
    """
    shapely.prepare(shapes)
    behind, ahead = STRtree(shapes).query(shapes, predicate="intersects")
    corners, owners = shapely.get_coordinates(shapes, return_index=True)
    depths = planes[:, :1] + planes[:, 1:2] * corners[:, 0] + planes[:, 2:] * corners[:, 1]
    # The lead of each outline (rows) over the outline of each corner (columns), at this corner.
    own_depths = depths[owners, np.arange(len(corners))]
    leads = depths - own_depths
    # Its minimum and its maximum over the corners of each outline: [i, k] is the lead of outline i over outline k.
    first_corners = np.searchsorted(owners, np.arange(len(shapes)))
    min_leads = np.minimum.reduceat(leads, first_corners, axis=1)
    max_leads = np.maximum.reduceat(leads, first_corners, axis=1)
    # For a pair, there are limits from the corners of the outline behind and, with the opposite sign, from those of the
    # outline ahead. The common region lies within both outlines, so both limits hold there.
    max_lead = np.minimum(max_leads[ahead, behind], -min_leads[behind, ahead])
    min_lead = np.maximum(min_leads[ahead, behind], -max_leads[behind, ahead])
    pairs = np.flatnonzero(max_lead > TOUCHING_MM)
    only_touch = shapely.touches(shapes[behind[pairs]], shapes[ahead[pairs]])
    pairs = pairs[~only_touch]
    return Overlaps(behind[pairs], ahead[pairs], nearer_everywhere=min_lead[pairs] > -TOUCHING_MM)


def _depth(facet: Facet, view: Camera) -> Vector:
    """Return the plane (3,) of a facet's depth over the picture: (c, a, b) for the depth c + a u + b v at (u, v).

    A larger depth is nearer to the camera.
    """
    # The components of the facet's normal to the right and up in the picture, and towards the camera.
    normal_right, normal_up = facet.normal @ view.right, facet.normal @ view.up
    normal_toward = facet.normal @ view.toward
    # How much nearer the facet comes for each millimetre to the right, and for each millimetre up.
    per_right, per_up = -normal_right / normal_toward, -normal_up / normal_toward
    corner = facet.rings_mm[0][0]
    depth_at_origin = corner @ view.toward - per_right * (corner @ view.right) - per_up * (corner @ view.up)
    return np.array([depth_at_origin, per_right, per_up])


def _nearer_part(region: BaseGeometry, lead_plane: Vector) -> BaseGeometry:
    """Return the part of a region in which one face is nearer than another one, by more than TOUCHING_MM.

    The *lead* says how much nearer it is. ``lead_plane`` is (c, a, b): the lead at the point (u, v) of the picture is
    c + a u + b v.
    """
    constant, gradient = lead_plane[0], lead_plane[1:]
    corners = shapely.get_coordinates(region)
    # By how much the leads at the corners of the region exceed TOUCHING_MM.
    excesses = constant + corners @ gradient - TOUCHING_MM
    if (excesses <= 0).all():
        return Polygon()
    if (excesses > 0).all():
        return region
    # The excess is positive on one side of a line. So the region is cut with a square on this side that is larger than
    # the region. The excess grows in the direction ``inward``. One side of the square lies on the line.
    slope = math.hypot(*gradient)
    inward = gradient / slope
    along = np.array([-gradient[1], gradient[0]]) / slope
    # The point of the line that is nearest to the middle of the region.
    middle = corners.mean(axis=0)
    on_line = middle - inward * (constant + middle @ gradient - TOUCHING_MM) / slope
    size = 4 * (np.ptp(corners, axis=0).sum() + abs(excesses).max() / slope)
    start, end, depth = on_line - size * along, on_line + size * along, size * inward
    square = Polygon([start, end, end + depth, start + depth])
    return _polygons(shapely.intersection(region, square))


def _polygons(geometry: BaseGeometry) -> BaseGeometry:
    """Return the polygons of a geometry, without points and lines."""
    if geometry.geom_type in ("Polygon", "MultiPolygon"):
        return geometry
    return shapely.MultiPolygon([part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"])


def _visible_facet(facet: Facet, region: BaseGeometry, whole: bool, view: Camera) -> VisibleFacet:
    """Return a facet with its visible region and its brightness. The light comes from above and left of the camera."""
    front = bool(facet.normal @ view.toward > 0)
    light = view.toward + 0.6 * view.up - 0.35 * view.right
    lit = float((facet.normal if front else -facet.normal) @ light / np.linalg.norm(light))
    return VisibleFacet(facet, region, whole, max(0.0, lit), front)
