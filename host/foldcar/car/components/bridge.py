"""A bridge over the LiPo that carries the boards: a shelf across the car on two legs, whose feet are taped to the floor.

A flange at one of its long edges has a tongue through the floor. It holds the bridge against the push and pull of a USB
plug, which would fold the legs over. The bridge drops in from above with the boards screwed on.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from foldcar.car.components.mounts import add_screw, cylinder
from foldcar.car.components.shape import Shape
from foldcar.car.folded.model import Point, Pose, Solid, ToolClearance
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Feather, FeatherWing
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Box, PartData

# The options' resistors, by their values.
DIVIDER_UPPER, DIVIDER_LOWER, OE_PULL_UP = "20 kΩ resistor", "10 kΩ resistor", "2.2 kΩ resistor"
# The options' pins of the Feather, as in the firmware's feather_board.cpp, feather_hal.h and output_gate.h.
BUTTON_PIN, DIVIDER_PIN, OE_PIN = "32", "34", "27"
# Resistors are soldered below the Feather, beside its legs: height of their middles below the board, distance from a row.
RESISTOR_DOWN_MM, RESISTOR_BESIDE_MM = 2.0, 3.6
# Distance along the row from the leg of a pin to the end of a resistor beside it, for the bend of the wire; chosen.
RESISTOR_FROM_LEG_MM = 1.0
# Distance of a flange's ends from the legs' feet.
FOOT_CLEARANCE_MM = 0.5


def half_length_mm(parts: Catalogue) -> float:
    """Return half of the bridge's length along the car (mm), with room for the boards and film around their screws."""
    feather, assembly = parts.feather, parts.assembly
    screw_offset = max(abs(y) for _, y in feather.free_holes(parts.board_screw))
    hole_margin = assembly.screw_hole_mm.value / 2 + assembly.fold_distance_mm.value
    return max(feather.width_mm.value / 2, screw_offset + hole_margin)


def shelf_height_mm(parts: Catalogue) -> float:
    """Return how high (mm) the middle of the shelf's film is above that of the floor.

    The LiPo and screw heads lie below it.
    """
    return parts.film_mm + parts.lipo.height_mm.value + parts.assembly.shelf_clearance_mm.value


def usb_height_mm(parts: Catalogue) -> float:
    """Return height of the USB socket's middle over the floor's middle surface (mm)."""
    on_shelf = parts.film_mm / 2 + parts.spacer.length_mm.value
    return shelf_height_mm(parts) + on_shelf + parts.feather.usb.at_mm[2]


def stack_height_mm(parts: Catalogue) -> float:
    """Return height from the floor's middle surface to the bends of the leads over the servos' plugs (mm)."""
    feather, wing = parts.feather, parts.featherwing
    boards = feather.board_mm.value + wing.gap_mm.value + wing.plug_top_mm.value + wing.plug_bend_mm.value
    return shelf_height_mm(parts) + parts.film_mm / 2 + parts.spacer.length_mm.value + boards


class BridgeSpan(NamedTuple):
    """How far the bridge extends across the car from the middle of its boards (mm): to the left and to the right.

    The USB socket is at the left.
    """

    left_mm: float
    right_mm: float


def bridge_span(parts: Catalogue) -> BridgeSpan:
    """Return how far the bridge extends to the left and to the right of the middle of its boards (mm)."""
    assembly = parts.assembly
    left_mm = mouth_mm(parts) + assembly.usb_inside_mm.value - assembly.bridge_gap_mm.value
    return BridgeSpan(left_mm, right_mm=parts.feather.length_mm.value / 2 + assembly.bridge_gap_mm.value)


def middle_mm(parts: Catalogue, y_mm: float) -> float:
    """Return y (mm) of the bridge's middle if the middle of its boards is at ``y_mm``."""
    span = bridge_span(parts)
    return y_mm + (span.left_mm - span.right_mm) / 2


