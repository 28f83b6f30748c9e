"""Draws all sheets of a car side by side as one picture (PNG), to look at before cutting; not to cut from."""

import io
import itertools
import math
from collections.abc import Sequence

from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from foldcar.car.components.shape import on_circle
from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Path, Point, Shape, Sheet

# Pixels of a sheet's longer side, at which the names on pieces can be read; of the picture's sides, at most.
SHEET_PX = 1300
MOST_PX = 6000
DPI = 100
# Heights, in pixels, of a sheet's heading, of the picture's and of the legend.
HEADING_PX = 45
MARGIN_PX = 30
LEGEND_PX = 60
# Thicker than a layer's line, so that names can be read.
LINE_PT = 0.9
FACETS = 32


def preview(sheets: Sequence[Sheet], title: str) -> bytes:
    """The picture's bytes: every sheet with its name and film, lines in the colours of their layers, pieces shaded."""
    columns = math.ceil(math.sqrt(len(sheets)))
    rows = math.ceil(len(sheets) / columns)
    width_mm, height_mm = (max(getattr(sheet, side) for sheet in sheets) for side in ("width_mm", "height_mm"))
    scale = min(SHEET_PX / max(width_mm, height_mm), MOST_PX / (columns * width_mm), MOST_PX / (rows * height_mm))
    cell = width_mm * scale + MARGIN_PX, height_mm * scale + HEADING_PX
    wide, high = columns * cell[0] + MARGIN_PX, rows * cell[1] + LEGEND_PX + HEADING_PX
    figure = Figure(figsize=(wide / DPI, high / DPI), dpi=DPI, facecolor="white")
    figure.text(MARGIN_PX / wide, 1 - 0.6 * HEADING_PX / high, title, fontsize=18, va="center", parse_math=False)
    for number, sheet in enumerate(sheets):
        row, column = divmod(number, columns)
        left, low = MARGIN_PX + column * cell[0], high - HEADING_PX - (row + 1) * cell[1]
        axes = figure.add_axes(
            (left / wide, low / high, sheet.width_mm * scale / wide, sheet.height_mm * scale / high),
            xlim=(0, sheet.width_mm), ylim=(0, sheet.height_mm), frame_on=False, xticks=[], yticks=[],
        )  # fmt: skip
        axes.set_title(f"{sheet.name}: {sheet.film}", fontsize=14, loc="left", parse_math=False)
        axes.add_patch(Rectangle((0, 0), sheet.width_mm, sheet.height_mm, fill=False, edgecolor="0.7", clip_on=False))
        outer = itertools.chain.from_iterable(sheet.on("CUT_OUTER"))
        outlines = [_points(shape) for shape in outer if isinstance(shape, Path) and shape.closed]
        axes.add_collection(PolyCollection(outlines, facecolors="#eef3f8"))
        for layer, groups in sheet.layers:
            lines = [_points(shape) for shape in itertools.chain.from_iterable(groups)]
            # Modules of the QR code are to be seen as squares: their lines are drawn at scale.
            points = layer.width_mm * scale * 72 / DPI if layer.name == "QR_CODE" else LINE_PT
            cap = "butt" if layer.name == "QR_CODE" else "round"
            axes.add_collection(LineCollection(lines, colors=layer.hex, linewidths=points, capstyle=cap))
    used = {shape.layer for sheet in sheets for shape in sheet.shapes}
    keys = [Line2D([], [], color=layer.hex, lw=3, label=layer.name) for layer in LAYERS.values() if layer.name in used]
    across = len(keys) if columns > 1 else math.ceil(len(keys) / 2)
    corner = MARGIN_PX / wide, 0.0
    figure.legend(handles=keys, loc="lower left", bbox_to_anchor=corner, ncols=across, fontsize=14, frameon=False)
    binary = io.BytesIO()
    # Without the version of matplotlib.
    figure.savefig(binary, format="png", metadata={"Software": None})
    return binary.getvalue()


def _points(shape: Shape) -> list[Point]:
    """The shape's line, that of a closed one back to its start; a circle as a polygon."""
    if isinstance(shape, Circle):
        return on_circle(shape.radius_mm, (2 * math.pi * k / FACETS for k in range(FACETS + 1)), shape.center_mm)
    return [*shape.points_mm, *shape.points_mm[: shape.closed]]
