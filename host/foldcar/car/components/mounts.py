"""Mounts of servo, rod, switch and ball caster in walls, caps and floors, with layers of film behind them; screws.

A servo is inserted from outside until its ears lie on the wall. Its shaft points outwards, its length runs along the
wall. A rod passes both walls and carries wheels that turn freely. A switch snaps into an end cap. A caster is screwed
under the floor of a user's module. The simulator has contacts for wheels and bellies only, so a caster is mass without
contact there. A screw's frame has its origin in the middle of its length, z along its axis towards its head.
"""

import math

from foldcar.car.components.shape import Shape, on_circle, rectangle_around
from foldcar.car.folded.model import IDENTITY, Point, Pose, Solid, ToolClearance
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity

# Sides of a notch's round end.
ARC_STEPS = 24


def servo_reach_mm(parts: Catalogue) -> tuple[float, float]:
    """Return distance (mm) from the axis to the end of the servo's layer or nut, on its long side and on its short
    side.
    """
    servo, nut = parts.servo, parts.screw.nut_width_mm
    axis_offset = servo.length_mm.value / 2 - servo.axis_from_end_mm.value
    nut_corner = 0.0 if nut is None else nut.value / 3**0.5
    half_length = max(doubler_length_mm(parts) / 2, servo.screw_spacing_mm.value / 2 + nut_corner)
    return half_length + axis_offset, half_length - axis_offset


def doubler_length_mm(parts: Catalogue) -> float:
    """Return length (mm) of the second layer of film behind a servo, which reaches past the notches."""
    return 2 * (screw_end_mm(parts) + parts.assembly.doubler_margin_mm.value)


def screw_end_mm(parts: Catalogue) -> float:
    """Return distance (mm) from the middle of the opening to the outer end of a screw's notch.

    The notch has room for servos whose screws are farther apart; for screws that are nearer the servo's own slots do.
    """
    return (parts.servo.screw_spacing_mm.max_value + parts.assembly.screw_hole_mm.value) / 2


def min_doubler_mm(parts: Catalogue) -> float:
    """Return minimum height (mm) of the second layer of film behind a servo."""
    margins = parts.assembly.opening_clearance_mm.value + parts.assembly.doubler_margin_mm.value
    return parts.servo.width_mm.max_value + 2 * margins


def put_servo(shape: Shape, name: str, wall: str, axis_mm: Point, inward: float, height_mm: float) -> str:
    """Mount a servo in an opening of the face ``wall``; return the name of the mounted part.

    Behind the opening a second layer of film, the face ``NAME.doubler``, is ``height_mm`` high. ``axis_mm`` is the point
    where the servo's axis passes the wall; ``inward`` is 1 if its long side lies towards +x, else -1.
    """
    parts, servo, film = shape.parts, shape.parts.servo, shape.parts.film_mm
    # The middle of the body, whose axis is near one of its ends.
    x, y = axis_mm[0] + inward * (servo.length_mm.value / 2 - servo.axis_from_end_mm.value), axis_mm[1]
    hole = _cut_servo_opening(shape, wall, f"{name}.wall opening", x, y)
    outline = rectangle_around((0.0, 0.0), doubler_length_mm(parts), height_mm)
    shape.layer(f"{name}.doubler", wall, outline, (x, y), "servo doubler")
    _cut_servo_opening(shape, f"{name}.doubler", f"{name}.opening", 0.0, 0.0)
    # z of the wall's frame points into the car. The ears' undersides lie on the outside of the wall, the body's bottom is
    # inside; depth is z of its middle.
    depth = servo.ear_underside_mm.value - servo.depth_mm.value / 2 - film / 2
    # The box's length and width lie in the wall. If the long side points to -x, half a turn puts the shaft at the axis.
    pose = compose(translation(x, y, depth), rotation("z", 0.0 if inward > 0 else math.pi))
    size, title = (servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value), shape.path(name)
    shape.box(servo.name, title, wall, pose, size, servo.mass_kg.value, [hole], _servo_solids(parts))
    for i, direction in enumerate((-1, 1), 1):
        # The screws come from outside, through ear, wall and doubler.
        under_head = (x + direction * servo.screw_spacing_mm.value / 2, y, -film / 2 - servo.ear_thickness_mm.value)
        seat, grip = compose(translation(*under_head), rotation("x", math.pi)), servo.ear_thickness_mm.value + 2 * film
        add_screw(shape, parts.screw, f"{title} screw {i}", wall, seat, grip)
    return title


# Half a side of the layer of film around a rod.
ROD_LAYER_MM = 10.0


def rod_hole_mm(parts: Catalogue) -> float:
    """Return diameter of a hole in a wall (mm) that the thickest rod passes."""
    return parts.axle_rod.diameter_mm.max_value + 2 * parts.assembly.cut_mm.value


