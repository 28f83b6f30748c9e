"""Mass properties of a folded car's bodies: film as plates of its thickness, bought parts as their solids.

Input: a FoldedCar (millimetres). Output: mass, centre of mass and inertia of one body in SI units, in the car's frame.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import FoldedCar, Mount, Point, Pose, Solid
from foldcar.car.folded.placed import PlacedFace, placed_faces
from foldcar.car.folded.pose import compose
from foldcar.car.parts.bought import Film

MM = 1e-3


@dataclass(frozen=True)
class MassProperties:
    """Mass properties of a rigid body in the axes of the car.

    ``center_m`` (3,) is the centre of mass, and ``inertia_kg_m2`` (3, 3) is the tensor about it.
    """

    mass_kg: float
    center_m: NDArray[np.float64]
    inertia_kg_m2: NDArray[np.float64]


def assemble(bodies: Iterable[MassProperties]) -> MassProperties:
    """Return the mass properties of the bodies as one rigid body (parallel-axis theorem)."""
    parts = list(bodies)
    mass_kg = sum(part.mass_kg for part in parts)
    center = np.sum([part.mass_kg * part.center_m for part in parts], axis=0) / mass_kg
    inertia = np.zeros((3, 3))
    for part in parts:
        offset = part.center_m - center
        inertia += part.inertia_kg_m2 + part.mass_kg * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(mass_kg, center, inertia)


def body_properties(car: FoldedCar, body: str) -> MassProperties:
    """Return the mass properties of the film and the parts of a body (``segment0`` … or ``wheel0`` …), hinges flat.

    They are in SI units, in the frame of the car.
    """
    film = (plate_properties(face, car.parts.film) for face in placed_faces(car, (body,))[body])
    return assemble([*film, *(mount_properties(mount) for mount in car.mounts if mount.body == body)])


def mount_properties(mount: Mount) -> MassProperties:
    """Return the mass properties of a part of uniform density (SI units, in the frame of the car).

    The part is made of its solids or, if it has none, of its box.
    """
    volumes_mm3 = [_volume_mm3(solid) for solid in mount.shape]
    properties = []
    for solid, volume_mm3 in zip(mount.shape, volumes_mm3, strict=True):
        mass_kg = mount.mass_kg * volume_mm3 / sum(volumes_mm3)
        size_m = [size * MM for size in solid.size_mm]
        if solid.kind == "cylinder":
            # The moments of inertia of a cylinder with the diameter d and the length h are m (3/4 d² + h²) / 12 about x
            # and y, and m d² / 8 about its axis z.
            diameter_m, _, length_m = size_m
            across_axis = mass_kg * (0.75 * diameter_m**2 + length_m**2) / 12
            about_axis = mass_kg * diameter_m**2 / 8
            moments = np.array([across_axis, across_axis, about_axis])
        else:
            # That of a box about an axis is m / 12 times the sum of the squares of its two sizes across the axis.
            squares = np.square(size_m)
            moments = mass_kg / 12 * (squares.sum() - squares)
        about_centre = MassProperties(mass_kg, np.zeros(3), np.diag(moments))
        properties.append(_moved(about_centre, compose(mount.pose, solid.pose)))
    return assemble(properties)


def _volume_mm3(solid: Solid) -> float:
    """Return the volume of a box or cylinder; 0 if it has no part in the mass."""
    if solid.weightless:
        return 0.0
    box_mm3 = math.prod(solid.size_mm)
    return box_mm3 * (math.pi / 4) if solid.kind == "cylinder" else box_mm3


def max_placement_shift_mm(car: FoldedCar) -> float:
    """Return how far (mm) the centre of mass may move along the floor because parts are placed by eye.

    These are the parts with a printed outline, or with holes that mark their corners.
    """
    marked: set[str] = set()
    for piece in car.pieces:
        for face in piece.faces:
            marked.update(mark.name for mark in face.marks)
            for hole in face.holes:
                if hole.kind == "mark":
                    # A hole is called such as "B1.PART corner 2".
                    last_name = hole.name.rpartition(".")[2]
                    marked.add(last_name.partition(" corner ")[0])
    placed_by_eye_kg = sum(mount.mass_kg for mount in car.mounts if mount.name in marked)
    car_kg = sum(body_properties(car, body).mass_kg for body in {placed.body for placed in car.placed})
    return car.parts.assembly.placement_mm.value * placed_by_eye_kg / car_kg


def film_area_cm2(car: FoldedCar) -> float:
    """Return the area of the car's flat pieces (cm²): all faces with tabs; holes are not subtracted."""
    return sum(piece.count * sum(area_mm2(face.outline_mm) for face in piece.faces) for piece in car.pieces) / 100


