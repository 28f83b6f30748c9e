"""Screws with their nuts as parts of their own: head, shank and nut, and the room of the screwdriver.

A screw's frame has its origin in the middle of its length, z along its axis towards its head.
"""

from foldcar.car.compiler.shape import Shape
from foldcar.car.folded.model import Access, Pose, Solid
from foldcar.car.folded.pose import compose, translation
from foldcar.car.parts.catalogue import Catalogue
from foldcar.car.parts.fasteners import Screw


def cylinder(
    diameter_mm: float, low_mm: float, high_mm: float, x_mm: float = 0.0, y_mm: float = 0.0, bore_mm: float = 0.0
) -> Solid:
    """A cylinder along z between two heights, with a bore along its axis."""
    pose = translation(x_mm, y_mm, (low_mm + high_mm) / 2)
    bores = ((0.0, 0.0, bore_mm),) if bore_mm else ()
    return Solid("cylinder", (diameter_mm, diameter_mm, high_mm - low_mm), pose, bores)


def driver(parts: Catalogue, z_mm: float) -> Access:
    """The room of a screwdriver along +z from a height."""
    return Access("driver", translation(0, 0, z_mm), *parts.tools.driver_mm)


def screw_in(shape: Shape, screw: Screw, name: str, on: str, under_head: Pose, grip_mm: float) -> None:
    """Add a screw: ``under_head`` is the point below its head in the frame of the face ``on``, z outwards.

    Its nut is ``grip_mm`` below the head.
    """
    head, shank = screw.head_height_mm.value, screw.length_mm.value
    middle = (head - shank) / 2
    solids = [
        cylinder(screw.head_diameter_mm.value, -middle, head - middle),
        cylinder(screw.diameter_mm.value, -shank - middle, -middle),
    ]
    if screw.nut_width_mm is not None and screw.nut_height_mm is not None:
        # A nut is held with a flat towards what stands beside it.
        low = -grip_mm - screw.nut_height_mm.value - middle
        solids.append(cylinder(screw.nut_width_mm.value, low, -grip_mm - middle))
    size = (screw.head_diameter_mm.value, screw.head_diameter_mm.value, head + shank)
    pose = compose(under_head, translation(0, 0, middle))
    accesses = [driver(shape.parts, head - middle)]
    shape.box(screw.name, name, on, pose, size, screw.mass_kg.value, (), solids, accesses)
