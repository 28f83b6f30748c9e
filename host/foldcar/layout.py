"""Where everything sits in a car's body box: film panels, servos, boards, batteries.

Input: a Design. Output: placed solid boxes in millimetres, in the car's frame (x forward, y left, z up from
the middle of the body box at axle height). A part that finds no room is a DesignError.
"""

from dataclasses import dataclass

from foldcar.design import Design, DesignError
from foldcar.parts import BoxPart, catalogue


@dataclass(frozen=True, slots=True)
class PlacedBox:
    """A solid, axis-aligned box of even density: size and middle in millimetres, mass in kilograms."""

    name: str
    mass_kg: float
    size_mm: tuple[float, float, float]
    center_mm: tuple[float, float, float]


def layout(design: Design) -> tuple[PlacedBox, ...]:
    """Everything the chassis consists of, wheels excepted."""
    return (*film_panels(design), *servos(design), *electronics(design))


def film_panels(design: Design) -> tuple[PlacedBox, ...]:
    """The folded box beam: four sides, the flap of its seam, two end caps."""
    film, flap = catalogue().film, catalogue().assembly.lap_flap_mm.value
    t = film.thickness_mm.value
    length, width, height = design.length_mm, design.values["width"], design.values["height"]
    side, floor, end = (width - t) / 2, (height - t) / 2, (length - t) / 2

    def panel(name: str, size: tuple[float, float, float], center: tuple[float, float, float]) -> PlacedBox:
        mass_kg = size[0] * size[1] * size[2] * 1e-9 * film.density_kg_m3.value
        return PlacedBox(name, mass_kg, size, center)

    return (
        panel("floor", (length, width, t), (0, 0, -floor)),
        panel("lid", (length, width, t), (0, 0, floor)),
        panel("left side", (length, t, height), (0, side, 0)),
        panel("right side", (length, t, height), (0, -side, 0)),
        # The seam's flap lies along one edge of the floor; its pull to that side, under 0.2 mm of the
        # centre of mass, is less than the model can express, so it is put in the middle.
        panel("seam flap", (length, flap, t), (0, 0, -floor + t)),
        panel("front cap", (t, width, height), (end, 0, 0)),
        panel("rear cap", (t, width, height), (-end, 0, 0)),
    )


def servos(design: Design) -> tuple[PlacedBox, ...]:
    """Two servos an axle, left then right, inside their walls, the short end away from the car's middle."""
    servo, wall = catalogue().servo, catalogue().film.thickness_mm.value
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value
    inward = length / 2 - servo.axis_from_end_mm.value
    y = design.values["width"] / 2 - wall - depth / 2
    size = (length, depth, width)
    return tuple(
        PlacedBox(servo.name, servo.mass_kg.value, size, (x - inward if x > 0 else x + inward, side * y, 0))
        for x in design.axles_mm
        for side in (1, -1)
    )


def electronics(design: Design) -> tuple[PlacedBox, ...]:
    """Boards and batteries in the first body module.

    The board stack stands on the floor with the LiPo under it. The servos' battery hangs under the lid, where
    its cells can be changed; where the car is too low for that, it lies on the floor behind the boards.
    """
    parts, wall = catalogue(), catalogue().film.thickness_mm.value
    stack = (parts.lipo, parts.feather, parts.featherwing)
    stack_length = max(part.length_mm.value for part in stack)
    stack_height = sum(part.height_mm.value for part in stack)
    middle = design.module_centers_mm[design.modules.index("B")]
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
    placed = [PlacedBox(parts.battery.name, parts.battery.mass_kg.value, battery, (battery_x, 0, battery_z))]
    bottom = floor
    for part in stack:
        size = _size(part)
        placed.append(PlacedBox(part.name, part.mass_kg.value, size, (stack_x, 0, bottom + size[2] / 2)))
        bottom += size[2]
    placed.append(
        PlacedBox(parts.wiring.name, parts.wiring.mass_kg.value, _size(parts.wiring), (middle, 0, 0))
    )
    return tuple(placed)


def _size(part: BoxPart, turned: bool = False) -> tuple[float, float, float]:
    along, across = part.length_mm.value, part.width_mm.value
    return (across, along, part.height_mm.value) if turned else (along, across, part.height_mm.value)


def _too_small(design: Design, key: str, needed: float, what: str) -> str:
    return f"{design.values[key]:g} is below the minimum {needed:g} ({what})"
