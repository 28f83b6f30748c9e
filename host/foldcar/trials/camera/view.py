"""Finds the camera's pose from the markers on the floor; without a lens also focal length and first distortion.

Input: the floor markers' corners in a picture, the course. Output: a View with its covariance, and remarks on markers
that are missing, were moved or were printed at another size.

The unknowns are pose, logarithm of the focal length f, k1, the size s of the print, and each marker's offset from its
position (dx, dy, turn). The fit minimises the sum of ((pixels - projected) / PIXEL)² and of each unknown's squared
distance from its expected value, in standard deviations (PLACING_M, …). The scene's frame is thus the best fit to all
markers. The covariance is that of the linearised problem at the solution.
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
# Standard deviations: placing by a person, scale of a printer, a corner in a picture, and phones' lenses.
PLACING_M, PLACING_RAD = 0.002, 0.01
PRINTED = 0.005
PIXEL = 0.15
FOCAL, MIDDLE, RADIAL = 0.25, 0.01, 0.02
# Markers that are farther from their positions, or turned by more, were moved.
MOVED_M, MOVED_RAD = 0.012, math.radians(4)
# Without the moved marker, the others fit to this tolerance.
CONSISTENT_M, CONSISTENT_RAD = 0.006, math.radians(2)
# A print whose scale differs by more gets a remark.
REMARKED_PRINT = 0.01


@dataclass(frozen=True)
class View:
    """A camera: its lens, and the transform from the scene's frame to its own, ``turn`` (rotation vector), ``shift_m``.

    ``course`` has the markers at their fitted positions. ``unknowns`` and ``covariance`` are those of the fit.
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
        """The camera's position in the scene."""
        return numpy.asarray(-self.rotation.T @ self.shift_m)

    def pixels(self, points: Floats) -> Floats:
        """Return the pixels of points (n, 3) of the scene."""
        return self.lens.pixels(points @ self.rotation.T + self.shift_m)

    def on_plane(self, pixels: Floats, height_m: float) -> Floats:
        """Return where rays through pixels (n, 2) intersect the plane at a height: x, y (n, 2)."""
        rays = self.lens.rays(pixels) @ self.rotation
        place = self.place_m
        return numpy.asarray(place[:2] + rays[:, :2] * ((height_m - place[2]) / rays[:, 2])[:, None])

    def frame_error(self, pixel: Floats, ahead: Floats, height_m: float) -> Floats:
        """Return the standard deviations (m, m, rad) of x, y and heading that are due to camera and floor markers.

        They are those of an object at ``pixel`` that points to the pixel ``ahead``, at that height: the covariance of the
        fit is propagated by a numerical Jacobian.
        """

        def place_of(unknowns: Floats) -> Floats:
            lens, turn, shift, _, _ = _split(unknowns, self.lens, self.with_lens, self.course)
            view = replace(self, lens=lens, turn=turn, shift_m=shift)
            (x, y), (ahead_x, ahead_y) = view.on_plane(numpy.array([pixel, ahead]), height_m)
            return numpy.array([x, y, math.atan2(ahead_y - y, ahead_x - x)])

        unshifted = place_of(self.unknowns)
        columns = []
        for k, sd in enumerate(numpy.sqrt(numpy.diag(self.covariance))):
            step = numpy.zeros_like(self.unknowns)
            step[k] = 0.1 * max(sd, 1e-9)
            columns.append((place_of(self.unknowns + step) - unshifted) / step[k])
        jacobian = numpy.column_stack(columns)
        variances: Floats = numpy.diag(jacobian @ self.covariance @ jacobian.T).astype(float)
        return numpy.asarray(numpy.sqrt(variances), dtype=float)


def marker_corners(size_m: float) -> Floats:
    """Return the corners of a marker in its own frame, in the order of `detection.py`."""
    half = size_m / 2
    return numpy.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])


def floor_corners(marker: FloorMarker, size_m: float) -> Floats:
    """Return the corners of a marker on the floor in the scene's frame."""
    cos, sin = math.cos(marker.turn_rad), math.sin(marker.turn_rad)
    turned = marker_corners(size_m) @ numpy.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]])
    placed: Floats = turned + numpy.array([marker.x_m, marker.y_m, 0])
    return placed


