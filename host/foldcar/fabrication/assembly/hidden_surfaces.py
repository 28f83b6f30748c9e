"""Computes the visible regions of flat faces in space exactly.

Input: Facets in millimetres and a Camera. Output: for each visible facet its visible region on the picture plane. The
depth of a flat face is linear over the picture. So, of the common part of two outlines, a face hides the side of a line
where it is nearer. Faces may intersect.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
    rings = [ring for facet in facets for ring in facet.rings_mm]
    corners = np.round(view.flat(np.concatenate(rings)), GRID_DECIMALS)
    ring_of_corner = np.repeat(range(len(rings)), [len(ring) for ring in rings])
    loops = shapely.linearrings(corners, indices=ring_of_corner)
    facet_of_ring = np.repeat(range(len(facets)), [len(facet.rings_mm) for facet in facets])
    outlines = shapely.polygons(loops, indices=facet_of_ring)
    in_picture = np.flatnonzero(shapely.area(outlines) > MIN_AREA_MM2)
    # Rounding can make holes touch the outlines of faces seen almost edge-on.
    shapes = shapely.make_valid(outlines[in_picture])
    planes = np.array([_depth(facets[i], view) for i in in_picture]).reshape(-1, 3)
    visible = []
    for number, hiding_regions in _hiding_regions(shapes, planes).items():
        facet, region = facets[in_picture[number]], shapes[number]
        remaining = region
        if hiding_regions:
            remaining = _polygons(shapely.difference(region, shapely.union_all(hiding_regions)))
        is_whole = region.area - remaining.area < MIN_AREA_MM2
        if not is_whole:
            # Rounding leaves slivers between adjacent hiding faces.
            region = remaining.buffer(-SLIVER_MM, join_style="mitre").buffer(SLIVER_MM, join_style="mitre")
        if region.area > MIN_AREA_MM2:
            visible.append(_visible_facet(facet, region, is_whole, view))
    return sorted(visible, key=lambda seen: float((seen.facet.rings_mm[0] @ view.toward).mean()))


def _hiding_regions(shapes: NDArray[np.object_], planes: Vector) -> dict[int, list[BaseGeometry]]:
    """Return the regions of the picture in which each outline is hidden by others, by the outline's number.

    Outlines that are hidden completely are not in the result. ``planes`` (n, 3) are the depths of the outlines (see
    ``_depth``).
    """
    behind, ahead, everywhere = _overlapping(shapes, planes)
    # An outline is hidden completely if another one is nearer everywhere and covers it. It then hides nothing that the
    # other one does not hide, so it is left out of all that follows.
    is_covered = shapely.covers(shapes[ahead[everywhere]], shapes[behind[everywhere]])
    covered = behind[everywhere][is_covered]
    remaining = np.setdiff1d(range(len(shapes)), covered)
    hiding: dict[int, list[BaseGeometry]] = {int(number): [] for number in remaining}
    is_pair_of_remaining = ~np.isin(behind, covered) & ~np.isin(ahead, covered)
    pairs = np.flatnonzero(is_pair_of_remaining)
    for rear, front, is_nearer_everywhere in zip(behind[pairs], ahead[pairs], everywhere[pairs], strict=True):
        region = shapes[front]
        if not is_nearer_everywhere:
            common = _polygons(shapely.intersection(shapes[rear], region))
            region = _nearer_part(common, planes[front] - planes[rear])
        hiding[rear].append(region)
    return hiding


def _overlapping(
    shapes: NDArray[np.object_], planes: Vector
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Return the pairs of outlines that overlap, and of which one hides a part of the other.

    The three arrays (n,) are the index of the outline behind, the index of the outline ahead, and whether the latter is
    nearer everywhere. ``planes`` (outlines, 3) are c, a, b of the depth c + a u + b v, where a larger depth is nearer.
    The difference between two depths is linear over the picture. So within an outline it lies between its minimum and
    its maximum at the corners of this outline.
    """
    shapely.prepare(shapes)
    behind, ahead = STRtree(shapes).query(shapes, predicate="intersects")
    corners, owners = shapely.get_coordinates(shapes, return_index=True)
    depths = planes[:, :1] + planes[:, 1:2] * corners[:, 0] + planes[:, 2:] * corners[:, 1]
    # How much nearer the plane of each outline (rows) is than each corner (columns).
    depth_of_corner = depths[owners, np.arange(len(corners))]
    leads = depths - depth_of_corner
    # The smallest and the largest lead of each outline (rows) over the corners of each outline (columns).
    first_corners = np.searchsorted(owners, np.arange(len(shapes)))
    least = np.minimum.reduceat(leads, first_corners, axis=1)
    greatest = np.maximum.reduceat(leads, first_corners, axis=1)
    # The common region lies within both outlines, so the limits from the corners of both hold.
    somewhere = np.minimum(greatest[ahead, behind], -least[behind, ahead]) > TOUCHING_MM
    everywhere = np.maximum(least[ahead, behind], -greatest[behind, ahead]) > -TOUCHING_MM
    pairs = np.flatnonzero(somewhere)
    pairs = pairs[~shapely.touches(shapes[behind[pairs]], shapes[ahead[pairs]])]
    return behind[pairs], ahead[pairs], everywhere[pairs]


def _depth(facet: Facet, view: Camera) -> Vector:
    """Return (c, a, b) of a facet: its depth at the point (u, v) of the picture is c + a u + b v.

    A larger depth is nearer.
    """
    normal = facet.normal
    slope = normal @ view.toward
    a, b = -(normal @ view.right) / slope, -(normal @ view.up) / slope
    point = facet.rings_mm[0][0]
    return np.array([point @ view.toward - a * (point @ view.right) - b * (point @ view.up), a, b])


def _nearer_part(region: BaseGeometry, lead_plane: Vector) -> BaseGeometry:
    """Return the part of a region in which one face is nearer than another one, by more than TOUCHING_MM.

    The *lead* says how much nearer it is. ``lead_plane`` is (c, a, b): the lead at the point (u, v) of the picture is
    c + a u + b v.
    """
    constant, gradient = lead_plane[0], lead_plane[1:]
    corners = shapely.get_coordinates(region)
    # The leads at the corners of the region, without TOUCHING_MM.
    leads = constant + corners @ gradient - TOUCHING_MM
    if (leads <= 0).all():
        return Polygon()
    if (leads > 0).all():
        return region
    # The lead is positive on one side of a line. This half plane is represented by a square that is larger than the
    # region. One side of the square lies on the line.
    slope = math.hypot(*gradient)
    along = np.array([-gradient[1], gradient[0]]) / slope
    inward = gradient / slope
    middle = corners.mean(axis=0)
    on_line = middle - inward * (constant + middle @ gradient - TOUCHING_MM) / slope
    size = 4 * (np.ptp(corners, axis=0).sum() + abs(leads).max() / slope)
    square = [on_line + s * size * along + t * size * inward for s, t in ((-1, 0), (1, 0), (1, 1), (-1, 1))]
    return _polygons(shapely.intersection(region, Polygon(square)))


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