def area_mm2(outline: Sequence[Point]) -> float:
    """Return the signed area of a polygon (mm²), positive if it runs counter-clockwise (shoelace formula)."""
    x0, y0 = outline[-1]
    doubled = 0.0
    for x1, y1 in outline:
        doubled += x0 * y1 - x1 * y0
        x0, y0 = x1, y1
    return doubled / 2


def plate_properties(placed: PlacedFace, film: Film) -> MassProperties:
    """Return the mass properties of a face as a plate of uniform thickness (SI units, in the frame of the car)."""
    face, thickness_mm = placed.face, placed.piece.thickness_mm
    # The moments of an outline are its area, the first moments, and the second moments. Those of the holes are
    # subtracted.
    hole_moments = sum((_moments(hole.outline_mm) for hole in face.holes), np.zeros(6))
    area_mm2, first_x, first_y, second_xx, second_yy, second_xy = _moments(face.outline_mm) - hole_moments
    center_x, center_y = first_x / area_mm2, first_y / area_mm2
    # Second moments (mm⁴) about the centre of the area (parallel-axis theorem), and across the thickness.
    xx = second_xx - area_mm2 * center_x * center_x
    yy = second_yy - area_mm2 * center_y * center_y
    xy = second_xy - area_mm2 * center_x * center_y
    zz = area_mm2 * thickness_mm**2 / 12
    inertia_mm4 = np.array([[yy + zz, -xy, 0.0], [-xy, xx + zz, 0.0], [0.0, 0.0, xx + yy]])
    # The density is per cubic metre, so the thickness and the area count in metres.
    density_kg_mm2 = thickness_mm * MM**3 * film.density_kg_m3.value
    inertia_kg_m2 = inertia_mm4 * (density_kg_mm2 * MM**2)
    center_m = np.array([center_x * MM, center_y * MM, 0.0])
    in_face = MassProperties(area_mm2 * density_kg_mm2, center_m, inertia_kg_m2)
    return _moved(in_face, placed.pose)


def _moments(outline: Sequence[Point]) -> NDArray[np.float64]:
    """Return six moments of the area of a polygon about its frame's origin, by Green's theorem.

    These are the area (mm²), its first moments along x and y (mm³), and its second moments xx, yy and xy (mm⁴). They are
    positive if the polygon runs counter-clockwise.
    """
    # Each edge makes a triangle with the origin. The moments of the polygon are the sums of those of these triangles.
    # Edges start at (x0, y0) and end at (x1, y1).
    x0, y0 = np.array(outline).T
    x1, y1 = np.array((*outline[1:], outline[0])).T
    doubled_areas = x0 * y1 - x1 * y0
    area = doubled_areas.sum() / 2
    first_x = ((x0 + x1) * doubled_areas).sum() / 6
    first_y = ((y0 + y1) * doubled_areas).sum() / 6
    second_xx = ((x0 * x0 + x0 * x1 + x1 * x1) * doubled_areas).sum() / 12
    second_yy = ((y0 * y0 + y0 * y1 + y1 * y1) * doubled_areas).sum() / 12
    second_xy = ((x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0) * doubled_areas).sum() / 24
    return np.array([area, first_x, first_y, second_xx, second_yy, second_xy])


def _moved(properties: MassProperties, pose: Pose) -> MassProperties:
    """Return the mass properties of the body moved by the pose (mm)."""
    matrix = np.array(pose)
    turn, shift = matrix[:3, :3], matrix[:3, 3] * MM
    center = turn @ properties.center_m + shift
    return MassProperties(properties.mass_kg, center, turn @ properties.inertia_kg_m2 @ turn.T)
