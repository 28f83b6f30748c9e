"""The Feather and the FeatherWing on it: what stands on them, and the room for plugs, fingers and tools.

A board's frame has its origin in the middle of its underside, x away from USB; a mount's has it in the middle of its box.
"""

import math
from collections.abc import Sequence

from foldcar.car.compiler.shape import Shape
from foldcar.car.components.fasteners import driver
from foldcar.car.folded.model import Access, Pose, Solid
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.electronics import Feather, FeatherWing, Plug
from foldcar.car.parts.quantity import Box


def mouth_mm(parts: Catalogue) -> float:
    """Distance of the USB socket's mouth from the middle of its board (mm)."""
    usb = parts.feather.usb
    return usb.size_mm[0] / 2 - usb.at_mm[0]


def plug_room_mm(plug: Plug) -> float:
    """Diameter of the cylinder (mm) that the largest of such plugs passes."""
    return math.hypot(*(size.value + size.tolerance for size in (plug.width_mm, plug.thickness_mm)))


def _plug(plug: Plug) -> tuple[float, float]:
    """Diameter and length of the cylinder (mm) that the largest of such plugs takes."""
    return plug_room_mm(plug), plug.length_mm.value + plug.length_mm.tolerance


def put_feather(shape: Shape, on: str, under: Pose, holes: Sequence[str]) -> None:
    """Add the Feather, ``under`` its board's frame in that of the face ``on``."""
    feather, plugs = shape.parts.feather, shape.parts.plugs
    _, y, z = feather.usb.at_mm
    usb = compose(translation(-mouth_mm(shape.parts), y, z), rotation("y", -math.pi / 2))
    socket = feather.battery_socket
    (along, across, up), (_, reach, _) = socket.at_mm, socket.size_mm
    battery = compose(translation(along, across + reach / 2, up), rotation("x", -math.pi / 2))
    ways = [
        Access("plug", usb, *_plug(plugs.usb)),
        Access("plug", battery, *_plug(plugs.battery)),
    ]
    standing = (*feather.headers, *feather.joints, *feather.small, feather.usb, socket, feather.antenna, feather.reset)
    _put(shape, feather, on, under, standing, ways, holes)


def put_wing(shape: Shape, on: str, under: Pose, holes: Sequence[str]) -> None:
    """Add the wing with the servos' plugs upright in it; ``under`` is the frame of the Feather below it.

    Its reset button stands between plugs, so that a screwdriver's tip presses it, not a finger.
    """
    parts, wing = shape.parts, shape.parts.featherwing
    here = compose(under, translation(0, 0, parts.feather.board_mm.value + wing.gap_mm.value))
    top = wing.plug_top_mm.value + wing.plug_bend_mm.value
    solids, ways = [*wing.headers, wing.terminal_block, wing.reset], []
    for header in wing.servo_headers:
        (x, y, _), low = header.at_mm, wing.board_mm.value
        size = (*header.size_mm[:2], top - low)
        solids.append(header.model_copy(update={"at_mm": (x, y, (top + low) / 2), "size_mm": size}))
        plug = parts.plugs.servo
        ways.append(Access("plug", translation(x, y, top), *_plug(plug)))
    x, y, z = wing.reset.at_mm
    pressed = driver(parts, 0.0)
    above = translation(x, y, z + wing.reset.size_mm[2] / 2)
    ways.append(Access(pressed.tool, above, pressed.diameter_mm, pressed.length_mm))
    _put(shape, wing, on, here, solids, ways, ())


def _put(
    shape: Shape, board: Feather | FeatherWing, on: str, under: Pose, boxes: Sequence[Box], ways: Sequence[Access],
    holes: Sequence[str],
) -> None:  # fmt: skip
    """Add a board; boxes and accesses are given in its own frame."""
    length, width, height = (size.value for size in (board.length_mm, board.width_mm, board.height_mm))
    down = translation(0, 0, -height / 2)
    middle = translation(0, 0, (board.board_mm.value - height) / 2)
    bores = tuple((x, y, several.diameter_mm) for several in board.holes for x, y in several.at_mm)
    plate = Solid("box", (length, width, board.board_mm.value), middle, bores)
    solids = [plate, *(Solid("box", box.size_mm, compose(down, translation(*box.at_mm))) for box in boxes)]
    accesses = [Access(way.tool, compose(down, way.pose), way.diameter_mm, way.length_mm) for way in ways]
    pose, size = compose(under, translation(0, 0, height / 2)), (length, width, height)
    shape.box(board.name, board.name, on, pose, size, board.mass_kg.value, holes, solids, accesses)
