"""How a car stands at a place of a scene: what one camera sees worst, height and tilt, the ground tells best.

Input: a scene as it was placed, heights of its ground, a car's body, a place. Output: height of the car's origin, pitch
and roll, with their covariance. A wheel of radius r rests where ground h touches its tread first: its axle is at

    max over d of h(x + d) + sqrt(r² - d²),   -r < d < r along the car,

the highest of its width. Of a wheel that leans by the roll φ, sqrt(r² - d²) counts times cos φ, and it touches beside its
middle. A rigid car rests on three wheels around its middle, no other wheel in the ground. Often more than one three will
do: with a wheel on a step the car stands on a diagonal and leans to either side. The mean and the covariance are those of
all these planes, here and beside (REACH_M, ASIDE_M), where a car climbs or drops. Hinged cars do the same, less exactly.
The body of one whose wheels do not surround its middle drags: its slope is not known.

Obstacles are not as high as planned: each has a factor of its own, with a standard deviation, by the car that drives over
them. What touches is one obstacle, as the ground itself shows; rough ground is one with all that stands on it.
Of each pose the corners alone tell height, pitch and roll, m, with covariance C; the
ground g(s) tells the same with covariance R. Sought are the factors s and an offset b that all pictures share (a marker
that is glued on askew, a camera that is off), most probable given

    m = g(s) + b + noise,   covariance C + R.

Errors of neighbouring pictures are alike: each counts as ALIKE of one. A car that hangs on its belly stands higher than
its wheels say: the factor takes that up, so that the path is right, but it is not the obstacle's then.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy
from numpy.typing import NDArray
from scipy.ndimage import label, map_coordinates

from foldcar.errors import FoldcarError
from foldcar.figures.ground import Extent, HeightMap, height_map
from foldcar.figures.top_view import view_of
from foldcar.simulation.heights import Heights
from foldcar.trials.camera.detection import Floats

if TYPE_CHECKING:
    from foldcar.trials.camera.poses import Pose

CELL_M = 0.005
MAX_CELLS = 1200
MARGIN_M = 0.4
# Ahead and aside: how much a car may have climbed, how well it is known where an obstacle lies.
REACH_M, ASIDE_M = 0.012, 0.003
# On flat ground: tyres are pressed in, wheels are not round, lids bend.
FLAT_M, FLAT_RAD = 0.0015, 0.012
# How much these errors grow with the sine of the tilt: wheels slip off edges and lift for a moment.
TILTED = 3.0
# Slope of a car whose body drags.
DRAGS = 0.3
# Ground nearer to the floor's height is floor.
FLOOR_M = 0.0005
MAX_OBSTACLES = 26
# Built obstacles against planned ones, as shares of the height: all of a course alike, each by itself.
HEIGHT_ALIKE, HEIGHT_OWN = 0.2, 0.1
HEIGHT_SHARE = math.hypot(HEIGHT_ALIKE, HEIGHT_OWN)
SHIFTS_M = numpy.array([(0.0, 0.0), (-REACH_M, 0.0), (REACH_M, 0.0), (0.0, -ASIDE_M), (0.0, ASIDE_M)])
# Places along a wheel, and across it in its widths.
ALONG = numpy.linspace(-0.98, 0.98, 25)
ACROSS = numpy.array([-0.45, 0.0, 0.45])
# The centre of mass, which three wheels surround, is so near to the car's middle, as a share of the wheels' distances.
MIDDLE = 0.1
# Of a pose, what the ground tells: z, pitch, roll.
GROUND = [2, 4, 5]
# Standard deviations of the offset: height (m), pitch and roll (rad).
OFFSET = numpy.array([0.01, 0.03, 0.03])
STEP = 0.02
# Pictures that are farther off (χ² of three) count less: a car that tips, or is in the air.
FAR = 12.0
ALIKE, MIN_ERROR = 0.4, 0.03
FACTORS = (0.3, 3.0)
# A factor that is known better than TOLD, and farther from 1 than it and than twice its error, is told. Beyond OTHER the
# obstacle is another one.
TOLD = 0.1
OTHER = (0.5, 2.0)


class Place(NamedTuple):
    """Where a car is and how it is tilted: nose up, left side up."""

    x_m: float
    y_m: float
    heading_rad: float
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @staticmethod
    def of(pose: Floats) -> "Place":
        """Of x, y, z (m), heading, pitch, roll (rad)."""
        x, y, _, heading, pitch, roll = pose.tolist()
        return Place(x, y, heading, pitch, roll)


@dataclass(frozen=True)
class Stance:
    """Height of the origin (m), pitch and roll (rad), and their covariance."""

    values: Floats
    covariance: Floats


@dataclass(frozen=True)
class Standing:
    """The ground, and the wheels of the car: places ahead and to the left of the origin, radii and width (m).

    ``obstacle`` has the number of each cell's obstacle, 0 for floor. ``factors`` are their heights relative to the
    planned ones, ``factor_errors`` the standard deviations; the floor's are 1 and 0.
    """

    ground: HeightMap
    obstacle: NDArray[numpy.int32]
    factors: Floats
    factor_errors: Floats
    ahead_m: Floats
    left_m: Floats
    radii_m: Floats
    width_m: float
    hinged: bool

    @cached_property
    def level(self) -> Floats:
        """Height of the origin (m), slope ahead and bank to the left on level floor: wheels of two radii tilt the car."""
        if numpy.ptp(self.radii_m) == 0:
            return numpy.array([self.radii_m[0], 0.0, 0.0])
        tilted: Floats = self._stands(self.radii_m[None])[0].mean(axis=0)
        return tilted

    @property
    def radius_m(self) -> float:
        """Height of the origin over level floor (m), the wheels' radius if they have one."""
        return float(self.level[0])

    def at(self, place: Place) -> Stance:
        """How the car stands there."""
        planes = self.planes(place, SHIFTS_M)
        values = planes[0].mean(axis=0)
        off = numpy.concatenate(planes) - values
        # Heights and tilts are proportional to the factor.
        under = self.under(place)
        share = max((float(self.factor_errors[k] / self.factors[k]) for k in under), default=0.0)
        raised = share * (values - self.level)
        lean = math.hypot(math.sin(place.pitch_rad), math.sin(place.roll_rad))
        flat = (2.0 if self.hinged else 1.0) * (1 + TILTED * lean) * numpy.array([FLAT_M, FLAT_RAD, FLAT_RAD])
        covariance = numpy.diag(flat**2) + off.T @ off / len(off) + numpy.outer(raised, raised)
        sin_pitch, bank = values[1:].clip(-0.99, 0.99)
        pitch = math.asin(sin_pitch)
        roll = math.asin(min(max(bank / math.cos(pitch), -0.99), 0.99))
        return Stance(numpy.array([values[0], pitch, roll]), covariance)

    def planes(self, place: Place, shifts_m: Floats = SHIFTS_M[:1]) -> list[Floats]:
        """For each shift of the car, ahead and to the left, the planes (n, 3) on which the axles may be.

        A plane is the height at the origin, and by how much it rises per metre of the car ahead and to the left.
        """
        # A wheel that leans touches the ground beside its middle, and with its edge.
        sin, cos = math.sin(place.roll_rad), math.cos(place.roll_rad)
        rise = self.radii_m[:, None, None] * numpy.sqrt(1 - ALONG**2) * cos - self.width_m * ACROSS[:, None] * sin
        return self._stands((self.heights(*self._below(place, shifts_m)) + rise).max(axis=(2, 3)))

    def _stands(self, all_axles: Floats) -> list[Floats]:
        """The planes for heights of the axles (shifts, wheels) over which each wheel touches the ground."""
        threes, inverses = self._threes
        if not len(threes):
            return [self._dragging(axles) for axles in all_axles]
        all_planes = numpy.einsum("tij,stj->sti", inverses, all_axles[:, threes])
        above = (all_planes @ self._places.T >= all_axles[:, None] - 1e-6).all(axis=2)
        return [planes[stand] for planes, stand in zip(all_planes, above, strict=True)]

    def _dragging(self, axles: Floats) -> Floats:
        slopes = numpy.array([-DRAGS, DRAGS])
        across = numpy.linalg.pinv(self._places[:, [0, 2]])
        height, bank = across @ (axles[:, None] - self.ahead_m[:, None] * slopes)
        return numpy.column_stack([height, slopes, bank])

    def under(self, place: Place) -> list[int]:
        """Numbers of the obstacles below the wheels of a car there."""
        numbers = self._numbers(*self._cells(*self._below(place, SHIFTS_M[:1])))
        return [number for number in numpy.unique(numbers).tolist() if number]

    def middle(self, number: int) -> tuple[float, float]:
        """Where an obstacle is (m)."""
        row, column = (float(at.mean()) + 0.5 for at in numpy.nonzero(self.obstacle == number))
        extent, cell = self.ground.extent, self.ground.cell_m
        return extent.x_min_m + cell * column, extent.y_min_m + cell * row

    def rescaled(self, factors: Floats, errors: Floats) -> "Standing":
        """The same with other heights."""
        return replace(self, factors=factors, factor_errors=errors)

    def _below(self, place: Place, shifts_m: Floats) -> tuple[Floats, Floats]:
        """Places (shifts, wheels, ACROSS, ALONG) below the wheels of the car."""
        ahead, left = (at[:, None, None, None] for at in shifts_m.T)
        radii = self.radii_m[:, None, None]
        ahead = ahead + math.cos(place.pitch_rad) * self.ahead_m[:, None, None] + radii * ALONG
        aside = math.sin(place.roll_rad) * radii * numpy.sqrt(1 - ALONG**2)
        left = left + math.cos(place.roll_rad) * (self.left_m[:, None, None] + self.width_m * ACROSS[:, None]) + aside
        cos, sin = math.cos(place.heading_rad), math.sin(place.heading_rad)
        return place.x_m + ahead * cos - left * sin, place.y_m + ahead * sin + left * cos

    def _cells(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        extent, cell = self.ground.extent, self.ground.cell_m
        return (y - extent.y_min_m) / cell - 0.5, (x - extent.x_min_m) / cell - 0.5

    def _numbers(self, rows: Floats, columns: Floats) -> NDArray[numpy.int32]:
        last_row, last_column = (size - 1 for size in self.obstacle.shape)
        nearest = numpy.rint(rows).clip(0, last_row).astype(int), numpy.rint(columns).clip(0, last_column).astype(int)
        numbers: NDArray[numpy.int32] = self.obstacle[nearest]
        return numbers

    @cached_property
    def _places(self) -> Floats:
        return numpy.column_stack([numpy.ones_like(self.ahead_m), self.ahead_m, self.left_m])

    @cached_property
    def _threes(self) -> tuple[NDArray[numpy.intp], Floats]:
        """Wheels (n, 3) that surround the car's middle, and what makes planes of their axles (n, 3, 3)."""
        found = []
        for three in combinations(range(len(self.ahead_m)), 3):
            places = self._places[list(three)]
            if abs(numpy.linalg.det(places)) > 1e-6:
                found.append((three, numpy.linalg.inv(places)))
        # The first row has the shares of the weight that the three would carry.
        if not any(inverse[0].min() > -1e-9 for _, inverse in found):
            found = []
        around = [(three, inverse) for three, inverse in found if inverse[0].min() >= -MIDDLE]
        threes, inverses = [three for three, _ in around], [inverse for _, inverse in around]
        return numpy.array(threes, dtype=int).reshape(-1, 3), numpy.array(inverses).reshape(-1, 3, 3)

    def heights(self, x: Floats, y: Floats) -> Floats:
        """Of the ground at places of any shape (m)."""
        cells = self._cells(x, y)
        planned: Floats = map_coordinates(self.ground.z_m, cells, order=1, mode="nearest")
        return planned * self.factors[self._numbers(*cells)]


def standing(scene: Mapping[str, Any], heights: Heights, body: Mapping[str, Any]) -> Standing:
    """Of a scene of docs/carsim.md over its start, goal and terrain, with the heights of `carsim_heights`."""
    view = view_of([scene])
    extent = Extent(view.x_min_m - MARGIN_M, view.x_max_m + MARGIN_M, view.y_min_m - MARGIN_M, view.y_max_m + MARGIN_M)
    cells = min(MAX_CELLS, max(2, round(max(extent.size_m) / CELL_M)))
    wheels = body["wheels"]
    ahead = numpy.array([wheel["x_m"] for wheel in wheels])
    left = numpy.array([body["track_m"] / 2 * (1 if wheel["side"] == "left" else -1) for wheel in wheels])
    radii_m = numpy.array([wheel["radius_m"] for wheel in wheels])
    ground = height_map(heights, scene, extent, cells)
    raised = numpy.abs(ground.z_m) > FLOOR_M
    obstacle, count = label(raised)
    if count > MAX_OBSTACLES:
        obstacle, count = raised.astype(numpy.int32), 1
    errors = numpy.array([0.0] + count * [HEIGHT_SHARE])
    width_m, hinged = wheels[0]["width_m"], bool(body["hinges"])
    return Standing(ground, obstacle, numpy.ones(count + 1), errors, ahead, left, radii_m, width_m, hinged)


def fit_heights(poses: "Sequence[Pose]", ground: Standing, pixel: float) -> Standing:
    """The ground with the obstacles' heights by these poses, whose corners are known to ``pixel``."""
    count = len(ground.factors) - 1
    none = numpy.zeros(count + 1)
    planned = ground.rescaled(none + 1, none)
    raised = [planned.rescaled(1 + STEP * (numpy.arange(count + 1) == k), none) for k in range(count + 1)]
    normal, wanted = numpy.zeros((count + 3, count + 3)), numpy.zeros(count + 3)
    normal[:count, :count] = numpy.linalg.inv(HEIGHT_OWN**2 * numpy.eye(count) + HEIGHT_ALIKE**2)
    normal[count:, count:] = numpy.diag(OFFSET**-2)
    for pose in poses:
        place = Place.of(pose.values)
        stance = planned.at(place)
        values, spread = pose.by_corners(pixel)
        off = values[GROUND] - stance.values
        design = numpy.zeros((3, count + 3))
        design[:, count:] = numpy.eye(3)
        middle = planned.planes(place)[0].mean(axis=0)
        for k in planned.under(place):
            design[:, k - 1] = (raised[k].planes(place)[0].mean(axis=0) - middle) / STEP
        weight = numpy.linalg.inv(spread[numpy.ix_(GROUND, GROUND)] + stance.covariance)
        weight *= ALIKE / max(1.0, float(off @ weight @ off) / FAR)
        normal += design.T @ weight @ design
        wanted += design.T @ weight @ off
    covariance = numpy.linalg.inv(normal)
    factors, errors = none + 1, none.copy()
    factors[1:] = (1 + (covariance @ wanted)[:count]).clip(*FACTORS)
    errors[1:] = numpy.hypot(MIN_ERROR, numpy.sqrt(numpy.diag(covariance)[:count]))
    return ground.rescaled(factors, errors)


def height_remarks(ground: Standing, where: str) -> list[str]:
    """A remark on each obstacle that seems not to be as high as planned.

    FoldcarError, beginning with ``where``, if it is less than half as high, or more than twice.
    """
    remarks = []
    for k, (factor, error) in enumerate(zip(ground.factors, ground.factor_errors, strict=True)):
        if error < TOLD and abs(factor - 1) > max(TOLD, 2 * error):
            x_mm, y_mm = (1000 * at for at in ground.middle(k))
            height = (
                f"the car rode as if the obstacle at {x_mm:.0f}, {y_mm:.0f} mm were {factor:.2f} ± {error:.2f} times as "
                "high as planned"
            )
            if not OTHER[0] < factor < OTHER[1]:
                raise FoldcarError(f"{where}: is a film of another trial: {height}")
            remarks.append(f"{height}: measure it, unless the car hung on its belly")
    return remarks
