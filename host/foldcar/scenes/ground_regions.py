"""Changes Scenic's flat regions: all are compared in the ground plane, and shapes without an area are refused.

A car's middle lies above the ground. For Scenic, `ego.position in CircularRegion(…)` holds only at the exact height of
the circle's centre, so it would never hold while the car drives. carsim compares all regions in the ground plane.

Scenic refuses a circle of radius 0 or a polygon whose sides cross in a library's words, or with none.
"""

import functools
import inspect
import math
from collections.abc import Iterator, Mapping
from typing import Any

# Lengths and angles that give a region its area.
SIZES = {"CircularRegion": ("radius",), "SectorRegion": ("radius", "angle"), "RectangularRegion": ("width", "length")}


@functools.cache
def use_ground_regions() -> None:
    """Change Scenic's classes of regions, so that they lie in the ground plane and say why a shape has no area.

    A point is then inside a region if it is inside in the view from above, whatever its height. This changes the classes
    in this process; later calls do nothing.
    """
    from scenic.core.distributions import distributionFunction
    from scenic.core.regions import CircularRegion, PolygonalRegion, RectangularRegion, SectorRegion
    from scenic.core.type_support import toVector
    from scenic.core.vectors import Vector

    def contains_in_ground_plane(contains_point: Any) -> Any:
        """Return a function like ``contains_point``, Scenic's method of a region, that ignores the point's height."""

        def contains(region: Any, point: Any) -> bool:
            """Return whether the point is in the region after it is moved to the height of the region."""
            position = toVector(point)
            position_at_height_of_region = Vector(position.x, position.y, region.z)
            return bool(contains_point(region, position_at_height_of_region))

        # Scenic then also accepts points with random coordinates.
        return distributionFunction(contains)

    for kind in (CircularRegion, SectorRegion):
        kind.containsPoint = contains_in_ground_plane(kind.containsPoint)
    for kind in (CircularRegion, SectorRegion, RectangularRegion, PolygonalRegion):
        kind.__init__ = _constructor_with_reasons(kind, kind.__init__)


def _constructor_with_reasons(kind: Any, scenic_init: Any) -> Any:
    """Return a constructor of Scenic's region class ``kind`` that says why a shape has no area.

    It calls ``scenic_init``, the class's own constructor. If that raises an error that does not say why, the returned
    constructor raises Scenic's InvalidScenarioError with a reason.
    """
    from scenic.core.errors import InvalidScenarioError
    from shapely.errors import GEOSException

    signature = inspect.signature(scenic_init)

    @functools.wraps(scenic_init)
    def init(region: Any, *args: Any, **keywords: Any) -> None:
        """Create a region of the class ``kind``. Raises InvalidScenarioError, which gives a reason, if it has no area."""
        try:
            scenic_init(region, *args, **keywords)
        except (AssertionError, AttributeError, TypeError, ValueError, GEOSException) as error:
            is_derived = type(region) is not kind
            is_wrong_call = isinstance(error, TypeError) and kind.__name__ in str(error)
            if is_derived or is_wrong_call:
                # The error comes from a class of the program, or says which argument is missing or unknown.
                raise
            arguments = signature.bind(region, *args, **keywords).arguments
            reason = next(_faults(kind.__name__, arguments), None)
            if reason is None and isinstance(error, AttributeError | TypeError):
                # The error has nothing to do with the area, so its own message is better.
                raise
            message = reason or "its numbers give no area of the ground"
            raise InvalidScenarioError(f"{kind.__name__}: {message}") from None

    return init


def _faults(kind: str, arguments: Mapping[str, Any]) -> Iterator[str]:
    """Yield the reasons for which a region of Scenic's class ``kind`` has no area."""
    for name in SIZES.get(kind, ()):
        size = arguments[name]
        if isinstance(size, int | float) and not 0 < size < math.inf:
            yield f"{name} {size:g} is not above 0 and finite"
    if kind == "SectorRegion" and isinstance(arguments["center"], tuple | list):
        yield f"center {arguments['center']} is not a vector: write x @ y"
    if kind == "PolygonalRegion" and arguments.get("polygon") is None:
        yield from _faults_of_corners(list(arguments.get("points") or ()))
    elif kind == "PolygonalRegion" and hasattr(arguments["polygon"], "geom_type"):
        yield from _faults_of_polygon(arguments["polygon"])


def _faults_of_corners(corners: list[Any]) -> Iterator[str]:
    """Yield the reasons for which a polygon with these corners, given as Scenic's vectors or as tuples, has no area."""
    from shapely import Polygon

    if len(corners) < 3:
        yield f"{len(corners)} corners: a polygon has at least 3"
        return
    for number, corner in enumerate(corners, start=1):
        try:
            is_finite = all(math.isfinite(coordinate) for coordinate in tuple(corner)[:2])
        except TypeError:
            is_finite = False
        if not is_finite:
            yield f"corner {number} is not two finite numbers (a corner cannot be random)"
            return
    yield from _faults_of_polygon(Polygon([tuple(corner)[:2] for corner in corners]))


def _faults_of_polygon(polygon: Any) -> Iterator[str]:
    """Yield the reasons for which a polygon of Shapely has no area or is not valid."""
    from shapely.validation import explain_validity

    if not polygon.convex_hull.area:
        yield "its corners lie on one line"
    # Shapely's text is "Valid Geometry", or a reason with a place, such as "Self-intersection[0.5 0.5]".
    reason, _, place = explain_validity(polygon).rstrip("]").partition("[")
    if reason == "Self-intersection":
        x, y = (float(coordinate) for coordinate in place.split())
        yield f"its sides cross at ({x:.4g}, {y:.4g})"
    elif reason != "Valid Geometry":
        place_text = f" at {place}" if place else ""
        yield f"is not a valid polygon ({reason.lower()}{place_text})"
