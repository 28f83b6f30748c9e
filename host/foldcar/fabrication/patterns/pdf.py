"""Writes sheets as PDF at true scale, tiled on A4 or letter pages with registration marks, and reads it back with pypdf.

Layers are identified by their colours. Only the operators that patterns contain are read: stroked lines and circles in
device colours, one clipping rectangle a page; text is skipped.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pypdf import PdfReader, Transformation
from pypdf.errors import PyPdfError
from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, LayerName, Path, Point, ReadingError, Shape, Sheet
from foldcar.fabrication.patterns.tiles import BLANK_MM, MARK_MM, Tile, printed

# The colour of registration marks; no layer has it.
MARK_RGB = (230, 0, 126)
MARK_WIDTH_MM = 0.2
POINTS_PER_MM = 72 / 25.4
# Largest deviation of four cubic arcs from a circle, relative to its radius.
ARC_ERROR = 4e-4
Matrix = tuple[float, float, float, float, float, float]


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


@dataclass(frozen=True, slots=True)
class Page:
    """One page: ``clip_mm`` is the clipping rectangle (x0, y0, x1, y1), ``marks`` the lines of registration marks."""

    width_mm: float
    height_mm: float
    clip_mm: tuple[float, float, float, float]
    shapes: tuple[Shape, ...]
    marks: tuple[tuple[Point, Point], ...]


def read_pdf(binary: bytes) -> list[Page]:
    """The pages; ReadingError if they contain anything but a pattern."""
    try:
        reader = PdfReader(io.BytesIO(binary), strict=True)
        return [_Interpreter(page).page() for page in reader.pages]
    except (PyPdfError, ValueError, IndexError, AttributeError) as error:
        raise ReadingError(f"not PDF: {error}") from error


class _Interpreter:
    """Interprets the operators of one page."""

    def __init__(self, page: Any) -> None:
        box = page.mediabox
        self.size = (float(box.width) / POINTS_PER_MM, float(box.height) / POINTS_PER_MM)
        self.words = page.get_contents().get_data().decode("latin-1").split()
        self.matrix: Matrix = (1 / POINTS_PER_MM, 0.0, 0.0, 1 / POINTS_PER_MM, 0.0, 0.0)
        self.colour = (0, 0, 0)
        self.stack: list[tuple[Matrix, tuple[int, int, int]]] = []
        self.parts: list[list[Any]] = []
        self.clip = (0.0, 0.0, *self.size)
        self.shapes: list[Shape] = []
        self.marks: list[tuple[Point, Point]] = []

    def page(self) -> Page:
        """The page after all operators."""
        text = False
        operands: list[float] = []
        for word in self.words:
            if word in ("BT", "ET"):
                text, operands = word == "BT", []
            elif text or not word.strip("[]"):
                continue
            elif word.strip("[]")[0] in "+-.0123456789":
                operands.append(float(word.strip("[]")))
            elif word[0] not in "/[]":
                self._follow(word, operands)
                operands = []
        return Page(*self.size, self.clip, tuple(self.shapes), tuple(self.marks))

    def _follow(self, name: str, operands: list[float]) -> None:
        if name == "q":
            self.stack.append((self.matrix, self.colour))
        elif name == "Q":
            self.matrix, self.colour = self.stack.pop()
        elif name == "cm":
            a, b, c, d, e, f = operands
            self.matrix = Transformation((a, b, c, d, e, f)).transform(Transformation(self.matrix)).ctm
        elif name in ("RG", "rg"):
            if name == "RG":
                red, green, blue = (round(255 * value) for value in operands)
                self.colour = (red, green, blue)
        elif name in ("m", "l", "c"):
            points = [self._point(operands[i], operands[i + 1]) for i in range(0, len(operands), 2)]
            if name == "m":
                self.parts.append([])
            self.parts[-1].append((name, points))
        elif name == "h":
            self.parts[-1].append(("h", []))
        elif name == "re":
            x, y, width, height = operands
            self.parts.append([("re", [self._point(x, y), self._point(x + width, y + height)])])
        elif name in ("W", "W*"):
            if len(self.parts) != 1 or self.parts[0][0][0] != "re":
                raise ReadingError("has a clipping path that is not a rectangle")
            (x0, y0), (x1, y1) = self.parts[0][0][1]
            self.clip = (x0, y0, x1, y1)
        elif name in ("n", "S", "s"):
            if name != "n":
                for part in self.parts:
                    self._stroke(part)
            self.parts = []
        elif name not in ("w", "J", "j", "M", "d", "i", "gs"):
            raise ReadingError(f'has the operator "{name}"')

    def _point(self, x: float, y: float) -> Point:
        a, b, c, d, e, f = self.matrix
        return a * x + c * y + e, b * x + d * y + f

    def _stroke(self, part: list[Any]) -> None:
        kinds = [kind for kind, _ in part]
        if self.colour == MARK_RGB:
            self.marks.append((part[0][1][0], part[1][1][0]))
            return
        layer = next((layer.name for layer in LAYERS.values() if layer.rgb == self.colour), None)
        if layer is None:
            raise ReadingError(f"has lines of colour {self.colour}, which no layer has")
        if "c" in kinds:
            self.shapes.append(_circle(layer, part))
        else:
            points = tuple(points[0] for kind, points in part if kind in ("m", "l"))
            self.shapes.append(Path(layer, points, kinds[-1] == "h"))


def _circle(layer: LayerName, part: list[Any]) -> Circle:
    """The circle that four cubic arcs approximate; ReadingError if they do not."""
    curves = [points for kind, points in part if kind == "c"]
    if len(curves) != 4:
        raise ReadingError(f"has a curve on {layer} that is not a circle")
    controls = np.array(curves)
    ends = controls[:, 2]
    starts, center = np.vstack([part[0][1], ends[:-1]]), ends.mean(axis=0)
    radius = float(np.linalg.norm(ends[0] - center))
    middles = (starts + 3 * controls[:, 0] + 3 * controls[:, 1] + ends) / 8
    distances = np.linalg.norm(np.concatenate([starts, ends, middles]) - center, axis=1)
    if np.abs(distances - radius).max() > ARC_ERROR * radius + 1e-4:
        raise ReadingError(f"has a curve on {layer} that is not a circle")
    return Circle(layer, (float(center[0]), float(center[1])), radius)
