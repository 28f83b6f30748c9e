"""Writes sheets as PDF, each on a page of its size, and reads it back with pypdf.

Layers are identified by their colours. Only the operators that patterns contain are read: stroked lines and circles in
device colours; text is skipped.
"""

import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from pypdf import PdfReader, Transformation
from pypdf.errors import PyPdfError
from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Path, Point, ReadingError, Shape, Sheet

# Largest deviation of four cubic arcs from a circle, relative to its radius.
ARC_ERROR = 4e-4
LAYER_OF = {layer.rgb: layer.name for layer in LAYERS.values()}


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


def read_pdf(binary: bytes) -> list[Sheet]:
    """The sheet on each page; ReadingError if a page contains anything but a pattern."""
    try:
        return [_sheet(page) for page in PdfReader(io.BytesIO(binary), strict=True).pages]
    except (PyPdfError, ValueError, IndexError, AttributeError) as error:
        raise ReadingError(f"not PDF: {error}") from error


def _sheet(page: Any) -> Sheet:
    """Interprets the operators of one page."""
    content = re.sub(r"\bBT\b.*?\bET\b", "", page.get_contents().get_data().decode("latin-1"), flags=re.DOTALL)
    matrix = Transformation().scale(1 / mm)
    colour: tuple[int, ...] = (0, 0, 0)
    stack: list[tuple[Transformation, tuple[int, ...]]] = []
    shapes: list[Shape] = []
    # Subpaths of the current path, each with its operators and their points.
    parts: list[list[tuple[str, list[Point]]]] = []
    operands: list[float] = []
    for word in content.split():
        number = word.strip("[]")
        if number and number[0] in "+-.0123456789":
            operands.append(float(number))
            continue
        if not number or word[0] == "/":
            continue
        match word:
            case "q":
                stack.append((matrix, colour))
            case "Q":
                matrix, colour = stack.pop()
            case "cm":
                a, b, c, d, e, f = operands
                matrix = Transformation((a, b, c, d, e, f)).transform(matrix)
            case "RG":
                colour = tuple(round(255 * value) for value in operands)
            case "m" | "l" | "c" | "h":
                a, b, c, d, e, f = matrix.ctm
                pairs = zip(operands[::2], operands[1::2], strict=True)
                if word == "m":
                    parts.append([])
                parts[-1].append((word, [(a * x + c * y + e, b * x + d * y + f) for x, y in pairs]))
            case "S":
                shapes += [_shape(part, colour) for part in parts]
                parts = []
            case "n":
                parts = []
            case "rg" | "w" | "J" | "j" | "M" | "d" | "i" | "gs":
                pass
            case _:
                raise ReadingError(f'has the operator "{word}"')
        operands = []
    return Sheet("", float(page.mediabox.width) / mm, float(page.mediabox.height) / mm, (tuple(shapes),))


def _shape(part: list[tuple[str, list[Point]]], colour: tuple[int, ...]) -> Shape:
    """The line, or the circle that four cubic arcs approximate; ReadingError for any other curve."""
    if colour not in LAYER_OF:
        raise ReadingError(f"has lines of colour {colour}, which no layer has")
    layer = LAYER_OF[colour]
    kinds = "".join(kind for kind, _ in part)
    if "c" not in kinds:
        return Path(layer, tuple(points[0] for _, points in part if points), kinds.endswith("h"))
    if kinds.removesuffix("h") != "mcccc":
        raise ReadingError(f"has a curve on {layer} that is not a circle")
    controls = np.array([points for kind, points in part if kind == "c"])
    ends = controls[:, 2]
    starts, center = np.vstack([part[0][1], ends[:-1]]), ends.mean(axis=0)
    radius = float(np.linalg.norm(ends[0] - center))
    middles = (starts + 3 * controls[:, 0] + 3 * controls[:, 1] + ends) / 8
    distances = np.linalg.norm(np.concatenate([starts, ends, middles]) - center, axis=1)
    if np.abs(distances - radius).max() > ARC_ERROR * radius + 1e-4:
        raise ReadingError(f"has a curve on {layer} that is not a circle")
    return Circle(layer, (float(center[0]), float(center[1])), radius)