def wheel_hole_mm(parts: Catalogue) -> float:
    """Return diameter of the holes of a wheel (mm) that turns on the rod."""
    return rod_hole_mm(parts) + parts.axle_rod.play_mm.value


def put_rod(
    shape: Shape, walls: tuple[str, str], axis_mm: Point, apart_mm: float, gap_mm: float, wheel_mm: float
) -> None:
    """Mount a rod through two walls, ``apart_mm`` from each other, with a spacer tube and a cap for a wheel at each end.

    ``axis_mm`` is where it passes each wall, ``gap_mm`` the distance of a wheel from its wall, ``wheel_mm`` its width.
    """
    parts, film = shape.parts, shape.parts.film_mm
    rod, tube, cap = parts.axle_rod, parts.axle_tube, parts.axle_cap
    for wall in walls:
        side = wall.rpartition(".")[2]
        outline = rectangle_around((0.0, 0.0), 2 * ROD_LAYER_MM, 2 * ROD_LAYER_MM)
        shape.layer(f"{side} rod.doubler", wall, outline, axis_mm, "rod doubler")
        shape.round_hole(f"{side} rod.doubler", f"{side} rod.doubler.rod", "axle", (0.0, 0.0), rod_hole_mm(parts))
        shape.round_hole(wall, f"{side} rod.wall.rod", "axle", axis_mm, rod_hole_mm(parts))
        diameter, bore = tube.diameter_mm.value, tube.bore_mm.value
        mass_kg = math.pi / 4 * (diameter**2 - bore**2) * gap_mm * 1e-9 * tube.density_kg_m3.value
        size, solids = (diameter, diameter, gap_mm), [cylinder(diameter, -gap_mm / 2, gap_mm / 2, bore_mm=bore)]
        pose = translation(*axis_mm, -(film + gap_mm) / 2)
        shape.box(tube.name, shape.path(f"{side} spacer tube"), wall, pose, size, mass_kg, solids=solids)
        diameter, height = cap.diameter_mm.value, cap.height_mm.value
        solids = [cylinder(diameter, -height / 2, height / 2, bore_mm=rod.diameter_mm.value)]
        pose = translation(*axis_mm, -(film / 2 + gap_mm + wheel_mm + height / 2))
        size = (diameter, diameter, height)
        shape.box(cap.name, shape.path(f"{side} axle cap"), wall, pose, size, cap.mass_kg.value, solids=solids)
    diameter, length = rod.diameter_mm.value, apart_mm + film + 2 * (gap_mm + wheel_mm + cap.height_mm.value)
    mass_kg = math.pi / 4 * diameter**2 * length * 1e-9 * rod.density_kg_m3.value
    solids = [cylinder(diameter, -length / 2, length / 2)]
    pose = translation(*axis_mm, apart_mm / 2)
    shape.box(rod.name, shape.path("rod"), walls[0], pose, (diameter, diameter, length), mass_kg, solids=solids)


def _servo_solids(parts: Catalogue) -> list[Solid]:
    """Return the servo's body, ears, turret, idler and spline in the body's frame, whose z points to its bottom."""
    servo = parts.servo
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value

    def z(height_over_bottom: Quantity) -> float:
        return depth / 2 - height_over_bottom.value

    ear_z, thickness = z(servo.ear_underside_mm), servo.ear_thickness_mm.value
    axis_x, hole_x = servo.axis_from_end_mm.value - length / 2, servo.screw_spacing_mm.value / 2
    top_z, turret_z, spline_z = -depth / 2, z(servo.turret_top_mm), z(servo.spline_top_mm)
    holes = tuple((x, 0.0, servo.screw_hole_mm.value) for x in (-hole_x, hole_x))
    idler_x = axis_x + servo.idler_from_axis_mm.value
    # The centre screw cuts its thread into the servo's shaft, so turret and spline have a bore as wide as the screw.
    screw = parts.centre_screw.diameter_mm.value
    return [
        Solid("box", (length, width, depth), IDENTITY),
        Solid("box", (servo.ear_span_mm.value, width, thickness), translation(0, 0, ear_z - thickness / 2), holes),
        cylinder(servo.turret_diameter_mm.value, turret_z, top_z, axis_x, bore_mm=screw),
        cylinder(servo.idler_diameter_mm.value, turret_z, top_z, idler_x),
        cylinder(servo.spline_diameter_mm.value, spline_z, turret_z, axis_x, bore_mm=screw),
    ]


