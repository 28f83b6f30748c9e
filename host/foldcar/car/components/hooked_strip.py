"""A wheel's strips of film between two discs, with hooks on their edges that hold the discs: rim, hub.

The rim is equal strips around the discs, each hooked to the next one. A strip's hooks drop from outside into notches in
the discs' edges, where its necks lie flush with the running circle. Its first facet has a tongue, the last facet of the
strip before it a slot. The tongue's head passes the slot's wide part and is then pulled into the narrow part. The last
facet dips by the film's thickness, so that the circle stays even.

The hub is a layer glued onto the inner disc over the horn, with three walls folded up from its edges. A hook on each
drops through a slot of the outer disc, which is then turned until the hooks lie behind film; the rim holds it there.

A facet's frame: x along the strip, y across it from the inner disc to the outer one, z towards the axle. Lengths in mm.
"""

import math
from typing import NamedTuple

from foldcar.car.components.shape import Shape, on_circle
from foldcar.car.components.wheel_size import NECK_MM, PLAY_MM, WALL_RAD, WALLS, WheelSize, arc_steps
from foldcar.car.folded.model import Point, Pose
from foldcar.car.folded.pose import compose, rotation, translation

# Hooks of the rim: how far a head extends on each side of its neck, and the length of every head.
HOOK_MM = 1.5
DEPTH_MM = 2.5
# The tip of a hook is shorter than its head by this on each hooking side, so that it finds its slot.
TAPER_MM = 1.0


class Hook(NamedTuple):
    """A neck and a head at an edge of a facet. They hold a disc.

    The neck passes through the disc over ``reach_mm``. The head is wider than the neck, by ``left_mm`` on its left and
    by ``right_mm`` on its right; one of them may be 0.
    """

    neck_mm: float
    left_mm: float
    right_mm: float
    reach_mm: float

    def path(self, side: str, x: float, y: float) -> dict[str, Point]:
        """Return the hook as a part of the outline of a facet, where it replaces the middle of the edge ``side``.

        ``side`` is ``inner`` or ``outer``. The middle of the neck begins at (``x``, ``y``), and the hook points away from
        the facet. The points run counter-clockwise around the facet, and each has the name of the edge that starts at
        it. The edge at the tip of the hook is ``inner tip`` or ``outer tip``; the others are numbered.
        """
        outwards = -1 if side == "inner" else 1
        head_y, tip_y = y + outwards * self.reach_mm, y + outwards * (self.reach_mm + DEPTH_MM)

        def half(direction: int, hook_mm: float) -> list[Point]:
            """Return the half to the left (-1) or right (1) of the hook's middle, from the facet to the tip."""
            neck_x = x + direction * self.neck_mm / 2
            if hook_mm == 0:
                return [(neck_x, y), (neck_x, tip_y)]
            head_x = neck_x + direction * hook_mm
            return [(neck_x, y), (neck_x, head_y), (head_x, head_y), (head_x - direction * TAPER_MM, tip_y)]

        left, right = half(-1, self.left_mm), half(1, self.right_mm)
        # Counter-clockwise, the inner edge runs from left to right, the outer edge from right to left.
        to_tip, from_tip = (left, right) if side == "inner" else (right, left)
        points = [*to_tip, *reversed(from_tip)]
        names = [f"{side} {number}" for number in range(len(points))]
        names[len(to_tip) - 1] = f"{side} tip"
        return dict(zip(names, points, strict=True))


def facet(
    length_mm: float, width_mm: float, hooks: tuple[Hook | None, Hook | None] = (None, None), base_mm: float = 0.0
) -> dict[str, Point]:
    """Return the outline of a facet, counter-clockwise from the origin: each point by the edge that starts at it.

    The edge ``inner`` lies at y = 0, at the inner disc, and ``outer`` at y = width. The edge ``last``, towards the facet
    before, lies at x = 0, and ``next`` at x = length. ``hooks`` are the hook for the inner disc and the one for the outer
    disc; they stand in the middles of these edges. With ``base_mm``, a tongue grows from the middle of the edge at
    x = 0: the part of this length is called ``base``, and the rest behind it ``behind``.
    """
    inner_hook, outer_hook = hooks
    outline = {"inner": (0.0, 0.0)}
    if inner_hook is not None:
        outline |= inner_hook.path("inner", length_mm / 2, 0.0)
    outline |= {"next": (length_mm, 0.0), "outer": (length_mm, width_mm)}
    if outer_hook is not None:
        outline |= outer_hook.path("outer", length_mm / 2, width_mm)
    outline["last"] = (0.0, width_mm)
    if base_mm:
        outline |= {"base": (0.0, (width_mm + base_mm) / 2), "behind": (0.0, (width_mm - base_mm) / 2)}
    return outline


