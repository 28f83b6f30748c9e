"""The layers of a cutting sheet: names, colours and line weights, equal in all file formats.

All colours are those of LightBurn's palette (docs.lightburnsoftware.com, Color Palette), which so gives each layer its
own settings. Origami Simulator reads the same ones: mountain red, valley blue, outline black. Layers are written in the
order of cutting: outlines last, so that pieces do not move before.
"""

from dataclasses import dataclass
from typing import Literal

LayerName = Literal["LABEL", "QR_CODE", "SCORE", "FOLD_MOUNTAIN", "FOLD_VALLEY", "CUT_INNER", "CUT_OUTER"]


@dataclass(frozen=True, slots=True)
class Layer:
    """A layer: ``rgb`` is its colour, ``lightburn`` its number in LightBurn's palette, ``width_mm`` the line weight.

    ``aci`` is the nearest AutoCAD colour index; ``line_type`` and ``dashes_mm`` (line and gap by turns) are those of
    folds that are drawn.
    """

    name: LayerName
    rgb: tuple[int, int, int]
    lightburn: str
    aci: int
    width_mm: float
    line_type: str = "CONTINUOUS"
    dashes_mm: tuple[float, ...] = ()

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


# A module of the QR code is as wide as its layer's lines: phones read 0.5 mm and more.
LAYERS: dict[LayerName, Layer] = {
    layer.name: layer
    for layer in (
        Layer("LABEL", (128, 128, 128), "C16", 8, 0.18),
        Layer("QR_CODE", (160, 0, 160), "C15", 212, 0.6),
        Layer("SCORE", (255, 128, 0), "C05", 30, 0.18),
        Layer("FOLD_MOUNTAIN", (255, 0, 0), "C02", 1, 0.18, "DASHDOT", (3.0, 1.0, 0.3, 1.0)),
        Layer("FOLD_VALLEY", (0, 0, 255), "C01", 5, 0.18, "DASHED", (3.0, 1.5)),
        Layer("CUT_INNER", (0, 160, 0), "C11", 92, 0.25),
        Layer("CUT_OUTER", (0, 0, 0), "C00", 7, 0.25),
    )
}
