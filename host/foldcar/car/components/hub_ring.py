"""The hub ring: a strip of eight facets that keeps the two discs apart at the hub.

Hooks on four facets drop through slots of both discs, which are then turned against the ring, the inner one one way and
the outer one the other way, until the hooks lie behind film. The rim holds the discs in that place. A ninth facet lies
inside the first one, its hooks in the same slots, so that the ring closes without glue.
"""

import math

from foldcar.car.compiler.shape import Shape
from foldcar.car.components.hooked_strip import Hook, facet
from foldcar.car.components.wheel_size import RING_FACETS, WheelSize
from foldcar.car.folded.model import Point

NECK_MM = 5.0
HOOK_MM = 1.6
# The arms of a horn lie along x and y of the disc; the hooks are between them.
FIRST_RAD = math.pi / 4
ARC_STEPS = 8
# Play towards the axle, which lets the wheel tilt: as little as machines repeat.
RADIAL_PLAY_MM = 0.1


def build_ring(shape: Shape, size: WheelSize) -> None:
    """Faces ``ring 0`` … ``ring 8``; slots in the discs."""
    ring, width = size.ring, size.between_mm
    reach = 2 * size.clearance_mm + size.film_mm
    hooks = Hook(NECK_MM, 0.0, HOOK_MM, reach), Hook(NECK_MM, HOOK_MM, 0.0, reach)
    turn = math.degrees(ring.turn_rad)
    dip, shift = math.degrees(ring.dip_rad(size.film_mm)), ring.shift_mm(size.film_mm)
    for i in range(RING_FACETS + 1):
        # The last facet starts a little further on than the first one, whose slots it shares.
        at = ring.facet_mm / 2 - (shift if i == RING_FACETS else 0.0)
        points, names = facet(ring.facet_mm, width, None if i % 2 else hooks, at)
        shape.face(f"ring {i}", points, names, role="rim", piece="wheel hub ring")
    for i in range(RING_FACETS):
        extra = {RING_FACETS - 2: dip, RING_FACETS - 1: -dip}.get(i, 0.0)
        shape.connect(f"ring {i}.next", f"ring {i + 1}.last", "bend", turn + extra)
    for i in range(0, RING_FACETS, 2):
        direction = FIRST_RAD + i * ring.turn_rad
        # Directions around the axle run clockwise in the inner disc's frame, and the outer disc's hooks point backwards.
        for disc, angle in (("inner", -direction), ("outer", direction)):
            name = f"{disc} ring slot {i // 2 + 1}"
            shape.polygon_hole(disc, name, "slot", _slot(size, angle, double=i == 0))
            shape.lock(f"ring {i}.{disc} tip", disc, name)


def turn_rad(size: WheelSize) -> float:
    """Angle by which a disc is turned against the ring until the hooks hold."""
    inside = size.ring.apothem_mm - size.film_mm / 2
    return math.atan((NECK_MM / 2 + HOOK_MM) / inside) - math.atan(NECK_MM / 2 / inside)


def _slot(size: WheelSize, angle_rad: float, double: bool) -> list[Point]:
    """A slot around the axle, in which a hook for one or two layers of film turns; the hook points clockwise."""
    apothem, film, play = size.ring.apothem_mm, size.film_mm, size.clearance_mm
    low = apothem - (1.5 if double else 0.5) * film - RADIAL_PLAY_MM
    high = math.hypot(apothem + film / 2, NECK_MM / 2 + HOOK_MM) + play
    half = math.atan(NECK_MM / 2 / (apothem - film / 2)) + play / apothem
    start, end = angle_rad - half, angle_rad + half + turn_rad(size)
    steps = [start + (end - start) * i / ARC_STEPS for i in range(ARC_STEPS + 1)]
    return [
        *((high * math.cos(at), high * math.sin(at)) for at in steps),
        *((low * math.cos(at), low * math.sin(at)) for at in reversed(steps)),
    ]
