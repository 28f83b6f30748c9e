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
    """Return the stable stance of a car on level ground.

    Of all stances in which no wheel is below the ground, it is the one with the lowest centre of mass. The car stands on
    two axles. If its centre of mass is below the axles, it may also stand on a single axle, with the centre of mass
    straight below that axle. ``wheels_mm`` are the axles' x and their wheels' radii, and ``center_mm`` are x and z of the
    centre of mass. All are given in the car's frame, in which the axles have z = 0.
    """
    center_x, center_z = center_mm
    # If the car is level at the height of its largest wheels, no wheel is below the ground. So at least this stance is
    # possible.
    stances = [Stance(0.0, max(radius for _, radius in wheels_mm))]
    # Stances on two axles, as derived at the head of this file.
    for (rear_x, rear_radius), (front_x, front_radius) in itertools.combinations(sorted(wheels_mm), 2):
        if front_x > rear_x:
            sin_pitch = (front_radius - rear_radius) / (front_x - rear_x)
            # Wheels that differ by more than the distance of their axles cannot both stand; the limits avoid an error.
            pitch = math.asin(max(-1.0, min(1.0, sin_pitch)))
            stances.append(Stance(pitch, front_radius - front_x * math.sin(pitch)))
    # Stances on a single axle.
    if center_z < 0:
        for axle_x, radius in wheels_mm:
            pitch = math.atan((center_x - axle_x) / center_z)
            stances.append(Stance(pitch, radius - axle_x * math.sin(pitch)))

    def is_above_ground(stance: Stance) -> bool:
        return all(stance.height_mm(axle_x, 0) >= radius - ROUNDING_MM for axle_x, radius in wheels_mm)

    return min(filter(is_above_ground, stances), key=lambda stance: stance.height_mm(center_x, center_z))
