"""What makes a wheel of folded discs: the horn that turns it and the tyre around it."""

import math
from typing import Literal

from foldcar.car.parts.quantity import Bought, Data, Holes, Quantity


class Arms(Data):
    """A horn's arms: their directions, lengths from the axis to the tip, and the width at the tip."""

    at_deg: tuple[float, ...]
    reach_mm: tuple[float, ...]
    width_mm: float
    tolerance: float
    source: str


class Horn(Bought):
    """A servo horn; it comes with the servo, and its mass counts to the wheel's.

    Its frame: the axis is z, arms in the plane of x and y, the first along x. Arms or disc are flush with the hub's
    outer face. ``holes`` are all, ``wheel_screws`` those of them that hold a wheel. Its cost says whence it comes.
    """

    mass_kg: Quantity
    arms: Arms | None
    disc_diameter_mm: Quantity | None
    hub_diameter_mm: Quantity
    height_mm: Quantity
    thickness_mm: Quantity
    spline_depth_mm: Quantity
    centre_hole_mm: Quantity
    recess_diameter_mm: Quantity
    recess_depth_mm: Quantity
    holes: Holes
    wheel_screws: Holes

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Least x and y, greatest x and y of arms, disc and hub (mm)."""
        half = max(self.hub_diameter_mm.value, self.disc_diameter_mm.value if self.disc_diameter_mm else 0.0) / 2
        xs, ys = [-half, half], [-half, half]
        if self.arms:
            for angle_deg, reach in zip(self.arms.at_deg, self.arms.reach_mm, strict=True):
                xs.append(reach * round(math.cos(math.radians(angle_deg)), 9))
                ys.append(reach * round(math.sin(math.radians(angle_deg)), 9))
        return min(xs), min(ys), max(xs), max(ys)


class Tyre(Bought):
    """A wheel's tyre; without a ``width_mm`` of its own it is cut to the rim's width. Its cost is a wheel's.

    It is cut from a strip, or from a tube that shrinks. Without a ``friction`` of its own it has the film's.
    """

    form: Literal["strip", "tube"]
    thickness_mm: Quantity
    width_mm: Quantity | None
    density_kg_m3: Quantity
    friction: Quantity | None
    note: str

    def running_width_mm(self, rim_width_mm: float) -> float:
        """The width that touches the ground (mm), on a rim of that width."""
        return rim_width_mm if self.width_mm is None else min(self.width_mm.value, rim_width_mm)

    def cut(self, radius_mm: float, rim_width_mm: float) -> str:
        """What to cut for a wheel of that outer radius: a strip as long as the tyre's middle, or a piece of tube."""
        wide, thick = self.running_width_mm(rim_width_mm), self.thickness_mm.value
        if self.form == "tube":
            least = 2 * (radius_mm - thick)
            flat = math.ceil(math.pi * least / 2)
            return f"{wide:g} mm of a tube that is wider than {least:g} mm before it shrinks ({flat} mm flat)"
        return f"a strip of {round(math.pi * (2 * radius_mm - thick))} x {wide:g} mm"

    def mass_kg(self, radius_mm: float, rim_width_mm: float) -> float:
        """The mass of a ring of that outer radius (kg)."""
        thickness = self.thickness_mm.value
        area_mm2 = math.pi * (radius_mm**2 - (radius_mm - thickness) ** 2)
        width_mm = rim_width_mm if self.width_mm is None else self.width_mm.value
        return area_mm2 * width_mm * 1e-9 * self.density_kg_m3.value
