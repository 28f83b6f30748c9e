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
        base, outwards = (x, y), -1 if side == "inner" else 1
        left = self._points_to_tip(base, outwards, left_or_right=-1, head_mm=self.left_mm)
        right = self._points_to_tip(base, outwards, left_or_right=1, head_mm=self.right_mm)
        # Counter-clockwise around the facet, the inner edge runs from left to right, the outer edge from right to left.
        to_tip, from_tip = (left, right) if side == "inner" else (right, left)
        outline: dict[str, Point] = {}
        for point in (*to_tip, *reversed(from_tip)):
            # The edge at the tip starts at the last point of the way to it.
            name = "tip" if len(outline) == len(to_tip) - 1 else len(outline)
            outline[f"{side} {name}"] = point
        return outline

    def _points_to_tip(self, base: Point, outwards: int, left_or_right: int, head_mm: float) -> list[Point]:
        """Return the points along one side of the hook, from the facet to the tip.

        The neck begins with its middle at ``base``. The hook points towards +y if ``outwards`` is 1, and towards -y if it
        is -1. ``left_or_right`` is -1 for its left side and 1 for its right side. The head is wider than the neck by
        ``head_mm`` on this side.
        """
        middle_x, y = base
        head_y = y + outwards * self.reach_mm
        tip_y = y + outwards * (self.reach_mm + DEPTH_MM)
        neck_x = middle_x + left_or_right * self.neck_mm / 2
        if head_mm == 0:
            return [(neck_x, y), (neck_x, tip_y)]
        head_x = neck_x + left_or_right * head_mm
        # The head narrows towards the tip.
        tip_x = head_x - left_or_right * TAPER_MM
        return [(neck_x, y), (neck_x, head_y), (head_x, head_y), (tip_x, tip_y)]


