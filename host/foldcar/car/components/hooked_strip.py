"""Sizes of a wheel, and its strips of film between two discs, with hooks on their edges that hold the discs: rim, hub.

A strip is a polygon of facets in the model and a smooth curve when built: its facets are together as long as the circle
that its middle surface bends to.

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
from foldcar.car.folded.model import Point, Pose
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Horn
from foldcar.car.parts.catalogue import Catalogue

# The maximum length of a rim strip, so that it fits on a sheet of A4.
MAX_STRIP_MM = 250.0
# Minimum number of ties from rim to disc. Spans shorter than the minimum do not make a disc of thin film stiffer.
MIN_TIES = 4
MIN_SPAN_MM = 65.0
# A tyre pulls with this force around the discs: a band of 12 x 1 mm² of natural rubber (1.5 MPa), stretched by a tenth.
TYRE_PULL_N = 1.8
# A disc is clamped at its hub, held inwards by the rim and outwards at the ties. It buckles above an edge load of
# CRITICAL D / span², with the bending stiffness D (Ritz solution: 22 to 33 for 4 to 6 ties and radii of 30 to 150 mm).
CRITICAL = 25.0
POISSON = 0.38
# Minimum length of a facet of the rim: the last facet has the slot for the next strip's tongue.
RIM_FACET_MM = 7.8
# The hub's walls, each an eighth of a turn wide, as seen from the axle.
WALLS = 3
WALL_RAD = math.pi / 4
# Film between a slot and another edge, and between the notches of the rim and the hub's walls.
BRIDGE_MM = 1.5
MIN_WEB_MM = 4.0
# Neck and hooks of the rim.
NECK_MM = 3.0
HOOK_MM = 1.5
# Play of the hub's necks towards the axle, which lets the outer disc run out of true: the repeatability of the machines.
PLAY_MM = 0.1


class WheelSize:
    """The sizes of a wheel, from its rolling ``radius_mm`` with tyre and its ``width_mm`` from outside to outside
    of the discs.
    """

    def __init__(self, radius_mm: float, width_mm: float, parts: Catalogue) -> None:
        self.radius_mm, self.width_mm, self.film_mm = radius_mm, width_mm, parts.film_mm
        # Play of a neck in its slot or notch on each side.
        self.clearance_mm = parts.assembly.slot_clearance_mm.value / 2
        # Radius of the discs and of the rim's outer face, on which the tyre lies.
        self.disc_radius_mm = radius_mm - parts.tyre.thickness_mm.value
        # Width of the strips between the discs, with some play.
        self.between_mm = width_mm - 2 * (self.film_mm + self.clearance_mm)
        # Length of the rim along the film's middle, and the number of equal strips that it consists of.
        length_mm = 2 * math.pi * (self.disc_radius_mm - self.film_mm / 2)
        self.strips = math.ceil(length_mm / MAX_STRIP_MM)
        # The tyre's pull T loads the edge of each disc with N = T / 2 R. A disc does not buckle up to N = CRITICAL D /
        # span², which limits the span between ties on each edge of a strip.
        radius_m, modulus = self.disc_radius_mm * 1e-3, parts.film.youngs_modulus_pa.value
        stiffness_n_m = modulus * (self.film_mm * 1e-3) ** 3 / 12 / (1 - POISSON**2)
        span_mm = max(MIN_SPAN_MM, 1e3 * math.sqrt(CRITICAL * stiffness_n_m * 2 * radius_m / TYRE_PULL_N))
        spans = math.ceil(2 * math.pi * self.disc_radius_mm / self.strips / span_mm)
        self.ties = max(spans, math.ceil(MIN_TIES / self.strips))
        # Directions of the ties around the axle, from x towards z of the wheel's frame; strip after strip.
        count = self.strips * self.ties
        self.tie_angles_rad = [2 * math.pi * i / count for i in range(count)]
        # Facets of the rim from tie to tie; each one's length, its angle to the next, its distance from the axle.
        self.facets_per_tie = max(1, math.floor(length_mm / (count * RIM_FACET_MM)))
        self.facet_mm = length_mm / (count * self.facets_per_tie)
        self.turn_rad = 2 * math.pi / (count * self.facets_per_tie)
        self.apothem_mm = self.facet_mm / 2 / math.tan(self.turn_rad / 2)
        # A strip's last facet dips until its end is one film inside the next strip's first facet, at this slope to it.
        self.slope_rad = math.asin(math.sin(self.turn_rad) - self.film_mm / self.facet_mm)
        # Half the width of a notch in a disc, and the distance of its bottom from the axle.
        self.notch_mm = NECK_MM / 2 + self.clearance_mm, self.apothem_mm - self.film_mm / 2 - self.clearance_mm
        # Distance of the hub's walls from the axle: a driver reaches every screw between them.
        self.hub_mm = hub_mm(parts)
        # Height of the hub's walls, from the middle of its layer on the inner disc to the outer disc, with some play.
        self.wall_mm = width_mm - 2.5 * self.film_mm - self.clearance_mm


def wheel_screws_mm(horn: Horn) -> tuple[Point, Point]:
    """Return the two holes that hold the wheel, which are the farthest from each other: points of the horn's frame."""
    holes = horn.wheel_screws.at_mm
    return max(((a, b) for a in holes for b in holes), key=lambda pair: (math.dist(*pair), pair[0]))


