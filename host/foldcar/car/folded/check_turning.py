"""Checks that wheels turn freely: nothing of the car is where a wheel's film, screws or tyre pass, nor another wheel.

Input: a car and its placed faces; wheels are alike, so that the first one stands for all. Output: findings.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from foldcar.car.folded.check_parts import Box, boxes
from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import Axle, FoldedCar, Mount
from foldcar.car.folded.placed import PlacedFace

# Least distance of what turns from what does not, less than between a servo's turret and the horn over it.
FREE_MM = 0.5
# What is as near to an axle as this is the spline that turns.
ON_AXIS_MM = 0.5
_CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)))

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Band:
    """What turning points pass: distances from the axle, and from the wheel's middle outwards along it (mm)."""

    near: float
    far: float
    inside: float
    outside: float

    def meets(self, other: "Band") -> bool:
        """Whether two bands come closer than FREE_MM."""
        across = self.near < other.far + FREE_MM and other.near < self.far + FREE_MM
        along = self.inside < other.outside + FREE_MM and other.inside < self.outside + FREE_MM
        return across and along


def check_turning(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], soft: str, distance_mm: float
) -> Iterator[Finding]:
    """Findings about wheels; parts named ``soft`` are ignored, tyres must be ``distance_mm`` apart."""
    for one, other in itertools.combinations(car.axles, 2):
        widths = (one.tyre_width_mm + other.tyre_width_mm) / 2
        if abs(one.center_mm[1] - other.center_mm[1]) >= widths:
            continue
        gap = float(np.hypot(one.center_mm[0] - other.center_mm[0], one.center_mm[2] - other.center_mm[2]))
        gap -= one.radius_mm + other.radius_mm
        if gap < distance_mm - 1e-6:
            yield Finding("wheels", one.wheel, f"is {gap:.2f} mm from {other.wheel}, the limit is {distance_mm:g} mm")
    turning = _turning(car, bodies)
    walls = [face for faces in bodies.values() for face in faces if face.body.startswith("segment")]
    firm = [mount for mount in car.mounts if mount.part != soft and mount.body.startswith("segment")]
    for axle in car.axles:
        for face in walls:
            if any(band.meets(one) for one in turning for band in [_band(face.corners_mm, axle)]):
                yield Finding("wheels", axle.wheel, f"runs into {face.title}")
        for mount in firm:
            still = [_band(_corners(box), axle) for box in boxes(mount) if not _is_spline(box, axle)]
            if any(band.meets(one) for one in turning for band in still):
                yield Finding("wheels", axle.wheel, f"runs into {mount.name}")


def _turning(car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]]) -> list[Band]:
    """The bands of the first wheel's film and parts, each once."""
    axle = next((axle for axle in car.axles if axle.wheel in bodies), None)
    if axle is None:
        return []
    bands = [_band(face.corners_mm, axle) for face in bodies[axle.wheel]]
    # The centre screw sits in the spline.
    mounts = (m for m in car.mounts if m.body == axle.wheel and not _is_spline(_box(m), axle))
    bands += [_band(_corners(box), axle) for mount in mounts for box in boxes(mount)]
    return list({tuple(round(v, 1) for v in (b.near, b.far, b.inside, b.outside)): b for b in bands}.values())


def _box(mount: Mount) -> Box:
    pose = np.array(mount.pose)
    return pose[:3, 3], pose[:3, :3], np.array(mount.size_mm) / 2


def _corners(box: Box) -> Points:
    center, turn, half = box
    corners: Points = _CORNERS * half @ turn.T + center
    return corners


def _band(corners: Points, axle: Axle) -> Band:
    """The band of the convex hull of these points, (n, 3) in mm."""
    x, y, z = (corners - axle.center_mm).T
    hull = shapely.MultiPoint(np.column_stack([x, z])).convex_hull
    near, far = float(hull.distance(shapely.Point(0, 0))), float(np.hypot(x, z).max())
    out = y if axle.side == "left" else -y
    return Band(near, far, float(out.min()), float(out.max()))


def _is_spline(box: Box, axle: Axle) -> bool:
    """Whether a box is a slender one around the axle."""
    center, turn, half = box
    reach = np.abs(turn) @ half
    off = float(np.hypot(center[0] - axle.center_mm[0], center[2] - axle.center_mm[2]))
    return off < ON_AXIS_MM and max(reach[0], reach[2]) < reach[1] + 1
