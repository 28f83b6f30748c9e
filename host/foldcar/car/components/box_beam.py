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

from foldcar.car.components.bridge import mouth_mm, span_mm, stack_height_mm
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
    boards = stack_height_mm(parts) + film / 2
    if parts.battery_place == "roof":
        # Its leads come through the lid, above the boards.
        boards += parts.wiring.wire_diameter_mm.value
    # In the right wall, the layer of film behind a servo must end below the lid's flap. The servo is in the middle of
    # the wall's height, so the flap's depth counts above it and below it.
    flap = assembly.flap_mm.value + film + assembly.slot_clearance_mm.value
    servo_and_flap = min_doubler_mm(parts) + 2 * flap
    return max(boards, servo_and_flap) + film


def _min_width_mm(parts: Catalogue) -> float:
    """Return the minimum outer width of the body (mm).

    The body must be wide enough for the boards on their bridge, and for two servos whose undersides touch.
    """
    assembly, film = parts.assembly, parts.film_mm
    # Across the body from the left wall: the gap to the USB socket, the boards up to the right end of their bridge, and
    # the gap to the right wall. The lid's flap hangs down in this last gap.
    socket_to_middle = mouth_mm(parts)
    _, middle_to_right_end = span_mm(parts)
    gap_to_right_wall = max(assembly.bridge_gap_mm.value, assembly.flap_gap_mm.value + film)
    boards = assembly.usb_inside_mm.value + socket_to_middle + middle_to_right_end + gap_to_right_wall
    return max(boards, 2 * parts.servo.ear_underside_mm.value) + 2 * film


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


def wall_mm(outer_mm: float, parts: Catalogue) -> float:
    """Return the distance between the middles of two opposite walls (mm): the outer dimension minus the film's
    thickness.
    """
    return outer_mm - parts.film_mm


def flap_end_mm(parts: Catalogue) -> float:
    """Return distance of a flap from the middle of an end cap (mm): the cap's tab and a clearance."""
    return parts.assembly.cap_tab_mm.value + 2 * parts.assembly.slot_clearance_mm.value


def latch_mm(parts: Catalogue) -> Point:
    """Return the length of a latch's notch along the lid, and its depth across the lid (mm), without a pull tab."""
    assembly = parts.assembly
    gap = assembly.grip_gap_mm.value
    return assembly.lock_mm.value + LEVER_OVER_MM + 2 * gap, assembly.grip_mm.value + gap


