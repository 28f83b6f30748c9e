"""How a car stands at a place of a scene: what one camera sees worst, height and tilt, the ground tells best.

Input: a scene as it was placed, heights of its ground, a car's body, a place. Output: height of the car's origin, pitch
and roll, with standard deviations. A wheel of radius r at x rests where ground h touches it first: its axle is at

    max over d of h(x + d) + sqrt(r² - d²),   -r < d < r along the car.

The car is the plane that fits the axles of its wheels best; three carry it, so that the fourth's distance from the
plane is a measure of doubt, as is how much all of it changes within the next REACH_M, where a car climbs or drops.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from scipy.ndimage import map_coordinates

from foldcar.camera.detection import Floats
from foldcar.figures.ground import Extent, HeightMap, height_map
from foldcar.figures.top_view import view_of
from foldcar.simulation.heights import Heights

CELL_M = 0.005
MOST_CELLS = 1200
MARGIN_M = 0.4
REACH_M = 0.012
# On flat ground: tyres are pressed in, wheels are not round, lids bend.
FLAT_M, FLAT_RAD = 0.0015, 0.012
# Places along a wheel.
ALONG = numpy.linspace(-0.98, 0.98, 25)


@dataclass(frozen=True)
class Stance:
    """Height of the origin (m), pitch and roll (rad), and standard deviations of the height and of both tilts."""

    z_m: float
    pitch_rad: float
    roll_rad: float
    height_error_m: float
    tilt_error_rad: float


@dataclass(frozen=True)
class Standing:
    """The ground, and the wheels of the car: places ahead and to the left of the origin, and their radius (m)."""

    ground: HeightMap
    ahead_m: Floats
    left_m: Floats
    radius_m: float
    hinged: bool

    def at(self, x_m: float, y_m: float, heading_rad: float) -> Stance:
        """How the car stands there."""
        planes = [self._plane(x_m, y_m, heading_rad, shift) for shift in (0.0, -REACH_M, REACH_M)]
        (z, slope, bank), off = planes[0]
        changes = numpy.ptp([plane for plane, _ in planes], axis=0)
        doubt = off * (2.0 if self.hinged else 1.0)
        base, track = float(numpy.ptp(self.ahead_m)), float(numpy.ptp(self.left_m))
        height_error = FLAT_M + 0.7 * doubt + 0.5 * changes[0]
        tilt_error = FLAT_RAD + 2 * doubt / max(min(base, track), 0.03) + 0.5 * float(changes[1:].max())
        return Stance(z, math.atan(slope), math.atan(bank), height_error, tilt_error)

    def _plane(self, x_m: float, y_m: float, heading_rad: float, shift_m: float) -> tuple[Floats, float]:
        """Height, slope ahead and bank to the left of the plane of the axles, and how far they are from it (rms, m)."""
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        along = self.ahead_m[:, None] + shift_m + self.radius_m * ALONG
        x = x_m + along * cos - self.left_m[:, None] * sin
        y = y_m + along * sin + self.left_m[:, None] * cos
        axles = (self.heights(x, y) + self.radius_m * numpy.sqrt(1 - ALONG**2)).max(axis=1)
        plane = self._solve @ axles
        return plane, float(numpy.sqrt(numpy.mean((axles - self._places @ plane) ** 2)))

    @cached_property
    def _places(self) -> Floats:
        return numpy.column_stack([numpy.ones_like(self.ahead_m), self.ahead_m, self.left_m])

    @cached_property
    def _solve(self) -> Floats:
        return numpy.asarray(numpy.linalg.pinv(self._places), float)

    def heights(self, x: Floats, y: Floats) -> Floats:
        """Of the ground at places of any shape (m)."""
        extent, cell = self.ground.extent, self.ground.cell_m
        rows, columns = (y - extent.y_min_m) / cell - 0.5, (x - extent.x_min_m) / cell - 0.5
        found: Floats = map_coordinates(self.ground.z_m, [rows, columns], order=1, mode="nearest")
        return found


def standing(scene: Mapping[str, Any], heights: Heights, body: Mapping[str, Any]) -> Standing:
    """Of a scene of docs/carsim.md over its start, goal and terrain, with the heights of `carsim_heights`."""
    view = view_of([scene])
    extent = Extent(view.x_min_m - MARGIN_M, view.x_max_m + MARGIN_M, view.y_min_m - MARGIN_M, view.y_max_m + MARGIN_M)
    cells = min(MOST_CELLS, max(2, round(max(extent.size_m) / CELL_M)))
    wheels = body["wheels"]
    ahead = numpy.array([wheel["x_m"] for wheel in wheels])
    left = numpy.array([body["track_m"] / 2 * (1 if wheel["side"] == "left" else -1) for wheel in wheels])
    radius_m = max(wheel["radius_m"] for wheel in wheels)
    return Standing(height_map(heights, scene, extent, cells), ahead, left, radius_m, bool(body["hinges"]))
