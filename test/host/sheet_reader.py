"""Reads written sheets back, and compares them with what was meant and with what cutters need.

Input: the intended sheets and the text or bytes of the written files. Output: findings as texts, none for correct files.
Of a PDF only the operators that sheets contain are read: stroked lines and circles in device colours; text is skipped.
"""

import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.entities.circle import Circle as DxfCircle
from ezdxf.entities.lwpolyline import LWPolyline
from numpy.typing import NDArray
from pypdf import PdfReader, Transformation
from reportlab.lib.units import mm
from scipy.spatial import cKDTree

from foldcar.fabrication.patterns.drawing import LAYERS, Circle, Path, Point, Shape, Sheet, bounds
from foldcar.fabrication.patterns.options import Options
from foldcar.fabrication.patterns.sheet_files import TOOL_LAYER

# Numbers have four decimals in files, six in PDF; cutters repeat within 0.1 mm.
TOLERANCE_MM = 0.01
# Findings of a kind that are listed.
SHOWN = 3
SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
# A vertex of LightBurn, and that it has no handles.
VERTEX = re.compile(r"V(-?[0-9.]+) (-?[0-9.]+)(?:c0x1c1x1)?")
# Largest deviation of four cubic arcs from a circle, relative to its radius.
ARC_ERROR = 4e-4
LAYER_OF = {layer.rgb: layer.name for layer in LAYERS.values()}


class ReadingError(Exception):
    """A file that is not a valid cutting sheet; the message says why."""


def check_sheet(sheet: Sheet, margin_mm: float) -> list[str]:
    """Findings about open outlines, duplicate lines, lines outside the usable area, lines of length 0."""
    findings = []
    for shape in sheet.shapes:
        if isinstance(shape, Path) and shape.layer == "CUT_OUTER" and not shape.closed:
            findings.append(f"an outline at {_at(shape)} is not closed")
        if not shape.length_mm > TOLERANCE_MM:
            findings.append(f"a line of no length on {shape.layer} at {_at(shape)}")
    rows = np.round(_vectors(shape for shape in sheet.shapes if shape.layer != "LABEL")[:, 1:], 2)
    # Whatever the lines' directions and layers.
    rows[(rows[:, 2] < 0) | ((rows[:, 2] == 0) & (rows[:, 3] < 0)), 2:] *= -1.0
    counts = Counter(map(tuple, (rows + 0.0).tolist()))
    findings += [f"{count} lines on each other at {row[0]}, {row[1]}" for row, count in counts.items() if count > 1]
    # Half a kerf may extend into the margin.
    spare = 0.5 + TOLERANCE_MM - margin_mm
    x0, y0, x1, y1 = bounds(sheet.shapes)
    if min(x0, y0) < -spare or x1 > sheet.width_mm + spare or y1 > sheet.height_mm + spare:
        findings.append(f"lines from {x0:.1f}, {y0:.1f} to {x1:.1f}, {y1:.1f} leave the usable part of the sheet")
    return findings[:SHOWN]


def check_same(meant: Sheet, read: Sheet) -> list[str]:
    """Findings about differences between the intended sheet and the one read: size, and every segment on its layer."""
    findings = []
    if max(abs(read.width_mm - meant.width_mm), abs(read.height_mm - meant.height_mm)) > TOLERANCE_MM:
        findings.append(f"is {read.width_mm} x {read.height_mm} mm large, not {meant.width_mm} x {meant.height_mm}")
    wanted, result = _vectors(meant.shapes), _vectors(read.shapes)
    findings += [_row(row, "is missing") for row in wanted[~_matched(wanted, result)]]
    findings += [_row(row, "is too much") for row in result[~_matched(result, wanted)]]
    if not findings and len(wanted) != len(result):
        findings.append(f"has {len(result)} lines, should have {len(wanted)}")
    return findings[:SHOWN]


def check_text(read: Callable[[str], Sheet], meant: Sheet, text: str, chosen: Options) -> list[str]:
    """Findings about a written sheet, by the reader of its format."""
    try:
        sheet = read(text)
    except ReadingError as error:
        return [str(error)]
    return [*check_same(meant, sheet), *check_sheet(sheet, chosen.margin_mm)]


def check_pdf(meant: Sequence[Sheet], binary: bytes) -> list[str]:
    """Findings about a written PDF, by page."""
    pages = read_pdf(binary)
    if len(pages) != len(meant):
        return [f"has {len(pages)} pages, should have {len(meant)}"]
    pairs = enumerate(zip(meant, pages, strict=True), 1)
    return [f"page {number}: {finding}" for number, (sheet, page) in pairs for finding in check_same(sheet, page)]


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


def _matched(have: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,): whether ``other`` has each row of ``have`` within the tolerance, whatever the lines' direction."""
    tree = cKDTree(other)
    result = np.zeros(len(have), dtype=bool)
    for sign in (1.0, -1.0):
        turned = have * (1.0, 1.0, 1.0, sign, sign)
        result |= tree.query(turned, p=np.inf, distance_upper_bound=TOLERANCE_MM)[0] <= TOLERANCE_MM
    return result


def _row(row: NDArray[np.float64], word: str) -> str:
    layer = list(LAYERS)[round(row[0] / 1000)]
    return f"a line on {layer} at {row[1]:.2f}, {row[2]:.2f} {word}"


