"""The hub: a layer glued onto the inner disc over the horn, whose walls keep the outer disc apart from it.

Three walls are folded up from the layer's edges. A hook on each drops through a slot of the outer disc, which is then
turned against the hub until the hooks lie behind film. The rim holds the disc in that place.
"""

import math

from foldcar.car.compiler.shape import Shape
from foldcar.car.components.hooked_strip import Hook, facet
from foldcar.car.components.wheel_size import PLAY_MM, WALL_RAD, WALLS, WheelSize
from foldcar.car.folded.model import Point
from foldcar.car.folded.pose import translation

NECK_MM = 5.0
HOOK_MM = 1.6
# Walls are between the arms of horns along x and y, where the screws and their slots need the layer's film.
FIRST_RAD = math.pi / 2
ARC_STEPS = 8
# Deviation of the layer's outline from a circle.
EVEN_MM = 0.02


def build_hub(shape: Shape, size: WheelSize) -> None:
    """Faces ``hub`` and ``wall 1`` …; slots in the face ``outer``."""
    points, names = _layer(size)
    shape.face("hub", points, names, piece="wheel hub")
    shape.laminate("hub", "inner", translation(0, 0, size.film_mm))
    length = 2 * size.hub_mm * math.tan(WALL_RAD / 2)
    hook = Hook(NECK_MM, HOOK_MM, 0.0, 2 * size.clearance_mm + size.film_mm)
    for i, direction in enumerate(_directions(), 1):
        points, names = facet(length, size.wall_mm, (None, hook), length / 2)
        shape.face(f"wall {i}", points, names, role="rim")
        shape.connect(f"hub.wall {i}", f"wall {i}.inner", "fold", 90)
        # Directions around the axle run the other way in the outer disc's frame; its hooks point backwards.
        slot = f"wall slot {i}"
        shape.polygon_hole("outer", slot, "slot", _slot(size, -direction))
        shape.lock(f"wall {i}.outer tip", "outer", slot)


def turn_rad(size: WheelSize) -> float:
    """Angle by which the outer disc is turned against the hub until the hooks hold."""
    inside = size.hub_mm - size.film_mm / 2
    return math.atan((NECK_MM / 2 + HOOK_MM) / inside) - math.atan(NECK_MM / 2 / inside)


def _directions() -> list[float]:
    """Directions of the walls in the frame of the hub and of the inner disc."""
    return [FIRST_RAD + 2 * math.pi * i / WALLS for i in range(WALLS)]


def _layer(size: WheelSize) -> tuple[list[Point], list[str]]:
    """A circle with a straight edge ``wall 1`` … for each wall."""
    radius, half = size.hub_mm / math.cos(WALL_RAD / 2), WALL_RAD / 2
    arc = 2 * math.pi / WALLS - WALL_RAD
    steps = math.ceil(arc / 2 / math.acos(1 - EVEN_MM / radius))
    angles, names = [], []
    for i, direction in enumerate(_directions(), 1):
        angles += [direction - half, *(direction + half + arc * k / steps for k in range(steps))]
        names += [f"wall {i}", *(f"arc {i} {k}" for k in range(steps))]
    return [(radius * math.cos(at), radius * math.sin(at)) for at in angles], names


def _slot(size: WheelSize, angle_rad: float) -> list[Point]:
    """A slot around the axle, in which a hook turns; the hook points clockwise."""
    low = size.hub_mm - size.film_mm / 2 - PLAY_MM
    high = math.hypot(size.hub_mm + size.film_mm / 2, NECK_MM / 2 + HOOK_MM) + size.clearance_mm
    half = math.atan(NECK_MM / 2 / (size.hub_mm - size.film_mm / 2)) + size.clearance_mm / size.hub_mm
    start, end = angle_rad - half, angle_rad + half + turn_rad(size)
    steps = [start + (end - start) * i / ARC_STEPS for i in range(ARC_STEPS + 1)]
    return [
        *((high * math.cos(at), high * math.sin(at)) for at in steps),
        *((low * math.cos(at), low * math.sin(at)) for at in reversed(steps)),
    ]
