"""Writes sheets as PDF, each on a page of its size. Layers differ by their colours."""

import io
from collections.abc import Sequence

from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.fabrication.patterns.drawing import Circle, Sheet


def pdf(sheets: Sequence[Sheet], title: str) -> bytes:
    """The file's bytes: a page for each sheet, without paper's margins."""
    # No ASCII-85 encoding: compressed streams are binary.
    rl_config.useA85 = 0
    binary = io.BytesIO()
    canvas = Canvas(binary, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("foldcar")
    # Viewers that support it print without scaling to the page.
    canvas.setViewerPreference("PrintScaling", "None")
    for sheet in sheets:
        canvas.setPageSize((sheet.width_mm * mm, sheet.height_mm * mm))
        canvas.scale(mm, mm)
        canvas.setLineJoin(1)
        for layer, groups in sheet.layers:
            canvas.setLineCap(0 if layer.name == "QR_CODE" else 1)
            canvas.setDash(list(layer.dashes_mm) if sheet.dashed else [])
            canvas.setStrokeColorRGB(*(value / 255 for value in layer.rgb))
            canvas.setLineWidth(layer.width_mm)
            for group in groups:
                # All shapes of a group are one path, which keeps pages small.
                path = canvas.beginPath()
                for shape in group:
                    if isinstance(shape, Circle):
                        path.circle(*shape.center_mm, shape.radius_mm)
                        continue
                    path.moveTo(*shape.points_mm[0])
                    for point in shape.points_mm[1:]:
                        path.lineTo(*point)
                    if shape.closed:
                        path.close()
                canvas.drawPath(path, stroke=1, fill=0)
        canvas.showPage()
    canvas.save()
    return binary.getvalue()
