"""Rods on which wheels without servos turn: holes in the walls and the wheels, spacer tubes and caps.

A rod goes through both side walls of a module. Lengths in mm.
"""

import math

from foldcar.car.components.mounts import cylinder
from foldcar.car.components.shape import Shape, rectangle_around
from foldcar.car.folded.model import Point
from foldcar.car.folded.pose import translation
from foldcar.car.parts.catalogue import Catalogue

# Half a side of the layer of film around a rod.
ROD_LAYER_MM = 10.0
# Cubic metres in a cubic millimetre.
M3_PER_MM3 = 1e-9


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
    mass_kg = math.pi / 4 * diameter**2 * length * M3_PER_MM3 * rod.density_kg_m3.value
    # z of a wall's frame points to the other wall.
    pose, size = translation(*axis_mm, apart_mm / 2), (diameter, diameter, length)
    solids = [cylinder(diameter, -length / 2, length / 2)]
    shape.box(rod.name, shape.path("rod"), walls[0], pose, size, mass_kg, solids=solids)


def _put_rod_end(shape: Shape, wall: str, axis_mm: Point, gap_mm: float, wheel_mm: float) -> None:
    """Add what a rod needs at one wall: the hole, a second layer of film, the spacer tube and the cap.

    ``axis_mm`` is the point where the rod passes the wall. From the wall outwards follow the tube, ``gap_mm`` long, the
    wheel, ``wheel_mm`` wide, and the cap. z of the wall's frame points into the car, so what is outside has negative z.
    """
    film, tube, cap = shape.parts.film_mm, shape.parts.axle_tube, shape.parts.axle_cap
    side = wall.rpartition(".")[2]
    # The layer, and a hole in it and in the wall.
    layer, hole_mm = f"{side} rod.doubler", rod_hole_mm(shape.parts)
    outline = rectangle_around((0.0, 0.0), 2 * ROD_LAYER_MM, 2 * ROD_LAYER_MM)
    shape.layer(layer, wall, outline, axis_mm, "rod doubler")
    shape.round_hole(layer, f"{layer}.rod", "axle", (0.0, 0.0), hole_mm)
    shape.round_hole(wall, f"{side} rod.wall.rod", "axle", axis_mm, hole_mm)
    # The tube.
    tube_mm, bore_mm = tube.diameter_mm.value, tube.bore_mm.value
    tube_kg = math.pi / 4 * (tube_mm**2 - bore_mm**2) * gap_mm * M3_PER_MM3 * tube.density_kg_m3.value
    tube_pose = translation(*axis_mm, -(film + gap_mm) / 2)
    tube_solid = cylinder(tube_mm, -gap_mm / 2, gap_mm / 2, bore_mm=bore_mm)
    tube_name = shape.path(f"{side} spacer tube")
    shape.box(tube.name, tube_name, wall, tube_pose, (tube_mm, tube_mm, gap_mm), tube_kg, solids=[tube_solid])
    # The cap.
    cap_mm, height = cap.diameter_mm.value, cap.height_mm.value
    cap_pose = translation(*axis_mm, -(film / 2 + gap_mm + wheel_mm + height / 2))
    cap_solid = cylinder(cap_mm, -height / 2, height / 2, bore_mm=shape.parts.axle_rod.diameter_mm.value)
    cap_name = shape.path(f"{side} axle cap")
    shape.box(cap.name, cap_name, wall, cap_pose, (cap_mm, cap_mm, height), cap.mass_kg.value, solids=[cap_solid])
