"""Mass properties of a folded car's bodies: film as plates of its thickness, bought parts as their solids.

Input: a FoldedCar (millimetres). Output: mass, centre of mass and inertia of one body in SI units, in the car's frame.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foldcar.car.folded.model import FoldedCar, Mount, Point, Pose
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
    volumes = [
        0.0 if solid.weightless else math.prod(solid.size_mm) * (math.pi / 4 if solid.kind == "cylinder" else 1.0)
        for solid in mount.shape
    ]
    properties = []
    for solid, volume in zip(mount.shape, volumes, strict=True):
        mass_kg = mount.mass_kg * volume / sum(volumes)
        x, y, z = (size * MM for size in solid.size_mm)
        if solid.kind == "cylinder":
            # With radius r and length h: m (3 r² + h²) / 12 across the axis, m r² / 2 about it. x is the diameter.
            across = mass_kg * (0.75 * x**2 + z**2) / 12
            moments = np.array([across, across, mass_kg * x**2 / 8])
        else:
            squares = np.square((x, y, z))
            moments = mass_kg / 12 * (squares.sum() - squares)
        about_centre = MassProperties(mass_kg, np.zeros(3), np.diag(moments))
        properties.append(_moved(about_centre, compose(mount.pose, solid.pose)))
    return assemble(properties)


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
    moments = _moments(face.outline_mm) - sum((_moments(hole.outline_mm) for hole in face.holes), np.zeros(6))
    area, first_x, first_y, second_xx, second_yy, second_xy = moments
    center_x, center_y = first_x / area, first_y / area
    # Moments about the centre of area (parallel-axis theorem), and across the thickness.
    xx = second_xx - area * center_x * center_x
    yy = second_yy - area * center_y * center_y
    xy = second_xy - area * center_x * center_y
    zz = area * thickness_mm**2 / 12
    inertia = np.array([[yy + zz, -xy, 0.0], [-xy, xx + zz, 0.0], [0.0, 0.0, xx + yy]])
    # The mass of a plate's area (kg/mm²) turns moments of area into moments of mass.
    density_kg_mm2 = thickness_mm * MM**3 * film.density_kg_m3.value
    inertia *= density_kg_mm2 * MM**2
    center_m = np.array([center_x * MM, center_y * MM, 0.0])
    in_face = MassProperties(area * density_kg_mm2, center_m, inertia)
    return _moved(in_face, placed.pose)


def _moments(outline: Sequence[Point]) -> NDArray[np.float64]:
    """Return six moments of the area of a polygon about its frame's origin, by Green's theorem.

    These are the area (mm²), its first moments along x and y (mm³), and its second moments xx, yy and xy (mm⁴). They are
    positive if the polygon runs counter-clockwise.
    """
    # The start and the end of each edge.
    x0, y0 = np.array(outline).T
    x1, y1 = np.array((*outline[1:], outline[0])).T
    # Twice the area of the triangle between the origin and each edge. Each sum adds up the moments of these triangles.
    cross = x0 * y1 - x1 * y0
    return np.array([
        cross.sum() / 2,
        ((x0 + x1) * cross).sum() / 6,
        ((y0 + y1) * cross).sum() / 6,
        ((x0 * x0 + x0 * x1 + x1 * x1) * cross).sum() / 12,
        ((y0 * y0 + y0 * y1 + y1 * y1) * cross).sum() / 12,
        ((x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0) * cross).sum() / 24,
    ])  # fmt: skip


def _moved(properties: MassProperties, pose: Pose) -> MassProperties:
    """Return the mass properties of the body moved by the pose (mm)."""
    matrix = np.array(pose)
    turn, shift = matrix[:3, :3], matrix[:3, 3] * MM
    center = turn @ properties.center_m + shift
    return MassProperties(properties.mass_kg, center, turn @ properties.inertia_kg_m2 @ turn.T)
