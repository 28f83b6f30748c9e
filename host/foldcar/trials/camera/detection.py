"""Finds markers in grey pictures and locates their corners to a few hundredths of a pixel.

Input: a grey picture. Output: corners (4, 2) in pixels by id, in the order top left, top right, bottom right, bottom
left of the upright print. Pixel centres have integer coordinates.

OpenCV locates quadrilaterals to half a pixel. Each side is then refined: the steepest change from black to white is
located along short lines across the side, and a straight line is fitted through these points. The corners are where the
lines of two sides intersect. Motion blurs opposite sides equally, so that the middle is that of mid-exposure.
"""

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy
from numpy.typing import NDArray

from foldcar.trials.camera.markers import MODULES

Floats = NDArray[numpy.float64]
Grey = NDArray[numpy.uint8]

# Positions along a side, without its ends, where two sides blur into each other.
ALONG = numpy.linspace(0.12, 0.88, 24)
# Half the length of the lines across a side: a fraction of a module, and its limits in pixels.
REACH_MODULES, REACH_PX = 0.9, (2.0, 9.0)
STEP_PX = 0.5
# Rounds of the fit of a side; each round excludes outliers.
FIT_ROUNDS = 3
# A marker whose sides are shorter cannot be read.
MIN_SIDE_PX = 11.0
# A square that cannot be read counts as the expected marker if its middle and its shape differ by at most these fractions
# of its side.
UNREAD_DISTANCE, UNREAD_SHAPE_ERROR = 0.5, 0.2