def put_bridge(shape: Shape, floor: str, x_mm: float, y_mm: float, side: int) -> None:
    """Add the bridge over the LiPo to the face ``floor``, and the boards that it carries.

    The bridge is a shelf on two legs with feet, and a flange that hangs down from the shelf's front edge if ``side`` is
    1, or from its rear edge if ``side`` is -1. The middle of the boards is at (``x_mm``, ``y_mm``) in the floor's frame,
    where x points forward, y to the left and z up. The boards' USB socket is at the left.
    """
    parts, half_length, shelf_z = shape.parts, half_length_mm(shape.parts), shelf_height_mm(shape.parts)
    span = bridge_span(parts)
    width = span.left_mm + span.right_mm
    _add_shelf_and_legs(shape, 2 * half_length, width, shelf_z)
    _add_flange(shape, width, shelf_z, shelf_edge="front" if side > 0 else "rear")
    # The origin of the shelf's frame is its right rear corner, and its axes point as those of the floor. The feet are
    # glued to the floor.
    shape.place("bridge.shelf", floor, translation(x_mm - half_length, y_mm - span.right_mm, shelf_z))
    for leg in ("right", "left"):
        shape.touch("laminate", f"bridge.{leg} foot", floor)
    # The slot in the floor for the tongue of the flange, under the middle of the flange.
    play = parts.assembly.slot_clearance_mm.value
    slot_center = (x_mm + side * half_length, middle_mm(parts, y_mm))
    slot_size = (parts.film_mm + play, parts.assembly.tongue_mm.value + 2 * play)
    shape.rectangular_hole(floor, "bridge slot", "slot", slot_center, *slot_size)
    shape.touch("tab_slot", "bridge.flange.tip", floor, "bridge slot")
    boards_middle = (half_length, span.right_mm)
    _add_boards_with_fasteners(shape, "bridge.shelf", boards_middle)


def _add_shelf_and_legs(shape: Shape, length: float, width: float, shelf_z: float) -> None:
    """Add the shelf of the bridge, and at its right and its left end a leg folded down and a foot folded outwards.

    ``length`` is the shelf's size along the car and ``width`` its size across. All are faces of plastic film. ``shelf_z``
    is the height of the shelf above the floor, measured between the middles of their thicknesses.
    """
    shape.rectangle("bridge.shelf", length, width, piece="bridge")
    for leg, shelf_edge in (("right", "near"), ("left", "far")):
        # A foot lies on the floor, so the leg ends one film above the floor's middle.
        shape.rectangle(f"bridge.{leg} leg", length, shelf_z - shape.parts.film_mm)
        shape.rectangle(f"bridge.{leg} foot", length, shape.parts.assembly.bridge_foot_mm.value)
        shape.connect(f"bridge.shelf.{shelf_edge}", f"bridge.{leg} leg.near", "fold", -90)
        shape.connect(f"bridge.{leg} leg.far", f"bridge.{leg} foot.near", "fold", -90)


def _add_flange(shape: Shape, width: float, shelf_z: float, shelf_edge: str) -> None:
    """Add the flange that hangs down from the shelf, with a tongue in its middle that reaches through the floor.

    ``shelf_edge`` is the edge of the shelf from which it hangs, ``front`` or ``rear``, and ``width`` the length of this
    edge. In the flange's frame, x runs along this edge and y points down. All are faces of plastic film. ``shelf_z`` is
    the height of the shelf above the floor, measured between the middles of their thicknesses.
    """
    assembly, film = shape.parts.assembly, shape.parts.film_mm
    # The flange becomes narrower towards its lower edge, which ends just above the floor and between the bridge's feet.
    lower_y = shelf_z - film / 2 - assembly.cap_clearance_mm.value
    lower_start = assembly.bridge_foot_mm.value + FOOT_CLEARANCE_MM
    lower_end = width - lower_start
    # The tongue reaches from the lower edge through the floor.
    tip_y = shelf_z + film / 2 + assembly.floor_tongue_reach_mm.value
    tongue_start = width / 2 - assembly.tongue_mm.value / 2
    tongue_end = width / 2 + assembly.tongue_mm.value / 2
    # The corners around the flange. Each has the name of the edge that begins at it; edges that need no name have a
    # number.
    corners = {
        "near": (0.0, 0.0), "1": (width, 0.0), "2": (lower_end, lower_y), "3": (tongue_end, lower_y),
        "tip": (tongue_end, tip_y), "5": (tongue_start, tip_y), "6": (tongue_start, lower_y), "7": (lower_start, lower_y),
    }  # fmt: skip
    shape.face("bridge.flange", corners)
    shape.connect(f"bridge.shelf.{shelf_edge}", "bridge.flange.near", "fold", -90)


