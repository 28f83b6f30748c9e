"""Measures where car and obstacles stand, from a photo before the trial, as deviations from their planned positions.

Input: a photo, the course, the planned scene with its lettered obstacles and the heights of its ground. Output:
deviations with standard deviations. A stiff card on ground h rests on points opposite to each other. The height of its
middle, at m, is max over d of (h(m + d) + h(m - d)) / 2, also on slopes and over holes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.errors import FoldcarError
from foldcar.scenes.obstacles import CAR, Obstacle
from foldcar.trials.camera.detection import Detector, Floats, Grey
from foldcar.trials.camera.ground import HEIGHT_ERROR, Standing
from foldcar.trials.camera.lens import Lens
from foldcar.trials.camera.markers import CAR_ID, FIRST_OBSTACLE_ID, MAX_OBSTACLES, Course, card_of
from foldcar.trials.camera.poses import PIXEL, CarMarker, find_pose
from foldcar.trials.camera.view import View, find_view, marker_corners

# Standard deviations with which a person lays a card against an obstacle, and glues a marker onto a lid.
LAID_M, LAID_RAD = 0.001, 0.01
# Standard deviation of a card's height on a hill or hole, besides the hill's own, and positions below the card, as
# fractions of its side.
HEIGHT_M = 0.003
BELOW_CARD = numpy.linspace(-0.5, 0.5, 13)
# An obstacle that is farther from its planned position is another one.
FAR_M = 0.5


@dataclass(frozen=True)
class MeasuredPlacement:
    """Deviations (m, m, rad) and their standard deviations by name, names of unseen markers, and remarks."""

    deviations: dict[str, tuple[float, float, float]]
    errors: dict[str, tuple[float, float, float]]
    missing: tuple[str, ...]
    remarks: tuple[str, ...]


def measure_placement(
    grey: Grey, where: str, course: Course, lens: Lens | None, scene: Mapping[str, Any],
    obstacles: Mapping[str, Obstacle], car: CarMarker, ground: Standing,
) -> MeasuredPlacement:  # fmt: skip
    """Measure the deviations of car and obstacles from the planned ``scene`` in a grey photo.

    Raises FoldcarError, beginning with ``where``, if an obstacle is far from its planned position.
    """
    corners = Detector().find(grey)
    size = (grey.shape[1], grey.shape[0])
    view = find_view(corners, course, size, lens.of_size(*size, where) if lens else None, where)
    deviations: dict[str, tuple[float, float, float]] = {}
    errors: dict[str, tuple[float, float, float]] = {}
    missing = []
    printed = course.printed(view.scale)
    for number, (name, obstacle) in enumerate(obstacles.items()):
        marker_pixels = corners.get(FIRST_OBSTACLE_ID + number) if number < MAX_OBSTACLES else None
        if marker_pixels is None:
            missing.append(name)
            continue
        card = card_of(obstacle, scene["terrain"], printed)
        height_m = _card_height(obstacle, 2 * printed.card_reach_m, ground) if card.on_ground else 0.0
        x, y, heading = _level_pose(view, marker_pixels, printed.obstacle_size_m, height_m)
        x, y = x + card.left_m * math.sin(heading), y - card.left_m * math.cos(heading)
        turned = math.remainder(heading - obstacle.heading_rad, math.tau) if card.turns else 0.0
        deviations[name] = (x - obstacle.x_m, y - obstacle.y_m, turned)
        card_errors = (math.hypot(LAID_M, LAID_RAD * card.left_m), LAID_M, LAID_RAD)
        if card.on_ground:
            middle = marker_pixels.mean(axis=0, keepdims=True)
            error_m = math.hypot(HEIGHT_M, HEIGHT_ERROR * height_m)
            lower, higher = (view.on_plane(middle, height_m + offset_m) for offset_m in (0.0, error_m))
            error_xy_m = math.hypot(LAID_M, float(numpy.linalg.norm(higher - lower)))
            card_errors = (error_xy_m, error_xy_m, LAID_RAD)
        errors[name] = _errors(view, marker_pixels, height_m, card_errors)
    pose = find_pose(corners[CAR_ID], view, car, ground) if CAR_ID in corners else None
    if pose is None:
        missing.append(CAR)
    else:
        start, (x, y, _, heading, *_) = scene["start"], (float(value) for value in pose.values)
        turned = math.remainder(heading - start["heading_rad"], math.tau)
        deviations[CAR] = (x - start["x_m"], y - start["y_m"], turned)
        errors[CAR] = _errors(view, corners[CAR_ID], ground.radius_m + car.z_m, (LAID_M, LAID_M, LAID_RAD))
    for name, (x, y, _) in deviations.items():
        if math.hypot(x, y) > FAR_M:
            raise FoldcarError(
                f"{where}: {name} stands {1000 * math.hypot(x, y):.0f} mm from its planned position: is the marker right?"
            )
    return MeasuredPlacement(deviations, errors, tuple(missing), view.remarks)


def _card_height(obstacle: Obstacle, side_m: float, ground: Standing) -> float:
    """Return the height (m) of the middle of a stiff card that rests on an obstacle (see the head of this file)."""
    x, y = numpy.meshgrid(obstacle.x_m + side_m * BELOW_CARD, obstacle.y_m + side_m * BELOW_CARD)
    heights_below = ground.heights(x, y)
    return float((heights_below + heights_below[::-1, ::-1]).max()) / 2


def _level_pose(view: View, corners: Floats, size_m: float, height_m: float) -> tuple[float, float, float]:
    """Return middle (x, y) and heading of a level marker at that height, fitted to its corners."""
    on_plane = view.on_plane(corners, height_m)
    middle = on_plane.mean(axis=0)
    own_corners, seen_corners = marker_corners(size_m)[:, :2], on_plane - middle
    cross = float((own_corners[:, 0] * seen_corners[:, 1] - own_corners[:, 1] * seen_corners[:, 0]).sum())
    return float(middle[0]), float(middle[1]), math.atan2(cross, float((own_corners * seen_corners).sum()))


def _errors(
    view: View, corners: Floats, height_m: float, placing_errors: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the standard errors of x, y (m) and heading (rad) of a level marker at that height.

    Sources are the camera with the floor markers, the noise of the corners, and ``placing_errors`` by the person.
    """
    middle, top_middle = corners.mean(axis=0), corners[:2].mean(axis=0)
    frame = view.frame_error(middle, top_middle, height_m)
    # Noise of the corners; that of the middle of four corners is half of one corner's.
    middle_m, shifted_m = view.on_plane(numpy.array([middle, middle + numpy.array([0, PIXEL / 2])]), height_m)
    noise_m = float(numpy.linalg.norm(middle_m - shifted_m))
    # The heading's error is one corner's noise at the corners' distance from the middle.
    corner_distance_m = float(numpy.linalg.norm(view.on_plane(corners[:2], height_m) - middle_m, axis=1).mean())
    pixel_errors = (noise_m, noise_m, 2 * noise_m / max(corner_distance_m, 1e-3))
    # Independent errors: their squares add up.
    x, y, turn = (math.hypot(*errors) for errors in zip(frame, pixel_errors, placing_errors, strict=True))
    return x, y, turn
