"""A wheel: an outer disc, an inner one with layers laminated around its hub, and a rim strip with sawtooth tabs.

The wheel's frame has its origin at the wheel's centre and y along the axle, outwards on the left side. The rim is
modelled as a prism of many sides, whose corners lie on the wheel's radius.
"""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.dimensions import RADIUS
from foldcar.car.folded.model import Point
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.catalogue import catalogue

TYRE_WIDTH = Parameter("tire_thickness", 12, 1, 40, "axial width of a tyre", "a rim strip that can be folded")
# Approximate length of a tooth: the rim bends smoothly, and the teeth can be cut by hand.
TOOTH_MM = 6.0
LEAST_TEETH = 24


class Wheel(Component):
    """Two discs and a rim; the servo's horn is screwed to the inner disc."""

    parameters = (RADIUS, TYRE_WIDTH)

    def build(self, shape: Shape) -> None:
        """Faces ``inner``, ``outer``, ``hub 1`` … and ``rim 0`` …"""
        assembly = catalogue().assembly
        radius, width = self["radius"], self["tire_thickness"]
        teeth = max(LEAST_TEETH, round(2 * math.pi * radius / TOOTH_MM))
        # Discs are drawn as seen from inside the wheel.
        for name, label in (("inner", "wheel inner disc"), ("outer", "wheel outer disc")):
            shape.face(name, _disc(radius, teeth), piece=label)
        layers = round(assembly.hub_layers.value)
        hubs = [f"hub {i + 1}" for i in range(layers)]
        hub_radius = max(assembly.hub_radius_share.value * radius, assembly.horn_screw_radius_mm.value + 3)
        thickness = catalogue().film.thickness_mm.value
        for i, hub in enumerate(hubs):
            shape.face(hub, _disc(min(hub_radius, radius), teeth), piece="wheel hub layer")
            shape.laminate(hub, "inner", translation(0, 0, (i + 1) * thickness))
        for face in ("inner", "outer", *hubs):
            shape.round_hole(face, f"{face}.hub", "axle", (0, 0), assembly.hub_hole_mm.value)
        for face in ("inner", *hubs):
            for i, side in enumerate((-1, 1)):
                center = (side * assembly.horn_screw_radius_mm.value, 0.0)
                shape.round_hole(face, f"{face}.horn screw {i + 1}", "screw", center, assembly.horn_hole_mm.value)
        self._rim(shape, radius, width, teeth)
        # The inner disc's printed side faces +y of the wheel's frame; their x axes agree.
        shape.begin_at("inner", compose(translation(0, -width / 2, 0), rotation("x", -math.pi / 2)))
        horn = catalogue().horn
        size = (horn.length_mm.value, horn.hub_diameter_mm.value, horn.thickness_mm.value)
        at = translation(0, 0, -(thickness + size[2]) / 2)
        shape.box(horn.name, "horn", "inner", at, size, assembly.horn_mass_kg.value)

    def _rim(self, shape: Shape, radius: float, width: float, teeth: int) -> None:
        facet = 2 * radius * math.sin(math.pi / teeth)
        turn = 360 / teeth
        depth = min(TOOTH_MM, radius / 3)
        outline = ((0.0, 0.0), (facet, 0.0), (facet, width), (0.0, width))
        for i in range(teeth):
            shape.face(f"rim {i}", outline, ("inner", "next", "outer", "last"), role="rim", piece="wheel rim")
        for i in range(teeth):
            if i + 1 < teeth:
                shape.connect(f"rim {i}.next", f"rim {i + 1}.last", "fold", turn)
            # Both discs are drawn from inside the wheel: the rim runs along the outline of one, against the other's.
            shape.connect(f"inner.{-i % teeth}", f"rim {i}.inner", "tab", 90, depth_mm=depth, mitre=0.25)
            shape.connect(f"outer.{i}", f"rim {i}.outer", "tab", 90, depth_mm=depth, mitre=0.25)
        shape.connect("rim 0.last", f"rim {teeth - 1}.next", "tab", turn, depth_mm=facet, mitre=0)


def _disc(radius: float, corners: int) -> tuple[Point, ...]:
    step = 2 * math.pi / corners
    return tuple((radius * math.cos(i * step), radius * math.sin(i * step)) for i in range(corners))
