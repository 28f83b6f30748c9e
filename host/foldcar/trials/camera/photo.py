"""Where car and obstacles stand, by a photo of the course before the trial, as deviations from their planned places.

Input: a photo, the course, the planned scene with its lettered obstacles and the heights of its ground. Output:
deviations with standard deviations. A stiff card on ground h rests where places opposite to each other carry it: its
middle, at m, is as high as max over d of (h(m + d) + h(m - d)) / 2, also on slopes and over holes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from foldcar.errors import FoldcarError
from foldcar.scenes.obstacles import CAR, Obstacle
from foldcar.trials.camera.detection import Detector, Floats, Grey
from foldcar.trials.camera.ground import HEIGHT_SHARE, Standing
from foldcar.trials.camera.lens import Lens
from foldcar.trials.camera.markers import CAR_ID, FIRST_OBSTACLE_ID, MAX_OBSTACLES, Course, card_of
from foldcar.trials.camera.poses import PIXEL, CarMarker, find_pose
from foldcar.trials.camera.view import View, find_view, marker_corners

# How well a person lays a card against an obstacle, and glues a marker onto a lid.
LAID_M, LAID_RAD = 0.001, 0.01
# How well the height of a card on a hill or a hole is known besides the hill's own (m), and places below it, as shares of
# its side.
HEIGHT_M = 0.003
BELOW = numpy.linspace(-0.5, 0.5, 13)
# What stands farther from its place is another obstacle.
FAR_M = 0.5


@dataclass(frozen=True)
class Placed:
    """Deviations (m, m, rad) and their standard deviations by name; what is not seen; remarks on the floor's markers."""

    deviations: dict[str, tuple[float, float, float]]
    errors: dict[str, tuple[float, float, float]]
    missing: tuple[str, ...]
    remarks: tuple[str, ...]


def find_placed(
    grey: Grey, where: str, course: Course, lens: Lens | None, scene: Mapping[str, Any], things: Mapping[str, Obstacle],
    car: CarMarker, ground: Standing,
) -> Placed:  # fmt: skip
    """Deviations from ``scene`` as planned; FoldcarError, beginning with ``where``."""
    corners = Detector().find(grey)
    size = (grey.shape[1], grey.shape[0])
    view = find_view(corners, course, size, lens.of_size(*size, where) if lens else None, where)
    deviations: dict[str, tuple[float, float, float]] = {}
    errors: dict[str, tuple[float, float, float]] = {}
    missing = []
    printed = course.printed(view.scale)
    for number, (name, thing) in enumerate(things.items()):
        seen = corners.get(FIRST_OBSTACLE_ID + number) if number < MAX_OBSTACLES else None
        if seen is None:
            missing.append(name)
            continue
        card = card_of(thing, scene["terrain"], printed)
        height_m = _card_height(thing, 2 * printed.card_reach_m, ground) if card.on_ground else 0.0
        x, y, heading = _lying(view, seen, printed.obstacle_size_m, height_m)
        x, y = x + card.left_m * math.sin(heading), y - card.left_m * math.cos(heading)
        turned = math.remainder(heading - thing.heading_rad, math.tau) if card.turns else 0.0
        deviations[name] = (x - thing.x_m, y - thing.y_m, turned)
        laid = (math.hypot(LAID_M, LAID_RAD * card.left_m), LAID_M, LAID_RAD)
        if card.on_ground:
            middle = seen.mean(axis=0, keepdims=True)
            error_m = math.hypot(HEIGHT_M, HEIGHT_SHARE * height_m)
            lower, higher = (view.on_plane(middle, height_m + by) for by in (0.0, error_m))
            off_m = math.hypot(LAID_M, float(numpy.linalg.norm(higher - lower)))
            laid = (off_m, off_m, LAID_RAD)
        errors[name] = _errors(view, seen, height_m, laid)
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
                f"{where}: {name} stands {1000 * math.hypot(x, y):.0f} mm from its place: is it its marker?"
            )
    return Placed(deviations, errors, tuple(missing), view.remarks)


def _card_height(thing: Obstacle, side_m: float, ground: Standing) -> float:
    x, y = numpy.meshgrid(thing.x_m + side_m * BELOW, thing.y_m + side_m * BELOW)
    heights = ground.heights(x, y)
    return float((heights + heights[::-1, ::-1]).max()) / 2


def _lying(view: View, corners: Floats, size_m: float, height_m: float) -> tuple[float, float, float]:
    """Middle and heading of a level marker at that height: the turn that fits its corners best."""
    flat = view.on_plane(corners, height_m)
    middle = flat.mean(axis=0)
    mine, there = marker_corners(size_m)[:, :2], flat - middle
    cross = float((mine[:, 0] * there[:, 1] - mine[:, 1] * there[:, 0]).sum())
    return float(middle[0]), float(middle[1]), math.atan2(cross, float((mine * there).sum()))


def _errors(view: View, corners: Floats, height_m: float, more: tuple[float, float, float]) -> tuple[float, float, float]:
    middle, top = corners.mean(axis=0), corners[:2].mean(axis=0)
    frame = view.frame_error(middle, top, height_m)
    # The corners' own noise: that of a middle is half of one corner's.
    a, b = view.on_plane(numpy.array([middle, middle + numpy.array([0, PIXEL / 2])]), height_m)
    seen_m = float(numpy.linalg.norm(a - b))
    side_m = float(numpy.linalg.norm(view.on_plane(corners[:2], height_m) - a, axis=1).mean())
    own = (seen_m, seen_m, 2 * seen_m / max(side_m, 1e-3))
    x, y, turn = (math.hypot(f, o, m) for f, o, m in zip(frame, own, more, strict=True))
    return x, y, turn
