"""Reads written sheets back, and compares them with what was meant and with what cutters need.

Input: the intended sheets and the text or bytes of the written files. Output: findings as texts, none for correct files.
Of a PDF only the operators that sheets contain are read: stroked lines and circles in device colours; text is skipped.
"""

import io
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.entities.circle import Circle as DxfCircle
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.lldxf.const import DXFError
from numpy.typing import NDArray
from pypdf import PdfReader, Transformation
from pypdf.errors import PyPdfError
from reportlab.lib.units import mm
from scipy.spatial import cKDTree

from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.drawing import LAYERS, Circle, LayerName, Path, Point, Shape, Sheet, bounds
from foldcar.fabrication.patterns.lbrn import TOOL_LAYER
from foldcar.fabrication.patterns.options import Options

# Numbers have four decimals in files, six in PDF; cutters repeat within 0.1 mm.
TOLERANCE_MM = 0.01
# Findings of a kind that are listed; the rest are counted.
SHOWN = 3
SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
# A vertex of LightBurn, and that it has no handles.
VERTEX = re.compile(r"V(-?[0-9.]+) (-?[0-9.]+)(?:c0x1c1x1)?")
LINES = {"LineClosed": True, "LineOpen": False}
# Largest deviation of four cubic arcs from a circle, relative to its radius.
ARC_ERROR = 4e-4
LAYER_OF = {layer.rgb: layer.name for layer in LAYERS.values()}


class ReadingError(FoldcarError):
    """A file that is not a valid cutting sheet; the message says why."""


def check_sheet(sheet: Sheet, margin_mm: float) -> list[str]:
    """Findings about open outlines, duplicate lines, lines outside the usable area, lines of length 0."""
    findings = []
    outer = [shape for shape in sheet.shapes if isinstance(shape, Path) and shape.layer == "CUT_OUTER"]
    findings += [f"an outline at {_at(shape)} is not closed" for shape in outer if not shape.closed]
    for shape in sheet.shapes:
        if not shape.length_mm > TOLERANCE_MM:
            findings.append(f"a line of no length on {shape.layer} at {_at(shape)}")
    findings += _doubled(shape for shape in sheet.shapes if shape.layer != "LABEL")
    if sheet.shapes:
        x0, y0, x1, y1 = bounds(sheet.shapes)
        # Half a kerf may extend into the margin.
        low, right, top = margin_mm - 0.5 - TOLERANCE_MM, sheet.width_mm - margin_mm, sheet.height_mm - margin_mm
        if x0 < low or y0 < low or x1 > right + 0.5 + TOLERANCE_MM or y1 > top + 0.5 + TOLERANCE_MM:
            findings.append(
                f"lines from {x0:.1f}, {y0:.1f} to {x1:.1f}, {y1:.1f} leave the usable part of "
                f"{sheet.width_mm:g} x {sheet.height_mm:g} mm"
            )
    return _short(findings)


def check_same(meant: Sheet, read: Sheet) -> list[str]:
    """Findings about differences between the intended sheet and the one read: size, and every segment on its layer."""
    findings = []
    if max(abs(read.width_mm - meant.width_mm), abs(read.height_mm - meant.height_mm)) > TOLERANCE_MM:
        findings.append(
            f"is {read.width_mm:.2f} x {read.height_mm:.2f} mm large, should be {meant.width_mm:g} x {meant.height_mm:g}"
        )
    return findings + _differences(meant.shapes, read.shapes)


def check_text(read: Callable[[str], Sheet], meant: Sheet, text: str, chosen: Options) -> list[str]:
    """Findings about a written sheet, by the reader of its format."""
    try:
        found = read(text)
    except ReadingError as error:
        return [str(error)]
    return [*check_same(meant, found), *check_sheet(found, chosen.margin_mm)]


def check_pdf(meant: Sequence[Sheet], binary: bytes) -> list[str]:
    """Findings about a written PDF, by page."""
    try:
        pages = read_pdf(binary)
    except ReadingError as error:
        return [str(error)]
    if len(pages) != len(meant):
        return [f"has {len(pages)} pages, should have {len(meant)}"]
    pairs = enumerate(zip(meant, pages, strict=True), 1)
    return [f"page {number}: {found}" for number, (sheet, page) in pairs for found in check_same(sheet, page)]


def _doubled(shapes: Iterable[Shape]) -> Iterator[str]:
    """Findings about segments and circles that lie on each other, whatever their layers and directions."""
    rows = np.round(_vectors(shapes)[:, 1:], 2)
    rows[(rows[:, 2] < 0) | ((rows[:, 2] == 0) & (rows[:, 3] < 0)), 2:] *= -1.0
    places, counts = np.unique(rows + 0.0, axis=0, return_counts=True)
    for (x, y, *_), count in zip(places, counts, strict=True):
        if count > 1:
            yield f"{count} lines on each other at {x:.2f}, {y:.2f}"