def access_radius_mm(parts: Catalogue) -> float:
    """Return radius of a hole through which a driver reaches all screws of the horn."""
    reach = max(math.hypot(*at) for at in wheel_screws_mm(parts.horn))
    play = max(0.5, parts.horn.wheel_screws.tolerance)
    return reach + max(parts.tools.driver_diameter_mm.value, parts.horn_screw.head_diameter_mm.value) / 2 + play


def hub_mm(parts: Catalogue) -> float:
    """Return the distance of the hub's walls from the axle (mm).

    It leaves film between their slots and the driver's hole.
    """
    return access_radius_mm(parts) + BRIDGE_MM + PLAY_MM + parts.film_mm / 2


def min_radius_mm(parts: Catalogue) -> float:
    """Return minimum rolling radius of a wheel: hub, film to the rim's notches, tyre; rounded up to 0.1 mm."""
    corner = hub_mm(parts) / math.cos(WALL_RAD / 2)
    least = corner + MIN_WEB_MM + 2 * parts.film_mm + parts.tyre.thickness_mm.value
    return math.ceil(10 * least - 1e-9) / 10


DEPTH_MM = 2.5
# The tip of a hook is shorter than its head by this on each hooking side, so that it finds its slot.
TAPER_MM = 1.0


class Hook(NamedTuple):
    """A neck and a head.

    The neck passes through a disc over ``reach_mm``; the head is wider, to the left, right or both.
    """

    neck_mm: float
    left_mm: float
    right_mm: float
    reach_mm: float

    def path(self, side: str, x: float, y: float) -> dict[str, Point]:
        """Return the hook as a part of the outline of a facet, where it replaces the middle of the edge ``side``.

        ``side`` is ``inner`` or ``outer``. The neck begins at (``x``, ``y``), and the hook points away from the
        facet. The points run counter-clockwise around the facet, and each has the name of the edge that starts at it.
        The edge at the tip of the hook is ``inner tip`` or ``outer tip``.
        """
        direction = -1 if side == "inner" else 1
        head_y, tip_y = y + direction * self.reach_mm, y + direction * (self.reach_mm + DEPTH_MM)
        neck_left, neck_right = x - self.neck_mm / 2, x + self.neck_mm / 2
        head_left, head_right = neck_left - self.left_mm, neck_right + self.right_mm
        left_half, right_half = [(neck_left, y)], [(neck_right, y)]
        tip_left, tip_right = (head_left, tip_y), (head_right, tip_y)
        if self.left_mm > 0:
            left_half += [(neck_left, head_y), (head_left, head_y)]
            tip_left = head_left + TAPER_MM, tip_y
        if self.right_mm > 0:
            right_half += [(neck_right, head_y), (head_right, head_y)]
            tip_right = head_right - TAPER_MM, tip_y
        halves = [*left_half, tip_left], [*right_half, tip_right]
        # The inner edge runs from left to right, the outer edge from right to left.
        first, second = halves if side == "inner" else halves[::-1]
        points, tip_index = [*first, *reversed(second)], len(first) - 1
        return {f"{side} {'tip' if i == tip_index else i}": point for i, point in enumerate(points)}


