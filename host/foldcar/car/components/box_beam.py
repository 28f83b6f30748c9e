"""The box beam, one strip folded from right wall, floor, left wall, lid and flap; nothing in it is glued.

Faces: ``right``, ``floor``, ``left``, ``lid``, ``flap``, each with x forward; neighbouring beams are fused along their
``front`` and ``rear`` edges. The lid turns about the left wall's upper edge. Its flap hangs inside the right wall, and
is held by a latch at one end of the lid or at both: a tongue on the flap's lower edge goes through a slot of that wall.
Beyond the fold the flap continues as a lever, which stands up in a notch of the lid. A finger pushes it outwards from
above: the flap turns about the wall's upper edge and draws the tongue in. A pull tab across one notch lifts the lid.
Both are reached from above, so that no wheel is in the way. ``width`` and ``height`` are outer dimensions; faces are
the film's middle surface.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from foldcar.car.components.bridge import bridge_span, mouth_mm, stack_height_mm
from foldcar.car.components.component import Component, Parameter
from foldcar.car.components.mounts import min_doubler_mm
from foldcar.car.components.shape import Shape
from foldcar.car.folded.model import Point, ToolClearance
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.catalogue import Catalogue


def _min_height_mm(parts: Catalogue) -> float:
    """Return the minimum outer height of the body (mm).

    Both the stack of boards and a servo must fit below the lid.
    """
    film, assembly = parts.film_mm, parts.assembly
    # Inside, the stack of boards stands on the floor. Its height is measured from the middle of the floor's film.
    boards = stack_height_mm(parts) + film / 2
    if parts.battery_place == "roof":
        # The leads of a battery on the roof come through the lid, above the boards.
        boards += parts.wiring.wire_diameter_mm.value
    # The right wall carries a servo at half of its height, with a layer of film behind it. This layer must end below
    # the flap that hangs from the lid. As the servo is in the middle, as much height is needed below it as above it.
    flap_depth = assembly.flap_mm.value + film + assembly.slot_clearance_mm.value
    servo_and_flap = min_doubler_mm(parts) + 2 * flap_depth
    return max(boards, servo_and_flap) + film


def _min_width_mm(parts: Catalogue) -> float:
    """Return the minimum outer width of the body (mm).

    The body must be wide enough for the boards on their bridge, and for two servos whose undersides touch.
    """
    assembly, film = parts.assembly, parts.film_mm
    # Four distances follow each other from the left wall to the right one. They lead to the USB socket, to the middle of
    # the boards, to the right end of the bridge that carries the boards, and to the right wall.
    wall_to_socket = assembly.usb_inside_mm.value
    socket_to_middle = mouth_mm(parts)
    middle_to_bridge_end = bridge_span(parts).right_mm
    # The lid's flap hangs down between the bridge and the right wall.
    bridge_end_to_wall = max(assembly.bridge_gap_mm.value, assembly.flap_gap_mm.value + film)
    boards = wall_to_socket + socket_to_middle + middle_to_bridge_end + bridge_end_to_wall
    two_servos = 2 * parts.servo.ear_underside_mm.value
    return max(boards, two_servos) + 2 * film


WIDTH = Parameter(
    "width", 95, _min_width_mm, 500,
    "outer width of the body", "the boards across it", shared=True, uniform=True,
)  # fmt: skip
HEIGHT = Parameter(
    "height", 50, _min_height_mm, 200, "outer height of the body; axles stand at half of it",
    "the boards and their plugs over the LiPo", shared=True, uniform=True,
)  # fmt: skip
PANELS = ("floor", "right", "left", "lid", "flap")
LENGTH = Parameter("length", 80, 1, 1000, "length of a box beam", "a strip that can be folded")
# A lever is wider than its tongue by this (mm).
LEVER_OVER_MM = 1.0
# Corners of levers and tongues are cut off by this (mm), so that they do not catch.
CORNER_MM = 1.0


def wall_distance_mm(outer_mm: float, parts: Catalogue) -> float:
    """Return the distance of two opposite walls (mm), from the middle of one film to the middle of the other.

    It is the outer dimension of the body minus the film's thickness.
    """
    return outer_mm - parts.film_mm


def flap_end_mm(parts: Catalogue) -> float:
    """Return distance of a flap from the middle of an end cap (mm): the cap's tab and a clearance."""
    return parts.assembly.cap_tab_mm.value + 2 * parts.assembly.slot_clearance_mm.value


