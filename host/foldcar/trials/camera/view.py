"""Where the camera stands, from the markers on the floor; without a lens also its focal length and first distortion.

Input: the floor markers' corners in a picture, the course. Output: a View with what is uncertain of it, and remarks on
markers that are missing, were moved or were printed at another size.

Sought is what is most probable: pose, logarithm of the focal length f, k1, the size s of the print, and of each marker
the offset from its place (dx, dy, turn). It minimises the sum of ((pixels - projected) / PIXEL)² and of each unknown's
squared distance from what is expected, in its standard deviation (PLACED_M, …). So the scene's frame is where the
markers are on the whole, and the covariance is that of the linear problem at the end.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy
from scipy.optimize import least_squares

from foldcar.errors import FoldcarError
from foldcar.trials.camera.detection import Floats
from foldcar.trials.camera.lens import Lens, assumed_lens
from foldcar.trials.camera.markers import Course, FloorMarker

MIN_MARKERS = 3
# Standard deviations of what a person and a printer do, of a corner in a picture, and of phones' lenses.
PLACED_M, TURNED_RAD = 0.002, 0.01
PRINTED = 0.005
PIXEL = 0.15
FOCAL, MIDDLE, RADIAL = 0.25, 0.01, 0.02
# Markers that lie farther from their places, or are turned by more, were moved.
MOVED_M, MOVED_RAD = 0.012, math.radians(4)
# Without the one that was moved the others fit to this.
FITS_M, FITS_RAD = 0.006, math.radians(2)
# A print whose size differs by more is worth a remark.
ODD_PRINT = 0.01


@dataclass(frozen=True)
class View:
    """A camera: its lens, and the scene's frame in its own, ``turn`` (a rotation vector) and ``shift_m``.

    ``course`` has the markers where they were found. ``unknowns`` and ``covariance`` are those of the fit.
    """

    lens: Lens
    turn: Floats
    shift_m: Floats
    course: Course
    scale: float
    remarks: tuple[str, ...]
    unknowns: Floats
    covariance: Floats
    with_lens: bool

    @cached_property
    def rotation(self) -> Floats:
        """The rotation from the scene's frame to the camera's."""
        return numpy.asarray(cv2.Rodrigues(self.turn)[0], dtype=float)

    @cached_property
    def place_m(self) -> Floats:
        """Where the camera is in the scene."""
        return numpy.asarray(-self.rotation.T @ self.shift_m)

    def pixels(self, points: Floats) -> Floats:
        """Pixels of points (n, 3) of the scene."""
        return self.lens.pixels(points @ self.rotation.T + self.shift_m)

    def on_plane(self, pixels: Floats, height_m: float) -> Floats:
        """Where rays through pixels (n, 2) meet the plane at a height: x, y (n, 2)."""
        rays = self.lens.rays(pixels) @ self.rotation
        place = self.place_m
        return numpy.asarray(place[:2] + rays[:, :2] * ((height_m - place[2]) / rays[:, 2])[:, None])

    def frame_error(self, pixel: Floats, ahead: Floats, height_m: float) -> Floats:
        """Standard deviations (m, m, rad) of x, y and heading that the camera's place and the markers' bring.

        Of what is at ``pixel``, points to the pixel ``ahead`` and is at that height.
        """

        def place(unknowns: Floats) -> Floats:
            lens, turn, shift, _, _ = _split(unknowns, self.lens, self.with_lens, self.course)
            view = replace(self, lens=lens, turn=turn, shift_m=shift)
            (x, y), (there_x, there_y) = view.on_plane(numpy.array([pixel, ahead]), height_m)
            return numpy.array([x, y, math.atan2(there_y - y, there_x - x)])

        base = place(self.unknowns)
        columns = []
        for k, sigma in enumerate(numpy.sqrt(numpy.diag(self.covariance))):
            step = numpy.zeros_like(self.unknowns)
            step[k] = 0.1 * max(sigma, 1e-9)
            columns.append((place(self.unknowns + step) - base) / step[k])
        jacobian = numpy.column_stack(columns)
        variances: Floats = numpy.diag(jacobian @ self.covariance @ jacobian.T).astype(float)
        return numpy.asarray(numpy.sqrt(variances), dtype=float)


def marker_corners(size_m: float) -> Floats:
    """The corners of a marker in its own frame, in the order of `detection.py`."""
    half = size_m / 2
    return numpy.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])


def floor_corners(marker: FloorMarker, size_m: float) -> Floats:
    """The corners of a marker on the floor in the scene's frame."""
    cos, sin = math.cos(marker.turn_rad), math.sin(marker.turn_rad)
    turned = marker_corners(size_m) @ numpy.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]])
    placed: Floats = turned + numpy.array([marker.x_m, marker.y_m, 0])
    return placed


def find_view(
    corners: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None, where: str
) -> View:
    """The camera of a picture of ``size`` (width, height); FoldcarError, beginning with ``where``."""
    known = {marker.id: marker for marker in course.floor}
    seen = {number: corners[number] for number in known if number in corners}
    missing = [str(number) for number in known if number not in seen]
    if len(seen) < MIN_MARKERS:
        raise FoldcarError(
            f"{where}: floor marker{'s' * (len(missing) != 1)} {', '.join(missing)} not seen: {MIN_MARKERS} of "
            f"{len(known)} are needed"
        )
    remarks = [f"floor marker {number} is not seen" for number in missing]
    view = _fit(seen, course, size, lens)
    if _worst(view, course, seen) > 1:
        view, moved = _without_the_moved(seen, course, size, lens, where)
        remarks.append(moved)
    if abs(view.scale - 1) > ODD_PRINT:
        remarks.append(
            f"the markers are {100 * view.scale:.1f} % of their size: measure the printed bar, or their places"
        )
    return replace(view, remarks=tuple(remarks))