def facet(
    length_mm: float, width_mm: float, hooks: tuple[Hook | None, Hook | None] = (None, None), base_mm: float = 0.0
) -> dict[str, Point]:
    """Return the outline of a facet with the names of its edges, counter-clockwise from the origin.

    The edges ``next`` and ``last`` lie at x = length and x = 0, the edges ``inner`` and ``outer`` at y = 0 and y =
    width. ``hooks``, one for the inner and one for the outer disc, stand in the middles of the latter two. With
    ``base_mm``, a tongue grows from the middle of ``last``; there the edge is called ``base`` and has that length.
    """
    outline = {"inner": (0.0, 0.0)}
    if hooks[0] is not None:
        outline |= hooks[0].path("inner", length_mm / 2, 0.0)
    outline |= {"next": (length_mm, 0.0), "outer": (length_mm, width_mm)}
    if hooks[1] is not None:
        outline |= hooks[1].path("outer", length_mm / 2, width_mm)
    outline["last"] = (0.0, width_mm)
    if base_mm:
        outline |= {"base": (0.0, (width_mm + base_mm) / 2), "behind": (0.0, (width_mm - base_mm) / 2)}
    return outline


# Lengths of the tongue's parts: outside, through the slot (minimum, and multiple of the film's thickness), head.
OUTSIDE_MM = 1.9
THROUGH_MM = 1.4
THROUGH_FILMS = 2.8
HEAD_MM = 3.4
# The slot: how far its narrow part extends over the head, and the length of the wide part.
OVER_MM = 0.7
WIDE_MM = 1.2


def build_rim(shape: Shape, size: WheelSize) -> None:
    """Add faces ``rim 0 0`` … (strip, facet) and tongues, and join their hooks to the edges ``notch i`` of the discs."""
    per_strip = size.ties * size.facets_per_tie
    for strip in range(size.strips):
        _add_strip(shape, size, strip, per_strip)
    for strip in range(size.strips):
        previous = (strip - 1) % size.strips
        shape.touch("lock", f"rim {strip} tongue head.tip", f"rim {previous} {per_strip - 1}", f"rim {previous} slot")
        for tie in range(size.ties):
            name, notch = f"rim {strip} {tie * size.facets_per_tie}", strip * size.ties + tie
            shape.touch("rim", f"{name}.inner tip", f"inner.notch {notch}")
            shape.touch("rim", f"{name}.outer tip", f"outer.notch {notch}")