class Notch(NamedTuple):
    """The size of a notch in the lid (mm): its length along the lid and its depth across the lid."""

    length_mm: float
    depth_mm: float


def latch_notch(parts: Catalogue) -> Notch:
    """Return the size of a latch's notch in the lid, without the room for a pull tab."""
    assembly = parts.assembly
    gap = assembly.grip_gap_mm.value
    length = assembly.lock_mm.value + LEVER_OVER_MM + 2 * gap
    return Notch(length, depth_mm=assembly.grip_mm.value + gap)


class BoxBeam(Component):
    """Three walls, a lid and its flap with up to two latches, one at the ``front`` and one at the ``rear``.

    The car sets three values for each END. ``flap_END`` is the distance (mm) of the flap from that end, which keeps
    it clear of the tabs of a cap. ``latch_END`` is 1 if there is a latch. ``pull_END`` is 1 if the pull tab of the
    lid is beside it.
    """

    parameters = (LENGTH, WIDTH, HEIGHT)

    def build(self, shape: Shape) -> None:
        """Add the faces of the beam: the floor, two walls, a lid with a flap, and the latches that hold the flap.

        The walls are folded up from the floor, the lid is folded from the left wall, and the flap from the lid. The flap
        goes inside the right wall.
        """
        length = self["length"]
        floor_width = wall_distance_mm(self["width"], self.parts)
        wall_height = wall_distance_mm(self["height"], self.parts)
        for name, width in (("floor", floor_width), ("right", wall_height), ("left", wall_height)):
            shape.rectangle(name, length, width, piece="beam")
        fold_starts = {end: self._flap_fold_start_mm(end) for end in ("front", "rear")}
        self._add_lid(shape, fold_starts)
        self._add_flap(shape, fold_starts)
        # Each panel is folded from the far edge of the panel before it, in the order in which the beam is rolled up.
        for panel, next_panel in pairwise(("right", "floor", "left", "lid", "flap")):
            shape.connect(f"{panel}.far", f"{next_panel}.near", "fold", 90)
        # The right edge of the lid is tucked in behind the upper edge of the right wall. The lid has up to three such
        # edges.
        for edge in ("far", "far front", "far rear"):
            if edge in shape.edges("lid"):
                shape.touch("tuck", f"lid.{edge}", "right.near")
        for end in ("front", "rear"):
            if self[f"latch_{end}"]:
                self._add_latch(shape, end)

    def _flap_fold_start_mm(self, end: str) -> float:
        """Return the distance (mm) from an end of the beam to the fold between lid and flap.

        The fold leaves out the part beside the cap at this end, and the notch of a latch there.
        """
        start_mm = self[f"flap_{end}"]
        if self[f"latch_{end}"]:
            start_mm += latch_notch(self.parts).length_mm
        return start_mm

    def _add_lid(self, shape: Shape, fold_starts: Mapping[str, float]) -> None:
        """Add the lid, with a notch in its right edge for each latch.

        The origin of the lid's frame is its rear left corner; x points forward, and y to the right. The flap is folded
        from the middle part of the right edge. ``fold_starts`` has, for each end of the lid, ``front`` and ``rear``, the
        distance (mm) from that end to this fold.
        """
        assembly, film = self.parts.assembly, self.parts.film_mm
        length = self["length"]
        # The lid is narrower than the floor, because wall and flap lie beside it.
        width = wall_distance_mm(self["width"], self.parts) - film - assembly.flap_gap_mm.value
        fold_front_x = length - fold_starts["front"]
        fold_rear_x = fold_starts["rear"]
        # The corners, counter-clockwise. Each has the name of the edge that leads from it to the next corner. The left
        # edge and the front edge come first.
        corners: dict[str, Point] = {"near": (0.0, 0.0), "front": (length, 0.0)}
        # The right edge, from front to rear, has up to five parts: beside a front cap, a notch, the fold of the flap, a
        # notch, and beside a rear cap.
        if self["flap_front"]:
            corners["far front"] = (length, width)
        if self["latch_front"]:
            notch_front_x = fold_front_x + latch_notch(self.parts).length_mm
            corners |= self._notch("front", notch_front_x, width)
        corners["far"] = (fold_front_x, width)
        if self["latch_rear"]:
            corners |= self._notch("rear", fold_rear_x, width)
        if self["flap_rear"]:
            corners["far rear"] = (self["flap_rear"], width)
        corners["rear"] = (0.0, width)
        shape.face("lid", corners)

    def _notch(self, end: str, front_x: float, lid_width: float) -> dict[str, Point]:
        """Return the points of a notch in the lid's right edge, from its front side at ``front_x`` (mm) to its rear side.

        The notch makes room for a lever, which fingers press. Some notches also have a pull tab, which grows from the
        middle of the notch's bottom, the edge ``END grip``. Such a notch is deeper. x points forward and y to the right.
        """
        assembly = self.parts.assembly
        length, depth = latch_notch(self.parts)
        has_pull_tab = bool(self[f"pull_{end}"])
        rear_x = front_x - length
        bottom_y = lid_width - depth
        if has_pull_tab:
            bottom_y -= assembly.grip_mm.value
        points: dict[str, Point] = {f"{end} side": (front_x, lid_width), f"{end} corner": (front_x, bottom_y)}
        if has_pull_tab:
            gap = assembly.grip_gap_mm.value
            points |= {f"{end} grip": (front_x - gap, bottom_y), f"{end} corner 2": (rear_x + gap, bottom_y)}
        points[f"{end} side 2"] = (rear_x, bottom_y)
        return points

    def _add_flap(self, shape: Shape, fold_starts: Mapping[str, float]) -> None:
        """Add the flap, which hangs from the lid inside the right wall.

        The origin of the flap's frame is the rear end of the fold between lid and flap. x points forward, and y down.
        ``fold_starts`` has the distance (mm) from the beam's ``front`` and from its ``rear`` to this fold.

        The flap is longer than its fold: at a latch, it continues under the notch of the lid. There a *lever* stands up
        through the notch, so its y is negative. The latch's tongue grows from the flap's lower edge below the lever, from
        the part ``lock front`` or ``lock rear``.
        """
        fold_length = self["length"] - sum(fold_starts.values())
        # The corners, from the rear end of the fold forward, down, back along the lower edge, and up. Each has the name
        # of the edge that leads from it to the next corner.
        corners: dict[str, Point] = {"near": (0.0, 0.0)}
        corners |= self._front_end_of_flap(fold_length)
        corners |= self._rear_end_of_flap()
        shape.face("flap", corners)

    def _front_end_of_flap(self, fold_front_x: float) -> dict[str, Point]:
        """Return the flap's corners (x forward, y down) from its fold's front end past the latch to the lower edge."""
        depth, gap = self.parts.assembly.flap_mm.value, self.parts.assembly.grip_gap_mm.value
        corners: dict[str, Point] = {"front": (fold_front_x, 0.0)}
        if not self["latch_front"]:
            return corners | {"far": (fold_front_x, depth)}
        # The notch of the lid begins at the front end of the fold. The lever keeps a gap from both of its sides.
        notch, half_tongue = latch_notch(self.parts).length_mm, self.parts.assembly.lock_mm.value / 2
        lever_rear_x, lever_front_x = fold_front_x + gap, fold_front_x + notch - gap
        tongue_x = fold_front_x + notch / 2
        corners |= self._lever("front", lever_rear_x, lever_front_x)
        corners["before front"] = (lever_front_x, depth)
        corners["lock front"] = (tongue_x + half_tongue, depth)
        corners["far"] = (tongue_x - half_tongue, depth)
        return corners

    def _rear_end_of_flap(self) -> dict[str, Point]:
        """Return the flap's corners (x forward, y down) from the lower edge past the latch to its fold's rear end."""
        depth, gap = self.parts.assembly.flap_mm.value, self.parts.assembly.grip_gap_mm.value
        if not self["latch_rear"]:
            return {"rear": (0.0, depth)}
        # The notch of the lid ends at the rear end of the fold, where x is 0.
        notch, half_tongue = latch_notch(self.parts).length_mm, self.parts.assembly.lock_mm.value / 2
        lever_rear_x, lever_front_x = gap - notch, -gap
        tongue_x = -notch / 2
        corners: dict[str, Point] = {
            "lock rear": (tongue_x + half_tongue, depth),
            "behind rear": (tongue_x - half_tongue, depth),
            "rear": (lever_rear_x, depth),
        }
        return corners | self._lever("rear", lever_rear_x, lever_front_x)

    def _lever(self, end: str, rear_x: float, front_x: float) -> dict[str, Point]:
        """Return the points of a lever in the flap's frame, from its rear side to its front side."""
        top_y = -self.parts.assembly.grip_mm.value
        return {
            f"{end} lever": (rear_x, 0.0),
            f"{end} lever 2": (rear_x + CORNER_MM, top_y),
            f"{end} lever 3": (front_x - CORNER_MM, top_y),
            f"{end} lever 4": (front_x, 0.0),
        }

    def _add_latch(self, shape: Shape, end: str) -> None:
        """Add the latch at an end of the lid, and the pull tab beside it if it is set for this end.

        The latch is a tongue that is folded outwards from the flap's lower edge and goes through a slot of the right
        wall. To open it, a finger pushes the flap's lever outwards. The flap turns about its fold and draws the tongue
        in.
        """
        assembly, film = self.parts.assembly, self.parts.film_mm
        width, play = assembly.lock_mm.value, assembly.slot_clearance_mm.value
        notch = latch_notch(self.parts).length_mm
        # The tongue reaches from the middle of the flap's film, through the gap and the film of the wall, to beyond the
        # wall. So it passes one and a half films.
        reach = 1.5 * film + assembly.flap_gap_mm.value + assembly.lock_reach_mm.value
        shape.face(f"{end} tongue", _tongue_outline(width, reach), role="tab")
        shape.connect(f"flap.lock {end}", f"{end} tongue.near", "fold", -90)
        # The slot in the right wall, whose frame has x forward and y down from its upper edge.
        middle_from_end = self[f"flap_{end}"] + notch / 2
        slot_x = self["length"] - middle_from_end if end == "front" else middle_from_end
        slot_y = assembly.flap_mm.value
        slot_size = (width + 2 * play, film + play)
        shape.rectangular_hole("right", f"{end} lock slot", "slot", (slot_x, slot_y), *slot_size)
        shape.touch("lock", f"{end} tongue.tip", "right", f"{end} lock slot")
        self._require_latch_clearances(shape, end, width, slot_y)
        if self[f"pull_{end}"]:
            self._add_pull_tab(shape, end, notch - 2 * assembly.grip_gap_mm.value)

    def _require_latch_clearances(self, shape: Shape, end: str, width: float, flap_depth: float) -> None:
        """Require free space for the finger that opens a latch, and for its tongue when it is drawn in.

        Both are given in the frame of the tongue, which is ``width`` wide. The origin is an end of the fold between flap
        and tongue. x points along this fold, y outwards to the tip, and z down. The fold is ``flap_depth`` below the
        lid.
        """
        film = self.parts.film_mm
        # The tongue is free of the wall once it has moved inwards by this stroke. The lever is as long above the axis
        # about which the flap turns as the flap is below it. So the end of the lever moves outwards by the same stroke.
        stroke = self.parts.assembly.lock_reach_mm.value + film
        # The finger is a cylinder that stands on the lid and pushes the lever from inside, until the end of the stroke.
        finger, finger_length = self.parts.tools.finger_mm
        lid_top_z = -(flap_depth + film)
        finger_pose = compose(translation(width / 2, stroke - finger / 2, lid_top_z), rotation("x", math.pi))
        shape.require_clearance(f"{end} tongue", ToolClearance("finger", finger_pose, finger, finger_length))
        # When the tongue is drawn in, its fold moves inwards. This space is a cylinder along the fold, beside the flap.
        tongue_pose = compose(translation(0.0, -(film + stroke) / 2, 0.0), rotation("y", math.pi / 2))
        shape.require_clearance(f"{end} tongue", ToolClearance("tongue", tongue_pose, stroke, width))

    def _add_pull_tab(self, shape: Shape, end: str, width_mm: float) -> None:
        """Add the lid's pull tab, which stands up from the bottom of a notch, with room for a finger on each side.

        The origin of the tab's frame is an end of its fold. x points along the fold, y up, and z across the tab's film.
        """
        film = self.parts.film_mm
        finger, finger_length = self.parts.tools.finger_mm
        shape.face(f"{end} pull tab", _tongue_outline(width_mm, self.parts.assembly.grip_mm.value), role="tab")
        shape.connect(f"lid.{end} grip", f"{end} pull tab.near", "fold", -90)
        # A finger is a cylinder that begins at its tip and runs along z of its own frame. This turn makes it run up,
        # along y of the tab.
        upwards = rotation("x", -math.pi / 2)
        for side in (-1, 1):
            # The tip is beside the middle of the tab, just above its fold.
            tip = translation(width_mm / 2, film, side * (finger / 2 + film))
            finger_clearance = ToolClearance("finger", compose(tip, upwards), finger, finger_length)
            shape.require_clearance(f"{end} pull tab", finger_clearance)


