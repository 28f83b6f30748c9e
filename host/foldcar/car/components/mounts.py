"""Mounts of servo, switch and ball caster in walls, caps and floors, with layers of film behind them; screws.

A servo is inserted from outside until its ears lie on the wall. Its shaft points outwards, its length runs along the
wall. A switch snaps into an end cap. A caster is screwed
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
    """Return how far a mounted servo extends along the wall from the axis of its shaft, on its two sides.

    Behind the servo lies a second layer of film, and its screws have nuts. What reaches farther counts: the layer or the
    nuts.
    """
    servo, nut = parts.servo, parts.screw.nut_width_mm
    # The radius to the corners of a hexagonal nut is its width across the flats, divided by the square root of 3.
    nut_radius = 0.0 if nut is None else nut.value / 3**0.5
    nut_end = servo.screw_spacing_mm.value / 2 + nut_radius
    layer_end = doubler_length_mm(parts) / 2
    # Layer and nuts are symmetric about the servo's middle, from which the axis has this distance.
    half_length = max(layer_end, nut_end)
    axis_from_middle = servo.length_mm.value / 2 - servo.axis_from_end_mm.value
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

    In the wall's frame, x runs along the wall, and z points into the car. The servo lies in the opening with its depth
    along z, and is held by its two ears. ``axis_mm`` is the point where the axis of its shaft passes the wall. The axis
    is near one end of the servo: the servo's long side lies towards +x if ``inward`` is 1, and towards -x if it is -1.
    A second layer of film behind the opening, the face ``NAME.doubler``, is ``height_mm`` high.
    """
    parts, servo, film = shape.parts, shape.parts.servo, shape.parts.film_mm
    # The opening in the wall around the middle of the servo's body, and the layer behind it with the same opening.
    axis_x, y = axis_mm
    x = axis_x + inward * (servo.length_mm.value / 2 - servo.axis_from_end_mm.value)
    hole = _cut_servo_opening(shape, wall, f"{name}.wall opening", x, y)
    outline = rectangle_around((0.0, 0.0), doubler_length_mm(parts), height_mm)
    shape.layer(f"{name}.doubler", wall, outline, (x, y), "servo doubler")
    _cut_servo_opening(shape, f"{name}.doubler", f"{name}.opening", 0.0, 0.0)
    # The servo. The undersides of its ears lie on the wall's outer surface, half a film outside of the middle of the
    # wall, where z is -film / 2. The servo's bottom is inside, as far as the ears are above the bottom. Its middle is
    # half of its depth away from the bottom, towards the outside.
    middle_z = servo.ear_underside_mm.value - servo.depth_mm.value / 2 - film / 2
    # In the servo's own frame, its shaft is near the end at -x. If its long side lies towards -x of the wall, the servo
    # is turned by 180°.
    pose = compose(translation(x, y, middle_z), rotation("z", 0.0 if inward > 0 else math.pi))
    size = (servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value)
    title = shape.path(name)
    shape.box(servo.name, title, wall, pose, size, servo.mass_kg.value, holes=[hole], solids=_servo_solids(parts))
    # The two screws come from outside and hold ear, wall and layer.
    grip_mm = servo.ear_thickness_mm.value + 2 * film
    for number, direction in enumerate((-1, 1), 1):
        screw_x = x + direction * servo.screw_spacing_mm.value / 2
        on_ear = translation(screw_x, y, -film / 2 - servo.ear_thickness_mm.value)
        under_head = compose(on_ear, rotation("x", math.pi))
        add_screw(shape, parts.screw, f"{title} screw {number}", wall, under_head, grip_mm)
    return title


