"""The rim: equal strips around the two discs, each of them hooked to the next one.

A strip's hooks drop from outside into notches in the discs' edges, where its necks lie flush with the running circle.
Its first facet has a tongue whose head passes the wide part of the slot in the last facet of the strip before and is then
pulled into the narrow part. That facet dips by the film's thickness, so that the circle stays even.
"""

import math

from foldcar.car.compiler.shape import Shape
from foldcar.car.components.hooked_strip import Hook, facet
from foldcar.car.components.wheel_size import WheelSize
from foldcar.car.folded.model import Point, Pose
from foldcar.car.folded.pose import compose, rotation, translation

NECK_MM = 3.0
HOOK_MM = 1.5
# The tongue: the lengths of its part outside, of the part through the slot (at least, and per thickness) and of the head.
OUTSIDE_MM = 1.9
THROUGH_MM = 1.4
THROUGH_FILMS = 2.8
HEAD_MM = 3.4
# The slot: how far its narrow part reaches over the head, and the length of the wide part.
OVER_MM = 0.7
WIDE_MM = 1.2


def notch_mm(size: WheelSize) -> tuple[float, float]:
    """Half the width of a notch in a disc, and the distance of its bottom from the axle."""
    return NECK_MM / 2 + size.clearance_mm, size.rim.apothem_mm - size.film_mm / 2 - size.clearance_mm


def tie_angles_rad(size: WheelSize) -> list[float]:
    """Directions of the ties around the axle, from x towards z of the wheel's frame; strip after strip."""
    count = size.strips * size.ties
    return [2 * math.pi * i / count for i in range(count)]


def build_rim(shape: Shape, size: WheelSize) -> None:
    """Faces ``rim 0 0`` … (strip, facet) and the tongues; hooks in the edges ``notch i`` of the discs."""
    per_strip = size.ties * size.facets_per_tie
    for strip in range(size.strips):
        _strip(shape, size, strip, per_strip)
    for strip in range(size.strips):
        before = (strip - 1) % size.strips
        shape.lock(f"rim {strip} tongue head.tip", f"rim {before} {per_strip - 1}", f"rim {before} slot")
        for tie in range(size.ties):
            name, notch = f"rim {strip} {tie * size.facets_per_tie}", strip * size.ties + tie
            shape.hook(f"{name}.inner tip", f"inner.notch {notch}")
            shape.hook(f"{name}.outer tip", f"outer.notch {notch}")


def facet_pose(size: WheelSize, apothem_mm: float, length_mm: float, angle_rad: float) -> Pose:
    """The pose in the wheel's frame of a facet whose middle lies in that direction from the axle."""
    # x along the circle, y along the axle, z towards it.
    axes: Pose = ((0.0, 0.0, -1.0, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    turn = compose(rotation("y", -angle_rad), axes)
    return compose(turn, translation(-length_mm / 2, -size.between_mm / 2, -apothem_mm))


def _strip(shape: Shape, size: WheelSize, strip: int, count: int) -> None:
    length, width, turn = size.rim.facet_mm, size.between_mm, math.degrees(size.rim.turn_rad)
    dip = math.degrees(size.rim.dip_rad(size.film_mm))
    hook = Hook(NECK_MM, HOOK_MM, HOOK_MM, 2 * size.clearance_mm + size.film_mm)
    for i in range(count):
        hooks = (None, None) if i % size.facets_per_tie else (hook, hook)
        points, names = facet(length, width, hooks, length / 2, 0.0 if i else _tongue_mm(size))
        shape.face(f"rim {strip} {i}", points, names, role="rim", piece="wheel rim")
    for i in range(count - 1):
        extra = dip if i == count - 2 else 0.0
        shape.connect(f"rim {strip} {i}.next", f"rim {strip} {i + 1}.last", "bend", turn + extra)
    _tongue(shape, size, strip)
    shape.polygon_hole(f"rim {strip} {count - 1}", f"rim {strip} slot", "slot", _slot(size))


def _tongue_mm(size: WheelSize) -> float:
    """Width of the tongue."""
    return min(4.0, 0.36 * size.between_mm)


def _spread_mm(size: WheelSize) -> float:
    """How far the tongue's head reaches beyond it on each side."""
    return min(1.5, 0.15 * size.between_mm)


def _slot(size: WheelSize) -> list[Point]:
    """The slot in the last facet's frame: narrow where the tongue passes, wide beyond, where its head is put in."""
    along = math.sqrt(_through_mm(size) ** 2 - (2 * _apart_mm(size)) ** 2)
    start = size.rim.facet_mm - _short_mm(size) - OUTSIDE_MM
    right = start + size.film_mm / 2 + size.clearance_mm
    middle, left = start - along - OVER_MM, start - along - OVER_MM - WIDE_MM
    narrow = _tongue_mm(size) / 2 + size.clearance_mm
    wide = narrow + _spread_mm(size)
    half = [(left, wide), (middle, wide), (middle, narrow), (right, narrow)]
    across = size.between_mm / 2
    return [*((x, across - y) for x, y in half), *((x, across + y) for x, y in reversed(half))]


def _through_mm(size: WheelSize) -> float:
    """Length of the tongue's part that leads from one side of the facet to the other."""
    return max(THROUGH_MM, THROUGH_FILMS * size.film_mm)


def _slope_rad(size: WheelSize) -> float:
    """Angle between a strip's last facet and the first one of the next strip."""
    return size.rim.turn_rad - size.rim.dip_rad(size.film_mm)


def _apart_mm(size: WheelSize) -> float:
    """Distance of the tongue's outer part from the facet under it (mm)."""
    slope = _slope_rad(size)
    return size.rim.shift_mm(size.film_mm) * math.sin(slope) + size.film_mm * math.cos(slope)


def _short_mm(size: WheelSize) -> float:
    """How far the next strip starts before that facet ends (mm), along it."""
    slope = _slope_rad(size)
    return size.rim.shift_mm(size.film_mm) * math.cos(slope) - size.film_mm * math.sin(slope)


def _tongue(shape: Shape, size: WheelSize, strip: int) -> None:
    """The tongue: a part parallel to the facet under it, a part through its slot, a head behind it."""
    w, spread = _tongue_mm(size), _spread_mm(size)
    for name, length in (("out", OUTSIDE_MM), ("through", _through_mm(size))):
        corners = ((0.0, 0.0), (w, 0.0), (w, length), (0.0, length))
        shape.face(f"rim {strip} tongue {name}", corners, ("root", "b", "end", "a"), role="rim")
    head = ((0.0, 0.0), (w, 0.0), (w + spread, 0.3), (w + spread, 1.3), (w - 0.5, HEAD_MM), (0.5, HEAD_MM),
            (-spread, 1.3), (-spread, 0.3))  # fmt: skip
    shape.face(f"rim {strip} tongue head", head, ("root", "b", "c", "d", "tip", "e", "f", "g"), role="rim")
    parallel = math.degrees(_slope_rad(size))
    down = math.degrees(math.asin(2 * _apart_mm(size) / _through_mm(size)))
    tongue = f"rim {strip} tongue"
    shape.connect(f"rim {strip} 0.base", f"{tongue} out.root", "bend", parallel)
    shape.connect(f"{tongue} out.end", f"{tongue} through.root", "bend", down)
    shape.connect(f"{tongue} through.end", f"{tongue} head.root", "bend", -down)
