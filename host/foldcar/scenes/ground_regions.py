"""Makes Scenic compare circles and sectors in the ground plane, as it compares rectangles and polygons.

A car's middle lies above the ground. For Scenic, `ego.position in CircularRegion(…)` holds only at the exact height of
the circle's centre, so it would never hold while the car drives. carsim compares all regions in the ground plane.
"""

from functools import cache
from typing import Any


@cache
def compare_in_ground_plane() -> None:
    """Change Scenic's regions of this process, once."""
    from scenic.core.distributions import distributionFunction
    from scenic.core.regions import CircularRegion, SectorRegion
    from scenic.core.type_support import toVector
    from scenic.core.vectors import Vector

    def ground_plane_version(contains_point: Any) -> Any:
        def containsPoint(self: Any, point: Any) -> bool:  # noqa: N802
            at = toVector(point)
            return bool(contains_point(self, Vector(at.x, at.y, self.z)))

        return distributionFunction(containsPoint)

    for kind in (CircularRegion, SectorRegion):
        kind.containsPoint = ground_plane_version(kind.containsPoint)