def _vectors(shapes: Iterable[Shape]) -> NDArray[np.float64]:
    """(n, 5): layer's index · 1000, then a segment's midpoint and half of its extent (mm).

    A circle has its centre, its radius and a number that no segment has.
    """
    names = list(LAYERS)
    rows = []
    for shape in shapes:
        layer = 1000.0 * names.index(shape.layer)
        if isinstance(shape, Circle):
            rows.append((layer, *shape.center_mm, shape.radius_mm, -1e4))
            continue
        for (ax, ay), (bx, by) in shape.segments:
            rows.append((layer, (ax + bx) / 2, (ay + by) / 2, (bx - ax) / 2, (by - ay) / 2))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)


def _differences(meant: Iterable[Shape], read: Iterable[Shape]) -> list[str]:
    """Findings about lines that only one of the two has, within the tolerance, and about differing counts."""
    wanted, found = _vectors(meant), _vectors(read)
    findings = [_row(row, "is missing") for row in wanted[~_matched(wanted, found)]]
    findings += [_row(row, "is too much") for row in found[~_matched(found, wanted)]]
    if not findings and len(wanted) != len(found):
        findings.append(f"has {len(found)} lines, should have {len(wanted)}")
    return _short(findings)


def _matched(have: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,): whether ``other`` has each row of ``have`` within the tolerance, whatever the lines' direction."""
    tree = cKDTree(other)
    found = np.zeros(len(have), dtype=bool)
    for sign in (1.0, -1.0):
        turned = have * (1.0, 1.0, 1.0, sign, sign)
        found |= tree.query(turned, p=np.inf, distance_upper_bound=TOLERANCE_MM)[0] <= TOLERANCE_MM
    return found


def _row(row: NDArray[np.float64], word: str) -> str:
    layer = list(LAYERS)[round(row[0] / 1000)]
    return f"a line on {layer} at {row[1]:.2f}, {row[2]:.2f} {word}"


def _at(shape: Shape) -> str:
    x, y = shape.center_mm if isinstance(shape, Circle) else shape.points_mm[0]
    return f"{x:.2f}, {y:.2f}"


def _short(findings: list[str]) -> list[str]:
    if len(findings) <= SHOWN:
        return findings
    return [*findings[:SHOWN], f"and {len(findings) - SHOWN} more"]


def read_svg(text: str) -> Sheet:
    """The sheet in the file; ReadingError unless it is one with sizes in mm, of straight lines and circles on layers."""
    try:
        return _svg_sheet(ET.fromstring(text))
    except (ET.ParseError, KeyError, ValueError, IndexError) as error:
        raise ReadingError(f"not SVG: {error!r}") from error


def _svg_sheet(root: ET.Element) -> Sheet:
    # Without units the size depends on the program.
    sizes = [re.fullmatch("([0-9.]+)mm", root.attrib[side]) for side in ("width", "height")]
    if not all(sizes):
        raise ReadingError("width and height are not given in mm")
    width, height = (float(size[1]) for size in sizes if size)
    left, top, wide, high = map(float, root.attrib["viewBox"].split())

    def point(x: float, y: float) -> Point:
        return (x - left) * width / wide, height - (y - top) * height / high

    shapes: list[Shape] = []
    for group in root.iter(f"{SVG}g"):
        name = group.get(INKSCAPE_LABEL)
        if name not in LAYERS:
            raise ReadingError(f'has a layer "{name}"')
        layer = LAYERS[name].name
        for element in group:
            if element.tag == f"{SVG}circle":
                x, y, radius = (float(element.attrib[key]) for key in ("cx", "cy", "r"))
                shapes.append(Circle(layer, point(x, y), radius * width / wide))
            elif element.tag == f"{SVG}path":
                shapes += [replace(path, points_mm=tuple(point(*p) for p in path.points_mm))
                           for path in _svg_lines(layer, element.attrib["d"])]  # fmt: skip
            else:
                raise ReadingError(f"has a {element.tag.removeprefix(SVG)} on {layer}")
    if any("transform" in element.attrib for element in root.iter()):
        raise ReadingError("has a transform")
    return Sheet("", width, height, (tuple(shapes),))


def _svg_lines(layer: LayerName, data: str) -> Iterator[Path]:
    """The polylines of path data, of the commands M, L, l and z."""
    for part in re.findall("M[^M]*", data):
        points: list[Point] = []
        for command, text in re.findall("([A-Za-z])([^A-Za-z]*)", part):
            numbers = list(map(float, text.replace(",", " ").split()))
            if command not in "MLlz" or len(numbers) % 2:
                raise ReadingError(f"has a curve on {layer}")
            for dx, dy in zip(numbers[::2], numbers[1::2], strict=True):
                x, y = points[-1] if command == "l" else (0.0, 0.0)
                points.append((x + dx, y + dy))
        yield Path(layer, tuple(points), part.endswith("z"))


