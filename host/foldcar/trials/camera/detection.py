"""Finds markers in grey pictures and places their corners to a few hundredths of a pixel.

Input: a grey picture. Output: corners (4, 2) in pixels by id, in the order top left, top right, bottom right, bottom
left of the upright print; pixel centres are whole numbers.

OpenCV's quadrilaterals are good to half a pixel. Each side is then found anew: along short lines across it the place
of the steepest change from black to white, a straight line through these, the corners where the lines meet. Motion
blurs both sides of a marker alike, so that its middle stays where it was in the middle of the exposure.
"""

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy
from numpy.typing import NDArray

from foldcar.trials.camera.markers import MODULES

Floats = NDArray[numpy.float64]
Grey = NDArray[numpy.uint8]

# Places along a side; its ends, where two sides blur into each other, are left out.
ALONG = numpy.linspace(0.12, 0.88, 24)
# Half the length of the lines across (pixels), as a share of a module and within limits.
REACH_MODULES, REACH_PX = 0.9, (2.0, 9.0)
STEP_PX = 0.5
# Rounds in which a side's outliers are left out.
FITS = 3
# A marker whose sides are shorter cannot be read.
MIN_SIDE_PX = 11.0
# How far from where it must be a square may lie that cannot be read, and how far its corners from those of that
# shape, as shares of its side.
UNREAD_SIDES, UNREAD_SHAPE = 0.5, 0.2


