"""The layers of a cutting sheet: name, colour and line weight are the same in every file format.

Mountain red, valley blue and outline black are what Origami Simulator reads too. Layers are written in this order,
which is also the order to cut in: outlines last, so that pieces stay where they are until the end.
"""

from dataclasses import dataclass
from typing import Literal

LayerName = Literal["LABEL", "SCORE", "FOLD_MOUNTAIN", "FOLD_VALLEY", "CUT_INNER", "CUT_OUTER"]


@dataclass(frozen=True, slots=True)
class Layer:
    """``rgb`` is what is seen on screen, ``aci`` the nearest AutoCAD colour index, ``width_mm`` the line weight."""

    name: LayerName
    rgb: tuple[int, int, int]
    aci: int
    width_mm: float

    @property
    def hex(self) -> str:
        """The colour as SVG writes it."""
        return "#{:02x}{:02x}{:02x}".format(*self.rgb)

    @property
    def cut(self) -> bool:
        """Whether its lines go through the film."""
        return self.name.startswith("CUT")

    @property
    def fold(self) -> bool:
        """Whether its lines, or the dashes on them, are folds."""
        return self.name.startswith("FOLD")


LAYERS: dict[LayerName, Layer] = {
    layer.name: layer
    for layer in (
        Layer("LABEL", (96, 96, 96), 8, 0.13),
        Layer("SCORE", (255, 128, 0), 30, 0.18),
        Layer("FOLD_MOUNTAIN", (255, 0, 0), 1, 0.18),
        Layer("FOLD_VALLEY", (0, 0, 255), 5, 0.18),
        Layer("CUT_INNER", (0, 160, 80), 3, 0.25),
        Layer("CUT_OUTER", (0, 0, 0), 7, 0.25),
    )
}
