"""Mounts of servo, rod, switch and ball caster in walls, caps and floors, with layers of film behind them; screws.

A servo is inserted from outside until its ears lie on the wall. Its shaft points outwards, its length runs along the
wall. A rod passes both walls and carries wheels that turn freely. A switch snaps into an end cap. A caster is screwed
under the floor of a user's module. The simulator has contacts for wheels and bellies only, so a caster is mass without
contact there. A screw's frame has its origin in the middle of its length, z along its axis towards its head.
"""

import math
from typing import NamedTuple

from foldcar.car.components.component import ROUNDING
from foldcar.car.components.shape import Shape, on_circle, rectangle_around
from foldcar.car.folded.model import IDENTITY, Point, Pose, Solid, ToolClearance
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.bought import Screw
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.quantity import Quantity

# Sides of a notch's round end.
ARC_STEPS = 24


class ServoReach(NamedTuple):
    """How far a servo extends from its axis along the wall (mm): on its long side and on its short side."""

    long_mm: float
    short_mm: float


def servo_reach_mm(parts: Catalogue) -> ServoReach:
    """Return how far a servo with its fasteners extends from the axis of its shaft along the wall.

    It ends with the layer of film behind it, its doubler, or with the nut of its screw.
    """
    servo, nut = parts.servo, parts.screw.nut_width_mm
    axis_from_middle = servo.length_mm.value / 2 - servo.axis_from_end_mm.value
    # The radius to the corners of a hexagonal nut is its width across the flats, divided by the square root of 3.
    nut_radius = 0.0 if nut is None else nut.value / 3**0.5
    half_length = max(doubler_length_mm(parts) / 2, servo.screw_spacing_mm.value / 2 + nut_radius)
    return ServoReach(long_mm=half_length + axis_from_middle, short_mm=half_length - axis_from_middle)


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

    ``axis_mm`` is the point where the axis of the servo's shaft passes the wall. The axis is near one end of the servo:
    the long side lies towards +x of the wall if ``inward`` is 1, and towards -x if it is -1. Behind the opening a second
    layer of film, the face ``NAME.doubler``, is ``height_mm`` high.
    """
    parts, servo, film = shape.parts, shape.parts.servo, shape.parts.film_mm
    # The middle of the servo's body on the wall.
    axis_x, y = axis_mm
    x = axis_x + inward * (servo.length_mm.value / 2 - servo.axis_from_end_mm.value)
    hole = _cut_servo_opening(shape, wall, f"{name}.wall opening", x, y)
    outline = rectangle_around((0.0, 0.0), doubler_length_mm(parts), height_mm)
    shape.layer(f"{name}.doubler", wall, outline, (x, y), "servo doubler")
    _cut_servo_opening(shape, f"{name}.doubler", f"{name}.opening", 0.0, 0.0)
    # z of the wall's frame points into the car, and the wall's outer surface is at -film / 2. The undersides of the
    # ears lie on it, and the servo's bottom is as far inside as the ears are high. The middle is half of its depth
    # before that.
    middle_z = servo.ear_underside_mm.value - servo.depth_mm.value / 2 - film / 2
    # The box's length and width lie in the wall. If the long side points to -x, half a turn puts the shaft at the axis.
    pose = compose(translation(x, y, middle_z), rotation("z", 0.0 if inward > 0 else math.pi))
    size, title = (servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value), shape.path(name)
    shape.box(servo.name, title, wall, pose, size, servo.mass_kg.value, [hole], _servo_solids(parts))
    for number, direction in enumerate((-1, 1), 1):
        # The screws come from outside, through ear, wall and doubler.
        screw_x = x + direction * servo.screw_spacing_mm.value / 2
        under_head = translation(screw_x, y, -film / 2 - servo.ear_thickness_mm.value)
        seat, grip = compose(under_head, rotation("x", math.pi)), servo.ear_thickness_mm.value + 2 * film
        add_screw(shape, parts.screw, f"{title} screw {number}", wall, seat, grip)
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
    """Mount a rod through two walls, with a spacer tube and a cap for a wheel at each end.

    ``axis_mm`` is the point where it passes each wall. The walls are ``apart_mm`` from each other. Outside of a wall
    follow the spacer tube, ``gap_mm`` long, the wheel, ``wheel_mm`` wide, and the cap.
    """
    parts, film = shape.parts, shape.parts.film_mm
    for wall in walls:
        _put_rod_end(shape, wall, axis_mm, gap_mm, wheel_mm)
    rod = parts.axle_rod
    diameter = rod.diameter_mm.value
    length = apart_mm + film + 2 * (gap_mm + wheel_mm + parts.axle_cap.height_mm.value)
    mass_kg = math.pi / 4 * diameter**2 * length * 1e-9 * rod.density_kg_m3.value
    # z of a wall's frame points to the other wall.
    pose, size = translation(*axis_mm, apart_mm / 2), (diameter, diameter, length)
    solids = [cylinder(diameter, -length / 2, length / 2)]
    shape.box(rod.name, shape.path("rod"), walls[0], pose, size, mass_kg, solids=solids)


def _put_rod_end(shape: Shape, wall: str, axis_mm: Point, gap_mm: float, wheel_mm: float) -> None:
    """Add what a rod needs at one wall: the hole, a second layer of film, the spacer tube and the cap."""
    film, tube, cap = shape.parts.film_mm, shape.parts.axle_tube, shape.parts.axle_cap
    side = wall.rpartition(".")[2]
    layer, hole_mm = f"{side} rod.doubler", rod_hole_mm(shape.parts)
    outline = rectangle_around((0.0, 0.0), 2 * ROD_LAYER_MM, 2 * ROD_LAYER_MM)
    shape.layer(layer, wall, outline, axis_mm, "rod doubler")
    shape.round_hole(layer, f"{layer}.rod", "axle", (0.0, 0.0), hole_mm)
    shape.round_hole(wall, f"{side} rod.wall.rod", "axle", axis_mm, hole_mm)
    # z of the wall's frame points into the car, so what is outside has negative z.
    tube_mm, tube_bore_mm = tube.diameter_mm.value, tube.bore_mm.value
    tube_kg = math.pi / 4 * (tube_mm**2 - tube_bore_mm**2) * gap_mm * 1e-9 * tube.density_kg_m3.value
    tube_pose = translation(*axis_mm, -(film + gap_mm) / 2)
    tube_solid = cylinder(tube_mm, -gap_mm / 2, gap_mm / 2, bore_mm=tube_bore_mm)
    tube_name, tube_size = shape.path(f"{side} spacer tube"), (tube_mm, tube_mm, gap_mm)
    shape.box(tube.name, tube_name, wall, tube_pose, tube_size, tube_kg, solids=[tube_solid])
    cap_mm, height = cap.diameter_mm.value, cap.height_mm.value
    cap_pose = translation(*axis_mm, -(film / 2 + gap_mm + wheel_mm + height / 2))
    cap_solid = cylinder(cap_mm, -height / 2, height / 2, bore_mm=shape.parts.axle_rod.diameter_mm.value)
    cap_name, cap_size = shape.path(f"{side} axle cap"), (cap_mm, cap_mm, height)
    shape.box(cap.name, cap_name, wall, cap_pose, cap_size, cap.mass_kg.value, solids=[cap_solid])


def _servo_solids(parts: Catalogue) -> list[Solid]:
    """Return the servo's body, its ears, and the cylinders on its top: turret, idler and spline.

    They are in the body's frame: the origin is its middle, x runs along its length and z points to its bottom, into the
    car. So the top, from which the shaft stands out, is at negative z.
    """
    servo = parts.servo
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value

    def z(height_over_bottom: Quantity) -> float:
        return depth / 2 - height_over_bottom.value

    axis_x = servo.axis_from_end_mm.value - length / 2
    # The idler is the smaller round beside the turret.
    idler_x = axis_x + servo.idler_from_axis_mm.value
    screw_x = servo.screw_spacing_mm.value / 2
    ear_holes = tuple((x, 0.0, servo.screw_hole_mm.value) for x in (-screw_x, screw_x))
    ear_size = (servo.ear_span_mm.value, width, servo.ear_thickness_mm.value)
    ear_pose = translation(0, 0, z(servo.ear_underside_mm) - servo.ear_thickness_mm.value / 2)
    body_top_z, turret_z, spline_z = -depth / 2, z(servo.turret_top_mm), z(servo.spline_top_mm)
    # The centre screw cuts its thread into the servo's shaft, so turret and spline have a bore as wide as the screw.
    bore_mm = parts.centre_screw.diameter_mm.value
    return [
        Solid("box", (length, width, depth), IDENTITY),
        Solid("box", ear_size, ear_pose, ear_holes),
        cylinder(servo.turret_diameter_mm.value, turret_z, body_top_z, axis_x, bore_mm=bore_mm),
        cylinder(servo.idler_diameter_mm.value, turret_z, body_top_z, idler_x),
        cylinder(servo.spline_diameter_mm.value, spline_z, turret_z, axis_x, bore_mm=bore_mm),
    ]


def _cut_servo_opening(shape: Shape, face: str, name: str, x: float, y: float) -> str:
    """Cut the servo's opening, with a notch for the screw at each end, and return its full name.

    It is a rectangle around (x, y) with a round notch in the middle of each short side. With separate holes for the
    screws, less than 1 mm of film would be left between hole and opening, which would tear. A notch holds its screw up
    and down the wall, and outwards along it; the servo's body holds it inwards.
    """
    servo, assembly = shape.parts.servo, shape.parts.assembly
    clearance, radius = 2 * assembly.opening_clearance_mm.value, assembly.screw_hole_mm.value / 2
    half_length = (servo.length_mm.max_value + clearance) / 2
    half_width = (servo.width_mm.max_value + clearance) / 2
    # The half at +x, counter-clockwise: up the short side, with half a circle at its notch.
    notch_angles = [math.pi * (step / ARC_STEPS - 0.5) for step in range(ARC_STEPS + 1)]
    notch_center = (screw_end_mm(shape.parts) - radius, 0.0)
    half_outline = [
        (half_length, -half_width),
        (half_length, -radius),
        *on_circle(radius, notch_angles, notch_center),
        (half_length, radius),
        (half_length, half_width),
    ]
    # The other half is the same, turned by half a turn.
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
    slot_length, slot_width = switch.slot_length_mm.value, switch.slot_width_mm.value
    margin = parts.assembly.switch_margin_mm.value
    # The barbs of every such switch must hold behind the panel and its layers, each with a tape. So the thinnest film and
    # tape and the switch that needs the thickest panel count.
    min_film_mm = parts.film.thickness_mm.min_value
    min_layer_mm = min_film_mm + parts.assembly.tape_mm.min_value
    needed_layers = (switch.panel_least_mm.max_value - min_film_mm) / min_layer_mm
    layer_count = max(1, math.ceil(needed_layers - ROUNDING))
    # Between the slots the film is as wide as around them. So each slot is half of slot and margin from the middle.
    offset = (slot_length + margin) / 2
    outline = rectangle_around((0.0, 0.0), switches_width_mm(parts), slot_width + 2 * margin)
    for level in range(1, layer_count + 1):
        layer = f"switch.layer {level}"
        shape.layer(layer, panel, outline, at_mm, "switch doubler", level)
        for x in (-offset, offset):
            shape.rectangular_hole(layer, f"{layer}.opening", "opening", (x, 0.0), slot_length, slot_width)
    for name, x in ((SERVO_SWITCH, -offset), (BOARD_SWITCH, offset)):
        _put_switch(shape, name, panel, (at_mm[0] + x, at_mm[1]))


def _put_switch(shape: Shape, name: str, panel: str, at_mm: Point) -> None:
    """Mount a switch in a slot of the face ``panel``: its bezel lies on the outside, its body is inside."""
    switch, film = shape.parts.switch, shape.parts.film_mm
    slot_mm = (switch.slot_length_mm.value, switch.slot_width_mm.value)
    hole = shape.rectangular_hole(panel, f"{name} opening", "opening", at_mm, *slot_mm)
    # The mount's frame: the origin is the middle of the switch's height, z points outwards. From inside to outside
    # follow the body, the panel, the bezel and the rocker.
    outer_z = switch.height_mm.value / 2
    bezel_top_z = outer_z - switch.rocker_height_mm.value
    panel_z = outer_z - (switch.rocker_height_mm.value + switch.bezel_height_mm.value)
    bezel_mm, body_mm = switch.size_mm[:2], (switch.body_length_mm.value, switch.body_width_mm.value)
    solids = [
        _box_between(bezel_mm, panel_z, bezel_top_z),
        _box_between(body_mm, bezel_top_z, outer_z),
        _box_between(body_mm, -outer_z, panel_z),
    ]
    finger = ToolClearance("finger", translation(0, 0, outer_z), *shape.parts.tools.finger_mm)
    # z of the panel's frame points inwards: its outer surface, where the bezel lies, is at -film / 2.
    pose = compose(translation(*at_mm, panel_z - film / 2), rotation("x", math.pi))
    shape.box(
        switch.name, name, panel, pose, switch.size_mm, switch.mass_kg.value, holes=[hole], solids=solids,
        clearances=[finger],
    )  # fmt: skip


def _box_between(size_mm: Point, low_mm: float, high_mm: float) -> Solid:
    """Return a box around the z axis, of this size along x and y, between two heights."""
    return Solid("box", (*size_mm, high_mm - low_mm), translation(0, 0, (low_mm + high_mm) / 2))


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
    # The mount's frame: the origin is the middle of the button's height, z points outwards. The body is inside, and the
    # thread with the button on it is in front.
    half, front = button.height_mm.value / 2, button.front_mm.value
    thread_mm, body_mm = button.thread_mm.value, button.length_mm.value
    solids = [cylinder(thread_mm, half - front, half), cylinder(body_mm, -half, half - front)]
    finger = ToolClearance("finger", translation(0, 0, half), *parts.tools.finger_mm)
    # z of the panel's frame points inwards. The body begins behind the layer, one and a half films behind the panel's
    # middle, and the origin is half of the height before the body's inner end.
    behind_layer_z = film * 1.5
    pose = compose(translation(*at_mm, behind_layer_z + button_depth_mm(parts) - half), rotation("x", math.pi))
    shape.box(
        button.name, BUTTON, panel, pose, button.size_mm, button.mass_kg.value, holes=[hole], solids=solids,
        clearances=[finger],
    )  # fmt: skip


def put_caster(shape: Shape, name: str, floor: str, at_mm: Point) -> None:
    """Fix a ball caster under the face ``floor``, its centre at a point, with two screws.

    A second layer of film, the face ``NAME.plate``, lies on the floor above it.
    """
    caster, film = shape.parts.caster, shape.parts.film_mm
    margins, hole_mm = 2 * shape.parts.assembly.doubler_margin_mm.value, shape.parts.assembly.screw_hole_mm.value
    plate = f"{name}.plate"
    outline = rectangle_around((0.0, 0.0), caster.length_mm.value + margins, caster.width_mm.value + margins)
    shape.layer(plate, floor, outline, at_mm, "caster plate")
    center_x, center_y = at_mm
    holes = []
    for number, side in enumerate((-1, 1), 1):
        x = side * caster.hole_spacing_mm.value / 2
        shape.round_hole(plate, f"{plate}.screw {number}", "screw", (x, 0.0), hole_mm)
        holes.append(shape.round_hole(floor, f"{name}.screw {number}", "screw", (center_x + x, center_y), hole_mm))
    # z of the floor points up, and the caster hangs below it: it is turned over.
    center = translation(center_x, center_y, -(film + caster.height_mm.value) / 2)
    pose = compose(center, rotation("x", math.pi))
    shape.box(caster.name, shape.path(name), floor, pose, caster.size_mm, caster.mass_kg.value, holes=holes)


def cylinder(
    diameter_mm: float, low_mm: float, high_mm: float, x_mm: float = 0.0, y_mm: float = 0.0, bore_mm: float = 0.0
) -> Solid:
    """Return a cylinder along z between two heights, with a bore along its axis."""
    pose = translation(x_mm, y_mm, (low_mm + high_mm) / 2)
    bores = ((0.0, 0.0, bore_mm),) if bore_mm else ()
    return Solid("cylinder", (diameter_mm, diameter_mm, high_mm - low_mm), pose, bores)


def add_screw(shape: Shape, screw: Screw, name: str, on: str, under_head: Pose, grip_mm: float) -> None:
    """Add a screw to the face ``on``.

    ``under_head`` is a pose in the face's frame: its origin is the point under the screw's head, and its z points along
    the screw to the head. Between head and nut, if the screw has one, is what it holds, ``grip_mm`` thick.
    """
    head, shank = screw.head_height_mm.value, screw.length_mm.value
    # A mount's frame has its origin in the middle of the mount, at this height over the point under the head.
    middle_z = (head - shank) / 2

    def solid(diameter_mm: float, low: float, high: float) -> Solid:
        """Return a cylinder between two heights over the point under the head, in the frame of the mount."""
        return cylinder(diameter_mm, low - middle_z, high - middle_z)

    head_mm = screw.head_diameter_mm.value
    solids = [solid(head_mm, 0.0, head), solid(screw.diameter_mm.value, -shank, 0.0)]
    if screw.nut_width_mm is not None and screw.nut_height_mm is not None:
        # Parts beside a nut face one of its flats, so its width across flats counts.
        nut_bottom = -grip_mm - screw.nut_height_mm.value
        solids.append(solid(screw.nut_width_mm.value, nut_bottom, -grip_mm))
    driver = ToolClearance("driver", translation(0, 0, head - middle_z), *shape.parts.tools.driver_mm)
    pose, size = compose(under_head, translation(0, 0, middle_z)), (head_mm, head_mm, head + shank)
    shape.box(screw.name, name, on, pose, size, screw.mass_kg.value, solids=solids, clearances=[driver])
