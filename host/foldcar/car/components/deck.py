"""A shelf across the body: the boards are screwed onto it, the LiPo lies under it, its tongues go through both sides.

Its front and rear edges are folded down, which stiffens it against sagging.
"""

from foldcar.car.compiler.component import Component
from foldcar.car.compiler.parameter import Parameter
from foldcar.car.compiler.shape import Shape
from foldcar.car.components.box_beam import wall_mm
from foldcar.car.components.dimensions import WIDTH
from foldcar.car.folded.pose import translation
from foldcar.car.parts.catalogue import catalogue


class Deck(Component):
    """The face ``shelf``, x forward, y to the left, its origin at its right rear corner inside the wall."""

    parameters = (
        Parameter("length", 54, 20, 400, "along the car", "the tongues", internal=True),
        WIDTH,
    )

    def build(self, shape: Shape) -> None:
        """The shelf with a tongue at either side, and its two flanges."""
        assembly = catalogue().assembly
        length, inside = self["length"], self._inside_mm()
        a, b = (length - assembly.tongue_mm.value) / 2, (length + assembly.tongue_mm.value) / 2
        out = self.gap_mm + catalogue().film.thickness_mm.value / 2 + assembly.tongue_reach_mm.value
        outline = (
            (0.0, 0.0), (a, 0.0), (a, -out), (b, -out), (b, 0.0), (length, 0.0),
            (length, inside), (b, inside), (b, inside + out), (a, inside + out), (a, inside), (0.0, inside),
        )  # fmt: skip
        names = ("0", "1", "right tongue", "3", "4", "front", "6", "7", "left tongue", "9", "10", "rear")
        shape.face("shelf", outline, names, piece="deck")
        flange = assembly.flange_mm.value
        for edge in ("front", "rear"):
            corner = min(flange, inside / 4)
            points = ((0.0, 0.0), (inside, 0.0), (inside - corner, flange), (corner, flange))
            shape.face(f"{edge} flange", points, ("near", "1", "far", "3"))
            shape.connect(f"shelf.{edge}", f"{edge} flange.near", "fold", -90)

    def insert(self, shape: Shape, deck: str, floor: str, sides: tuple[str, str], x_mm: float, z_mm: float) -> None:
        """Put the shelf into a body: its rear end at x, its middle surface z above that of the floor.

        ``sides``: the left face, whose y runs up, and the right face, whose y runs down. Slots are cut into them.
        """
        assembly, thickness = catalogue().assembly, catalogue().film.thickness_mm.value
        slot_width = 2 * thickness + assembly.slot_clearance_mm.value
        slot_length = assembly.tongue_mm.value + 2 * assembly.slot_clearance_mm.value
        x = x_mm + self["length"] / 2
        left, right = sides
        heights = (z_mm, shape.face_size_mm(right)[1] - z_mm)
        for side, y in zip(sides, heights, strict=True):
            shape.rectangular_hole(side, f"{side} slot", "slot", (x, y), slot_length, slot_width)
        pose = translation(x_mm, self.gap_mm, z_mm)
        tongues = {"right tongue": (right, f"{right} slot"), "left tongue": (left, f"{left} slot")}
        shape.put_through(f"{deck}.shelf", floor, pose, tongues)

    @property
    def gap_mm(self) -> float:
        """Distance from the wall's middle surface to the shelf's edge (mm)."""
        return catalogue().film.thickness_mm.value / 2 + catalogue().assembly.slot_clearance_mm.value

    def _inside_mm(self) -> float:
        return wall_mm(self["width"]) - 2 * self.gap_mm
