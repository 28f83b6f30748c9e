"""A bridge over the LiPo that carries the boards: a shelf across the car on two legs, whose feet are taped to the floor.

A flange at one of its long edges has a tongue through the floor. It holds the bridge against the push and pull of a USB
plug, which would fold the legs over. The bridge drops in from above with the boards screwed on.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

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
# Distance of a flange's ends from the legs' feet.
FOOT_CLEARANCE_MM = 0.5


def half_width_mm(parts: Catalogue) -> float:
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


def span_mm(parts: Catalogue) -> tuple[float, float]:
    """Return distances of the bridge's ends from the boards' middle (mm): on the side of USB, and on the other."""
    assembly = parts.assembly
    at_wall = mouth_mm(parts) + assembly.usb_inside_mm.value - assembly.bridge_gap_mm.value
    return at_wall, parts.feather.length_mm.value / 2 + assembly.bridge_gap_mm.value


def middle_mm(parts: Catalogue, y_mm: float) -> float:
    """y (mm) of the bridge's middle if the middle of its boards is at ``y_mm``."""
    left, right = span_mm(parts)
    return y_mm + (left - right) / 2


def put_bridge(shape: Shape, floor: str, x_mm: float, y_mm: float, side: int) -> None:
    """Add the bridge that carries the boards over the LiPo, and the boards on it, to the face ``floor``.

    The middle of the boards is at (x, y), with USB towards +y. The faces are ``bridge.shelf`` (x forward, its origin
    at its right rear corner), a leg and a foot on each side, and ``bridge.flange``, at the front edge if ``side`` is
    1 and at the rear edge if it is -1.
    """
    parts, assembly, film = shape.parts, shape.parts.assembly, shape.parts.film_mm
    half_length, (_, right_span), shelf_z = half_width_mm(parts), span_mm(parts), shelf_height_mm(parts)
    length, width = 2 * half_length, sum(span_mm(parts))
    shape.rectangle("bridge.shelf", length, width, piece="bridge")
    for leg, edge in (("right", "near"), ("left", "far")):
        # The feet lie on the floor, the flange ends above it.
        shape.rectangle(f"bridge.{leg} leg", length, shelf_z - film)
        shape.rectangle(f"bridge.{leg} foot", length, assembly.bridge_foot_mm.value)
        shape.connect(f"bridge.shelf.{edge}", f"bridge.{leg} leg.near", "fold", -90)
        shape.connect(f"bridge.{leg} leg.far", f"bridge.{leg} foot.near", "fold", -90)
    # The flange hangs down from the shelf's edge; from its middle a tongue reaches through the floor.
    inset, depth = assembly.bridge_foot_mm.value + FOOT_CLEARANCE_MM, shelf_z - film / 2 - assembly.cap_clearance_mm.value
    tip = shelf_z + film / 2 + assembly.floor_tongue_reach_mm.value
    tongue_start, tongue_end = (width / 2 + sign * assembly.tongue_mm.value / 2 for sign in (-1, 1))
    points = {
        "near": (0.0, 0.0), "1": (width, 0.0), "2": (width - inset, depth), "3": (tongue_end, depth),
        "tip": (tongue_end, tip), "5": (tongue_start, tip), "6": (tongue_start, depth), "7": (inset, depth),
    }  # fmt: skip
    shape.face("bridge.flange", points)
    shape.connect("bridge.shelf.front" if side > 0 else "bridge.shelf.rear", "bridge.flange.near", "fold", -90)
    shape.place("bridge.shelf", floor, translation(x_mm - half_length, y_mm - right_span, shelf_z))
    for leg in ("right", "left"):
        shape.touch("laminate", f"bridge.{leg} foot", floor)
    slot_center, play = (x_mm + side * half_length, middle_mm(parts, y_mm)), assembly.slot_clearance_mm.value
    shape.rectangular_hole(floor, "bridge slot", "slot", slot_center, film + play, assembly.tongue_mm.value + 2 * play)
    shape.touch("tab_slot", "bridge.flange.tip", floor, "bridge slot")
    _add_boards_with_fasteners(shape, "bridge.shelf", (half_length, right_span))


def _add_boards_with_fasteners(shape: Shape, shelf: str, middle: tuple[float, float]) -> None:
    """Add the boards on the shelf: spacers and screws at two holes of the Feather, a foam pad under its other end.

    ``middle`` is the middle of the boards on the shelf. There are no screws at the other holes, because the radio
    module covers them in part. The pad is pressed to the height of the spacers.
    """
    parts, film = shape.parts, shape.parts.film_mm
    feather, spacer = parts.feather, parts.spacer
    holes, height = [], spacer.length_mm.value
    size = (spacer.diameter_mm.value, spacer.diameter_mm.value, height)
    # The board's x points to -y of the shelf, as USB points to +y: it is turned by -90°.
    for i, (x, y) in enumerate(((y, -x) for x, y in feather.free_holes(parts.board_screw)), 1):
        position = (middle[0] + x, middle[1] + y)
        holes.append(shape.round_hole(shelf, f"board screw {i}", "screw", position, parts.assembly.screw_hole_mm.value))
        pose = translation(*position, (film + height) / 2)
        spacer_solids = (cylinder(spacer.diameter_mm.value, -height / 2, height / 2, bore_mm=spacer.hole_mm.value),)
        shape.box(spacer.name, f"spacer {i}", shelf, pose, size, spacer.mass_kg.value, (), spacer_solids)
        under_head = compose(translation(*position, -film / 2), rotation("x", math.pi))
        add_screw(shape, parts.board_screw, f"board screw {i}", shelf, under_head, film + height + feather.board_mm.value)
    pad = parts.board_pad
    size = (pad.width_mm.value, pad.length_mm.value, height)
    pose = translation(middle[0], middle[1] - (feather.length_mm.value - pad.length_mm.value) / 2, (film + height) / 2)
    shape.box(pad.name, pad.name, shelf, pose, size, pad.mass_kg.value)
    _put_boards(shape, shelf, compose(translation(*middle, film / 2 + height), rotation("z", -math.pi / 2)), holes)


