"""How a car stands at a position in a scene: the ground determines height and tilt, which one camera measures badly.

Input: a scene as it was placed, heights of its ground, a car's body, a position. Output: height of the car's origin,
pitch and roll, with their covariance. A wheel of radius r rests on the ground h that touches its tread first. Its axle is
at

    max over d of h(x + d) + sqrt(r² - d²),   -r < d < r along the car,

the highest over its width. For a wheel that leans by the roll φ, sqrt(r² - d²) is multiplied by cos φ, and the wheel
touches beside its middle. A rigid car rests on three wheels around its middle, and no other wheel is in the ground. There
may be several such triples: with a wheel on a step, the car stands on a diagonal and leans to either side. Mean and
covariance are taken over all these planes, here and nearby (REACH_M, ASIDE_M), where a car climbs or drops. For hinged
cars this holds less exactly. If the wheels do not surround the middle, the body drags and its slope is unknown.

Real obstacles differ in height from planned ones. Each has a height factor with a standard deviation, which is estimated
from the car that drives over it. Connected raised ground is one obstacle; rough ground is one with all that stands on it.
In each picture, the corners alone measure height, pitch and roll, m, with covariance C. The ground g(s) predicts them
with covariance R. The unknowns are the factors s and an offset b that all pictures share (a marker that is glued on
askew, an error of the camera). They are most probable given

    m = g(s) + b + noise,   covariance C + R.

Errors of neighbouring pictures are correlated, so that each picture has the weight POSE_WEIGHT. A car that hangs on its
belly stands higher than on its wheels. The factor absorbs that: the path is right, but the factor is not the obstacle's.
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
# Shifts ahead and to the side: a car may have climbed already, and the position of an obstacle is uncertain.
REACH_M, ASIDE_M = 0.012, 0.003
# Standard deviations on flat ground: tyres are compressed, wheels are not round, lids bend.
FLAT_M, FLAT_RAD = 0.0015, 0.012
# Growth of these errors with the sine of the tilt, because wheels slip off edges and lift for a moment.
TILT_GROWTH = 3.0
# Largest slope of a car whose body drags.
DRAG_SLOPE = 0.3
# Ground whose height differs less from the floor's is floor.
FLOOR_M = 0.0005
MAX_OBSTACLES = 26
# Relative errors of the heights of built obstacles: common to a course, and of each obstacle.
HEIGHT_COMMON, HEIGHT_OWN = 0.2, 0.1
HEIGHT_ERROR = math.hypot(HEIGHT_COMMON, HEIGHT_OWN)
SHIFTS_M = numpy.array([(0.0, 0.0), (-REACH_M, 0.0), (REACH_M, 0.0), (0.0, -ASIDE_M), (0.0, ASIDE_M)])
# Positions along a wheel (in radii) and across it (in widths).
ALONG = numpy.linspace(-0.98, 0.98, 25)
ACROSS = numpy.array([-0.45, 0.0, 0.45])
# Tolerance for the centre of mass, which three wheels must surround: its distance from the car's middle.
SUPPORT_TOLERANCE = 0.1
# Indices of the pose values that the ground determines: z, pitch, roll.
GROUND_INDICES = [2, 4, 5]
# Standard deviations of the offset: height (m), pitch and roll (rad).
OFFSET = numpy.array([0.01, 0.03, 0.03])
STEP = 0.02
# Pictures with a larger χ² (three values) get less weight: the car tips or is in the air.
OUTLIER_CHI2 = 12.0
POSE_WEIGHT, MIN_ERROR = 0.4, 0.03
FACTORS = (0.3, 3.0)
# A factor is reported if its error is below INFORMATIVE, and its distance from 1 above that and above twice its error.
# Outside PLAUSIBLE_FACTORS, the film shows another obstacle.
INFORMATIVE = 0.1
PLAUSIBLE_FACTORS = (0.5, 2.0)


class Place(NamedTuple):
    """Position and attitude of a car; positive pitch is nose up, positive roll left side up."""

    x_m: float
    y_m: float
    heading_rad: float
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @staticmethod
    def of(pose: Floats) -> "Place":
        """Create it from x, y, z (m), heading, pitch, roll (rad)."""
        x, y, _, heading, pitch, roll = pose.tolist()
        return Place(x, y, heading, pitch, roll)


@dataclass(frozen=True)
class Stance:
    """Height of the origin (m), pitch and roll (rad), and their covariance."""

    values: Floats
    covariance: Floats


@dataclass(frozen=True)
class Standing:
    """The ground, and the wheels of the car: positions ahead and to the left of the origin, radii and width (m).

    ``obstacle`` has the number of each cell's obstacle, 0 for floor. ``factors`` are the heights of obstacles relative to
    the planned ones, ``factor_errors`` their standard deviations; the floor's are 1 and 0.
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
        """Height of the origin (m), slope ahead and bank to the left on level floor; unequal wheels tilt the car."""
        if numpy.ptp(self.radii_m) == 0:
            return numpy.array([self.radii_m[0], 0.0, 0.0])
        tilted: Floats = self._planes_on(self.radii_m[None])[0].mean(axis=0)
        return tilted

    @property
    def radius_m(self) -> float:
        """Height of the origin over level floor (m), the wheels' radius if they have one."""
        return float(self.level[0])

    def stance_at(self, place: Place) -> Stance:
        """Return height, pitch and roll of the car at ``place``, with their covariance.

        The mean is that of all planes on which it may stand there. The covariance has three terms: errors on level
        ground, deviations of the planes here and nearby, and the error of the obstacles' height.
        """
        planes = self.planes(place, SHIFTS_M)
        values = planes[0].mean(axis=0)
        deviations = numpy.concatenate(planes) - values
        # The error of the factor changes heights and tilts proportionally.
        obstacles = self.obstacles_below(place)
        relative_error = max((float(self.factor_errors[k] / self.factors[k]) for k in obstacles), default=0.0)
        height_spread = relative_error * (values - self.level)
        sin_tilt = math.hypot(math.sin(place.pitch_rad), math.sin(place.roll_rad))
        growth = (2.0 if self.hinged else 1.0) * (1 + TILT_GROWTH * sin_tilt)
        level_sd = growth * numpy.array([FLAT_M, FLAT_RAD, FLAT_RAD])
        plane_covariance = deviations.T @ deviations / len(deviations)
        covariance = numpy.diag(level_sd**2) + plane_covariance + numpy.outer(height_spread, height_spread)
        # The rises per metre along the car's axes are the sines of their slopes; the left axis is pitched too.
        sin_pitch, bank = values[1:].clip(-0.99, 0.99)
        pitch = math.asin(sin_pitch)
        roll = math.asin(min(max(bank / math.cos(pitch), -0.99), 0.99))
        return Stance(numpy.array([values[0], pitch, roll]), covariance)

    def planes(self, place: Place, shifts_m: Floats = SHIFTS_M[:1]) -> list[Floats]:
        """Return the planes (n, 3) on which the axles may lie, for each shift of the car ahead and to the left.

        A plane has the height at the origin, and its rise per metre ahead and to the left.
        """
        # Height of the axle over each point of a tyre's lower half: (wheels, across, along). A wheel that leans touches
        # the ground beside its middle, and with its edge.
        sin, cos = math.sin(place.roll_rad), math.cos(place.roll_rad)
        rise = self.radii_m[:, None, None] * numpy.sqrt(1 - ALONG**2) * cos - self.width_m * ACROSS[:, None] * sin
        # Height of the axle if the tyre touched the ground at this point: (shifts, wheels, across, along). The highest is
        # the true one, because no point of the tyre is in the ground.
        axle_heights = self.heights(*self._points_below(place, shifts_m)) + rise
        return self._planes_on(axle_heights.max(axis=(2, 3)))

    def _planes_on(self, axle_heights: Floats) -> list[Floats]:
        """Return, for each shift, the planes (n, 3) of three wheels on the ground with no other wheel in the ground.

        ``axle_heights`` (shifts, wheels) are the heights at which each wheel would touch the ground.
        """
        wheel_triples, inverses = self._supports
        if not len(wheel_triples):
            return [self._planes_dragging(heights) for heights in axle_heights]
        # The plane through the axles of each triple (shifts, triples, 3), and whether all wheels are on it or above.
        all_planes = numpy.einsum("tij,stj->sti", inverses, axle_heights[:, wheel_triples])
        is_above_ground = (all_planes @ self._wheel_rows.T >= axle_heights[:, None] - 1e-6).all(axis=2)
        return [planes[stands] for planes, stands in zip(all_planes, is_above_ground, strict=True)]

    def _planes_dragging(self, axle_heights: Floats) -> Floats:
        """Return two planes (2, 3) of a car whose body drags: of the largest slopes, fitted to the wheels across."""
        slopes = numpy.array([-DRAG_SLOPE, DRAG_SLOPE])
        inverse = numpy.linalg.pinv(self._wheel_rows[:, [0, 2]])
        height, bank = inverse @ (axle_heights[:, None] - self.ahead_m[:, None] * slopes)
        return numpy.column_stack([height, slopes, bank])

    def obstacles_below(self, place: Place) -> list[int]:
        """Return the numbers of the obstacles below the wheels of a car at ``place``."""
        numbers = self._numbers(*self._cells(*self._points_below(place, SHIFTS_M[:1])))
        return [number for number in numpy.unique(numbers).tolist() if number]

    def obstacle_middle(self, number: int) -> tuple[float, float]:
        """Return the middle of an obstacle (x, y in m)."""
        row, column = (float(indices.mean()) + 0.5 for indices in numpy.nonzero(self.obstacle == number))
        extent, cell = self.ground.extent, self.ground.cell_m
        return extent.x_min_m + cell * column, extent.y_min_m + cell * row

    def rescaled(self, factors: Floats, errors: Floats) -> "Standing":
        """Return the same with other height factors."""
        return replace(self, factors=factors, factor_errors=errors)

    def _points_below(self, place: Place, shifts_m: Floats) -> tuple[Floats, Floats]:
        """Return x and y (m) of the ground below points of the tyres, each (shifts, wheels, across, along).

        The points of a tyre are those of its lower half at ACROSS and ALONG; a leaning wheel is beside its axle's middle.
        """
        ahead, left = (shift[:, None, None, None] for shift in shifts_m.T)
        radii = self.radii_m[:, None, None]
        ahead = ahead + math.cos(place.pitch_rad) * self.ahead_m[:, None, None] + radii * ALONG
        aside = math.sin(place.roll_rad) * radii * numpy.sqrt(1 - ALONG**2)
        left = left + math.cos(place.roll_rad) * (self.left_m[:, None, None] + self.width_m * ACROSS[:, None]) + aside
        cos, sin = math.cos(place.heading_rad), math.sin(place.heading_rad)
        return place.x_m + ahead * cos - left * sin, place.y_m + ahead * sin + left * cos

    def _cells(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return fractional rows and columns of positions (m) in the raster of the ground."""
        extent, cell = self.ground.extent, self.ground.cell_m
        return (y - extent.y_min_m) / cell - 0.5, (x - extent.x_min_m) / cell - 0.5

    def _numbers(self, rows: Floats, columns: Floats) -> NDArray[numpy.int32]:
        """Return the numbers of the obstacles at these cells, 0 for floor."""
        last_row, last_column = (size - 1 for size in self.obstacle.shape)
        nearest = numpy.rint(rows).clip(0, last_row).astype(int), numpy.rint(columns).clip(0, last_column).astype(int)
        numbers: NDArray[numpy.int32] = self.obstacle[nearest]
        return numbers

    @cached_property
    def _wheel_rows(self) -> Floats:
        """The rows (wheels, 3) of 1, ahead and left, by which a plane's coefficients give the axles' heights."""
        return numpy.column_stack([numpy.ones_like(self.ahead_m), self.ahead_m, self.left_m])

    @cached_property
    def _supports(self) -> tuple[NDArray[numpy.intp], Floats]:
        """The triples of wheels (n, 3) whose triangle contains the car's middle, so that the car can stand on them.

        A matrix for each triple (n, 3, 3) converts the heights of its axles to the coefficients of the car's plane.
        """
        supports = []
        for wheels in combinations(range(len(self.ahead_m)), 3):
            rows = self._wheel_rows[list(wheels)]
            if abs(numpy.linalg.det(rows)) > 1e-6:
                supports.append((wheels, numpy.linalg.inv(rows)))
        # The first row of an inverse has the fractions of the weight that the three wheels would carry. If no triple
        # carries the car without the tolerance, part of the body drags on the ground.
        if not any(inverse[0].min() > -1e-9 for _, inverse in supports):
            supports = []
        stable = [(wheels, inverse) for wheels, inverse in supports if inverse[0].min() >= -SUPPORT_TOLERANCE]
        triples, inverses = [wheels for wheels, _ in stable], [inverse for _, inverse in stable]
        return numpy.array(triples, dtype=int).reshape(-1, 3), numpy.array(inverses).reshape(-1, 3, 3)

    def heights(self, x: Floats, y: Floats) -> Floats:
        """Return the heights (m) of the ground at positions; the arrays may have any shape."""
        cells = self._cells(x, y)
        planned: Floats = map_coordinates(self.ground.z_m, cells, order=1, mode="nearest")
        return planned * self.factors[self._numbers(*cells)]


def standing(scene: Mapping[str, Any], heights: Heights, body: Mapping[str, Any]) -> Standing:
    """Return the ground and wheels for a scene of docs/carsim.md, with the heights of `carsim_heights`.

    The ground covers start, goal and terrain.
    """
    view = view_of([scene])
    extent = Extent(view.x_min_m - MARGIN_M, view.x_max_m + MARGIN_M, view.y_min_m - MARGIN_M, view.y_max_m + MARGIN_M)
    cells = min(MAX_CELLS, max(2, round(max(extent.size_m) / CELL_M)))
    wheels = body["wheels"]
    ahead_m = numpy.array([wheel["x_m"] for wheel in wheels])
    left_m = numpy.array([body["track_m"] / 2 * (1 if wheel["side"] == "left" else -1) for wheel in wheels])
    radii_m = numpy.array([wheel["radius_m"] for wheel in wheels])
    ground = height_map(heights, scene, extent, cells)
    raised = numpy.abs(ground.z_m) > FLOOR_M
    # The number of each cell's obstacle, 0 on the floor.
    obstacle, count = label(raised)
    if count > MAX_OBSTACLES:
        # Too many for a fit of each height, such as the bumps of rough ground: they are one obstacle.
        obstacle, count = raised.astype(numpy.int32), 1
    # The floor's height, the first, is known.
    errors = numpy.array([0.0] + count * [HEIGHT_ERROR])
    width_m, hinged = wheels[0]["width_m"], bool(body["hinges"])
    return Standing(ground, obstacle, numpy.ones(count + 1), errors, ahead_m, left_m, radii_m, width_m, hinged)


def fit_heights(poses: "Sequence[Pose]", ground: Standing, pixel: float) -> Standing:
    """Fit the obstacles' heights to poses by weighted least squares; corners have the standard deviation ``pixel``.

    Unknowns are the change of each obstacle's height, as a fraction, and an offset of height, pitch and roll that all
    poses share. A pose deviates from its planned stance by the offset and by the changes of the obstacles under its
    wheels. Outliers have less weight.
    """
    count = len(ground.factors) - 1
    zeros = numpy.zeros(count + 1)
    planned = ground.rescaled(zeros + 1, zeros)
    raised = [planned.rescaled(1 + STEP * (numpy.arange(count + 1) == k), zeros) for k in range(count + 1)]
    # Normal equations: the unknowns are the obstacles' changes, then the offset. The priors come first; heights have a
    # common error and one of their own.
    normal, right_side = numpy.zeros((count + 3, count + 3)), numpy.zeros(count + 3)
    normal[:count, :count] = numpy.linalg.inv(HEIGHT_OWN**2 * numpy.eye(count) + HEIGHT_COMMON**2)
    normal[count:, count:] = numpy.diag(OFFSET**-2)
    for pose in poses:
        place = Place.of(pose.values)
        stance = planned.stance_at(place)
        values, spread = pose.by_corners(pixel)
        deviation = values[GROUND_INDICES] - stance.values
        # The deviation is design @ unknowns.
        design = numpy.zeros((3, count + 3))
        design[:, count:] = numpy.eye(3)
        # `planes` has one element here, because the car is not shifted.
        middle = planned.planes(place)[0].mean(axis=0)
        for k in planned.obstacles_below(place):
            design[:, k - 1] = (raised[k].planes(place)[0].mean(axis=0) - middle) / STEP
        weight = numpy.linalg.inv(spread[numpy.ix_(GROUND_INDICES, GROUND_INDICES)] + stance.covariance)
        weight *= POSE_WEIGHT / max(1.0, float(deviation @ weight @ deviation) / OUTLIER_CHI2)
        normal += design.T @ weight @ design
        right_side += design.T @ weight @ deviation
    covariance = numpy.linalg.inv(normal)
    factors, errors = zeros + 1, zeros.copy()
    factors[1:] = (1 + (covariance @ right_side)[:count]).clip(*FACTORS)
    errors[1:] = numpy.hypot(MIN_ERROR, numpy.sqrt(numpy.diag(covariance)[:count]))
    return ground.rescaled(factors, errors)


def height_remarks(ground: Standing, where: str) -> list[str]:
    """Return a remark on each obstacle whose height seems to differ from the planned one.

    The height is the planned one times a factor; factors that the film hardly determines are skipped. Raises
    FoldcarError, beginning with ``where``, if a factor is outside PLAUSIBLE_FACTORS.
    """
    remarks = []
    for number, (factor, error) in enumerate(zip(ground.factors, ground.factor_errors, strict=True)):
        if error < INFORMATIVE and abs(factor - 1) > max(INFORMATIVE, 2 * error):
            x_mm, y_mm = (1000 * coordinate for coordinate in ground.obstacle_middle(number))
            text = (
                f"the car rode as if the obstacle at {x_mm:.0f}, {y_mm:.0f} mm were {factor:.2f} ± {error:.2f} times as "
                "high as planned"
            )
            if not PLAUSIBLE_FACTORS[0] < factor < PLAUSIBLE_FACTORS[1]:
                raise FoldcarError(f"{where}: is a film of another trial: {text}")
            remarks.append(f"{text}: measure it, unless the car hung on its belly")
    return remarks