def find_view(
    corners: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None, where: str
) -> View:
    """Return the camera of a picture of ``size`` (width, height) by the ``corners`` of its markers, by id.

    If ``lens`` is None, the lens is fitted to the floor markers. Raises FoldcarError, beginning with ``where``, if too
    few floor markers are seen or several were moved.
    """
    markers_by_id = {marker.id: marker for marker in course.floor}
    seen = {number: corners[number] for number in markers_by_id if number in corners}
    missing = [str(number) for number in markers_by_id if number not in seen]
    if len(seen) < MIN_MARKERS:
        raise FoldcarError(
            f"{where}: floor marker{'s' * (len(missing) != 1)} {', '.join(missing)} not seen: {MIN_MARKERS} of "
            f"{len(markers_by_id)} are needed"
        )
    remarks = [f"floor marker {number} is not seen" for number in missing]
    view = _fit(seen, course, size, lens)
    if _largest_offset(view, course, seen) > 1:
        view, moved_remark = _without_moved_marker(seen, course, size, lens, where)
        remarks.append(moved_remark)
    if abs(view.scale - 1) > REMARKED_PRINT:
        remarks.append(
            f"the markers have {100 * view.scale:.1f} % of their size: measure the printed bar, or their positions"
        )
    return replace(view, remarks=tuple(remarks))


def ideal_pixels(lens: Lens, pixels: Floats) -> Floats:
    """Return the pixels of a camera with focal length 1 and no distortion."""
    return numpy.ascontiguousarray(lens.rays(pixels)[:, :2])


def _without_moved_marker(
    seen: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None, where: str
) -> tuple[View, str]:
    """Find the floor marker that was moved; return the view without it, and a remark on it.

    Each marker is left out once: without the moved one, all others have consistent positions. Raises FoldcarError if
    that holds for no marker or for several.
    """
    # Largest offset of the other markers (above 1 they are not consistent), marker that is left out, view.
    candidates = []
    for left_out in seen if len(seen) > MIN_MARKERS else ():
        other_corners = {number: pixels for number, pixels in seen.items() if number != left_out}
        view = _fit(other_corners, course, size, lens)
        candidates.append((_largest_offset(view, course, other_corners) * MOVED_M / CONSISTENT_M, left_out, view))
    candidates.sort(key=lambda candidate: candidate[0])
    offsets = [offset for offset, _, _ in candidates]
    # Ambiguous: without another marker the rest is consistent too, and fits nearly as well.
    is_ambiguous = len(offsets) > 1 and offsets[1] < min(3 * offsets[0], 1)
    if not offsets or offsets[0] > 1 or is_ambiguous:
        raise FoldcarError(
            f"{where}: the floor markers do not have the positions or sizes of the course: measure them again "
            "(`foldcar markers` writes course.json, which may be edited)"
        )
    _, moved_id, view = candidates[0]
    planned_marker = next(marker for marker in course.floor if marker.id == moved_id)
    moved_middle = view.on_plane(seen[moved_id], 0.0).mean(axis=0)
    away_mm = 1000 * math.hypot(moved_middle[0] - planned_marker.x_m, moved_middle[1] - planned_marker.y_m)
    place_text = f"{1000 * moved_middle[0]:.0f}, {1000 * moved_middle[1]:.0f} mm"
    return view, f"floor marker {moved_id} lies {away_mm:.0f} mm from its position, at {place_text}; it is left out"


def _largest_offset(view: View, course: Course, seen: Mapping[int, Floats]) -> float:
    """Return the largest offset of a floor marker from its planned pose, in units of the limits MOVED_M and MOVED_RAD.

    Above 1 the marker counts as moved.
    """
    planned_markers = {marker.id: marker for marker in course.floor}
    pairs = [(marker, planned_markers[marker.id]) for marker in view.course.floor if marker.id in seen]
    return max(
        max(
            math.hypot(marker.x_m - planned.x_m, marker.y_m - planned.y_m) / MOVED_M,
            abs(marker.turn_rad - planned.turn_rad) / MOVED_RAD,
        )
        for marker, planned in pairs
    )


