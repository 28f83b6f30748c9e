"""Checks of hinges at their limits: neither the two segments nor their wheels collide.

Input: a car and its placed faces, hinges flat. Output: findings.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from foldcar.car.folded.check_crossings import crossings
from foldcar.car.folded.finding import Finding
from foldcar.car.folded.model import FoldedCar, HingeJoint, Pose
from foldcar.car.folded.placed import PlacedFace
from foldcar.car.folded.pose import apply, compose, rotation, translation


def check_hinges(
    car: FoldedCar, bodies: Mapping[str, Sequence[PlacedFace]], wheel_distance_mm: float
) -> Iterator[Finding]:
    """Findings for each hinge at both limits, all others flat; hinge strips bend and are not checked.

    Wheels must stay ``wheel_distance_mm`` apart.
    """
    strips = {piece.name for piece in car.pieces if any(crease.flexure for crease in piece.creases)}
    for hinge in car.hinges:
        front, rear = (
            [face for face in bodies[body] if face.piece.name not in strips] for body in (hinge.front, hinge.rear)
        )
        for angle in (hinge.min_rad, hinge.max_rad):
            turn = folded_back(hinge, angle)
            moved = [replace(face, pose=compose(turn, face.pose)) for face in rear]
            place = f"between {hinge.front} and {hinge.rear}, folded by {math.degrees(angle):.1f} degrees"
            for one, other, length in crossings(front, moved):
                yield Finding("hinge", place, f"{one.title} runs through {other.title} over {length:.2f} mm")
            yield from _wheels(car, hinge, turn, place, wheel_distance_mm)


def folded_back(hinge: HingeJoint, angle_rad: float) -> Pose:
    """The rear segment's motion in the front one's frame (mm); a positive angle is the front segment nose up."""
    x, y, z = hinge.center_mm
    return compose(translation(x, y, z), rotation("y", angle_rad), translation(-x, -y, -z))


def _wheels(car: FoldedCar, hinge: HingeJoint, turn: Pose, place: str, distance_mm: float) -> Iterator[Finding]:
    for front in (axle for axle in car.axles if axle.body == hinge.front):
        for rear in (axle for axle in car.axles if axle.body == hinge.rear and axle.side == front.side):
            x, _, z = apply(turn, *rear.center_mm)
            gap = math.hypot(x - front.center_mm[0], z - front.center_mm[2]) - front.radius_mm - rear.radius_mm
            if gap < distance_mm - 1e-6:
                yield Finding(
                    "hinge", place, f"{front.wheel} is {gap:.2f} mm from {rear.wheel}, the limit is {distance_mm:g} mm"
                )