def _add_boards_with_fasteners(shape: Shape, shelf: str, middle: Point) -> None:
    """Add the boards and what holds them on the shelf.

    One end of the lower board, the Feather, is held by two screws with spacers. The other end stands on a pad of foam,
    because the radio module covers part of the holes there. The pad is pressed to the height of the spacers. ``middle``
    is the point of the shelf under the middle of the boards. In the shelf's frame x points forward, y to the left and z
    up.
    """
    parts, film, feather = shape.parts, shape.parts.film_mm, shape.parts.feather
    middle_x, middle_y = middle
    height = parts.spacer.length_mm.value
    # The spacers and screws.
    screw_holes = []
    for number, (board_x, board_y) in enumerate(feather.free_holes(parts.board_screw), 1):
        # The board's own x points away from its USB socket, which is at the left. So the board is turned by -90°: its x
        # points along -y of the shelf, and its y along +x.
        at_mm = (middle_x + board_y, middle_y - board_x)
        name = f"board screw {number}"
        screw_holes.append(shape.round_hole(shelf, name, "screw", at_mm, parts.assembly.screw_hole_mm.value))
        _add_spacer(shape, shelf, f"spacer {number}", at_mm)
        # The screw comes from below and holds shelf, spacer and board.
        under_head = compose(translation(*at_mm, -film / 2), rotation("x", math.pi))
        grip_mm = film + height + feather.board_mm.value
        add_screw(shape, parts.board_screw, name, shelf, under_head, grip_mm)
    # The pad ends below the right end of the Feather.
    pad = parts.board_pad
    pad_y = middle_y - (feather.length_mm.value - pad.length_mm.value) / 2
    pad_pose = translation(middle_x, pad_y, (film + height) / 2)
    pad_size = (pad.width_mm.value, pad.length_mm.value, height)
    shape.box(pad.name, pad.name, shelf, pad_pose, pad_size, pad.mass_kg.value)
    # The boards lie on the spacers.
    spacer_top = translation(middle_x, middle_y, film / 2 + height)
    board_pose = compose(spacer_top, rotation("z", -math.pi / 2))
    _put_boards(shape, shelf, board_pose, screw_holes)


def _add_spacer(shape: Shape, shelf: str, name: str, at_mm: Point) -> None:
    """Add a spacer that stands on the shelf at a point."""
    spacer = shape.parts.spacer
    diameter, height = spacer.diameter_mm.value, spacer.length_mm.value
    pose = translation(*at_mm, (shape.parts.film_mm + height) / 2)
    solid = cylinder(diameter, -height / 2, height / 2, bore_mm=spacer.hole_mm.value)
    size = (diameter, diameter, height)
    shape.box(spacer.name, name, shelf, pose, size, spacer.mass_kg.value, solids=[solid])


def option_resistors(parts: Catalogue) -> dict[str, Point]:
    """Return the places of the resistors that are soldered below the Feather for the options of a car.

    A resistor is known by its value, as text. Its place is its middle (x, y) in the Feather's frame (mm).
    """
    feather, length = parts.feather, parts.resistor.length_mm.value
    resistors: dict[str, Point] = {}
    if parts.divider == "fitted":
        pin_x, row_y = feather.pin_mm(DIVIDER_PIN)
        ground_x, _ = feather.pin_mm("GND")
        # Both resistors lie along the pins' row. The lower one is between the leg of its pin and that of GND, the upper
        # one on the other side of the pin.
        resistors[DIVIDER_LOWER] = ((pin_x + ground_x) / 2, row_y + RESISTOR_BESIDE_MM)
        resistors[DIVIDER_UPPER] = (pin_x + RESISTOR_FROM_LEG_MM + length / 2, row_y + RESISTOR_BESIDE_MM)
    if parts.oe_wire == "fitted":
        pin_x, row_y = feather.pin_mm(OE_PIN)
        supply_x, _ = feather.pin_mm("3V")
        resistors[OE_PULL_UP] = ((pin_x + supply_x) / 2, row_y - RESISTOR_BESIDE_MM)
    return resistors


def mouth_mm(parts: Catalogue) -> float:
    """Return distance of the USB socket's mouth from the middle of its board (mm)."""
    usb = parts.feather.usb
    return usb.size_mm[0] / 2 - usb.at_mm[0]


def plug_room_mm(plug: PartData) -> float:
    """Return diameter of the cylinder (mm) that the largest plug of this kind passes through."""
    return math.hypot(plug.width_mm.max_value, plug.thickness_mm.max_value)


