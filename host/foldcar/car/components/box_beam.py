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
    """Return the minimum outer height (mm).

    The body must be high enough for the boards over the floor, and for the layer of a servo between two flaps.
    """
    film, assembly = parts.film_mm, parts.assembly
    boards = stack_height_mm(parts) + film / 2
    if parts.battery_place == "roof":
        # Its leads come through the lid, above the boards.
        boards += parts.wiring.wire_diameter_mm.value
    # A servo's layer in the middle of the right wall ends below the lid's flap.
    beside_flap = min_doubler_mm(parts) + 2 * (assembly.flap_mm.value + film + assembly.slot_clearance_mm.value)
    return max(boards, beside_flap) + film


def _min_width_mm(parts: Catalogue) -> float:
    """Return the minimum outer width (mm).

    The body must be wide enough for the boards on their bridge, and for two servos whose undersides touch.
    """
    assembly, film = parts.assembly, parts.film_mm
    _, right = span_mm(parts)
    # The lid's flap goes down between the boards and the right wall.
    beside = max(assembly.bridge_gap_mm.value, assembly.flap_gap_mm.value + film)
    boards = assembly.usb_inside_mm.value + mouth_mm(parts) + right + beside
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
        # From each end of the beam to its flap's fold.
        notch, _ = latch_mm(self.parts)
        fold_starts = {end: self[f"flap_{end}"] + notch * self[f"latch_{end}"] for end in ("front", "rear")}
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
        """Add the lid, with a notch for each latch. The flap hangs at its far edge, inside the right wall.

        ``fold_starts`` are the distances (mm) from each end of the beam to the fold of the flap. The outline goes
        counter-clockwise, and a point has the name of the edge that starts at it.
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
        """Return the points of a notch in the lid, from its front side at ``front_x`` (mm) to its rear side.

        If the pull tab is at this end, it grows from the edge between the notch's corners.
        """
        assembly = self.parts.assembly
        notch_length, depth = latch_mm(self.parts)
        rear_x = front_x - notch_length
        bottom = lid_width - depth - self[f"pull_{end}"] * assembly.grip_mm.value
        points: dict[str, Point] = {f"{end} side": (front_x, lid_width), f"{end} corner": (front_x, bottom)}
        if self[f"pull_{end}"]:
            gap = assembly.grip_gap_mm.value
            points |= {f"{end} grip": (front_x - gap, bottom), f"{end} corner 2": (rear_x + gap, bottom)}
        points[f"{end} side 2"] = (rear_x, bottom)
        return points

    def _add_flap(self, shape: Shape, fold_starts: Mapping[str, float]) -> None:
        """Add the flap.

        For each latch it has a lever at the edge of its fold, and the edge of a tongue at its lower edge.

        ``fold_starts`` are the distances (mm) of the ends of the fold from the ends of the beam. The origin is the
        rear end of the fold; x runs forward and y down. A point has the name of the edge that starts at it. A lever
        stands up, at negative y, in the middle of its notch. Its upper corners are cut off by 1 mm.
        """
        assembly = self.parts.assembly
        fold_length = self["length"] - sum(fold_starts.values())
        notch, _ = latch_mm(self.parts)
        depth, grip = assembly.flap_mm.value, assembly.grip_mm.value
        gap, half = assembly.grip_gap_mm.value, assembly.lock_mm.value / 2
        front: dict[str, Point] = {"front": (fold_length, 0.0)}
        rear: dict[str, Point] = {"far": (fold_length, depth), "rear": (0.0, depth)}
        if self["latch_front"]:
            near, far, middle = fold_length + gap, fold_length + notch - gap, fold_length + notch / 2
            front = {"front": (fold_length, 0.0), "front lever": (near, 0.0), "front lever 2": (near + 1, -grip),
                     "front lever 3": (far - 1, -grip), "front lever 4": (far, 0.0)}  # fmt: skip
            rear = {"before front": (far, depth), "lock front": (middle + half, depth), "far": (middle - half, depth),
                    "rear": (0.0, depth)}  # fmt: skip
        if self["latch_rear"]:
            near, far, middle = -gap, gap - notch, -notch / 2
            del rear["rear"]
            rear |= {"lock rear": (middle + half, depth), "behind rear": (middle - half, depth), "rear": (far, depth),
                     "rear lever": (far, 0.0), "rear lever 2": (far + 1, -grip), "rear lever 3": (near - 1, -grip),
                     "rear lever 4": (near, 0.0)}  # fmt: skip
        shape.face("flap", {"near": (0.0, 0.0), **front, **rear})

    def _add_latch(self, shape: Shape, end: str) -> None:
        """Add the latch at an end: a tongue at the lower edge of the flap, folded outwards through a slot of the
        right wall.

        The flap hangs down inside the wall. If its lever, above, is pushed outwards, the tongue is drawn in. The
        finger that pushes it needs free space. The pull tab is added, too, if it is set for this end.
        """
        assembly, film = self.parts.assembly, self.parts.film_mm
        width, play, (notch, _) = assembly.lock_mm.value, assembly.slot_clearance_mm.value, latch_mm(self.parts)
        reach = 1.5 * film + assembly.flap_gap_mm.value + assembly.lock_reach_mm.value
        # From the beam's end to the middle of the notch.
        x = self[f"flap_{end}"] + notch / 2
        slot_center = (self["length"] - x if end == "front" else x, assembly.flap_mm.value)
        shape.face(f"{end} tongue", _tongue_outline(width, reach), role="tab")
        shape.connect(f"flap.lock {end}", f"{end} tongue.near", "fold", -90)
        shape.rectangular_hole("right", f"{end} lock slot", "slot", slot_center, width + 2 * play, film + play)
        shape.touch("lock", f"{end} tongue.tip", "right", f"{end} lock slot")
        # A finger pushes the lever outwards until the tip is within the wall; the lever, equally high, moves as far out.
        finger, finger_length = self.parts.tools.finger_mm
        stroke, lid_z = assembly.lock_reach_mm.value + film, -(slot_center[1] + film)
        # Both clearances are cylinders in the tongue's frame: the finger's stands on the lid, the tongue's lies along it.
        finger_pose = compose(translation(width / 2, stroke - finger / 2, lid_z), rotation("x", math.pi))
        tongue_pose = compose(translation(0.0, -(film + stroke) / 2, 0.0), rotation("y", math.pi / 2))
        shape.require_clearance(f"{end} tongue", ToolClearance("finger", finger_pose, finger, finger_length))
        shape.require_clearance(f"{end} tongue", ToolClearance("tongue", tongue_pose, stroke, width))
        if self[f"pull_{end}"]:
            self._add_pull_tab(shape, end, notch - 2 * assembly.grip_gap_mm.value)

    def _add_pull_tab(self, shape: Shape, end: str, width_mm: float) -> None:
        """Add the lid's pull tab across a notch, with room for two fingers."""
        film, (finger, finger_length) = self.parts.film_mm, self.parts.tools.finger_mm
        shape.face(f"{end} pull tab", _tongue_outline(width_mm, self.parts.assembly.grip_mm.value), role="tab")
        shape.connect(f"lid.{end} grip", f"{end} pull tab.near", "fold", -90)
        for side in (-1, 1):
            finger_start = translation(width_mm / 2, film, side * (finger / 2 + film))
            pose = compose(finger_start, rotation("x", -math.pi / 2))
            shape.require_clearance(f"{end} pull tab", ToolClearance("finger", pose, finger, finger_length))


