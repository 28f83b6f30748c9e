"""Screws, spacers and the tools that put them in, and the ball caster."""

from foldcar.car.parts.quantity import Bought, BoxPart, PartData, Quantity


class Screw(Bought):
    """A screw, ``length_mm`` below the head, with its nut, if it has one."""

    mass_kg: Quantity
    diameter_mm: Quantity
    length_mm: Quantity
    head_diameter_mm: Quantity
    head_height_mm: Quantity
    nut_width_mm: Quantity | None
    nut_height_mm: Quantity | None


class Spacer(Bought):
    """A round spacer around a screw."""

    mass_kg: Quantity
    length_mm: Quantity
    diameter_mm: Quantity
    hole_mm: Quantity


class Tools(PartData):
    """The room that a screwdriver, a finger, and a nut before its screw need."""

    driver_diameter_mm: Quantity
    driver_length_mm: Quantity
    finger_diameter_mm: Quantity
    finger_length_mm: Quantity
    nut_room_mm: Quantity

    @property
    def finger_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest finger (mm)."""
        return _largest(self.finger_diameter_mm), _largest(self.finger_length_mm)

    @property
    def driver_mm(self) -> tuple[float, float]:
        """Diameter and length of the largest screwdriver's shaft (mm)."""
        return _largest(self.driver_diameter_mm), _largest(self.driver_length_mm)


def _largest(size: Quantity) -> float:
    return size.value + size.tolerance


class Caster(BoxPart):
    """A ball caster: a ball under a flange with two screws."""

    hole_spacing_mm: Quantity