def facet(
    length_mm: float, width_mm: float, hooks: tuple[Hook | None, Hook | None] = (None, None), base_mm: float = 0.0
) -> dict[str, Point]:
    """Return the outline of a facet: a rectangle with its hooks, counter-clockwise from the origin.

    Each point has the name of the edge that starts at it. The edge ``inner`` lies at y = 0, at the inner disc of the
    wheel, and ``outer`` at y = width, at the outer disc. The facet before this one in the strip adjoins at x = 0, where
    the edge is ``last``, and the following facet at x = length, where the edge is ``next``.

    ``hooks`` are the hooks for the inner and for the outer disc. They stand in the middles of the edges ``inner`` and
    ``outer``. If ``base_mm`` is not 0, a tongue of this width grows from the middle of the edge at x = 0. Then this edge
    has three parts: ``last``, ``base``, from which the tongue grows, and ``behind``.
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
    """Add the *rim*, the strips of film around a wheel's discs, and join each strip to the strip before and to the discs.

    The facets of strip 0 are the faces ``rim 0 0``, ``rim 0 1`` and so on; the other strips are named alike. A name
    with a dot is an edge: ``rim 0 0.inner tip`` is an edge of the face ``rim 0 0``. The tongue at the start of a strip
    locks into a slot in the last facet of the strip before. A *tie* is a place at which the rim holds the two discs,
    ``inner`` and ``outer``: a facet there has a hook for each disc, and its tip lies in a notch of the disc.
    """
    facet_count = size.ties * size.facets_per_tie
    for strip in range(size.strips):
        _add_strip(shape, size, strip, facet_count)
    for strip in range(size.strips):
        previous = (strip - 1) % size.strips
        last_facet, slot = f"rim {previous} {facet_count - 1}", f"rim {previous} slot"
        shape.touch("lock", f"rim {strip} tongue head.tip", last_facet, slot)
        for tie in range(size.ties):
            tied_facet = f"rim {strip} {tie * size.facets_per_tie}"
            # The notches are counted around the whole wheel, the ties along each strip.
            notch = strip * size.ties + tie
            shape.touch("rim", f"{tied_facet}.inner tip", f"inner.notch {notch}")
            shape.touch("rim", f"{tied_facet}.outer tip", f"outer.notch {notch}")


def first_facet_pose(size: WheelSize, strip: int) -> Pose:
    """Return the pose of the first facet of a strip in the frame of the wheel.

    The origin of the wheel's frame is the middle of the wheel, and y points along the axle. The first facet of a strip
    is at a *tie*, where the strip holds the discs. A facet's frame has its origin at a corner; x points around the
    wheel, y along the axle, and z towards the axle.
    """
    # The directions of a facet's axes if the facet is on the x axis of the wheel: each column has one axis. There the
    # facet's x points along +z of the wheel, its y along +y, and its z, towards the axle, along -x.
    on_x_axis: Pose = (
        (0.0, 0.0, -1.0, 0.0),
        (0.0, 1.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 1.0),
    )
    # Then the facet is turned about the axle to its tie. Directions of ties are counted from x towards z, but a positive
    # rotation about y turns z towards x.
    to_tie = rotation("y", -size.tie_angles_rad[strip * size.ties])
    # From the wheel's middle to the middle of the facet, against the facet's z, and from there to the facet's corner.
    to_corner = translation(-size.facet_mm / 2, -size.between_mm / 2, -size.apothem_mm)
    return compose(to_tie, on_x_axis, to_corner)


def _add_strip(shape: Shape, size: WheelSize, strip: int, facet_count: int) -> None:
    """Add one strip of the wheel's rim, a chain of ``facet_count`` facets.

    At each *tie*, a place at which the rim holds the wheel's two discs, a facet has a hook for each disc. A tongue at the
    first facet and a slot in the last one join the strips to a ring.
    """
    # The facets.
    reach_mm = 2 * size.clearance_mm + size.film_mm
    hook = Hook(NECK_MM, left_mm=HOOK_MM, right_mm=HOOK_MM, reach_mm=reach_mm)
    for number in range(facet_count):
        is_at_tie = number % size.facets_per_tie == 0
        hooks = (hook, hook) if is_at_tie else (None, None)
        # The tongue grows from the first facet.
        base_mm = _tongue(size).width_mm if number == 0 else 0.0
        outline = facet(size.facet_mm, size.between_mm, hooks, base_mm)
        shape.face(f"rim {strip} {number}", outline, role="rim", piece="wheel rim")
    # The bends between them. All have the same angle, except the one before the last facet. It is larger, because the
    # last facet slopes inwards, so that its end lies below the start of the next strip.
    turn_deg = math.degrees(size.turn_rad)
    additional_deg = math.degrees(size.turn_rad - size.slope_rad)
    last = facet_count - 1
    for number in range(last):
        bend_deg = turn_deg + additional_deg if number + 1 == last else turn_deg
        edge, next_edge = f"rim {strip} {number}.next", f"rim {strip} {number + 1}.last"
        shape.connect(edge, next_edge, "bend", bend_deg)
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
    """Return the sizes of the tongue that joins a strip of the rim to the strip before it.

    The last facet of the strip before ends below the first facet of the strip, and the two overlap a little.
    """
    # Seen from the side, x runs along the strip's first facet, from its start. The last facet of the strip before rises
    # towards it at the angle `slope`, which is smaller than the angle `turn` between other facets. That facet ends at
    # x = beyond_start_mm, one film below the first facet.
    slope, film = size.slope_rad, size.film_mm
    beyond_start_mm = size.facet_mm * (math.cos(slope) - math.cos(size.turn_rad))
    # The same end point in a frame that is turned by the slope, so that x runs along the last facet of the strip before.
    overlap_mm = beyond_start_mm * math.cos(slope) - film * math.sin(slope)
    distance_mm = beyond_start_mm * math.sin(slope) + film * math.cos(slope)
    return Tongue(
        width_mm=min(TONGUE_MM, TONGUE_SHARE * size.between_mm),
        spread_mm=min(SPREAD_MM, SPREAD_SHARE * size.between_mm),
        through_mm=max(THROUGH_MM, THROUGH_FILMS * film),
        overlap_mm=overlap_mm,
        distance_mm=distance_mm,
    )


def _slot_outline(size: WheelSize) -> list[Point]:
    """Return the outline of the slot in the last facet of a strip, into which the tongue of the next strip locks.

    In the facet's frame x points towards the next strip and y across the strip. The tongue comes from the right and
    points to the left, towards -x. The slot has a narrow right part, in which the tongue stands, and a wide left part,
    through which the tongue's head is put.
    """
    tongue = _tongue(size)
    # The tongue first lies above the facet. Its middle part, ``through``, starts here and leads down through the film, to
    # as far below the facet as it was above it.
    through_start_x = size.facet_mm - tongue.overlap_mm - OUTSIDE_MM
    descent_mm = 2 * tongue.distance_mm
    # The middle part is the hypotenuse of a triangle with this descent. The other leg is the way along x.
    way_along_x = math.sqrt(tongue.through_mm**2 - descent_mm**2)
    # The narrow part of the slot reaches from the right of the middle part to over the head, which lies at its end.
    right_x = through_start_x + size.film_mm / 2 + size.clearance_mm
    middle_x = through_start_x - way_along_x - OVER_MM
    left_x = middle_x - WIDE_MM
    narrow_half = tongue.width_mm / 2 + size.clearance_mm
    wide_half = narrow_half + tongue.spread_mm
    # The slot is symmetric about the middle of the facet's width. Its outline runs along the half at smaller y from
    # left to right, and along the other half back.
    half_outline = [(left_x, wide_half), (middle_x, wide_half), (middle_x, narrow_half), (right_x, narrow_half)]
    middle_y = size.between_mm / 2
    lower = [(x, middle_y - from_middle) for x, from_middle in half_outline]
    upper = [(x, middle_y + from_middle) for x, from_middle in reversed(half_outline)]
    return [*lower, *upper]


def _add_tongue(shape: Shape, size: WheelSize, strip: int) -> None:
    """Add the tongue that joins a strip of the rim to the strip before it.

    The tongue grows from the strip's first facet and consists of three faces, one after the other. ``out`` lies above
    the last facet of the strip before and parallel to it. ``through`` goes through the slot of that facet. ``head`` is
    wider than the slot and holds behind it. In the frame of each face, the origin is the left end of its first edge, x
    runs across the tongue, and y towards the tongue's tip.
    """
    tongue, name = _tongue(size), f"rim {strip} tongue"
    width, spread = tongue.width_mm, tongue.spread_mm
    # The two rectangles. In all three faces, a corner has the name of the edge that starts at it.
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
    # The bend at the root makes `out` parallel to the facet below it. The next bend leads `through` down, from a distance
    # above that facet to the same distance below it. The last bend makes the head parallel to the facet again.
    descent_deg = math.degrees(math.asin(2 * tongue.distance_mm / tongue.through_mm))
    shape.connect(f"rim {strip} 0.base", f"{name} out.root", "bend", math.degrees(size.slope_rad))
    shape.connect(f"{name} out.end", f"{name} through.root", "bend", descent_deg)
    shape.connect(f"{name} through.end", f"{name} head.root", "bend", -descent_deg)


WALL_NECK_MM = 5.0
WALL_HOOK_MM = 1.6
# Directions of the walls in the frame of the hub and of the inner disc: between the arms of horns along x and y, where
# the screws and their slots need the layer's film.
DIRECTIONS_RAD = [math.pi / 2 + 2 * math.pi * i / WALLS for i in range(WALLS)]
ARC_STEPS = 8


def build_hub(shape: Shape, size: WheelSize) -> None:
    """Add the hub, which connects a wheel's two discs around the axle.

    The hub is a layer that is glued onto the inner disc, the face ``hub``, with walls that are folded up from its edges,
    the faces ``wall 1`` and so on. Each wall has a hook, and the outer disc, the face ``outer``, gets a slot for each
    hook. A hook is a narrow neck with a wider head. To assemble the wheel, you put the outer disc onto the hooks and turn
    it. Then the heads lie behind the disc's film.
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
        # z of the hub's frame and z of the outer disc's frame point towards each other. So an angle around the axle has
        # the opposite sign in the frame of the outer disc.
        angle_in_disc_rad = -direction
        shape.polygon_hole("outer", slot, "slot", _wall_slot_outline(size, angle_in_disc_rad))
        shape.touch("lock", f"{wall}.outer tip", "outer", slot)


