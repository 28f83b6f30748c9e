"""The layers of a cutting sheet: names, colours and line weights, equal in all file formats.

Origami Simulator reads the same colours: mountain red, valley blue, outline black. Layers are written in the order of
cutting: outlines last, so that pieces do not move before.
"""

from dataclasses import dataclass
from typing import Literal

LayerName = Literal["LABEL", "SCORE", "FOLD_MOUNTAIN", "FOLD_VALLEY", "CUT_INNER", "CUT_OUTER"]


@dataclass(frozen=True, slots=True)
class Layer:
    """A layer: ``rgb`` is its colour, ``aci`` the nearest AutoCAD colour index, ``width_mm`` the line weight."""

    name: LayerName
    rgb: tuple[int, int, int]
    aci: int
    width_mm: float

    @property
    def hex(self) -> str:
        """The colour as in SVG: #rrggbb."""
        return "#{:02x}{:02x}{:02x}".format(*self.rgb)

    @property
    def cut(self) -> bool:
        """Whether its lines are cut through the film."""
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