@dataclass
class Detector:
    """Reads markers; a search of a whole picture takes ten times as long as one where a marker was before."""

    _aruco: Any = field(default_factory=lambda: _aruco())

    def find(self, grey: Grey) -> dict[int, Floats]:
        """The markers of a picture. An id that is there twice is left out: nobody knows which is meant."""
        found = self.find_all(grey)
        numbers = [number for number, _ in found]
        return {number: corners for number, corners in found if numbers.count(number) == 1}

    def find_all(self, grey: Grey) -> list[tuple[int, Floats]]:
        """Ids and corners of all markers of a picture."""
        found, ids, _ = self._aruco.detectMarkers(grey)
        squares = [one.reshape(4, 2).astype(float) for one in found]
        numbers = [] if ids is None else ids.ravel().tolist()
        return [
            (k, refined(grey, square))
            for k, square in zip(numbers, squares, strict=True)
            if _shortest(square) >= MIN_SIDE_PX
        ]

    def find_near(self, grey: Grey, before: Floats, number: int, reach: float = 0.8) -> Floats | None:
        """The marker of that id around where its corners were ``before``, within ``reach`` of its size."""
        low, high = before.min(axis=0), before.max(axis=0)
        margin = max(16.0, reach * float((high - low).max()))
        height, width = grey.shape
        x0, y0 = (max(0, int(value)) for value in low - margin)
        x1, y1 = (min(most, int(value) + 2) for value, most in zip(high + margin, (width, height), strict=True))
        if x1 - x0 < MIN_SIDE_PX or y1 - y0 < MIN_SIDE_PX:
            return None
        window = grey[y0:y1, x0:x1]
        squares: list[Floats] = []
        # What is too small to be read as it is may be read enlarged.
        for scale in (1, 2):
            shown = window if scale == 1 else cv2.resize(window, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            found, ids, unread = self._aruco.detectMarkers(shown)
            for one, found_id in zip(found, [] if ids is None else ids.ravel().tolist(), strict=True):
                corners = (one.reshape(4, 2).astype(float) + 0.5) / scale - 0.5
                if found_id == number and _shortest(corners) >= MIN_SIDE_PX:
                    return numpy.asarray(refined(window, corners) + numpy.array([x0, y0]))
            squares += [(one.reshape(4, 2).astype(float) + 0.5) / scale - 0.5 for one in unread]
        # Motion blurs the modules before the square: one of its size where it must be is taken for it.
        same = _same_square(squares, before - numpy.array([x0, y0]))
        return None if same is None else numpy.asarray(refined(window, same) + numpy.array([x0, y0]))


def _same_square(squares: list[Floats], expected: Floats) -> Floats | None:
    """The corners nearest to the expected ones, in their order; None if none are near."""
    side = _shortest(expected)
    best: Floats | None = None
    nearest = UNREAD_SIDES * side
    for square in squares:
        for turn in range(4):
            turned = numpy.roll(square, turn, axis=0)
            # Shape and size must be right, the place less so.
            shape = float(numpy.abs((turned - turned.mean(axis=0)) - (expected - expected.mean(axis=0))).max())
            away = float(numpy.linalg.norm(turned.mean(axis=0) - expected.mean(axis=0)))
            if shape < UNREAD_SHAPE * side and away < nearest:
                best, nearest = turned, away
    return best


def _aruco() -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 5
    parameters.adaptiveThreshWinSizeMax = 29
    parameters.adaptiveThreshWinSizeStep = 12
    parameters.minMarkerPerimeterRate = 0.02
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    # The dictionary's codes differ in 11 bits at least: four wrong ones leave no doubt.
    parameters.errorCorrectionRate = 0.8
    # Small markers are read from their modules' middles, enlarged: photographs' edges are soft.
    parameters.perspectiveRemovePixelPerCell = 16
    parameters.perspectiveRemoveIgnoredMarginPerCell = 0.2
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    return cv2.aruco.ArucoDetector(dictionary, parameters)


def _shortest(corners: Floats) -> float:
    return float(numpy.linalg.norm(corners - numpy.roll(corners, -1, axis=0), axis=1).min())


def refined(grey: Grey, corners: Floats) -> Floats:
    """The corners where lines along the sides meet; ``corners`` where a side is not to be seen."""
    for _ in range(2):
        better = _refined_once(grey, corners)
        if better is None:
            return corners
        corners = better
    return corners


def _refined_once(grey: Grey, corners: Floats) -> Floats | None:
    following = numpy.roll(corners, -1, axis=0)
    sides = following - corners
    lengths = numpy.linalg.norm(sides, axis=1)
    if lengths.min() < 4:
        return None
    # Pictures have y downwards: of corners that go round clockwise this normal points outwards, from black to white.
    normals = numpy.column_stack([sides[:, 1], -sides[:, 0]]) / lengths[:, None]
    reach = float(numpy.clip(REACH_MODULES * lengths.min() / MODULES, *REACH_PX))
    across = numpy.arange(-reach, reach + STEP_PX / 2, STEP_PX)
    places = corners[:, None] + ALONG[None, :, None] * sides[:, None]
    points = places[:, :, None] + across[None, None, :, None] * normals[:, None, None]
    maps = points.reshape(-1, len(across), 2).astype(numpy.float32)
    values = cv2.remap(grey, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profiles = values.reshape(4, len(ALONG), len(across)).astype(float)
    slopes = numpy.clip(numpy.diff(profiles, axis=2), 0.0, None)
    # Squares: of noise, little is left beside the edge.
    weights = slopes**2
    sums = weights.sum(axis=2)
    if (sums.max(axis=1) <= 0).any():
        return None
    offsets = (weights * (across[:-1] + STEP_PX / 2)).sum(axis=2) / numpy.where(sums > 0, sums, 1.0)
    points, directions = _lines(places, offsets, sums, normals, sides / lengths[:, None])
    better = _meetings(numpy.roll(points, 1, axis=0), numpy.roll(directions, 1, axis=0), points, directions)
    return better if numpy.isfinite(better).all() and numpy.abs(better - corners).max() <= reach else None


def _lines(places: Floats, offsets: Floats, sums: Floats, normals: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Points and directions of lines at ``offsets`` from ``places``, one for each side, which outliers do not move."""
    at = numpy.einsum("snk,sk->sn", places - places[:, :1], along)
    weights = (sums > 0.1 * numpy.median(sums, axis=1, keepdims=True)).astype(float)
    rows = numpy.arange(len(at))
    for _ in range(FITS):
        total = numpy.maximum(weights.sum(axis=1), 1.0)
        middle_at, middle = (weights * at).sum(axis=1) / total, (weights * offsets).sum(axis=1) / total
        from_middle = at - middle_at[:, None]
        spread = (weights * from_middle**2).sum(axis=1)
        covariance = (weights * from_middle * (offsets - middle[:, None])).sum(axis=1)
        slope = covariance / numpy.where(spread > 0, spread, 1.0)
        off = numpy.abs(offsets - middle[:, None] - slope[:, None] * from_middle)
        # The median of those that count.
        ordered = numpy.sort(numpy.where(weights > 0, off, numpy.inf), axis=1)
        median = ordered[rows, numpy.minimum(total.astype(int) // 2, ordered.shape[1] - 1)]
        weights = numpy.where((off <= numpy.maximum(0.1, 3.7 * median)[:, None]) & (weights > 0), 1.0, 0.0)
    points = places[:, 0] + middle_at[:, None] * along + middle[:, None] * normals
    return points, along + slope[:, None] * normals


def _meetings(p: Floats, d: Floats, q: Floats, e: Floats) -> Floats:
    """Where lines through p along d meet lines through q along e; NaN for parallel ones."""
    cross = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    cross = numpy.where(numpy.abs(cross) < 1e-6, numpy.nan, cross)
    t = ((q[:, 0] - p[:, 0]) * e[:, 1] - (q[:, 1] - p[:, 1]) * e[:, 0]) / cross
    return numpy.asarray(p + t[:, None] * d)