def turn_rad(size: WheelSize) -> float:
    """Return the angle (rad) by which the outer disc is turned relative to the hub until the hooks hold.

    It is the angle that the head of a hook spans beside its neck, seen from the axle.
    """
    inside = size.hub_mm - size.film_mm / 2
    return math.atan((WALL_NECK_MM / 2 + WALL_HOOK_MM) / inside) - math.atan(WALL_NECK_MM / 2 / inside)


def _hub_outline(size: WheelSize) -> dict[str, Point]:
    """Return the outline of the hub's layer: a circle around the axle with a straight edge for each wall.

    Each point has the name of the edge that starts at it. The straight edges are called ``wall 1``, ``wall 2`` and so on.
    The outline runs counter-clockwise, and the origin of its frame is on the axle.
    """
    half_wall = WALL_RAD / 2
    # The middle of a straight edge has the distance hub_mm from the axle, so its ends lie on this circle.
    radius = size.hub_mm / math.cos(WALL_RAD / 2)
    # Between two walls the outline follows the circle, in short steps.
    arc_rad = 2 * math.pi / WALLS - WALL_RAD
    steps = arc_steps(radius, arc_rad)
    # The direction of each point around the axle. A wall begins half of its angle before its middle.
    point_angles: dict[str, float] = {}
    for number, wall_middle in enumerate(DIRECTIONS_RAD, 1):
        point_angles[f"wall {number}"] = wall_middle - half_wall
        arc_start = wall_middle + half_wall
        for step in range(steps):
            point_angles[f"arc {number} {step}"] = arc_start + arc_rad * step / steps
    points = on_circle(radius, point_angles.values())
    return dict(zip(point_angles, points, strict=True))