def _at(shape: Shape) -> str:
    x, y = shape.center_mm if isinstance(shape, Circle) else shape.points_mm[0]
    return f"{x:.2f}, {y:.2f}"


def read_svg(text: str) -> Sheet:
    """The sheet in the file; ReadingError unless it is one with sizes in mm, of straight lines and circles on layers."""
    root = ElementTree.fromstring(text)
    # Without units the size depends on the program.
    sizes = [re.fullmatch("([0-9.]+)mm", root.attrib[side]) for side in ("width", "height")]
    if not all(sizes):
        raise ReadingError("width and height are not given in mm")
    width, height = (float(size[1]) for size in sizes if size)
    if root.attrib["viewBox"] != f"0 0 {width:g} {height:g}" or any(
        "transform" in element.attrib for element in root.iter()
    ):
        raise ReadingError("is not at true scale")
    shapes: list[Shape] = []
    for group in root.iter(f"{SVG}g"):
        layer = _layer(group.get(INKSCAPE_LABEL))
        for element in group:
            if element.tag == f"{SVG}circle":
                x, y, radius = (float(element.attrib[key]) for key in ("cx", "cy", "r"))
                shapes.append(Circle(layer, (x, height - y), radius))
            else:
                shapes += _svg_lines(layer, element.attrib["d"], height)
    return Sheet("", width, height, (tuple(shapes),))


def _layer(name: Any) -> Any:
    if name not in LAYERS:
        raise ReadingError(f'has a layer "{name}"')
    return name


def _svg_lines(layer: Any, data: str, height: float) -> Iterator[Path]:
    """The polylines of path data: a start (M), relative steps (l), closed or not (z)."""
    for part in re.findall("M[^M]*", data):
        match = re.fullmatch(r"M([^a-z]+)l([^a-z]+)(z?)", part)
        if match is None:
            raise ReadingError(f"has a curve on {layer}")
        start, steps = (np.reshape(list(map(float, numbers.split())), (-1, 2)) for numbers in match.groups()[:2])
        points = np.cumsum(np.vstack([start, steps]), axis=0)
        yield Path(layer, tuple((x, height - y) for x, y in points.tolist()), bool(match[3]))


def read_dxf(text: str) -> Sheet:
    """The sheet in the file, its size from the drawing limits; ReadingError if it is not a valid sheet."""
    document = ezdxf.read(io.StringIO(text))
    problems = document.audit().errors
    if problems:
        raise ReadingError(f"fails ezdxf's audit: {problems[0].message}")
    if document.units != units.MM:
        raise ReadingError(f"$INSUNITS is {document.units}, millimetres are {int(units.MM)}")
    space = document.modelspace()
    shapes: list[Shape] = []
    for entity in space:
        layer = _layer(entity.dxf.layer)
        if isinstance(entity, DxfCircle):
            shapes.append(Circle(layer, (entity.dxf.center.x, entity.dxf.center.y), entity.dxf.radius))
        elif isinstance(entity, LWPolyline) and not entity.has_arc:
            points = tuple((float(x), float(y)) for x, y in entity.get_points("xy"))
            shapes.append(Path(layer, points, bool(entity.closed)))
        else:
            raise ReadingError(f"has a {entity.dxftype()} on {layer}")
    assert tuple(space.dxf.limmin)[:2] == (0, 0)
    return Sheet("", float(space.dxf.limmax[0]), float(space.dxf.limmax[1]), (tuple(shapes),))


def read_lbrn(text: str) -> Sheet:
    """The sheet in the project; ReadingError if it is not one, or if its layers are not cut in their order."""
    root = ElementTree.fromstring(text)
    settings = [{value.tag: value.attrib["Value"] for value in setting} for setting in root.iter("CutSetting")]
    settings.sort(key=lambda setting: int(setting["priority"]))
    names = {setting["index"]: setting["name"] for setting in settings}
    if [name for name in names.values() if name in LAYERS] != list(LAYERS):
        raise ReadingError("its layers are not cut in their order")
    shapes: list[Shape] = []
    size: Point | None = None
    for element in root.iter("Shape"):
        index, kind = element.attrib["CutIndex"], element.attrib["Type"]
        *turn, x, y = map(float, element.findtext("XForm", "").split())
        assert turn == [1, 0, 0, 1]
        if index == str(TOOL_LAYER):
            size = float(element.attrib["W"]), float(element.attrib["H"])
            assert kind == "Rect" and (2 * x, 2 * y) == size
        elif kind == "Ellipse":
            assert element.attrib["Rx"] == element.attrib["Ry"]
            shapes.append(Circle(_layer(names[index]), (x, y), float(element.attrib["Rx"])))
        else:
            vertices = element.findtext("VertList", "")
            assert kind == "Path" and not VERTEX.sub("", vertices), vertices
            points = tuple((float(px) + x, float(py) + y) for px, py in VERTEX.findall(vertices))
            shapes.append(Path(_layer(names[index]), points, element.findtext("PrimList") == "LineClosed"))
    assert size is not None
    return Sheet("", *size, (tuple(shapes),))


def read_pdf(binary: bytes) -> list[Sheet]:
    """The sheet on each page; ReadingError if a page contains anything but a pattern."""
    return [_pdf_sheet(page) for page in PdfReader(io.BytesIO(binary), strict=True).pages]


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
    layer = _layer(LAYER_OF.get(colour))
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