def _cut_servo_opening(shape: Shape, face: str, name: str, x: float, y: float) -> str:
    """Cut the servo's opening, with a notch for the screw at each end, and return its full name.

    Separate screw holes would leave less than 1 mm of film beside the opening, which holds nothing. A notch holds its
    screw across the wall's length and outwards; inwards the servo's body holds it.
    """
    servo, assembly = shape.parts.servo, shape.parts.assembly
    clearance, radius = 2 * assembly.opening_clearance_mm.value, assembly.screw_hole_mm.value / 2
    half_length, half_width = ((size.max_value + clearance) / 2 for size in (servo.length_mm, servo.width_mm))
    notch_center = screw_end_mm(shape.parts) - radius
    angles = [math.pi * (i / ARC_STEPS - 0.5) for i in range(ARC_STEPS + 1)]
    notch = on_circle(radius, angles, (notch_center, 0.0))
    ys = (-half_width, -radius, radius, half_width)
    half_outline = [*((half_length, y) for y in ys[:2]), *notch, *((half_length, y) for y in ys[2:])]
    outline = [*half_outline, *((-u, -v) for u, v in half_outline)]
    return shape.polygon_hole(face, name, "opening", [(x + u, y + v) for u, v in outline])


def switch_depth_mm(parts: Catalogue) -> float:
    """Return depth (mm) of the switch inside the panel."""
    switch = parts.switch
    return switch.height_mm.value - switch.rocker_height_mm.value - switch.bezel_height_mm.value


def switches_width_mm(parts: Catalogue) -> float:
    """Width (mm) of the layers behind both switches."""
    return 2 * parts.switch.slot_length_mm.value + 3 * parts.assembly.switch_margin_mm.value


# The switches of a car: in the + lead of the servos' battery; between EN and GND of the Feather, where closed is off.
SERVO_SWITCH, BOARD_SWITCH = "servo switch", "board switch"


def put_switches(shape: Shape, panel: str, at_mm: Point) -> None:
    """Mount both switches in slots of the face ``panel``, beside each other, the middle between them at ``at_mm``.

    Layers of film behind the panel, the faces ``switch.layer 1`` …, make it thick enough for the switches' barbs.
    """
    switch, parts = shape.parts.switch, shape.parts
    slot, margin = (switch.slot_length_mm.value, switch.slot_width_mm.value), parts.assembly.switch_margin_mm.value
    size = (switches_width_mm(parts), slot[1] + 2 * margin)
    # The barbs of every such switch must hold behind the layers of film and tape.
    min_layer_mm = parts.film.thickness_mm.min_value + parts.assembly.tape_mm.min_value
    layer_count = math.ceil((switch.panel_least_mm.max_value - parts.film.thickness_mm.min_value) / min_layer_mm - 1e-9)
    # Half the distance of the switches' middles: between their openings the film is as wide as around them.
    offset = (slot[0] + margin) / 2
    for i in range(max(1, layer_count)):
        name = f"switch.layer {i + 1}"
        shape.layer(name, panel, rectangle_around((0.0, 0.0), *size), at_mm, "switch doubler", i + 1)
        for x in (-offset, offset):
            shape.rectangular_hole(name, f"{name}.opening", "opening", (x, 0.0), *slot)
    for switch_name, x in ((SERVO_SWITCH, -offset), (BOARD_SWITCH, offset)):
        _put_switch(shape, switch_name, panel, (at_mm[0] + x, at_mm[1]))


def _put_switch(shape: Shape, name: str, panel: str, at_mm: Point) -> None:
    switch, film = shape.parts.switch, shape.parts.film_mm
    hole = shape.rectangular_hole(
        panel, f"{name} opening", "opening", at_mm, switch.slot_length_mm.value, switch.slot_width_mm.value
    )
    outside_mm, half = switch.rocker_height_mm.value + switch.bezel_height_mm.value, switch.height_mm.value / 2
    # z of the mount's frame points outwards; its box's middle lies inside.
    pose = compose(translation(*at_mm, half - outside_mm - film / 2), rotation("x", math.pi))
    bezel, body = switch.size_mm[:2], (switch.body_length_mm.value, switch.body_width_mm.value)
    bezel_low, bezel_high = half - outside_mm, half - switch.rocker_height_mm.value
    solids = [
        Solid("box", (*size, end - start), translation(0, 0, (start + end) / 2))
        for size, start, end in ((bezel, bezel_low, bezel_high), (body, bezel_high, half), (body, -half, bezel_low))
    ]
    finger = ToolClearance("finger", translation(0, 0, half), *shape.parts.tools.finger_mm)
    shape.box(switch.name, name, panel, pose, switch.size_mm, switch.mass_kg.value, [hole], solids, [finger])


# The optional button that starts and stops a trial.
BUTTON = "button"


