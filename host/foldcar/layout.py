"""Where everything sits in a car's boxes: film panels, servos, boards, batteries.

Input: a Design. Output: placed solid boxes in millimetres, in the car's frame (x forward, y left, z up from
the middle of the car's length at axle height, hinges flat). A part that finds no room is a DesignError.
"""

from dataclasses import dataclass

from foldcar.design import Design, DesignError
from foldcar.parts import BoxPart, catalogue


@dataclass(frozen=True, slots=True)
class PlacedBox:
    """A solid, axis-aligned box of even density: size and middle in millimetres, mass in kilograms.

    ``segment`` is the index of the rigid part of the car that carries it.
    """

    name: str
    mass_kg: float
    size_mm: tuple[float, float, float]
    center_mm: tuple[float, float, float]
    segment: int = 0


def layout(design: Design) -> tuple[PlacedBox, ...]:
    """Everything the segments consist of, wheels excepted."""
    return (*film_panels(design), *hinge_strips(design), *servos(design), *electronics(design))


def film_panels(design: Design) -> tuple[PlacedBox, ...]:
    """The folded box beam of every segment: four sides, the flap of its seam, two end caps."""
    return tuple(
        panel
        for index, segment in enumerate(design.segments)
        for panel in _beam(design, index, segment.center_mm, segment.length_mm)
    )


def _beam(design: Design, segment: int, middle: float, length: float) -> tuple[PlacedBox, ...]:
    film, flap = catalogue().film, catalogue().assembly.lap_flap_mm.value
    t = film.thickness_mm.value
    width, height = design.values["width"], design.values["height"]
    side, floor, end = (width - t) / 2, (height - t) / 2, (length - t) / 2

    def panel(
        name: str, size: tuple[float, float, float], x: float = 0, y: float = 0, z: float = 0
    ) -> PlacedBox:
        return PlacedBox(name, _film_kg(size), size, (middle + x, y, z), segment)

    return (
        panel("floor", (length, width, t), z=-floor),
        panel("lid", (length, width, t), z=floor),
        panel("left side", (length, t, height), y=side),
        panel("right side", (length, t, height), y=-side),
        # The seam's flap lies along one edge of the floor; its pull to that side, under 0.2 mm of the
        # centre of mass, is less than any other part's place is known to, so it is put in the middle.
        panel("seam flap", (length, flap, t), z=-floor + t),
        panel("front cap", (t, width, height), x=end),
        panel("rear cap", (t, width, height), x=-end),
    )


def hinge_strips(design: Design) -> tuple[PlacedBox, ...]:
    """Each hinge's strip at axle height, half of it with the segment before and half with the one after."""
    if not design.hinges_mm:
        return ()
    half, thickness = design.values["H.length"] / 2, design.values["H.thickness"]
    size = (half, design.values["width"], thickness)
    return tuple(
        PlacedBox("hinge strip", _film_kg(size), size, (x + sign * half / 2, 0, 0), index + (sign < 0))
        for index, x in enumerate(design.hinges_mm)
        for sign in (1, -1)
    )


def servos(design: Design) -> tuple[PlacedBox, ...]:
    """Two servos an axle, left then right, inside their walls, short ends away from its segment's middle."""
    servo, wall = catalogue().servo, catalogue().film.thickness_mm.value
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value
    inward = length / 2 - servo.axis_from_end_mm.value
    y = design.values["width"] / 2 - wall - depth / 2
    size = (length, depth, width)
    placed = []
    for x, index in zip(design.axles_mm, design.axle_segments, strict=True):
        middle = x - inward if x > design.segments[index].center_mm else x + inward
        placed += [
            PlacedBox(servo.name, servo.mass_kg.value, size, (middle, side * y, 0), index) for side in (1, -1)
        ]
    return tuple(placed)


def electronics(design: Design) -> tuple[PlacedBox, ...]:
    """Boards and batteries in the first body module.

    The board stack stands on the floor with the LiPo under it. The servos' battery hangs under the lid, where
    its cells can be changed; where the car is too low for that, it lies on the floor behind the boards.
    """
    parts, wall = catalogue(), catalogue().film.thickness_mm.value
    stack = (parts.lipo, parts.feather, parts.featherwing)
    stack_length = max(part.length_mm.value for part in stack)
    stack_height = sum(part.height_mm.value for part in stack)
    module = design.modules.index("B")
    middle, segment = design.module_centers_mm[module], design.segment_at(module)
    room = design.values["B.length"]
    inside_height = design.values["height"] - 2 * wall
    floor, lid = -inside_height / 2, inside_height / 2

    stacked = stack_height + parts.battery.height_mm.value <= inside_height
    for_battery = room if stacked else room - stack_length
    turned = parts.battery.length_mm.value > for_battery
    battery = _size(parts.battery, turned)
    if inside_height < stack_height:
        raise DesignError("height", _too_small(design, "height", stack_height + 2 * wall, "the board stack"))
    if for_battery < battery[0] or room < stack_length:
        needed = max(stack_length, battery[0]) if stacked else stack_length + battery[0]
        what = (
            "the batteries and boards"
            if stacked
            else f"the battery behind the boards at height {design.values['height']:g}"
        )
        raise DesignError("B.length", _too_small(design, "B.length", needed, what))
    if design.values["width"] - 2 * wall < battery[1]:
        what = f"the {parts.battery.name} at B.length {room:g}"
        raise DesignError("width", _too_small(design, "width", battery[1] + 2 * wall, what))

    if stacked:
        stack_x, battery_x, battery_z = middle, middle, lid - battery[2] / 2
    else:
        stack_x = middle + (room - stack_length) / 2
        battery_x, battery_z = middle - (room - battery[0]) / 2, floor + battery[2] / 2

    def place(part: BoxPart, size: tuple[float, float, float], x: float, z: float) -> PlacedBox:
        return PlacedBox(part.name, part.mass_kg.value, size, (x, 0, z), segment)

    placed = [place(parts.battery, battery, battery_x, battery_z)]
    bottom = floor
    for part in stack:
        size = _size(part)
        placed.append(place(part, size, stack_x, bottom + size[2] / 2))
        bottom += size[2]
    placed.append(place(parts.wiring, _size(parts.wiring), middle, 0))
    return tuple(placed)


def _film_kg(size_mm: tuple[float, float, float]) -> float:
    return size_mm[0] * size_mm[1] * size_mm[2] * 1e-9 * catalogue().film.density_kg_m3.value


def _size(part: BoxPart, turned: bool = False) -> tuple[float, float, float]:
    along, across = part.length_mm.value, part.width_mm.value
    return (across, along, part.height_mm.value) if turned else (along, across, part.height_mm.value)


def _too_small(design: Design, key: str, needed: float, what: str) -> str:
    return f"{design.values[key]:g} is below the minimum {needed:g} ({what})"
