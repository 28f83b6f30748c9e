"""Writes sheets as PDF at true scale, tiled on A4 or letter pages with registration marks."""

import io
from collections.abc import Sequence

from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.fabrication.patterns.drawing import Circle, Shape, Sheet
from foldcar.fabrication.patterns.layers import LAYERS
from foldcar.fabrication.patterns.tiles import BLANK_MM, MARK_MM, Tile, printed

# The colour of registration marks; no layer has it.
MARK_RGB = (230, 0, 126)
MARK_WIDTH_MM = 0.2


def pdf(sheets: Sequence[Sheet], paper: str, title: str) -> bytes:
    """The file's bytes: the pages of all sheets in order."""
    # No ASCII-85 encoding: compressed streams are binary.
    rl_config.useA85 = 0
    binary = io.BytesIO()
    canvas = Canvas(binary, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("foldcar")
    # Viewers that support it print without scaling to the page.
    canvas.setViewerPreference("PrintScaling", "None")
    for sheet in sheets:
        for tile, shown in printed(sheet, paper):
            _page(canvas, shown, tile)
    canvas.save()
    return binary.getvalue()


def _page(canvas: Canvas, sheet: Sheet, tile: Tile) -> None:
    canvas.setPageSize((tile.page_mm[0] * mm, tile.page_mm[1] * mm))
    if tile.marks_mm:
        canvas.setFont("Helvetica", 8)
        text = f"{tile.name}: print at 100 %, lay the crosses on those of the neighbouring pages"
        canvas.drawString(BLANK_MM * mm, 3 * mm, text)
    canvas.saveState()
    canvas.translate(tile.offset_mm[0] * mm, tile.offset_mm[1] * mm)
    window = canvas.beginPath()
    window.rect(
        tile.low_mm[0] * mm,
        tile.low_mm[1] * mm,
        (tile.high_mm[0] - tile.low_mm[0]) * mm,
        (tile.high_mm[1] - tile.low_mm[1]) * mm,
    )
    canvas.clipPath(window, stroke=0, fill=0)
    canvas.setLineJoin(1)
    for layer in LAYERS.values():
        canvas.setLineCap(0 if layer.name == "QR_CODE" else 1)
        canvas.setDash([length * mm for length in layer.dashes_mm] if sheet.dashed else [])
        canvas.setStrokeColorRGB(*(value / 255 for value in layer.rgb))
        canvas.setLineWidth(layer.width_mm * mm)
        for group in sheet.on(layer.name):
            _draw(canvas, group)
    canvas.setLineCap(1)
    canvas.setDash([])
    canvas.setStrokeColorRGB(*(value / 255 for value in MARK_RGB))
    canvas.setLineWidth(MARK_WIDTH_MM * mm)
    half = MARK_MM / 2
    for x, y in tile.marks_mm:
        canvas.line((x - half) * mm, y * mm, (x + half) * mm, y * mm)
        canvas.line(x * mm, (y - half) * mm, x * mm, (y + half) * mm)
    canvas.restoreState()
    canvas.showPage()


def _draw(canvas: Canvas, shapes: Sequence[Shape]) -> None:
    """Draw all shapes as one path, which keeps pages small."""
    path = canvas.beginPath()
    for shape in shapes:
        if isinstance(shape, Circle):
            path.circle(shape.center_mm[0] * mm, shape.center_mm[1] * mm, shape.radius_mm * mm)
            continue
        first, *others = shape.points_mm
        path.moveTo(first[0] * mm, first[1] * mm)
        for x, y in others:
            path.lineTo(x * mm, y * mm)
        if shape.closed:
            path.close()
    canvas.drawPath(path, stroke=1, fill=0)