def _servo_solids(parts: Catalogue) -> list[Solid]:
    """Return the servo's body, its ears, and the three cylinders on its top.

    The *spline* is the end of the shaft. It stands on the *turret*, a flat cylinder around the shaft. The *idler* is a
    smaller cylinder beside the turret. The solids are given in the servo's frame: the origin is the middle of the body, x
    runs along its length, and z points to its bottom, into the car. So the top, where the shaft is, has negative z.
    """
    servo = parts.servo
    length, width, depth = servo.length_mm.value, servo.width_mm.value, servo.depth_mm.value

    def z_at(height_over_bottom: Quantity) -> float:
        """Return z at a height over the servo's bottom, as the part's data give it."""
        return depth / 2 - height_over_bottom.value

    # The ears are one plate with a hole at each end.
    screw_x = servo.screw_spacing_mm.value / 2
    ear_holes = tuple((x, 0.0, servo.screw_hole_mm.value) for x in (-screw_x, screw_x))
    ear_size = (servo.ear_span_mm.value, width, servo.ear_thickness_mm.value)
    ear_pose = translation(0, 0, z_at(servo.ear_underside_mm) - servo.ear_thickness_mm.value / 2)
    # The cylinders. The centre screw cuts its thread into the shaft, so turret and spline have a bore as wide as it.
    axis_x = servo.axis_from_end_mm.value - length / 2
    idler_x = axis_x + servo.idler_from_axis_mm.value
    body_top_z = -depth / 2
    turret_top_z, spline_top_z = z_at(servo.turret_top_mm), z_at(servo.spline_top_mm)
    bore_mm = parts.centre_screw.diameter_mm.value
    return [
        Solid("box", (length, width, depth), IDENTITY),
        Solid("box", ear_size, ear_pose, ear_holes),
        cylinder(servo.turret_diameter_mm.value, turret_top_z, body_top_z, axis_x, bore_mm=bore_mm),
        cylinder(servo.idler_diameter_mm.value, turret_top_z, body_top_z, idler_x),
        cylinder(servo.spline_diameter_mm.value, spline_top_z, turret_top_z, axis_x, bore_mm=bore_mm),
    ]


def _cut_servo_opening(shape: Shape, face: str, name: str, x: float, y: float) -> str:
    """Cut the opening for a servo into a face, and return the full name of the hole.

    The opening is a rectangle around (x, y) with a round notch in the middle of each short side. The servo's two screws
    lie in the notches. Holes of their own would leave less than 1 mm of film beside the opening, which would tear. The
    notch holds its screw on three sides, and the servo's body is on the fourth.
    """
    servo, assembly = shape.parts.servo, shape.parts.assembly
    clearance, radius = 2 * assembly.opening_clearance_mm.value, assembly.screw_hole_mm.value / 2
    half_length = (servo.length_mm.max_value + clearance) / 2
    half_width = (servo.width_mm.max_value + clearance) / 2
    # The short side at +x, from its lower corner to its upper one, as seen from the middle of the opening. Its notch ends
    # with half a circle, whose angle runs from -90° to 90°.
    notch_angles = [math.pi * (step / ARC_STEPS - 0.5) for step in range(ARC_STEPS + 1)]
    notch_center = (screw_end_mm(shape.parts) - radius, 0.0)
    side = [
        (half_length, -half_width),
        (half_length, -radius),
        *on_circle(radius, notch_angles, notch_center),
        (half_length, radius),
        (half_length, half_width),
    ]
    # The other short side is this one, turned by 180° about the middle.
    opposite_side = [(-from_middle_x, -from_middle_y) for from_middle_x, from_middle_y in side]
    outline = [(x + from_middle_x, y + from_middle_y) for from_middle_x, from_middle_y in (*side, *opposite_side)]
    return shape.polygon_hole(face, name, "opening", outline)


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
    """Mount both switches of the car beside each other in the face ``panel``; ``at_mm`` is the middle between them.

    Barbs on a switch hold it behind the panel. The panel alone is too thin for them, so layers of film are stuck behind
    it with tape, the faces ``switch.layer 1`` and so on. The slots of the switches go through panel and layers.
    """
    switch, parts = shape.parts.switch, shape.parts
    slot_length, slot_width = switch.slot_length_mm.value, switch.slot_width_mm.value
    margin = parts.assembly.switch_margin_mm.value
    # The two slots have a margin between them, so the middle of each has this distance from the middle of the margin.
    offset = (slot_length + margin) / 2
    outline = rectangle_around((0.0, 0.0), switches_width_mm(parts), slot_width + 2 * margin)
    for level in range(1, _switch_layers(parts) + 1):
        layer = f"switch.layer {level}"
        shape.layer(layer, panel, outline, at_mm, "switch doubler", level)
        for slot_x in (-offset, offset):
            shape.rectangular_hole(layer, f"{layer}.opening", "opening", (slot_x, 0.0), slot_length, slot_width)
    middle_x, middle_y = at_mm
    _put_switch(shape, SERVO_SWITCH, panel, (middle_x - offset, middle_y))
    _put_switch(shape, BOARD_SWITCH, panel, (middle_x + offset, middle_y))


def _switch_layers(parts: Catalogue) -> int:
    """Return how many layers of film are stuck behind a panel, so that it is thick enough for the barbs of a switch.

    Any switch must hold in any film: the switch may need the thickest panel, and film and tape may be the thinnest.
    """
    panel_mm = parts.film.thickness_mm.min_value
    layer_mm = panel_mm + parts.assembly.tape_mm.min_value
    needed_panel_mm = parts.switch.panel_least_mm.max_value
    needed_layers = (needed_panel_mm - panel_mm) / layer_mm
    return max(1, math.ceil(needed_layers - ROUNDING))


