"""A bought ball caster under a floor, for user modules: `Sub("caster", Caster)` and `Caster.attach` in `build`.

The simulator has contacts for wheels and bellies only: in it a caster has mass but no contact.
"""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.shape import Shape
from foldcar.car.folded.pose import compose, rotation, translation


class Caster(Component):
    """A second layer of film on the floor; the caster is screwed under it."""

    def build(self, shape: Shape) -> None:
        """The face ``plate``, its origin at its centre."""
        caster, margin = self.parts.caster, self.parts.assembly.doubler_margin_mm.value
        a = caster.length_mm.value / 2 + margin
        b = caster.width_mm.value / 2 + margin
        shape.face("plate", ((-a, -b), (a, -b), (a, b), (-a, b)), piece="caster plate")
        _holes(shape, "plate", "", (0.0, 0.0))

    @staticmethod
    def attach(shape: Shape, mount: str, floor: str, at_mm: tuple[float, float]) -> None:
        """Fix the caster of the subcomponent ``mount`` under the caller's face ``floor``, its centre at ``at_mm``."""
        caster, film = shape.parts.caster, shape.parts.film.thickness_mm.value
        holes = _holes(shape, floor, f"{mount}.", at_mm)
        shape.laminate(f"{mount}.plate", floor, translation(*at_mm, film))
        under = translation(*at_mm, -(film + caster.height_mm.value) / 2)
        size = (caster.length_mm.value, caster.width_mm.value, caster.height_mm.value)
        pose = compose(under, rotation("x", math.pi))
        shape.box(caster.name, f"{shape.name}.{mount}", floor, pose, size, caster.mass_kg.value, holes)


def _holes(shape: Shape, face: str, prefix: str, middle: tuple[float, float]) -> list[str]:
    half, size = shape.parts.caster.hole_spacing_mm.value / 2, shape.parts.assembly.screw_hole_mm.value
    return [
        shape.round_hole(face, f"{prefix}screw {i + 1}", "screw", (middle[0] + x, middle[1]), size)
        for i, x in enumerate((-half, half))
    ]