def _tongue_outline(width_mm: float, reach_mm: float) -> dict[str, Point]:
    """Return the outline of a tongue that is folded along its first edge; its other corners are cut off."""
    corner = min(CORNER_MM, reach_mm / 2)
    return {"near": (0.0, 0.0), "1": (width_mm, 0.0), "tip": (width_mm - corner, reach_mm), "3": (corner, reach_mm)}


# The printed arrow to the front: its length, the minimum length that has room for its word, its width, and its distance
# from the ends of the floor.
ARROW_MM, MIN_ARROW_MM, ARROW_WIDTH_MM, ARROW_MARGIN_MM = 24.0, 16.0, 9.0, 2.0


def _mark_front(shape: Shape, floor: str) -> None:
    """Print an arrow with the word FRONT on a floor, near its front end, where the tab of the cap does not cover it.

    A floor that is too short for the word gets no arrow.
    """
    length, width = shape.face_size_mm(floor)
    y, half = width / 2, ARROW_WIDTH_MM / 2
    tip = length - flap_end_mm(shape.parts) - ARROW_MARGIN_MM
    start = max(ARROW_MARGIN_MM, tip - ARROW_MM)
    if tip - start >= MIN_ARROW_MM:
        corners = ((start, y - half), (tip - half, y - half), (tip, y), (tip - half, y + half), (start, y + half))
        shape.mark(floor, "FRONT", corners)


