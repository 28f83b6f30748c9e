"""The switch between battery and servos, snapped into an end cap with layers of film behind it."""

import math

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.shape import Shape
from foldcar.car.folded.model import Access, Point, Solid
from foldcar.car.folded.pose import compose, rotation, translation
from foldcar.car.parts.catalogue import Catalogue


def layers(parts: Catalogue) -> int:
    """How many layers of film and tape lie behind the panel, so that the barbs of any such switch hold."""
    film, tape = (one.value - one.tolerance for one in (parts.film.thickness_mm, parts.assembly.tape_mm))
    least = parts.switch.panel_least_mm
    return max(1, math.ceil((least.value + least.tolerance - film) / (film + tape) - 1e-9))


def depth_mm(parts: Catalogue) -> float:
    """How far the switch reaches inwards from the panel (mm)."""
    switch = parts.switch
    return switch.height_mm.value - switch.rocker_height_mm.value - switch.bezel_height_mm.value


class SwitchMount(Component):
    """Faces ``layer 1`` …; the parent calls :meth:`cut`."""

    def build(self, shape: Shape) -> None:
        """The layers, each with its opening at the origin."""
        switch, margin = self.parts.switch, self.parts.assembly.switch_margin_mm.value
        a, b = switch.slot_length_mm.value / 2 + margin, switch.slot_width_mm.value / 2 + margin
        for i in range(layers(self.parts)):
            name = f"layer {i + 1}"
            shape.face(name, ((-a, -b), (a, -b), (a, b), (-a, b)), piece="switch doubler")
            _opening(shape, name, f"{name}.opening", (0.0, 0.0))

    @staticmethod
    def cut(shape: Shape, mount: str, panel: str, at_mm: Point) -> None:
        """Put the switch of the subcomponent ``mount`` into the caller's face ``panel``, seen from inside."""
        switch, film = shape.parts.switch, shape.parts.film.thickness_mm.value
        for i in range(layers(shape.parts)):
            shape.laminate(f"{mount}.layer {i + 1}", panel, translation(*at_mm, (i + 1) * film))
        hole = _opening(shape, panel, f"{mount} opening", at_mm)
        outside = switch.rocker_height_mm.value + switch.bezel_height_mm.value
        half = switch.height_mm.value / 2
        # z of the mount's frame points outwards; its box's middle lies inside.
        middle = half - outside - film / 2
        pose = compose(translation(*at_mm, middle), rotation("x", math.pi))
        size = (switch.length_mm.value, switch.width_mm.value, switch.height_mm.value)
        body = (switch.body_length_mm.value, switch.body_width_mm.value)
        solids = [
            _box((size[0], size[1]), half - outside, half - switch.rocker_height_mm.value),
            _box(body, half - switch.rocker_height_mm.value, half),
            _box(body, -half, half - outside),
        ]
        tools = shape.parts.tools
        thick, long = tools.finger_mm
        finger = Access("finger", translation(0, 0, half), thick, long)
        shape.box(switch.name, switch.name, panel, pose, size, switch.mass_kg.value, [hole], solids, [finger])


def _opening(shape: Shape, face: str, name: str, at_mm: Point) -> str:
    switch = shape.parts.switch
    return shape.rectangular_hole(face, name, "opening", at_mm, switch.slot_length_mm.value, switch.slot_width_mm.value)


def _box(footprint: tuple[float, float], low_mm: float, high_mm: float) -> Solid:
    return Solid("box", (*footprint, high_mm - low_mm), translation(0, 0, (low_mm + high_mm) / 2))