def first_facet_pose(size: WheelSize, strip: int) -> Pose:
    """Return the pose of a strip's first facet in the frame of the wheel.

    The middle of the facet lies at the first tie.
    """
    # x along the circle, y along the axle, z towards it.
    axes: Pose = ((0.0, 0.0, -1.0, 0.0), (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    turn = compose(rotation("y", -size.tie_angles_rad[strip * size.ties]), axes)
    return compose(turn, translation(-size.facet_mm / 2, -size.between_mm / 2, -size.apothem_mm))


def _add_strip(shape: Shape, size: WheelSize, strip: int, count: int) -> None:
    """Add one strip of the wheel's rim: ``count`` facets, with hooks that hold the discs at each tie.

    A tongue at the first facet and a slot in the last one join the strips to a ring.
    """
    length_mm, width_mm, turn_deg = size.facet_mm, size.between_mm, math.degrees(size.turn_rad)
    dip_deg = math.degrees(size.turn_rad - size.slope_rad)
    hook = Hook(NECK_MM, left_mm=HOOK_MM, right_mm=HOOK_MM, reach_mm=2 * size.clearance_mm + size.film_mm)
    tongue_mm, _ = _tongue_width_mm(size)
    for i in range(count):
        hooks = (None, None) if i % size.facets_per_tie else (hook, hook)
        # The tongue grows from the first facet.
        outline = facet(length_mm, width_mm, hooks, base_mm=0.0 if i else tongue_mm)
        shape.face(f"rim {strip} {i}", outline, role="rim", piece="wheel rim")
    for i in range(count - 1):
        # The last facet dips under the start of the next strip.
        extra_deg = dip_deg if i == count - 2 else 0.0
        shape.connect(f"rim {strip} {i}.next", f"rim {strip} {i + 1}.last", "bend", turn_deg + extra_deg)
    _add_tongue(shape, size, strip)
    shape.polygon_hole(f"rim {strip} {count - 1}", f"rim {strip} slot", "slot", _slot_outline(size))


def _tongue_width_mm(size: WheelSize) -> tuple[float, float]:
    """Return the tongue's width (mm), and how far its head reaches beyond it on each side (mm)."""
    return min(4.0, 0.36 * size.between_mm), min(1.5, 0.15 * size.between_mm)


def _slot_outline(size: WheelSize) -> list[Point]:
    """Return the outline of the slot in the last facet.

    It is narrow where the tongue passes, and wide where its head goes in.

    The slot is narrow from ``right`` to ``middle`` and wide from there to ``left``. x runs towards the next strip,
    whose tongue comes back over the facet in the direction of -x.
    """
    overlap, distance_mm = _start_mm(size)
    # The part through the slot descends from above the facet to the same distance below it; this is its extent along x.
    through_length = math.sqrt(_through_mm(size) ** 2 - (2 * distance_mm) ** 2)
    start = size.facet_mm - overlap - OUTSIDE_MM
    right = start + size.film_mm / 2 + size.clearance_mm
    middle, left = start - through_length - OVER_MM, start - through_length - OVER_MM - WIDE_MM
    width, spread = _tongue_width_mm(size)
    narrow_half = width / 2 + size.clearance_mm
    wide_half = narrow_half + spread
    half_outline = [(left, wide_half), (middle, wide_half), (middle, narrow_half), (right, narrow_half)]
    middle_y = size.between_mm / 2
    return [*((x, middle_y - y) for x, y in half_outline), *((x, middle_y + y) for x, y in reversed(half_outline))]


def _through_mm(size: WheelSize) -> float:
    """Return the length (mm) of the part of the tongue that leads from one side of the facet to the other."""
    return max(THROUGH_MM, THROUGH_FILMS * size.film_mm)


def _start_mm(size: WheelSize) -> tuple[float, float]:
    """Return overlap (mm) of the next strip's start along the last facet, and distance of the strip's tongue from
    that facet.
    """
    slope, film = size.slope_rad, size.film_mm
    shift = size.facet_mm * (math.cos(slope) - math.cos(size.turn_rad))
    return shift * math.cos(slope) - film * math.sin(slope), shift * math.sin(slope) + film * math.cos(slope)


def _add_tongue(shape: Shape, size: WheelSize, strip: int) -> None:
    """Add the tongue that joins a strip of the rim to the strip before it, and the slot in that strip.

    The tongue has three faces. ``out`` lies parallel to the facet under it, ``through`` goes through the slot of that
    facet, and ``head``, which is wider than the slot, holds behind it.
    """
    width, spread = _tongue_width_mm(size)
    for name, length in (("out", OUTSIDE_MM), ("through", _through_mm(size))):
        corners = {"root": (0.0, 0.0), "b": (width, 0.0), "end": (width, length), "a": (0.0, length)}
        shape.face(f"rim {strip} tongue {name}", corners, role="rim")
    # The head widens at its root, and narrows towards its tip, so that it finds the slot.
    head = {"root": (0.0, 0.0), "b": (width, 0.0), "c": (width + spread, 0.3), "d": (width + spread, 1.3),
            "tip": (width - 0.5, HEAD_MM), "e": (0.5, HEAD_MM), "f": (-spread, 1.3), "g": (-spread, 0.3)}  # fmt: skip
    shape.face(f"rim {strip} tongue head", head, role="rim")
    parallel_deg = math.degrees(size.slope_rad)
    # The part through the slot begins at a distance from the facet and ends at the same distance behind it.
    _, distance_mm = _start_mm(size)
    through_deg = math.degrees(math.asin(2 * distance_mm / _through_mm(size)))
    tongue = f"rim {strip} tongue"
    shape.connect(f"rim {strip} 0.base", f"{tongue} out.root", "bend", parallel_deg)
    shape.connect(f"{tongue} out.end", f"{tongue} through.root", "bend", through_deg)
    shape.connect(f"{tongue} through.end", f"{tongue} head.root", "bend", -through_deg)


WALL_NECK_MM = 5.0
WALL_HOOK_MM = 1.6
# Directions of the walls in the frame of the hub and of the inner disc: between the arms of horns along x and y, where
# the screws and their slots need the layer's film.
DIRECTIONS_RAD = [math.pi / 2 + 2 * math.pi * i / WALLS for i in range(WALLS)]
ARC_STEPS = 8
# Deviation of the layer's outline from a circle.
EVEN_MM = 0.02


def build_hub(shape: Shape, size: WheelSize) -> None:
    """Add the hub: a layer on the inner disc whose walls are folded up, with hooks that lock into slots of the
    outer disc.

    The faces are ``hub`` and ``wall 1`` …; the slots are cut into the face ``outer``.
    """
    shape.face("hub", _hub_outline(size), piece="wheel hub")
    shape.place("hub", "inner", translation(0, 0, size.film_mm), laminated=True)
    length = 2 * size.hub_mm * math.tan(WALL_RAD / 2)
    hook = Hook(WALL_NECK_MM, left_mm=WALL_HOOK_MM, right_mm=0.0, reach_mm=2 * size.clearance_mm + size.film_mm)
    for i, direction in enumerate(DIRECTIONS_RAD, 1):
        shape.face(f"wall {i}", facet(length, size.wall_mm, (None, hook)), role="rim")
        shape.connect(f"hub.wall {i}", f"wall {i}.inner", "fold", 90)
        # Directions around the axle run the other way in the outer disc's frame; its hooks point backwards.
        slot = f"wall slot {i}"
        shape.polygon_hole("outer", slot, "slot", _wall_slot_outline(size, -direction))
        shape.touch("lock", f"wall {i}.outer tip", "outer", slot)


def turn_rad(size: WheelSize) -> float:
    """Return angle (rad) by which the outer disc is turned relative to the hub until the hooks hold."""
    inside = size.hub_mm - size.film_mm / 2
    return math.atan((WALL_NECK_MM / 2 + WALL_HOOK_MM) / inside) - math.atan(WALL_NECK_MM / 2 / inside)


def _hub_outline(size: WheelSize) -> dict[str, Point]:
    """Return the outline of the hub's layer: a circle with a straight edge ``wall 1``, ``wall 2``, … for each wall."""
    radius, half_wall = size.hub_mm / math.cos(WALL_RAD / 2), WALL_RAD / 2
    arc_rad = 2 * math.pi / WALLS - WALL_RAD
    steps = math.ceil(arc_rad / 2 / math.acos(1 - EVEN_MM / radius))
    angles = {}
    for i, direction in enumerate(DIRECTIONS_RAD, 1):
        angles[f"wall {i}"] = direction - half_wall
        angles |= {f"arc {i} {k}": direction + half_wall + arc_rad * k / steps for k in range(steps)}
    return dict(zip(angles, on_circle(radius, angles.values()), strict=True))


def _wall_slot_outline(size: WheelSize, angle_rad: float) -> list[Point]:
    """Return the outline of a slot in the outer disc: an arc around the axle, along which a hook turns into its lock.

    ``angle_rad`` is the direction of the hook before it turns. The hook points clockwise.
    """
    inner_radius = size.hub_mm - size.film_mm / 2 - PLAY_MM
    outer_radius = math.hypot(size.hub_mm + size.film_mm / 2, WALL_NECK_MM / 2 + WALL_HOOK_MM) + size.clearance_mm
    half_angle = math.atan(WALL_NECK_MM / 2 / (size.hub_mm - size.film_mm / 2)) + size.clearance_mm / size.hub_mm
    start, end = angle_rad - half_angle, angle_rad + half_angle + turn_rad(size)
    angles = [start + (end - start) * i / ARC_STEPS for i in range(ARC_STEPS + 1)]
    return [*on_circle(outer_radius, angles), *on_circle(inner_radius, reversed(angles))]
