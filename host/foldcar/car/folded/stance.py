"""The stance of a folded car on level ground, hinges flat: wheels of different radii tilt it.

Input: a FoldedCar. Output: pitch and height. With the pitch θ, nose up, a point (x, z) of the car's frame is
x sin θ + z cos θ + h above the ground. An axle lies at z = 0, a wheel of radius r stands if x sin θ + h = r. So two axles
that stand have sin θ = (r₁ - r₂) / (x₁ - x₂).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from foldcar.car.folded.model import FoldedCar, Point
from foldcar.car.folded.weight import assemble, body_properties

# A wheel at this height over the ground or less counts as standing.
ROUNDING_MM = 1e-9


@dataclass(frozen=True, slots=True)
class Stance:
    """The car's pitch, positive with the nose up, and the height of its origin over the ground."""

    pitch_rad: float
    origin_mm: float

    def height_mm(self, x_mm: float, z_mm: float) -> float:
        """Return the height over the ground of a point of the car's frame (mm): ``stance.height_mm(0, -25)``."""
        return x_mm * math.sin(self.pitch_rad) + z_mm * math.cos(self.pitch_rad) + self.origin_mm


def center_mm(car: FoldedCar) -> tuple[float, float, float]:
    """Return the centre of mass of the whole car in its frame (mm)."""
    bodies = sorted({placed.body for placed in car.placed})
    x, y, z = (assemble(body_properties(car, body) for body in bodies).center_m * 1e3).tolist()
    return x, y, z


def stance(car: FoldedCar) -> Stance:
    """Return the car's stance."""
    wheels = [(axle.center_mm[0], axle.radius_mm) for axle in car.axles]
    if len({radius for _, radius in wheels}) == 1:
        return Stance(0.0, wheels[0][1])
    x, _, z = center_mm(car)
    return standing(wheels, (x, z))


def standing(wheels_mm: Sequence[Point], center_mm: Point) -> Stance:
    """Return the stable stance: of all stances in which no wheel is below the ground, the one with the lowest
    centre of mass.

    ``wheels_mm`` are (x, radius), and ``center_mm`` is (x, z). The car stands on two axles. If its centre of mass is
    below the axles, it may also hang from a single axle, with the centre of mass below that axle.
    """
    x, z = center_mm
    # Level on the largest wheels no wheel is below the ground, so there is always a stance.
    stances = [Stance(0.0, max(radius for _, radius in wheels_mm))]
    for (rear, rear_radius), (front, front_radius) in itertools.combinations(sorted(wheels_mm), 2):
        if front > rear:
            pitch = math.asin(max(-1.0, min(1.0, (front_radius - rear_radius) / (front - rear))))
            stances.append(Stance(pitch, front_radius - front * math.sin(pitch)))
    for axle_x, radius in wheels_mm if z < 0 else ():
        # The centre of mass is straight below the axle.
        pitch = math.atan((x - axle_x) / z)
        stances.append(Stance(pitch, radius - axle_x * math.sin(pitch)))

    def is_above_ground(stance: Stance) -> bool:
        return all(stance.height_mm(axle_x, 0) >= radius - ROUNDING_MM for axle_x, radius in wheels_mm)

    return min(filter(is_above_ground, stances), key=lambda stance: stance.height_mm(x, z))
