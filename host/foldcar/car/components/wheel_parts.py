"""The bought parts of a wheel: horn, its centre screw, two wheel screws and the tyre, with their shapes.

Poses are in the frame of the inner disc, whose z points from the car outwards along the axle.
"""

import math

from foldcar.car.compiler.shape import Shape
from foldcar.car.components.fasteners import cylinder, screw_in
from foldcar.car.components.wheel_size import WheelSize, wheel_screws_mm
from foldcar.car.folded.model import Pose, Solid
from foldcar.car.folded.pose import apply, compose, inverse, rotation, translation
from foldcar.car.parts.catalogue import Catalogue

# The tyre's ring is modelled as so many boxes.
TYRE_BOXES = 48


def add_wheel_parts(shape: Shape, size: WheelSize) -> None:
    """Mount the horn on the inner disc's side towards the car, screws from outside, the tyre over both discs."""
    horn, parts = shape.parts.horn, shape.parts
    under = -size.film_mm / 2
    x0, y0, x1, y1 = horn.extent_mm
    center = ((x0 + x1) / 2, (y0 + y1) / 2, under - horn.height_mm.value / 2)
    shape.box(
        horn.name, "horn", "inner", translation(*center), (x1 - x0, y1 - y0, horn.height_mm.value), horn.mass_kg.value,
        solids=_horn_solids(shape.parts, center),
    )  # fmt: skip
    seat = translation(0, 0, under - horn.recess_depth_mm.value)
    screw_in(shape, parts.centre_screw, "centre screw", "inner", seat, 0.0)
    for i, (x, y) in enumerate(wheel_screws_mm(horn)):
        # On the hub's layer.
        seat = translation(x, y, -under + size.film_mm)
        screw_in(shape, parts.horn_screw, f"wheel screw {i + 1}", "inner", seat, 0.0)
    if parts.tyre.thickness_mm.value > 0:
        _tyre(shape, size)


def _horn_solids(parts: Catalogue, center: tuple[float, float, float]) -> list[Solid]:
    """Hub and arms or disc, relative to the middle of the horn's box."""
    horn, screw = parts.horn, parts.horn_screw.diameter_mm.value
    x, y, _ = center
    height, flat, recess = horn.height_mm.value, horn.thickness_mm.value, horn.recess_depth_mm.value
    hub, wide = horn.hub_diameter_mm.value, horn.recess_diameter_mm.value
    # From the servo outwards: around the spline, a floor for the centre screw's head, a recess for it.
    ends = (-height / 2, -height / 2 + horn.spline_depth_mm.value, height / 2 - recess, height / 2)
    bores = (parts.servo.spline_diameter_mm.value, horn.centre_hole_mm.value, wide)
    layers = zip(ends, ends[1:], bores, strict=False)
    solids = [cylinder(hub, low, high, -x, -y, bore_mm=bore) for low, high, bore in layers]
    # Arms and disc are flush with the hub's outer face; the screws cut their way into them.
    at_z = (height - flat) / 2
    at = wheel_screws_mm(horn)
    if horn.disc_diameter_mm:
        disc = horn.disc_diameter_mm.value
        holes = ((0.0, 0.0, wide), *((u, v, screw) for u, v in at))
        solids.append(Solid("cylinder", (disc, disc, flat), translation(-x, -y, at_z), holes))
    if horn.arms:
        for angle, reach in zip(horn.arms.at_deg, horn.arms.reach_mm, strict=True):
            out = rotation("z", math.radians(angle))
            along = (apply(inverse(out), *point) for point in at)
            holes = ((-reach / 2, 0.0, wide), *((u - reach / 2, v, screw) for u, v, _ in along))
            pose = compose(translation(-x, -y, at_z), out, translation(reach / 2, 0, 0))
            solids.append(Solid("box", (reach, horn.arms.width_mm, flat), pose, holes))
    return solids


def _tyre(shape: Shape, size: WheelSize) -> None:
    """A ring of boxes over both discs and the rim."""
    tyre = shape.parts.tyre
    width, thick = tyre.running_width_mm(size.width_mm), tyre.thickness_mm.value
    step = 2 * math.pi / TYRE_BOXES
    middle = size.disc_radius_mm + thick / 2
    box = (thick, 2 * middle * math.tan(step / 2), width)
    solids = [
        Solid("box", box, compose(rotation("z", i * step), translation(middle, 0, 0))) for i in range(TYRE_BOXES)
    ]
    pose: Pose = translation(0, 0, (size.width_mm - size.film_mm) / 2)
    shape.box(tyre.name, "tyre", "inner", pose, (2 * size.radius_mm, 2 * size.radius_mm, width),
              tyre.mass_kg(size.radius_mm, size.width_mm), solids=solids)  # fmt: skip