# Lengths of the tongue's parts: outside, through the slot (minimum, and multiple of the film's thickness), head.
OUTSIDE_MM = 1.9
THROUGH_MM = 1.4
THROUGH_FILMS = 2.8
HEAD_MM = 3.4
# The tongue's width, and by how much its head is wider on each side. In a narrow strip they are fractions of its width.
TONGUE_MM, TONGUE_SHARE = 4.0, 0.36
SPREAD_MM, SPREAD_SHARE = 1.5, 0.15
# The head has its full width between these distances from its root. The corners of its tip are this far from the sides
# of the tongue.
HEAD_WIDE_FROM_MM, HEAD_WIDE_TO_MM = 0.3, 1.3
HEAD_TIP_INSET_MM = 0.5
# The slot: how far its narrow part extends over the head, and the length of the wide part.
OVER_MM = 0.7
WIDE_MM = 1.2


def build_rim(shape: Shape, size: WheelSize) -> None:
    """Add the strips of the rim, and join each to the strip before it and to both discs.

    Strip s has the faces ``rim s 0``, ``rim s 1`` … and its tongue. The tongue locks into a slot in the last facet of
    the strip before. A *tie* is a place of the rim that holds the discs: its facet has a hook for each disc, which lies
    in the disc's edge ``notch i``. Ties are counted around the whole wheel.
    """
    facet_count = size.ties * size.facets_per_tie
    for strip in range(size.strips):
        _add_strip(shape, size, strip, facet_count)
    for strip in range(size.strips):
        previous = (strip - 1) % size.strips
        last_facet, slot = f"rim {previous} {facet_count - 1}", f"rim {previous} slot"
        shape.touch("lock", f"rim {strip} tongue head.tip", last_facet, slot)
        for tie in range(size.ties):
            tied_facet, notch = f"rim {strip} {tie * size.facets_per_tie}", strip * size.ties + tie
            shape.touch("rim", f"{tied_facet}.inner tip", f"inner.notch {notch}")
            shape.touch("rim", f"{tied_facet}.outer tip", f"outer.notch {notch}")