def _put_boards(shape: Shape, on: str, under: Pose, holes: Sequence[str]) -> None:
    """Add the Feather, and on it the wing with the plugs of the servos.

    ``under`` is the pose of the Feather in the frame of the face ``on``, and ``holes`` are those of the Feather's screws.
    """
    parts, feather, wing = shape.parts, shape.parts.feather, shape.parts.featherwing

    def plug(name: str, pose: Pose) -> ToolClearance:
        data: PartData = getattr(parts.plugs, name)
        return ToolClearance("plug", pose, plug_room_mm(data), data.length_mm.max_value)

    _, usb_y, usb_z = feather.usb.at_mm
    usb_plug_pose = compose(translation(-mouth_mm(parts), usb_y, usb_z), rotation("y", -math.pi / 2))
    socket = feather.battery_socket
    socket_x, socket_y, socket_z = socket.at_mm
    socket_mouth = translation(socket_x, socket_y + socket.size_mm[1] / 2, socket_z)
    battery_plug_pose = compose(socket_mouth, rotation("x", -math.pi / 2))
    resistors = []
    for x, y in option_resistors(parts).values():
        at_mm = (x, y, -RESISTOR_DOWN_MM)
        resistors.append(Box(at_mm=at_mm, size_mm=parts.resistor.size_mm, tolerance=1.0, source="chosen"))
    _put_board(
        shape,
        feather,
        on,
        under,
        boxes=(*feather.standing, *feather.joints(parts.headers)),
        clearances=[plug("usb", usb_plug_pose), plug("battery", battery_plug_pose)],
        holes=holes,
        pins=resistors,
    )
    # The servos' plugs stand upright with their leads bent over them: each is one solid with its header.
    bottom_z, top_z = wing.board_mm.value, wing.plug_top_mm.value + wing.plug_bend_mm.value
    boxes, clearances = [*wing.headers, wing.terminal_block, wing.reset], []
    for header in wing.servo_headers:
        x, y, _ = header.at_mm
        length, width, _ = header.size_mm
        changes = {"at_mm": (x, y, (top_z + bottom_z) / 2), "size_mm": (length, width, top_z - bottom_z)}
        boxes.append(header.model_copy(update=changes))
        clearances.append(plug("servo", translation(x, y, top_z)))
    # The reset button stands between plugs, so that a screwdriver's tip presses it, not a finger.
    x, y, z = wing.reset.at_mm
    reset_top = translation(x, y, z + wing.reset.size_mm[2] / 2)
    clearances.append(ToolClearance("driver", reset_top, *parts.tools.driver_mm))
    on_feather = compose(under, translation(0, 0, feather.board_mm.value + wing.gap_mm.value))
    _put_board(shape, wing, on, on_feather, boxes=boxes, clearances=clearances, holes=(), pins=wing.pins)


def _put_board(
    shape: Shape, board: Feather | FeatherWing, on: str, under: Pose, *, boxes: Sequence[Box],
    clearances: Sequence[ToolClearance], holes: Sequence[str], pins: Sequence[Box],
) -> None:  # fmt: skip
    """Add a board on the face ``on``.

    The origin of the board's frame is in the middle of its underside, and z points up. ``under`` is the pose of this
    frame in that of the face. ``boxes`` are the components on the board, ``pins`` have no mass of their own, and
    ``clearances`` are the places that must be free for tools: all three are given in the board's frame. ``holes`` are
    the names of the holes in the face for the board's screws. A board becomes a *mount*, whose frame begins in the
    middle of its height.
    """
    length, width, height = board.size_mm
    plate_height = board.board_mm.value
    board_in_mount = translation(0, 0, -height / 2)
    # The plate of the board, with its holes, lies at the bottom of the mount.
    bores: list[tuple[float, float, float]] = []
    for pattern in board.holes:
        bores += ((x, y, pattern.diameter_mm) for x, y in pattern.at_mm)
    plate_pose = translation(0, 0, (plate_height - height) / 2)
    solids = [Solid("box", (length, width, plate_height), plate_pose, tuple(bores))]
    # What stands on the plate or below it.
    for box in boxes:
        solids.append(Solid("box", box.size_mm, compose(board_in_mount, translation(*box.at_mm))))
    for pin in pins:
        solids.append(Solid("box", pin.size_mm, compose(board_in_mount, translation(*pin.at_mm)), weightless=True))
    mount_clearances = [replace(clearance, pose=compose(board_in_mount, clearance.pose)) for clearance in clearances]
    pose = compose(under, translation(0, 0, height / 2))
    shape.box(
        board.name, board.name, on, pose, board.size_mm, board.mass_kg.value, holes=holes, solids=solids,
        clearances=mount_clearances,
    )  # fmt: skip
