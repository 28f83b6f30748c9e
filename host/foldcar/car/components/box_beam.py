"""The box beam, folded from floor, left side, lid, right side and a closing flap, and the caps of its ends.

Faces of the beam: ``floor``, ``left``, ``lid``, ``right``, each with x forward; neighbouring beams are fused along
their ``front`` and ``rear`` edges. ``width`` and ``height`` are outer dimensions; faces are the film's middle surface.
"""

from itertools import pairwise

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.dimensions import HEIGHT, WIDTH
from foldcar.car.parts.catalogue import catalogue

PANELS = ("floor", "left", "lid", "right")
LENGTH = Parameter("length", 80, 1, 1000, "length of a box beam", "a strip that can be folded")


def wall_mm(outer_mm: float) -> float:
    """Distance between the middle surfaces of two opposite walls (mm): the outer dimension less one film thickness."""
    return outer_mm - catalogue().film.thickness_mm.value


class Panel(Component):
    """A rectangle of film: ``length`` along x, ``width`` along y; face ``panel``."""

    parameters = (
        Parameter("length", 10, 0.5, 2000, "along x", "what can be cut"),
        Parameter("width", 10, 0.5, 2000, "along y", "what can be cut"),
    )

    def build(self, shape: Shape) -> None:
        """One face with edges near, front, far and rear."""
        shape.rectangle("panel", self["length"], self["width"])


class BoxBeam(Component):
    """Four walls and the tab of their seam, which is glued to the inside of the floor at its right edge."""

    parameters = (LENGTH, WIDTH, HEIGHT)

    def build(self, shape: Shape) -> None:
        """The four walls; each one's far edge is folded to the next one's near edge."""
        for name, size in zip(PANELS, (self["width"], self["height"]) * 2, strict=True):
            shape.rectangle(name, self["length"], wall_mm(size), piece="beam")
        for one, following in pairwise(PANELS):
            shape.connect(f"{one}.far", f"{following}.near", "fold", 90)
        flap = catalogue().assembly.lap_flap_mm.value
        shape.connect("floor.near", "right.far", "tab", 90, depth_mm=flap, mitre=0)


class EndCap(Component):
    """The end of a beam: a rectangle ``cap`` with edges near (floor), front, far (lid) and rear."""

    parameters = (WIDTH, HEIGHT, Parameter("slit", 0, 0, 100, "length of a slit for cables", "none", internal=True))

    def build(self, shape: Shape) -> None:
        """The face ``cap``, seen from inside: x points right on a front cap and left on a rear cap."""
        width, height = wall_mm(self["width"]), wall_mm(self["height"])
        # "front cap 1" is the one of segment 1.
        shape.rectangle("cap", width, height, piece=shape.name.rpartition(" ")[0] or "end cap")
        if self["slit"] > 0:
            slit = catalogue().assembly.cable_slit_mm.value
            shape.rectangular_hole("cap", "slit", "slit", (width / 2, height / 2), self["slit"], slit)