def _tongue_outline(width_mm: float, reach_mm: float) -> dict[str, Point]:
    """Return the outline of a tongue that is folded along its first edge; its other corners are cut off."""
    corner = min(1.0, reach_mm / 2)
    return {"near": (0.0, 0.0), "1": (width_mm, 0.0), "tip": (width_mm - corner, reach_mm), "3": (corner, reach_mm)}


ARROW_MM, MIN_ARROW_MM, ARROW_WIDTH_MM = 24.0, 16.0, 9.0


def _mark_front(shape: Shape, floor: str) -> None:
    """Print an arrow to the front on a floor, behind the tab of the cap, if the floor is long enough for its word."""
    length, width = shape.face_size_mm(floor)
    tip, y, half = length - flap_end_mm(shape.parts) - 2.0, width / 2, ARROW_WIDTH_MM / 2
    start = max(2.0, tip - ARROW_MM)
    if tip - start >= MIN_ARROW_MM:
        corners = ((start, y - half), (tip - half, y - half), (tip, y), (tip - half, y + half), (start, y + half))
        shape.mark(floor, "FRONT", corners)


# Edge of a front cap, seen from inside, at each wall; on a rear cap left and right are exchanged.
CAP_EDGES = {"floor": "near", "right": "front", "lid": "far", "left": "rear"}
OPPOSITE = {"left": "right", "right": "left", "floor": "floor", "lid": "lid"}


def cap_inset_mm(parts: Catalogue) -> float:
    """Return distance (mm) of a cap's edges from the walls' middle surfaces: film and clearance, so that its tabs fit
    inside.
    """
    return parts.film_mm + parts.assembly.cap_clearance_mm.value


def put_cap(shape: Shape, cap: str, end: str, module: str, outer_mm: Point, slit_mm: float) -> None:
    """Tape a cap into the ``end`` (front or rear) of the beam of ``module``; with ``slit_mm`` > 0 it has a cable
    slit so long.

    The face ``CAP.cap`` is seen from inside, with the edges near (floor), front, far (lid) and rear. ``CAP.flange``
    lies under the lid. x points right on a front cap and left on a rear cap. ``outer_mm`` is the width and height of
    the body.
    """
    parts, assembly, inset = shape.parts, shape.parts.assembly, cap_inset_mm(shape.parts)
    width, height = (wall_mm(size, parts) - 2 * inset for size in outer_mm)
    body, depth = shape.body_of(f"{module}.beam.floor"), assembly.cap_tab_mm.value
    # "front cap 1" is the one of segment 1.
    shape.rectangle(f"{cap}.cap", width, height, piece=cap.rpartition(" ")[0], body=body)
    shape.face(f"{cap}.flange", ((0.0, 0.0), (width, 0.0), (width - depth, depth), (depth, depth)), body=body)
    shape.connect(f"{cap}.cap.far", f"{cap}.flange.0", "fold", 90)
    if slit_mm > 0:
        at = (width / 2, height / 2)
        shape.rectangular_hole(f"{cap}.cap", f"{cap}.slit", "slit", at, slit_mm, assembly.cable_slit_mm.value)
    if end == "front":
        _mark_front(shape, f"{module}.beam.floor")
    for panel, edge in CAP_EDGES.items():
        wall = f"{module}.beam.{panel if end == 'front' else OPPOSITE[panel]}.{end}"
        if panel == "lid":
            shape.touch("tuck", f"{cap}.cap.{edge}", wall)
        else:
            shape.connect(wall, f"{cap}.cap.{edge}", "tab", 90, depth_mm=depth, inset_mm=inset)