def ideal_pixels(lens: Lens, pixels: Floats) -> Floats:
    """The pixels of a camera of focal length 1 without distortion."""
    return numpy.ascontiguousarray(lens.rays(pixels)[:, :2])


def _without_the_moved(
    seen: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None, where: str
) -> tuple[View, str]:
    """The view by the markers that agree, and a remark on the one that does not."""
    found = []
    for left_out in seen if len(seen) > MIN_MARKERS else ():
        rest = {number: one for number, one in seen.items() if number != left_out}
        view = _fit(rest, course, size, lens)
        found.append((_worst(view, course, rest) * MOVED_M / FITS_M, left_out, view))
    found.sort(key=lambda one: one[0])
    if not found or found[0][0] > 1 or (len(found) > 1 and found[1][0] < 3 * found[0][0] and found[1][0] < 1):
        raise FoldcarError(
            f"{where}: the floor markers do not lie where the course has them, or not as large: measure them again "
            "(`foldcar markers` writes course.json, which may be edited)"
        )
    _, moved, view = found[0]
    planned = next(one for one in course.floor if one.id == moved)
    middle = view.on_plane(seen[moved], 0.0).mean(axis=0)
    away_mm = 1000 * math.hypot(middle[0] - planned.x_m, middle[1] - planned.y_m)
    place = f"{1000 * middle[0]:.0f}, {1000 * middle[1]:.0f} mm"
    return view, f"floor marker {moved} lies {away_mm:.0f} mm from its place, at {place}: left out"


def _worst(view: View, course: Course, seen: Mapping[int, Floats]) -> float:
    """By how much the farthest marker is from its place, relative to what is taken as moved."""
    places = {one.id: one for one in course.floor}
    offsets = [
        max(
            math.hypot(one.x_m - places[one.id].x_m, one.y_m - places[one.id].y_m) / MOVED_M,
            abs(one.turn_rad - places[one.id].turn_rad) / MOVED_RAD,
        )
        for one in view.course.floor
        if one.id in seen
    ]
    return max(offsets)


def _split(
    unknowns: Floats, start: Lens, with_lens: bool, course: Course
) -> tuple[Lens, Floats, Floats, float, list[FloorMarker]]:
    lens = start
    if not with_lens:
        log_focal, k1, x, y = unknowns[6:10]
        span = max(start.width, start.height)
        focal = 0.8 * span * math.exp(log_focal)
        middle = ((start.width - 1) / 2 + x * span, (start.height - 1) / 2 + y * span)
        lens = replace(start, focal_px=focal, middle_px=middle, distortion=(float(k1), 0.0, 0.0, 0.0, 0.0))
    offsets = unknowns[11:].reshape(-1, 3)
    floor = [
        replace(one, x_m=one.x_m + dx, y_m=one.y_m + dy, turn_rad=one.turn_rad + turn)
        for one, (dx, dy, turn) in zip(course.floor, offsets, strict=False)
    ]
    return lens, unknowns[:3], unknowns[3:6], 1 + float(unknowns[10]), floor


def _fit(seen: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None) -> View:
    here = replace(course, floor=tuple(one for one in course.floor if one.id in seen))
    start = lens or assumed_lens(*size)
    pixels = numpy.concatenate([seen[one.id] for one in here.floor])
    points = numpy.concatenate([floor_corners(one, here.floor_size_m) for one in here.floor])
    spreads = numpy.concatenate([
        [FOCAL, RADIAL, MIDDLE, MIDDLE] if lens is None else [1e-9] * 4,
        [PRINTED],
        numpy.tile([PLACED_M, PLACED_M, TURNED_RAD], len(here.floor)),
    ])  # fmt: skip

    def residuals(unknowns: Floats) -> Floats:
        found, turn, shift, scale, floor = _split(unknowns, start, lens is not None, here)
        placed = numpy.concatenate([floor_corners(one, here.floor_size_m * scale) for one in floor])
        projected = found.pixels(placed @ cv2.Rodrigues(turn)[0].T + shift)
        return numpy.concatenate([((pixels - projected) / PIXEL).ravel(), unknowns[6:] / spreads])

    best = None
    for focal in (0.8,) if lens else (0.55, 0.8, 1.15):
        guess = start if lens else replace(start, focal_px=focal * max(size))
        _, turn, shift = cv2.solvePnP(points, ideal_pixels(guess, pixels), numpy.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
        unknowns = numpy.concatenate([turn.ravel(), shift.ravel(), numpy.zeros(5 + 3 * len(here.floor))])
        unknowns[6] = 0.0 if lens else math.log(focal / 0.8)
        scales = numpy.concatenate([[0.01] * 3, [0.01] * 3, spreads])
        # Markers that were moved are noticed by what they leave over: a soft loss would hide them.
        fit = least_squares(residuals, unknowns, x_scale=scales, max_nfev=8)
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None
    best = least_squares(residuals, best.x, x_scale=scales, max_nfev=60)
    result, turn, shift, scale, floor = _split(best.x, start, lens is not None, here)
    covariance = numpy.linalg.pinv(best.jac.T @ best.jac)
    there = replace(here, floor=tuple(floor))
    return View(result, turn, shift, there, scale, (), best.x, covariance, lens is not None)