def _wall_slot_outline(size: WheelSize, angle_rad: float) -> list[Point]:
    """Return the outline of the slot in the outer disc for the hook of one wall of the hub: an arc around the axle.

    To assemble the wheel, you put the hook through the slot's counter-clockwise end. Then you turn the disc until the
    hook's neck stands at the clockwise end, in the direction ``angle_rad`` from the axle. There the hook's head, which
    is wider than its neck on one side only, holds behind the film. The origin of the disc's frame is on the axle.
    """
    # The radii between which the slot lies. The neck is as thick as the film, and its middle has the distance hub_mm from
    # the axle. The outer radius leads to the outer corner of the head.
    neck_inside, neck_outside = size.hub_mm - size.film_mm / 2, size.hub_mm + size.film_mm / 2
    inner_radius = neck_inside - PLAY_MM
    outer_radius = math.hypot(neck_outside, WALL_NECK_MM / 2 + WALL_HOOK_MM) + size.clearance_mm
    # Half of the neck's width and its clearance, as angles around the axle.
    half_neck_rad = math.atan(WALL_NECK_MM / 2 / neck_inside) + size.clearance_mm / size.hub_mm
    # The slot spans the neck in its final place, and the angle by which the disc is turned.
    start_angle = angle_rad - half_neck_rad
    end_angle = angle_rad + half_neck_rad + turn_rad(size)
    slot_rad = end_angle - start_angle
    angles = [start_angle + slot_rad * step / ARC_STEPS for step in range(ARC_STEPS + 1)]
    return [*on_circle(outer_radius, angles), *on_circle(inner_radius, reversed(angles))]