class BoxBeam(Component):
    """Three walls, a lid and its flap with up to two latches, one at the ``front`` and one at the ``rear``.

    The car sets three values for each END. ``flap_END`` is the distance (mm) of the flap from that end, which keeps
    it clear of the tabs of a cap. ``latch_END`` is 1 if there is a latch. ``pull_END`` is 1 if the pull tab of the
    lid is beside it.
    """

    parameters = (LENGTH, WIDTH, HEIGHT)

    def build(self, shape: Shape) -> None:
        """Add the floor, the two walls that are folded up from it, the lid that is folded from the left wall, flap
        and latches.
        """
        length = self["length"]
        width, height = wall_mm(self["width"], self.parts), wall_mm(self["height"], self.parts)
        for name, size in (("floor", width), ("right", height), ("left", height)):
            shape.rectangle(name, length, size, piece="beam")
        # The flap's fold begins behind the tab of a cap and behind the notch of a latch.
        notch, _ = latch_mm(self.parts)
        fold_starts: dict[str, float] = {}
        for end in ("front", "rear"):
            fold_starts[end] = self[f"flap_{end}"]
            if self[f"latch_{end}"]:
                fold_starts[end] += notch
        self._add_lid(shape, fold_starts)
        self._add_flap(shape, fold_starts)
        for panel, following in (("right", "floor"), ("floor", "left"), ("left", "lid"), ("lid", "flap")):
            shape.connect(f"{panel}.far", f"{following}.near", "fold", 90)
        for edge in ("far", "far front", "far rear"):
            if edge in shape.edges("lid"):
                shape.touch("tuck", f"lid.{edge}", "right.near")
        for end in ("front", "rear"):
            if self[f"latch_{end}"]:
                self._add_latch(shape, end)

    def _add_lid(self, shape: Shape, fold_starts: Mapping[str, float]) -> None:
        """Add the lid, with a notch for each latch.

        Its frame: the origin is the rear end of the left wall's upper edge; x points forward and y to the right wall.
        The flap hangs at the lid's right edge, ``far``, between the latches. ``fold_starts`` has, for the front and the
        rear of the beam, the distance (mm) from that end to the beginning of this fold. Where a cap's tab is beside the
        lid, the rest of its right edge is called ``far front`` or ``far rear``.

        The outline goes counter-clockwise, and a point has the name of the edge that starts at it.
        """
        assembly, film = self.parts.assembly, self.parts.film_mm
        length = self["length"]
        # The lid is narrower than the floor, because wall and flap lie beside it.
        width = wall_mm(self["width"], self.parts) - film - assembly.flap_gap_mm.value
        fold_front, fold_rear = length - fold_starts["front"], fold_starts["rear"]
        points: dict[str, Point] = {"near": (0.0, 0.0), "front": (length, 0.0)}
        if self["flap_front"]:
            points["far front"] = (length, width)
        if self["latch_front"]:
            notch_length, _ = latch_mm(self.parts)
            points |= self._notch("front", fold_front + notch_length, width)
        points["far"] = (fold_front, width)
        if self["latch_rear"]:
            points |= self._notch("rear", fold_rear, width)
        if self["flap_rear"]:
            points["far rear"] = (self["flap_rear"], width)
        points["rear"] = (0.0, width)
        shape.face("lid", points)

    def _notch(self, end: str, front_x: float, lid_width: float) -> dict[str, Point]:
        """Return the points of a notch in the lid's right edge, from its front side at ``front_x`` (mm) to its rear side.

        A notch is as deep as its lever needs, and deeper if the pull tab is in it, too. The pull tab grows from the
        middle of the notch's bottom, the edge ``END grip``.
        """
        assembly = self.parts.assembly
        length, depth = latch_mm(self.parts)
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

        Its frame: the origin is the rear end of the fold between lid and flap; x points forward and y down.
        ``fold_starts`` has, for the front and the rear of the beam, the distance (mm) from that end to the fold.

        At a latch the flap continues beyond its fold, below the notch of the lid. There it has a lever that stands up
        through the notch, at negative y, and the edge ``lock END`` at its lower edge, from which the tongue grows. The
        outline goes around the flap from the origin. A point has the name of the edge that starts at it.
        """
        assembly = self.parts.assembly
        fold_length = self["length"] - sum(fold_starts.values())
        notch, _ = latch_mm(self.parts)
        depth, gap = assembly.flap_mm.value, assembly.grip_gap_mm.value
        half_tongue = assembly.lock_mm.value / 2
        points: dict[str, Point] = {"near": (0.0, 0.0), "front": (fold_length, 0.0)}
        if self["latch_front"]:
            rear_x, front_x = fold_length + gap, fold_length + notch - gap
            middle_x = fold_length + notch / 2
            points |= self._lever("front", rear_x, front_x)
            points |= {"before front": (front_x, depth), "lock front": (middle_x + half_tongue, depth)}
            points["far"] = (middle_x - half_tongue, depth)
        else:
            points["far"] = (fold_length, depth)
        if self["latch_rear"]:
            rear_x, front_x = gap - notch, -gap
            middle_x = -notch / 2
            points |= {"lock rear": (middle_x + half_tongue, depth), "behind rear": (middle_x - half_tongue, depth)}
            points["rear"] = (rear_x, depth)
            points |= self._lever("rear", rear_x, front_x)
        else:
            points["rear"] = (0.0, depth)
        shape.face("flap", points)

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
        """Add the latch at an end: a tongue that is folded outwards from the flap's lower edge, through a slot of the
        right wall.

        A finger that pushes the flap's lever outwards draws the tongue in. Both the finger and the tongue need free
        space. The pull tab is added, too, if it is set for this end.
        """
        assembly, film = self.parts.assembly, self.parts.film_mm
        width, play = assembly.lock_mm.value, assembly.slot_clearance_mm.value
        notch, _ = latch_mm(self.parts)
        # The tongue passes the gap and the wall. Half a film is counted to the middle of the flap.
        reach = 1.5 * film + assembly.flap_gap_mm.value + assembly.lock_reach_mm.value
        middle_from_end = self[f"flap_{end}"] + notch / 2
        slot_x = self["length"] - middle_from_end if end == "front" else middle_from_end
        slot_y = assembly.flap_mm.value
        shape.face(f"{end} tongue", _tongue_outline(width, reach), role="tab")
        shape.connect(f"flap.lock {end}", f"{end} tongue.near", "fold", -90)
        slot_size = (width + 2 * play, film + play)
        shape.rectangular_hole("right", f"{end} lock slot", "slot", (slot_x, slot_y), *slot_size)
        shape.touch("lock", f"{end} tongue.tip", "right", f"{end} lock slot")
        # The tongue's frame: the origin is an end of its fold; x points along the fold, y outwards to the tip, z down.
        # The tongue is free once it has moved by this stroke. The lever is as high above the flap's fold as the tongue is
        # low, so it moves as far outwards.
        stroke, lid_z = assembly.lock_reach_mm.value + film, -(slot_y + film)
        # The finger is a cylinder that stands on the lid, behind the lever. It follows the lever by the stroke.
        finger, finger_length = self.parts.tools.finger_mm
        finger_pose = compose(translation(width / 2, stroke - finger / 2, lid_z), rotation("x", math.pi))
        shape.require_clearance(f"{end} tongue", ToolClearance("finger", finger_pose, finger, finger_length))
        # The space into which the tongue's fold moves is a cylinder along the fold, inside of the flap.
        tongue_pose = compose(translation(0.0, -(film + stroke) / 2, 0.0), rotation("y", math.pi / 2))
        shape.require_clearance(f"{end} tongue", ToolClearance("tongue", tongue_pose, stroke, width))
        if self[f"pull_{end}"]:
            self._add_pull_tab(shape, end, notch - 2 * assembly.grip_gap_mm.value)

    def _add_pull_tab(self, shape: Shape, end: str, width_mm: float) -> None:
        """Add the lid's pull tab, which stands up from the bottom of a notch, with room for a finger on each side.

        The tab's frame: the origin is an end of its fold; x points along the fold, y up, z across the tab.
        """
        film, (finger, finger_length) = self.parts.film_mm, self.parts.tools.finger_mm
        shape.face(f"{end} pull tab", _tongue_outline(width_mm, self.parts.assembly.grip_mm.value), role="tab")
        shape.connect(f"lid.{end} grip", f"{end} pull tab.near", "fold", -90)
        for side in (-1, 1):
            # A finger comes from above: it is a cylinder whose axis, z of its own frame, points up from the fold.
            finger_tip = translation(width_mm / 2, film, side * (finger / 2 + film))
            pose = compose(finger_tip, rotation("x", -math.pi / 2))
            shape.require_clearance(f"{end} pull tab", ToolClearance("finger", pose, finger, finger_length))


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


# The edge of a front cap, seen from inside, that meets each wall. A rear cap is seen from the other direction, so its
# edges meet the OPPOSITE walls.
CAP_EDGES = {"floor": "near", "right": "front", "lid": "far", "left": "rear"}
OPPOSITE = {"left": "right", "right": "left", "floor": "floor", "lid": "lid"}


def cap_inset_mm(parts: Catalogue) -> float:
    """Return distance (mm) of a cap's edges from the walls' middle surfaces: film and clearance, so that its tabs fit
    inside.
    """
    return parts.film_mm + parts.assembly.cap_clearance_mm.value


def put_cap(shape: Shape, cap: str, end: str, module: str, outer_mm: Point, slit_mm: float) -> None:
    """Add the cap that closes one end of a beam, and tape it to the beam's walls and floor.

    ``end`` is ``front`` or ``rear``, ``module`` the name of the module with the beam, ``outer_mm`` the width and height
    of the body. ``slit_mm`` is the length of a slit for cables in the cap's middle; with 0 there is none.

    The cap is the face ``CAP.cap``, seen from inside the car: its edge ``near`` is at the floor and ``far`` at the lid;
    ``front`` and ``rear`` are at the side walls. x points right on a front cap and left on a rear cap. A second face,
    ``CAP.flange``, is folded from the cap's upper edge and lies under the lid.
    """
    parts, assembly, inset = shape.parts, shape.parts.assembly, cap_inset_mm(shape.parts)
    width, height = (wall_mm(size, parts) - 2 * inset for size in outer_mm)
    body, depth = shape.body_of(f"{module}.beam.floor"), assembly.cap_tab_mm.value
    # The cap of segment 1 is called "front cap 1", and its piece is a "front cap".
    piece = cap.rpartition(" ")[0]
    shape.rectangle(f"{cap}.cap", width, height, piece=piece, body=body)
    flange = {"fold": (0.0, 0.0), "1": (width, 0.0), "2": (width - depth, depth), "3": (depth, depth)}
    shape.face(f"{cap}.flange", flange, body=body)
    shape.connect(f"{cap}.cap.far", f"{cap}.flange.fold", "fold", 90)
    if slit_mm > 0:
        middle = (width / 2, height / 2)
        shape.rectangular_hole(f"{cap}.cap", f"{cap}.slit", "slit", middle, slit_mm, assembly.cable_slit_mm.value)
    if end == "front":
        _mark_front(shape, f"{module}.beam.floor")
    for front_wall, edge in CAP_EDGES.items():
        wall = front_wall if end == "front" else OPPOSITE[front_wall]
        cap_edge, wall_edge = f"{cap}.cap.{edge}", f"{module}.beam.{wall}.{end}"
        if wall == "lid":
            # The lid is not taped, because it opens.
            shape.touch("tuck", cap_edge, wall_edge)
        else:
            shape.connect(wall_edge, cap_edge, "tab", 90, depth_mm=depth, inset_mm=inset)