def _split(
    unknowns: Floats, start: Lens, with_lens: bool, course: Course
) -> tuple[Lens, Floats, Floats, float, list[FloorMarker]]:
    """Return lens, turn, shift, scale of the print and floor markers for a vector of unknowns.

    The vector has turn (3) and shift (3) of the camera, 4 numbers of the lens, the scale, and 3 offsets of each marker.
    With ``with_lens`` the lens is ``start``, and its numbers are ignored.
    """
    lens = start
    if not with_lens:
        log_focal, k1, x, y = unknowns[6:10]
        larger_side = max(start.width, start.height)
        focal_px = 0.8 * larger_side * math.exp(log_focal)
        middle_px = ((start.width - 1) / 2 + x * larger_side, (start.height - 1) / 2 + y * larger_side)
        lens = replace(start, focal_px=focal_px, middle_px=middle_px, distortion=(float(k1), 0.0, 0.0, 0.0, 0.0))
    offsets = unknowns[11:].reshape(-1, 3)
    floor = [
        replace(marker, x_m=marker.x_m + dx, y_m=marker.y_m + dy, turn_rad=marker.turn_rad + turn)
        for marker, (dx, dy, turn) in zip(course.floor, offsets, strict=False)
    ]
    return lens, unknowns[:3], unknowns[3:6], 1 + float(unknowns[10]), floor


def _fit(seen: Mapping[int, Floats], course: Course, size: tuple[int, int], lens: Lens | None) -> View:
    """Fit camera, lens, scale of print and floor markers to the corners ``seen`` in a picture, by least squares.

    The unknowns are turn (3) and shift (3) of the camera, 4 numbers of the lens, the scale, and 3 offsets of each marker
    (see `_split`). A known lens stays as it is.
    """
    visible_course = replace(course, floor=tuple(marker for marker in course.floor if marker.id in seen))
    start_lens = lens or assumed_lens(*size)
    pixels = numpy.concatenate([seen[marker.id] for marker in visible_course.floor])
    points = numpy.concatenate([floor_corners(marker, visible_course.floor_size_m) for marker in visible_course.floor])
    # Standard deviations of the unknowns from the lens on: lens, scale, offsets of the markers. The pose has no prior.
    # The numbers of a known lens are held at 0.
    prior_sds = numpy.concatenate([
        [FOCAL, RADIAL, MIDDLE, MIDDLE] if lens is None else [1e-9] * 4,
        [PRINTED],
        numpy.tile([PLACING_M, PLACING_M, PLACING_RAD], len(visible_course.floor)),
    ])  # fmt: skip

    def residuals(unknowns: Floats) -> Floats:
        fitted_lens, turn, shift, scale, floor = _split(unknowns, start_lens, lens is not None, visible_course)
        placed = numpy.concatenate([floor_corners(marker, visible_course.floor_size_m * scale) for marker in floor])
        projected = fitted_lens.pixels(placed @ cv2.Rodrigues(turn)[0].T + shift)
        return numpy.concatenate([((pixels - projected) / PIXEL).ravel(), unknowns[6:] / prior_sds])

    # Without a lens several focal lengths are tried, because the fit has local minima.
    best = None
    for focal in (0.8,) if lens else (0.55, 0.8, 1.15):
        guess = start_lens if lens else replace(start_lens, focal_px=focal * max(size))
        _, turn, shift = cv2.solvePnP(points, ideal_pixels(guess, pixels), numpy.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
        unknowns = numpy.concatenate([turn.ravel(), shift.ravel(), numpy.zeros(5 + 3 * len(visible_course.floor))])
        # The focal length's logarithm relative to that of the assumed lens, 0.8 of the larger side.
        unknowns[6] = 0.0 if lens else math.log(focal / 0.8)
        scales = numpy.concatenate([[0.01] * 3, [0.01] * 3, prior_sds])
        # A robust loss would hide moved markers, which are recognised by their residuals. A few evaluations suffice to
        # find the best start.
        fit = least_squares(residuals, unknowns, x_scale=scales, max_nfev=8)
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None
    best = least_squares(residuals, best.x, x_scale=scales, max_nfev=60)
    result, turn, shift, scale, floor = _split(best.x, start_lens, lens is not None, visible_course)
    covariance = numpy.linalg.pinv(best.jac.T @ best.jac)
    fitted_course = replace(visible_course, floor=tuple(floor))
    return View(result, turn, shift, fitted_course, scale, (), best.x, covariance, lens is not None)