def read_dxf(text: str) -> Sheet:
    """The sheet in the file, its size from the drawing limits; ReadingError if it is not a valid sheet."""
    try:
        document = ezdxf.read(io.StringIO(text))
    except (OSError, DXFError) as error:
        raise ReadingError(f"not DXF: {error}") from error
    problems = document.audit().errors
    if problems:
        raise ReadingError(f"fails ezdxf's audit: {problems[0].message}")
    if document.units != units.MM:
        raise ReadingError(f"$INSUNITS is {document.units}, millimetres are {int(units.MM)}")
    space = document.modelspace()
    shapes: list[Shape] = []
    for entity in space:
        name = entity.dxf.layer
        if name not in LAYERS or name not in document.layers:
            raise ReadingError(f'has a layer "{name}"')
        layer = LAYERS[name].name
        if isinstance(entity, DxfCircle):
            shapes.append(Circle(layer, (entity.dxf.center.x, entity.dxf.center.y), entity.dxf.radius))
        elif isinstance(entity, LWPolyline) and not entity.has_arc:
            points = tuple((float(x), float(y)) for x, y in entity.get_points("xy"))
            shapes.append(Path(layer, points, bool(entity.closed)))
        else:
            raise ReadingError(f"has a {entity.dxftype()} on {name}")
    low, high = space.dxf.limmin, space.dxf.limmax
    if (low[0], low[1]) != (0, 0):
        raise ReadingError(f"the sheet's corner is at {low[0]:g}, {low[1]:g}")
    return Sheet("", float(high[0]), float(high[1]), (tuple(shapes),))


def read_lbrn(text: str) -> Sheet:
    """The sheet in the project; ReadingError if it is not one, or if its layers are not cut in their order."""
    try:
        root = ET.fromstring(text)
        names = dict(_layers(root))
        shapes: list[Shape] = []
        size: Point | None = None
        for element in root.iter("Shape"):
            index, kind = element.attrib["CutIndex"], element.attrib["Type"]
            x, y = _shift(element)
            if index == str(TOOL_LAYER) and kind == "Rect":
                size = float(element.attrib["W"]), float(element.attrib["H"])
                if (2 * x, 2 * y) != size:
                    raise ReadingError(f"the sheet's corner is at {x - size[0] / 2:g}, {y - size[1] / 2:g}")
                continue
            if names.get(index) not in LAYERS:
                raise ReadingError(f'has a {kind} on layer {index} "{names.get(index, "")}"')
            layer = LAYERS[names[index]].name  # type: ignore[index]
            if kind == "Ellipse" and element.attrib["Rx"] == element.attrib["Ry"]:
                shapes.append(Circle(layer, (x, y), float(element.attrib["Rx"])))
            elif kind == "Path":
                shapes.append(Path(layer, _points(element, (x, y)), LINES[element.findtext("PrimList", "")]))
            else:
                raise ReadingError(f"has a {kind} on {layer}")
    except (ET.ParseError, KeyError, ValueError) as error:
        raise ReadingError(f"not a LightBurn project: {error!r}") from error
    if size is None:
        raise ReadingError("has no sheet's edge on T1")
    return Sheet("", *size, (tuple(shapes),))


def _layers(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Number and name of each layer in the order of cutting, which must be that of `LAYERS`."""
    found = []
    for setting in root.iter("CutSetting"):
        index, name, priority = (setting.find(key).attrib["Value"] for key in ("index", "name", "priority"))  # type: ignore[union-attr]
        found.append((int(priority), index, name))
    found.sort()
    if [name for _, _, name in found if name in LAYERS] != list(LAYERS):
        raise ReadingError("its layers are not cut in their order")
    yield from ((index, name) for _, index, name in found)


def _shift(element: ET.Element) -> Point:
    *turn, x, y = map(float, element.findtext("XForm", "").split())
    if turn != [1, 0, 0, 1]:
        raise ReadingError("has a shape that is turned")
    return x, y


def _points(element: ET.Element, shift: Point) -> tuple[Point, ...]:
    text = element.findtext("VertList", "")
    found = tuple((float(x) + shift[0], float(y) + shift[1]) for x, y in VERTEX.findall(text))
    if VERTEX.sub("", text):
        raise ReadingError("has a curve")
    return found


def read_pdf(binary: bytes) -> list[Sheet]:
    """The sheet on each page; ReadingError if a page contains anything but a pattern."""
    try:
        return [_pdf_sheet(page) for page in PdfReader(io.BytesIO(binary), strict=True).pages]
    except (PyPdfError, ValueError, IndexError, AttributeError) as error:
        raise ReadingError(f"not PDF: {error}") from error


def _pdf_sheet(page: Any) -> Sheet:
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
                shapes += [_pdf_shape(part, colour) for part in parts]
                parts = []
            case "n":
                parts = []
            case "rg" | "w" | "J" | "j" | "M" | "d" | "i" | "gs":
                pass
            case _:
                raise ReadingError(f'has the operator "{word}"')
        operands = []
    return Sheet("", float(page.mediabox.width) / mm, float(page.mediabox.height) / mm, (tuple(shapes),))


def _pdf_shape(part: list[tuple[str, list[Point]]], colour: tuple[int, ...]) -> Shape:
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


# Readers of sheets in single files, by ending.
READERS = {"svg": read_svg, "dxf": read_dxf, "lbrn2": read_lbrn}