def button_depth_mm(parts: Catalogue) -> float:
    """Return depth (mm) of the button inside the panel."""
    return parts.push_button.height_mm.value - parts.push_button.front_mm.value


def put_button(shape: Shape, panel: str, at_mm: Point) -> None:
    """Mount the button in a hole of the face ``panel``, with a layer of film behind it: the face ``button.layer``.

    It comes from inside; its nut is screwed on from outside.
    """
    parts, button, film = shape.parts, shape.parts.push_button, shape.parts.film_mm
    side = button.length_mm.value + 2 * parts.assembly.switch_margin_mm.value
    shape.layer("button.layer", panel, rectangle_around((0.0, 0.0), side, side), at_mm, "button doubler")
    shape.round_hole("button.layer", "button.layer.opening", "opening", (0.0, 0.0), button.hole_mm.value)
    hole = shape.round_hole(panel, "button opening", "opening", at_mm, button.hole_mm.value)
    half, front = button.height_mm.value / 2, button.front_mm.value
    # z of the mount's frame points outwards; its body begins behind panel and layer.
    inside_mm = button.height_mm.value - front
    pose = compose(translation(*at_mm, film * 1.5 + inside_mm - half), rotation("x", math.pi))
    solids = [
        cylinder(button.thread_mm.value, half - front, half),
        cylinder(button.length_mm.value, -half, half - front),
    ]
    finger = ToolClearance("finger", translation(0, 0, half), *parts.tools.finger_mm)
    shape.box(button.name, BUTTON, panel, pose, button.size_mm, button.mass_kg.value, [hole], solids, [finger])


def put_caster(shape: Shape, name: str, floor: str, at_mm: Point) -> None:
    """Fix a ball caster under the face ``floor``, its centre at a point, with a second layer: the face ``NAME.plate``."""
    caster, margin = shape.parts.caster, 2 * shape.parts.assembly.doubler_margin_mm.value
    outline = rectangle_around((0.0, 0.0), caster.length_mm.value + margin, caster.width_mm.value + margin)
    shape.layer(f"{name}.plate", floor, outline, at_mm, "caster plate")
    hole_x, hole_mm = caster.hole_spacing_mm.value / 2, shape.parts.assembly.screw_hole_mm.value
    holes = []
    for i, x in enumerate((-hole_x, hole_x), 1):
        shape.round_hole(f"{name}.plate", f"{name}.plate.screw {i}", "screw", (x, 0.0), hole_mm)
        holes.append(shape.round_hole(floor, f"{name}.screw {i}", "screw", (at_mm[0] + x, at_mm[1]), hole_mm))
    center = translation(*at_mm, -(shape.parts.film_mm + caster.height_mm.value) / 2)
    pose = compose(center, rotation("x", math.pi))
    shape.box(caster.name, shape.path(name), floor, pose, caster.size_mm, caster.mass_kg.value, holes)


def cylinder(
    diameter_mm: float, low_mm: float, high_mm: float, x_mm: float = 0.0, y_mm: float = 0.0, bore_mm: float = 0.0
) -> Solid:
    """Return a cylinder along z between two heights, with a bore along its axis."""
    pose = translation(x_mm, y_mm, (low_mm + high_mm) / 2)
    bores = ((0.0, 0.0, bore_mm),) if bore_mm else ()
    return Solid("cylinder", (diameter_mm, diameter_mm, high_mm - low_mm), pose, bores)


def add_screw(shape: Shape, screw: Screw, name: str, on: str, under_head: Pose, grip_mm: float) -> None:
    """Add a screw to the face ``on``. ``under_head`` is the point below its head in that face's frame, z outwards.

    Its nut, if it has one, is ``grip_mm`` below the head.
    """
    head, shank = screw.head_height_mm.value, screw.length_mm.value
    middle_z = (head - shank) / 2
    solids = [
        cylinder(screw.head_diameter_mm.value, -middle_z, head - middle_z),
        cylinder(screw.diameter_mm.value, -shank - middle_z, -middle_z),
    ]
    if screw.nut_width_mm is not None and screw.nut_height_mm is not None:
        # Parts beside a nut face one of its flats, so its width across flats counts.
        nut_low = -grip_mm - screw.nut_height_mm.value - middle_z
        solids.append(cylinder(screw.nut_width_mm.value, nut_low, -grip_mm - middle_z))
    size = (screw.head_diameter_mm.value, screw.head_diameter_mm.value, head + shank)
    pose = compose(under_head, translation(0, 0, middle_z))
    clearances = [ToolClearance("driver", translation(0, 0, head - middle_z), *shape.parts.tools.driver_mm)]
    shape.box(screw.name, name, on, pose, size, screw.mass_kg.value, (), solids, clearances)
