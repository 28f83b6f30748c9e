"""The height of a scene's ground over a rectangle of the plane, as pictures show it from above, and its colours.

One colour scale for the heights of several scenes: white at 0, brown above, blue below, with hill shading.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, Normalize
from numpy.typing import NDArray

from foldcar.simulation.heights import Floats, Heights

ABOVE = LinearSegmentedColormap.from_list("above", ["#f7f7f5", "#f0dfb8", "#cfa65b", "#8a5a1c", "#3f2506"])
BELOW = LinearSegmentedColormap.from_list("below", ["#f7f7f5", "#a9c9de", "#3a7ca8", "#123f5f"])
COLOURS = 512
# Light from the upper left; slopes are exaggerated, because hills of a few centimetres would look flat.
AZIMUTH_RAD = numpy.radians(135)
ALTITUDE_RAD = numpy.radians(45)
STEEPER = 1.5
SHADE = 0.45
MIN_RANGE_MM = 1.0


@dataclass(frozen=True)
class Extent:
    """A rectangle of the plane (m)."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float

    @property
    def size_m(self) -> tuple[float, float]:
        """Length along x and along y."""
        return self.x_max_m - self.x_min_m, self.y_max_m - self.y_min_m


@dataclass(frozen=True)
class HeightMap:
    """Heights ``z_m``, (rows, columns) along (y, x), at the centres of square cells with side ``cell_m``."""

    extent: Extent
    cell_m: float
    z_m: Floats


def height_map(heights: Heights, scene: Mapping[str, Any], extent: Extent, cells: int) -> HeightMap:
    """Return the ground over approximately ``extent``, with ``cells`` cells along its longer side."""
    length_m, width_m = extent.size_m
    cell_m = max(length_m, width_m) / cells
    columns, rows = max(2, round(length_m / cell_m)), max(2, round(width_m / cell_m))
    # The middles of the cells.
    x_m, y_m = numpy.meshgrid(
        extent.x_min_m + cell_m * (numpy.arange(columns) + 0.5), extent.y_min_m + cell_m * (numpy.arange(rows) + 0.5)
    )
    # The cells do not cover exactly the extent, because they are square.
    covered = Extent(
        x_min_m=extent.x_min_m,
        x_max_m=extent.x_min_m + columns * cell_m,
        y_min_m=extent.y_min_m,
        y_max_m=extent.y_min_m + rows * cell_m,
    )
    return HeightMap(covered, cell_m, heights(scene, x_m, y_m))


def height_scale(maps: Sequence[HeightMap]) -> ScalarMappable:
    """Return a colour scale (mm) for all heights of the maps. It is white at height 0 and darker above and below.

    The darkest colour below 0 stands for the deepest hole, or for half of the maximum height if that is more. So shallow
    holes stay pale.
    """
    low_mm = high_mm = 0.0
    for ground in maps:
        low_mm = min(low_mm, 1e3 * float(numpy.min(ground.z_m)))
        high_mm = max(high_mm, 1e3 * float(numpy.max(ground.z_m)))
    high_mm = max(high_mm, MIN_RANGE_MM + low_mm)
    depth_mm = max(-low_mm, high_mm / 2)
    colours = []
    for height_mm in numpy.linspace(low_mm, high_mm, COLOURS):
        colours.append(ABOVE(height_mm / high_mm) if height_mm >= 0 else BELOW(-height_mm / depth_mm))
    return ScalarMappable(Normalize(low_mm, high_mm), ListedColormap(colours))


def shaded(ground: HeightMap, scale: ScalarMappable) -> NDArray[Any]:
    """Return the colours (rows, columns, 3) of a map of heights that is lit from the side.

    Level ground has the colour of the ``scale``. Slopes towards the light are brighter, and slopes away from it darker.
    """
    colours = scale.to_rgba(ground.z_m * 1e3)[..., :3]
    slope_y, slope_x = numpy.gradient(ground.z_m * STEEPER, ground.cell_m)
    # The light is the cosine of the angle between the ground's normal (-slope_x, -slope_y, 1) and the direction of the
    # light, which is their scalar product divided by the length of the normal (Lambert's law).
    slope_to_light = numpy.cos(ALTITUDE_RAD) * (slope_y * numpy.sin(AZIMUTH_RAD) + slope_x * numpy.cos(AZIMUTH_RAD))
    light_on_level_ground = numpy.sin(ALTITUDE_RAD)
    normal_length = numpy.sqrt(1 + slope_x**2 + slope_y**2)
    light = (light_on_level_ground - slope_to_light) / normal_length
    brightness = 1 + SHADE * (light - light_on_level_ground)
    result: NDArray[Any] = numpy.clip(colours * brightness[..., None], 0.0, 1.0)
    return result