def first_facet_pose(size: WheelSize, strip: int) -> Pose:
    """Return the pose of a strip's first facet in the frame of the wheel, whose y is the axle.

    The middle of the facet lies at the strip's first tie.
    """
    # A facet on the wheel's x axis: its x points along z of the wheel, around the circle; its y along the axle; its z
    # along -x of the wheel, towards the axle. The columns of the matrix are these axes.
    on_x_axis: Pose = ((0.0, 0.0, -1.0, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    # A tie's angle runs from x towards z, which is backwards for a rotation about y.
    to_tie = rotation("y", -size.tie_angles_rad[strip * size.ties])
    # From the axle to the facet's origin, half a length and half a width beside its middle.
    to_origin = translation(-size.facet_mm / 2, -size.between_mm / 2, -size.apothem_mm)
    return compose(to_tie, on_x_axis, to_origin)


def _add_strip(shape: Shape, size: WheelSize, strip: int, facet_count: int) -> None:
    """Add one strip of the wheel's rim, with hooks that hold the discs at each tie.

    A tongue at the first facet and a slot in the last one join the strips to a ring.
    """
    reach_mm = 2 * size.clearance_mm + size.film_mm
    hook = Hook(NECK_MM, left_mm=HOOK_MM, right_mm=HOOK_MM, reach_mm=reach_mm)
    for number in range(facet_count):
        # The first facet after each tie has the hooks.
        is_at_tie = number % size.facets_per_tie == 0
        hooks = (hook, hook) if is_at_tie else (None, None)
        base_mm = _tongue(size).width_mm if number == 0 else 0.0
        outline = facet(size.facet_mm, size.between_mm, hooks, base_mm)
        shape.face(f"rim {strip} {number}", outline, role="rim", piece="wheel rim")
    turn_deg, last_dip_deg = math.degrees(size.turn_rad), math.degrees(size.turn_rad - size.slope_rad)
    last = facet_count - 1
    for number in range(last):
        # The last facet dips under the start of the next strip.
        dip_deg = last_dip_deg if number + 1 == last else 0.0
        edge, next_edge = f"rim {strip} {number}.next", f"rim {strip} {number + 1}.last"
        shape.connect(edge, next_edge, "bend", turn_deg + dip_deg)
    _add_tongue(shape, size, strip)
    shape.polygon_hole(f"rim {strip} {last}", f"rim {strip} slot", "slot", _slot_outline(size))


class Tongue(NamedTuple):
    """The sizes of the tongue at the start of a strip (mm).

    Its head is wider by ``spread_mm`` on each side. Its part ``through`` the slot leads from above the last facet of the
    strip before to below it. The start of the strip overlaps that facet by ``overlap_mm``, and the tongue lies
    ``distance_mm`` above it.
    """

    width_mm: float
    spread_mm: float
    through_mm: float
    overlap_mm: float
    distance_mm: float


def _tongue(size: WheelSize) -> Tongue:
    """Return the sizes of the tongues of a wheel."""
    # Seen from the side, along the first facet of a strip and across it: the last facet of the strip before ends beyond
    # the start of the first one by `beyond`, because it rises less than other facets do, and one film inside.
    slope, film = size.slope_rad, size.film_mm
    beyond = size.facet_mm * (math.cos(slope) - math.cos(size.turn_rad))
    return Tongue(
        width_mm=min(TONGUE_MM, TONGUE_SHARE * size.between_mm),
        spread_mm=min(SPREAD_MM, SPREAD_SHARE * size.between_mm),
        through_mm=max(THROUGH_MM, THROUGH_FILMS * film),
        # The same two distances, turned by the slope: along the last facet and across it.
        overlap_mm=beyond * math.cos(slope) - film * math.sin(slope),
        distance_mm=beyond * math.sin(slope) + film * math.cos(slope),
    )


def _slot_outline(size: WheelSize) -> list[Point]:
    """Return the outline of the slot in the last facet of a strip, for the tongue of the next strip.

    In the facet's frame x runs towards the next strip, whose tongue comes back over the facet in the direction of -x.
    So the slot is narrow on its right, where the tongue passes, and wide on its left, where the head goes in.
    """
    tongue = _tongue(size)
    # The part through the slot descends from above the facet to the same distance below it; this is its extent along x.
    through_length = math.sqrt(tongue.through_mm**2 - (2 * tongue.distance_mm) ** 2)
    through_start = size.facet_mm - tongue.overlap_mm - OUTSIDE_MM
    right = through_start + size.film_mm / 2 + size.clearance_mm
    middle = through_start - through_length - OVER_MM
    left = middle - WIDE_MM
    narrow_half = tongue.width_mm / 2 + size.clearance_mm
    wide_half = narrow_half + tongue.spread_mm
    # The half at smaller y, from left to right, and then its mirror image back.
    half_outline = [(left, wide_half), (middle, wide_half), (middle, narrow_half), (right, narrow_half)]
    middle_y = size.between_mm / 2
    lower = [(x, middle_y - y) for x, y in half_outline]
    upper = [(x, middle_y + y) for x, y in reversed(half_outline)]
    return [*lower, *upper]


def _add_tongue(shape: Shape, size: WheelSize, strip: int) -> None:
    """Add the tongue that joins a strip of the rim to the strip before it.

    The tongue has three faces. ``out`` lies parallel to the facet under it, ``through`` goes through the slot of that
    facet, and ``head``, which is wider than the slot, holds behind it. In their frames, x runs across the tongue and y
    towards its tip.
    """
    tongue, name = _tongue(size), f"rim {strip} tongue"
    width, spread = tongue.width_mm, tongue.spread_mm
    for part, length in (("out", OUTSIDE_MM), ("through", tongue.through_mm)):
        corners = {"root": (0.0, 0.0), "right": (width, 0.0), "end": (width, length), "left": (0.0, length)}
        shape.face(f"{name} {part}", corners, role="rim")
    # The head widens at its root, and narrows towards its tip, so that it finds the slot.
    head = {
        "root": (0.0, 0.0),
        "right shoulder": (width, 0.0),
        "right side": (width + spread, HEAD_WIDE_FROM_MM),
        "right taper": (width + spread, HEAD_WIDE_TO_MM),
        "tip": (width - HEAD_TIP_INSET_MM, HEAD_MM),
        "left taper": (HEAD_TIP_INSET_MM, HEAD_MM),
        "left side": (-spread, HEAD_WIDE_TO_MM),
        "left shoulder": (-spread, HEAD_WIDE_FROM_MM),
    }
    shape.face(f"{name} head", head, role="rim")
    # The part through the slot begins at a distance from the facet and ends at the same distance behind it.
    through_deg = math.degrees(math.asin(2 * tongue.distance_mm / tongue.through_mm))
    shape.connect(f"rim {strip} 0.base", f"{name} out.root", "bend", math.degrees(size.slope_rad))
    shape.connect(f"{name} out.end", f"{name} through.root", "bend", through_deg)
    shape.connect(f"{name} through.end", f"{name} head.root", "bend", -through_deg)


WALL_NECK_MM = 5.0
WALL_HOOK_MM = 1.6
# Directions of the walls in the frame of the hub and of the inner disc: between the arms of horns along x and y, where
# the screws and their slots need the layer's film.
DIRECTIONS_RAD = [math.pi / 2 + 2 * math.pi * i / WALLS for i in range(WALLS)]
ARC_STEPS = 8


def build_hub(shape: Shape, size: WheelSize) -> None:
    """Add the hub: a layer on the inner disc whose walls are folded up, with hooks that lock into slots of the
    outer disc.

    The faces are ``hub`` and ``wall 1`` …; the slots are cut into the face ``outer``. The outer disc is put on with its
    slots before the hooks, and is then turned until the heads lie behind film.
    """
    shape.face("hub", _hub_outline(size), piece="wheel hub")
    shape.place("hub", "inner", translation(0, 0, size.film_mm), laminated=True)
    length = 2 * size.hub_mm * math.tan(WALL_RAD / 2)
    # The neck passes the outer disc. The head is wider on one side only, where the film is after the turn.
    reach_mm = 2 * size.clearance_mm + size.film_mm
    hook = Hook(WALL_NECK_MM, left_mm=WALL_HOOK_MM, right_mm=0.0, reach_mm=reach_mm)
    for number, direction in enumerate(DIRECTIONS_RAD, 1):
        wall, slot = f"wall {number}", f"wall slot {number}"
        shape.face(wall, facet(length, size.wall_mm, (None, hook)), role="rim")
        shape.connect(f"hub.{wall}", f"{wall}.inner", "fold", 90)
        # The outer disc's frame is that of the hub seen from the other side, so directions run the other way.
        shape.polygon_hole("outer", slot, "slot", _wall_slot_outline(size, -direction))
        shape.touch("lock", f"{wall}.outer tip", "outer", slot)


def turn_rad(size: WheelSize) -> float:
    """Return the angle (rad) by which the outer disc is turned relative to the hub until the hooks hold.

    It is the angle that the head of a hook spans beside its neck, seen from the axle.
    """
    inside = size.hub_mm - size.film_mm / 2
    return math.atan((WALL_NECK_MM / 2 + WALL_HOOK_MM) / inside) - math.atan(WALL_NECK_MM / 2 / inside)


def _hub_outline(size: WheelSize) -> dict[str, Point]:
    """Return the outline of the hub's layer: a circle with a straight edge ``wall 1``, ``wall 2``, … for each wall.

    A point has the name of the edge that starts at it.
    """
    half_wall = WALL_RAD / 2
    # The walls' middles have the distance hub_mm from the axle, so the corners beside them lie on this circle.
    radius = size.hub_mm / math.cos(WALL_RAD / 2)
    # From wall to wall the outline follows the circle.
    arc_rad = 2 * math.pi / WALLS - WALL_RAD
    steps = arc_steps(radius, arc_rad)
    angles = {}
    for number, direction in enumerate(DIRECTIONS_RAD, 1):
        angles[f"wall {number}"] = direction - half_wall
        for step in range(steps):
            angles[f"arc {number} {step}"] = direction + half_wall + arc_rad * step / steps
    return dict(zip(angles, on_circle(radius, angles.values()), strict=True))


def _wall_slot_outline(size: WheelSize, angle_rad: float) -> list[Point]:
    """Return the outline of a slot in the outer disc for the hook of a wall: an arc around the axle.

    The hook is put through the counter-clockwise part of the slot. Then the disc turns until the hook is in the
    direction ``angle_rad``, at the slot's clockwise end; its head points clockwise and holds behind the film there.
    """
    # Along the radius, the slot reaches from the neck's inner face, with some play, to the outer corner of the head.
    inside, outside = size.hub_mm - size.film_mm / 2, size.hub_mm + size.film_mm / 2
    inner_radius = inside - PLAY_MM
    outer_radius = math.hypot(outside, WALL_NECK_MM / 2 + WALL_HOOK_MM) + size.clearance_mm
    # Half of the neck's angle as seen from the axle, with its clearance.
    half_neck_rad = math.atan(WALL_NECK_MM / 2 / inside) + size.clearance_mm / size.hub_mm
    start, end = angle_rad - half_neck_rad, angle_rad + half_neck_rad + turn_rad(size)
    angles = [start + (end - start) * step / ARC_STEPS for step in range(ARC_STEPS + 1)]
    return [*on_circle(outer_radius, angles), *on_circle(inner_radius, reversed(angles))]