def option_resistors(parts: Catalogue) -> dict[str, Point]:
    """Return the middle (x, y) of each resistor below the Feather, in the Feather's frame (mm), by its value as text."""
    feather, length = parts.feather, parts.resistor.length_mm.value
    resistors: dict[str, Point] = {}
    if parts.divider == "fitted":
        # The lower one lies between the legs of its pin and of GND, the upper one goes on towards the other end.
        (pin_x, row_y), (ground_x, _) = feather.pin_mm(DIVIDER_PIN), feather.pin_mm("GND")
        resistors[DIVIDER_LOWER] = ((pin_x + ground_x) / 2, row_y + RESISTOR_BESIDE_MM)
        resistors[DIVIDER_UPPER] = (pin_x + 1.0 + length / 2, row_y + RESISTOR_BESIDE_MM)
    if parts.oe_wire == "fitted":
        (pin_x, row_y), (supply_x, _) = feather.pin_mm(OE_PIN), feather.pin_mm("3V")
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
    """Add the Feather and the wing with the plugs of the servos.

    ``under`` is the pose of the Feather in the face ``on``.
    """
    parts, feather, wing = shape.parts, shape.parts.feather, shape.parts.featherwing

    def plug(name: str, pose: Pose) -> ToolClearance:
        data: PartData = getattr(parts.plugs, name)
        return ToolClearance("plug", pose, plug_room_mm(data), data.length_mm.max_value)

    (_, y, z), socket = feather.usb.at_mm, feather.battery_socket
    usb_plug_pose = compose(translation(-mouth_mm(parts), y, z), rotation("y", -math.pi / 2))
    (along, across, up), (_, reach, _) = socket.at_mm, socket.size_mm
    battery_plug_pose = compose(translation(along, across + reach / 2, up), rotation("x", -math.pi / 2))
    _put_board(
        shape,
        feather,
        on,
        under,
        (*feather.standing, *feather.joints(parts.headers)),
        [plug("usb", usb_plug_pose), plug("battery", battery_plug_pose)],
        holes,
        [
            Box(at_mm=(x, y, -RESISTOR_DOWN_MM), size_mm=parts.resistor.size_mm, tolerance=1.0, source="chosen")
            for x, y in option_resistors(parts).values()
        ],
    )
    # The servos' plugs stand upright with their leads bent over them: each is one solid with its header.
    plugs_top_mm, plugs_bottom_mm = wing.plug_top_mm.value + wing.plug_bend_mm.value, wing.board_mm.value
    solids, clearances = [*wing.headers, wing.terminal_block, wing.reset], []
    for header in wing.servo_headers:
        (x, y, _), size = header.at_mm, (*header.size_mm[:2], plugs_top_mm - plugs_bottom_mm)
        solids.append(header.model_copy(update={"at_mm": (x, y, (plugs_top_mm + plugs_bottom_mm) / 2), "size_mm": size}))
        clearances.append(plug("servo", translation(x, y, plugs_top_mm)))
    # The reset button stands between plugs, so that a screwdriver's tip presses it, not a finger.
    x, y, z = wing.reset.at_mm
    clearances.append(ToolClearance("driver", translation(x, y, z + wing.reset.size_mm[2] / 2), *parts.tools.driver_mm))
    _put_board(
        shape,
        wing,
        on,
        compose(under, translation(0, 0, feather.board_mm.value + wing.gap_mm.value)),
        solids,
        clearances,
        (),
        wing.pins,
    )


def _put_board(
    shape: Shape, board: Feather | FeatherWing, on: str, under: Pose, boxes: Sequence[Box],
    clearances: Sequence[ToolClearance], holes: Sequence[str], pins: Sequence[Box] = (),
) -> None:  # fmt: skip
    """Add a board on the face ``on``; ``under`` is the pose of the middle of its underside, which is the board's frame.

    ``boxes``, weightless ``pins`` and ``clearances`` are in the frame of the board. ``holes`` are those of its
    screws.
    """
    length, width, height = board.size_mm
    # From the frame of the mount, the middle of its box, to the board's frame, on its underside.
    down = translation(0, 0, -height / 2)
    middle = translation(0, 0, (board.board_mm.value - height) / 2)
    screw_holes = tuple((x, y, pattern.diameter_mm) for pattern in board.holes for x, y in pattern.at_mm)
    plate = Solid("box", (length, width, board.board_mm.value), middle, screw_holes)
    solids = [plate, *(Solid("box", box.size_mm, compose(down, translation(*box.at_mm))) for box in boxes)]
    solids += [Solid("box", pin.size_mm, compose(down, translation(*pin.at_mm)), weightless=True) for pin in pins]
    clearances = [replace(clearance, pose=compose(down, clearance.pose)) for clearance in clearances]
    pose = compose(under, translation(0, 0, height / 2))
    shape.box(board.name, board.name, on, pose, board.size_mm, board.mass_kg.value, holes, solids, clearances)