def _put_switch(shape: Shape, name: str, panel: str, at_mm: Point) -> None:
    """Mount a switch in a slot of the face ``panel``, with its middle at ``at_mm``.

    The body of the switch is inside, behind the panel. Its *bezel*, the frame around the rocker, lies on the panel's
    outer surface. A finger must be able to press the rocker.
    """
    switch, film = shape.parts.switch, shape.parts.film_mm
    slot_mm = (switch.slot_length_mm.value, switch.slot_width_mm.value)
    hole = shape.rectangular_hole(panel, f"{name} opening", "opening", at_mm, *slot_mm)
    # The solids, in the frame of the switch. Its origin is the middle of the switch's height, and z points outwards. From
    # inside to outside follow the body, the bezel and the rocker.
    top_z = switch.height_mm.value / 2
    bezel_top_z = top_z - switch.rocker_height_mm.value
    bezel_bottom_z = top_z - (switch.rocker_height_mm.value + switch.bezel_height_mm.value)
    bezel_mm, body_mm = switch.size_mm[:2], (switch.body_length_mm.value, switch.body_width_mm.value)
    bezel = _box_between(bezel_mm, bezel_bottom_z, bezel_top_z)
    rocker = _box_between(body_mm, bezel_top_z, top_z)
    body = _box_between(body_mm, -top_z, bezel_bottom_z)
    finger = ToolClearance("finger", translation(0, 0, top_z), *shape.parts.tools.finger_mm)
    # z of the panel's frame points inwards, so the switch is turned over. The underside of its bezel lies on the panel's
    # outer surface, at -film / 2.
    pose = compose(translation(*at_mm, bezel_bottom_z - film / 2), rotation("x", math.pi))
    shape.box(
        switch.name, name, panel, pose, switch.size_mm, switch.mass_kg.value, holes=[hole], solids=[bezel, rocker, body],
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
    # The solids, in the frame of the button. Its origin is the middle of the button's height, and z points outwards. The
    # body is inside, and the thread with the button on it is in front.
    half_height = button.height_mm.value / 2
    body_top_z = half_height - button.front_mm.value
    thread = cylinder(button.thread_mm.value, body_top_z, half_height)
    body = cylinder(button.length_mm.value, -half_height, body_top_z)
    finger = ToolClearance("finger", translation(0, 0, half_height), *parts.tools.finger_mm)
    # z of the panel's frame points inwards, so the button is turned over. Its body begins behind the layer, which is one
    # and a half films behind the middle of the panel's film. The origin is half of the height before the body's end.
    behind_layer_z = film * 1.5
    middle_z = behind_layer_z + button_depth_mm(parts) - half_height
    pose = compose(translation(*at_mm, middle_z), rotation("x", math.pi))
    shape.box(
        button.name, BUTTON, panel, pose, button.size_mm, button.mass_kg.value, holes=[hole], solids=[thread, body],
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

    ``under_head`` is the pose of the screw in the frame of the face: its origin is the point just under the screw's head,
    and its z points along the screw to the head. The screw holds what is between its head and its nut, ``grip_mm`` thick.
    For a screw without a nut, ``grip_mm`` has no meaning.
    """
    head_height, shank_length = screw.head_height_mm.value, screw.length_mm.value
    # The head lies above the origin of ``under_head``, and the shank below it. A mount's own origin is the middle between
    # the top of the head and the end of the shank, which has this height.
    middle_z = (head_height - shank_length) / 2

    def cylinder_between(diameter_mm: float, low: float, high: float) -> Solid:
        """Return a cylinder between two heights over the point under the head, in the frame of the mount."""
        return cylinder(diameter_mm, low - middle_z, high - middle_z)

    head_mm = screw.head_diameter_mm.value
    head = cylinder_between(head_mm, 0.0, head_height)
    shank = cylinder_between(screw.diameter_mm.value, -shank_length, 0.0)
    solids = [head, shank]
    if screw.nut_width_mm is not None and screw.nut_height_mm is not None:
        # Parts beside a nut face one of its flats, so the nut is modelled as wide as it is across its flats.
        nut_bottom = -grip_mm - screw.nut_height_mm.value
        solids.append(cylinder_between(screw.nut_width_mm.value, nut_bottom, -grip_mm))
    driver = ToolClearance("driver", translation(0, 0, head_height - middle_z), *shape.parts.tools.driver_mm)
    pose, size = compose(under_head, translation(0, 0, middle_z)), (head_mm, head_mm, head_height + shank_length)
    shape.box(screw.name, name, on, pose, size, screw.mass_kg.value, solids=solids, clearances=[driver])