# The wall that each edge of a cap meets. A cap is seen from inside the car, so the walls beside a rear cap are
# exchanged.
FRONT_CAP_WALLS = {"near": "floor", "front": "right", "far": "lid", "rear": "left"}
REAR_CAP_WALLS = {"near": "floor", "front": "left", "far": "lid", "rear": "right"}


def cap_inset_mm(parts: Catalogue) -> float:
    """Return distance (mm) of a cap's edges from the walls' middle surfaces: film and clearance, so that its tabs fit
    inside.
    """
    return parts.film_mm + parts.assembly.cap_clearance_mm.value


def put_cap(shape: Shape, cap: str, end: str, module: str, outer_mm: Point, slit_mm: float) -> None:
    """Add the cap that closes one end of a beam, and tape it to the beam's floor and walls.

    ``cap`` is the name of the cap, such as "front cap 1" for the cap of segment 1. ``end`` is the end of the beam,
    ``front`` or ``rear``, and ``module`` the name of the module with the beam. ``outer_mm`` are the outer width and
    height of the body. ``slit_mm`` is the length of a slit for cables in the cap's middle; with 0 there is no slit.

    The cap is the face ``CAP.cap``. In its frame, seen from inside the car, x points right on a front cap and left on a
    rear cap, and y points up. A second face, ``CAP.flange``, is folded from the cap's upper edge and lies under the lid.
    """
    parts, assembly, inset = shape.parts, shape.parts.assembly, cap_inset_mm(shape.parts)
    beam, tab_depth = f"{module}.beam", assembly.cap_tab_mm.value
    body = shape.body_of(f"{beam}.floor")
    width, height = (wall_distance_mm(size, parts) - 2 * inset for size in outer_mm)
    # The cap, whose piece has its name without the number of the segment.
    piece = cap.rpartition(" ")[0]
    shape.rectangle(f"{cap}.cap", width, height, piece=piece, body=body)
    # The flange is a trapezoid, as deep as a tab.
    flange = {"fold": (0.0, 0.0), "1": (width, 0.0), "2": (width - tab_depth, tab_depth), "3": (tab_depth, tab_depth)}
    shape.face(f"{cap}.flange", flange, body=body)
    shape.connect(f"{cap}.cap.far", f"{cap}.flange.fold", "fold", 90)
    if slit_mm > 0:
        middle = (width / 2, height / 2)
        shape.rectangular_hole(f"{cap}.cap", f"{cap}.slit", "slit", middle, slit_mm, assembly.cable_slit_mm.value)
    if end == "front":
        _mark_front(shape, f"{beam}.floor")
    # The joins of the cap's edges to the walls of the beam.
    wall_by_edge = FRONT_CAP_WALLS if end == "front" else REAR_CAP_WALLS
    for edge, wall in wall_by_edge.items():
        cap_edge, wall_edge = f"{cap}.cap.{edge}", f"{beam}.{wall}.{end}"
        if wall == "lid":
            # The lid is not taped, because it opens.
            shape.touch("tuck", cap_edge, wall_edge)
        else:
            shape.connect(wall_edge, cap_edge, "tab", 90, depth_mm=tab_depth, inset_mm=inset)