@dataclass
class Detector:
    """Reads markers. Searching a whole picture takes ten times as long as searching near an earlier position."""

    _aruco: Any = field(default_factory=lambda: _aruco())

    def find(self, grey: Grey) -> dict[int, Floats]:
        """Return the corners of a picture's markers by id; ids that occur twice are ambiguous and left out."""
        markers = self.find_all(grey)
        numbers = [number for number, _ in markers]
        return {number: corners for number, corners in markers if numbers.count(number) == 1}

    def find_all(self, grey: Grey) -> list[tuple[int, Floats]]:
        """Return ids and corners, (4, 2) in pixels, of all markers of a picture that are large enough to be read."""
        quads, ids, _ = self._aruco.detectMarkers(grey)
        squares = [quad.reshape(4, 2).astype(float) for quad in quads]
        marker_ids = [] if ids is None else ids.ravel().tolist()
        return [
            (number, refined(grey, square))
            for number, square in zip(marker_ids, squares, strict=True)
            if _shortest(square) >= MIN_SIDE_PX
        ]

    def find_near(self, grey: Grey, last_corners: Floats, number: int, margin_factor: float = 0.8) -> Floats | None:
        """Return the corners of marker ``number``, searched near its ``last_corners``, or None if it is not found.

        The window has a margin of ``margin_factor`` times the marker's size.
        """
        low, high = last_corners.min(axis=0), last_corners.max(axis=0)
        margin = max(16.0, margin_factor * float((high - low).max()))
        height, width = grey.shape
        x0, y0 = (max(0, int(value)) for value in low - margin)
        x1, y1 = (min(size, int(value) + 2) for value, size in zip(high + margin, (width, height), strict=True))
        if x1 - x0 < MIN_SIDE_PX or y1 - y0 < MIN_SIDE_PX:
            return None
        window = grey[y0:y1, x0:x1]
        squares: list[Floats] = []
        # A marker that is too small to be read may be readable in an enlarged picture.
        for scale in (1, 2):
            enlarged = window if scale == 1 else cv2.resize(window, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            quads, ids, unread_quads = self._aruco.detectMarkers(enlarged)
            for quad, marker_id in zip(quads, [] if ids is None else ids.ravel().tolist(), strict=True):
                # Pixel centres have integer coordinates, so the window's edge is at -0.5 at either scale.
                corners = (quad.reshape(4, 2).astype(float) + 0.5) / scale - 0.5
                if marker_id == number and _shortest(corners) >= MIN_SIDE_PX:
                    return numpy.asarray(refined(window, corners) + numpy.array([x0, y0]))
            squares += [(quad.reshape(4, 2).astype(float) + 0.5) / scale - 0.5 for quad in unread_quads]
        # Motion blurs the modules sooner than the square, so a square of the expected size and position is accepted.
        square = _same_square(squares, last_corners - numpy.array([x0, y0]))
        return None if square is None else numpy.asarray(refined(window, square) + numpy.array([x0, y0]))


def _same_square(squares: list[Floats], expected: Floats) -> Floats | None:
    """Return the square nearest to the expected one, with corners in the same order; None if none is near enough."""
    side = _shortest(expected)
    nearest_square: Floats | None = None
    min_distance = UNREAD_DISTANCE * side
    for square in squares:
        for turn in range(4):
            turned = numpy.roll(square, turn, axis=0)
            # The tolerance of shape and size is smaller than that of the position.
            shape_error = float(numpy.abs((turned - turned.mean(axis=0)) - (expected - expected.mean(axis=0))).max())
            distance = float(numpy.linalg.norm(turned.mean(axis=0) - expected.mean(axis=0)))
            if shape_error < UNREAD_SHAPE_ERROR * side and distance < min_distance:
                nearest_square, min_distance = turned, distance
    return nearest_square


def _aruco() -> Any:
    """Return OpenCV's detector of markers, with parameters for small and soft pictures."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 5
    parameters.adaptiveThreshWinSizeMax = 29
    parameters.adaptiveThreshWinSizeStep = 12
    parameters.minMarkerPerimeterRate = 0.02
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    # The dictionary's codes differ in at least 11 bits, so that four wrong bits can be corrected.
    parameters.errorCorrectionRate = 0.8
    # Read small markers from the enlarged middles of their modules, because edges in photos are soft.
    parameters.perspectiveRemovePixelPerCell = 16
    parameters.perspectiveRemoveIgnoredMarginPerCell = 0.2
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return cv2.aruco.ArucoDetector(dictionary, parameters)


def _shortest(corners: Floats) -> float:
    return float(numpy.linalg.norm(corners - numpy.roll(corners, -1, axis=0), axis=1).min())


def refined(grey: Grey, corners: Floats) -> Floats:
    """Refine corners (4, 2) by lines fitted to the sides; return them unchanged if a side is not visible."""
    # In the second round the first one's corners tell better where the sides are.
    for _ in range(2):
        new_corners = _refined_once(grey, corners)
        if new_corners is None:
            return corners
        corners = new_corners
    return corners


def _refined_once(grey: Grey, corners: Floats) -> Floats | None:
    """Return the corners (4, 2) at which lines fitted to the four sides intersect; None if a side is not visible.

    Brightness is sampled along lines across each side, from black to white; the steepest step is a point of the side.
    """
    next_corners = numpy.roll(corners, -1, axis=0)
    sides = next_corners - corners
    lengths = numpy.linalg.norm(sides, axis=1)
    if lengths.min() < 4:
        return None
    # y points down in pictures and the corners go round clockwise, so this normal points outwards, from black to white.
    normals = numpy.column_stack([sides[:, 1], -sides[:, 0]]) / lengths[:, None]
    reach = float(numpy.clip(REACH_MODULES * lengths.min() / MODULES, *REACH_PX))
    positions_across = numpy.arange(-reach, reach + STEP_PX / 2, STEP_PX)
    # Positions along the sides (4, n, 2), and at each of them points across the side (4, n, across, 2).
    positions = corners[:, None] + ALONG[None, :, None] * sides[:, None]
    points = positions[:, :, None] + positions_across[None, None, :, None] * normals[:, None, None]
    sample_points = points.reshape(-1, len(positions_across), 2).astype(numpy.float32)
    columns, rows = sample_points[..., 0], sample_points[..., 1]
    values = cv2.remap(grey, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profiles = values.reshape(4, len(ALONG), len(positions_across)).astype(float)
    slopes = numpy.clip(numpy.diff(profiles, axis=2), 0.0, None)
    # Squaring suppresses the noise beside the edge.
    weights = slopes**2
    weight_sums = weights.sum(axis=2)
    if (weight_sums.max(axis=1) <= 0).any():
        return None
    # The edge is at the weighted mean of all steps, each of which lies half way between two samples.
    moments = (weights * (positions_across[:-1] + STEP_PX / 2)).sum(axis=2)
    offsets = moments / numpy.where(weight_sums > 0, weight_sums, 1.0)
    line_points, directions = _fit_lines(positions, offsets, weight_sums, normals, sides / lengths[:, None])
    # A corner is where the side before it and the side after it intersect.
    points_before, directions_before = (numpy.roll(values, 1, axis=0) for values in (line_points, directions))
    new_corners = _intersections(points_before, directions_before, line_points, directions)
    return new_corners if numpy.isfinite(new_corners).all() and numpy.abs(new_corners - corners).max() <= reach else None


def _fit_lines(
    positions: Floats, offsets: Floats, weight_sums: Floats, normals: Floats, directions: Floats
) -> tuple[Floats, Floats]:
    """Fit a line to each of the four sides of a marker; return a point (4, 2) and a direction (4, 2) of each.

    The edge was seen at n ``positions`` (4, n, 2) along a side, moved by ``offsets`` (4, n) along its normal. All are
    in pixels; ``normals`` and ``directions`` (4, 2) are unit vectors. ``weight_sums`` (4, n) are large where the edge is
    steep. Faint positions and outliers are excluded.

    A side's line is: offset = mean_offset + slope (position - mean_position), by least squares.
    """
    # Distance of each position from the side's first one (4, n).
    position = numpy.einsum("snk,sk->sn", positions - positions[:, :1], directions)
    # A weight is 1 for points in the fit, 0 for excluded ones.
    weights = (weight_sums > 0.1 * numpy.median(weight_sums, axis=1, keepdims=True)).astype(float)
    rows = numpy.arange(len(position))
    for _ in range(FIT_ROUNDS):
        total = numpy.maximum(weights.sum(axis=1), 1.0)
        mean_position, mean_offset = (weights * position).sum(axis=1) / total, (weights * offsets).sum(axis=1) / total
        from_middle = position - mean_position[:, None]
        spread = (weights * from_middle**2).sum(axis=1)
        covariance = (weights * from_middle * (offsets - mean_offset[:, None])).sum(axis=1)
        slope = covariance / numpy.where(spread > 0, spread, 1.0)
        residual = numpy.abs(offsets - mean_offset[:, None] - slope[:, None] * from_middle)
        # Exclude points beyond 3.7 times the median residual of those not yet excluded: 2.5 standard deviations. Within
        # 0.1 pixels no point is an outlier.
        ordered = numpy.sort(numpy.where(weights > 0, residual, numpy.inf), axis=1)
        median = ordered[rows, numpy.minimum(total.astype(int) // 2, ordered.shape[1] - 1)]
        weights = numpy.where((residual <= numpy.maximum(0.1, 3.7 * median)[:, None]) & (weights > 0), 1.0, 0.0)
    points = positions[:, 0] + mean_position[:, None] * directions + mean_offset[:, None] * normals
    return points, directions + slope[:, None] * normals


def _intersections(p: Floats, d: Floats, q: Floats, e: Floats) -> Floats:
    """Return where lines through p along d intersect lines through q along e; NaN for parallel lines."""
    cross = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    cross = numpy.where(numpy.abs(cross) < 1e-6, numpy.nan, cross)
    t = ((q[:, 0] - p[:, 0]) * e[:, 1] - (q[:, 1] - p[:, 1]) * e[:, 0]) / cross
    return numpy.asarray(p + t[:, None] * d)
