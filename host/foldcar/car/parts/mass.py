"""Mass, centre of mass and inertia of rigid bodies, of solid boxes and cylinders, in SI units."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class MassProperties:
    """Mass properties of a rigid body in the car's axes.

    ``center_m`` is the (3,) centre of mass, ``inertia_kg_m2`` the (3, 3) tensor about it.
    """

    mass_kg: float
    center_m: NDArray[np.float64]
    inertia_kg_m2: NDArray[np.float64]


def box_properties(
    mass_kg: float, size_m: tuple[float, float, float], center_m: tuple[float, float, float]
) -> MassProperties:
    """A solid box of uniform density with its edges along the axes."""
    squares = np.square(size_m)
    inertia = np.diag(mass_kg / 12 * (squares.sum() - squares))
    return MassProperties(mass_kg, np.array(center_m, dtype=np.float64), inertia)


def cylinder_properties(mass_kg: float, diameter_m: float, length_m: float) -> MassProperties:
    """A solid cylinder of uniform density around z, its middle at the origin."""
    across = mass_kg * (0.75 * diameter_m**2 + length_m**2) / 12
    return MassProperties(mass_kg, np.zeros(3), np.diag([across, across, mass_kg * diameter_m**2 / 8]))


def assemble(bodies: Iterable[MassProperties]) -> MassProperties:
    """The mass properties of the bodies as one rigid body (parallel-axis theorem)."""
    parts = list(bodies)
    mass_kg = sum(part.mass_kg for part in parts)
    center = np.sum([part.mass_kg * part.center_m for part in parts], axis=0) / mass_kg
    inertia = np.zeros((3, 3))
    for part in parts:
        offset = part.center_m - center
        inertia += part.inertia_kg_m2 + part.mass_kg * (
            offset @ offset * np.eye(3) - np.outer(offset, offset)
        )
    return MassProperties(mass_kg, center, inertia)
